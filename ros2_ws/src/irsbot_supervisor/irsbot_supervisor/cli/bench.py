"""`bench`: latency, CPU and memory of the suite, compared with its goals, in one run on this machine."""

from __future__ import annotations

import os
import platform
from datetime import datetime, timezone
from enum import Enum
from pathlib import Path
from statistics import median
from typing import Annotated

import typer
from rich.table import Table

from irsbot_kinematics import BadInput
from irsbot_kinematics.compiled import are_used
from irsbot_supervisor.cli.common import err, out, print_json
from irsbot_supervisor.fleet.version import code_version
from irsbot_supervisor.report.json_values import plain
from irsbot_supervisor.validation.bench import (
    batch,
    high_rate,
    loop_closure,
    offline,
    one_sample,
    recorder,
    report,
    startup,
    transport,
)
from irsbot_supervisor.validation.bench.history import append, read, write_page
from irsbot_supervisor.validation.bench.noise import Others
from irsbot_supervisor.validation.bench.report import Measured, Row


class Part(str, Enum):
    """A part that can be measured alone."""

    ONE_SAMPLE = "one-sample"
    TRANSPORT = "transport"
    HIGH_RATE = "high-rate"
    BATCH = "batch"
    STARTUP = "startup"
    OFFLINE = "offline"
    RECORDER = "recorder"
    LOOP_CLOSURE = "loop-closure"


def bench(
    only: Annotated[list[Part] | None, typer.Option(help="measure this part alone; may be repeated")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="seconds instead of minutes; shows that it works")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON")] = False,
    history: Annotated[Path | None, typer.Option(help="add the result to this file, a line of JSON each")] = None,
    page: Annotated[Path | None, typer.Option(help="with --history: draw all results of the file, .html")] = None,
) -> None:
    """Measure latency, loss, CPU, start-up, memory and throughput, and compare them with the goals.

    Takes about 10 minutes; close other programs first: what they take is measured too. A missed goal is reported but is
    not an error: exit code 0 means that everything was measured. Compares with Pinocchio where it is installed.

    Example: irsbot bench --only one-sample --only batch --history bench.jsonl --page bench.html
    """
    if page is not None and (history is None or page.suffix != ".html"):
        raise BadInput("--page draws the results of --history FILE, and its suffix must be .html")
    earlier = read(history) if history is not None else []  # refused before the work begins
    for file in filter(None, (history, page)):
        if not file.parent.is_dir():
            raise BadInput(f"cannot write '{file}': there is no folder '{file.parent}'")
    with Others() as others:
        measured = _measure(set(only or Part), quick)
    rows = report.rows(measured)
    facts = _facts(measured, rows, others, quick)
    if as_json:
        print_json(facts)
    else:
        _show(measured, rows, others, quick)
    if history is not None:
        append(history, plain(facts))
        if page is not None:
            write_page([*earlier, plain(facts)], page)


def _show(measured: Measured, rows: list[Row], others: Others, quick: bool) -> None:
    for table in _tables(measured):
        out.print(table)
    if rows:
        out.print(_goals(rows))
    if not others.quiet:
        out.print(f"not a quiet machine: other processes took {others.cores:.1f} of {os.cpu_count()} cores")
    if quick:
        out.print("a quick run is too short for its numbers to count")


def _measure(parts: set[Part], quick: bool) -> Measured:
    return Measured(
        one_sample.measure(_tell, quick=quick) if Part.ONE_SAMPLE in parts else (),
        transport.measure(_tell, quick=quick) if Part.TRANSPORT in parts else (),
        high_rate.measure(_tell, quick=quick) if Part.HIGH_RATE in parts else None,
        batch.measure(_tell, quick=quick) if Part.BATCH in parts else None,
        startup.measure(_tell, quick=quick) if Part.STARTUP in parts else (),
        offline.measure(_tell, quick=quick) if Part.OFFLINE in parts else None,
        recorder.measure(_tell, quick=quick) if Part.RECORDER in parts else None,
        loop_closure.measure(_tell, quick=quick) if Part.LOOP_CLOSURE in parts else None,
    )


def _tell(text: str) -> None:
    err.print(text)


def _goals(rows: list[Row]) -> Table:
    table = Table("goal", "what", "wanted", "measured", "met", title="goals")
    for row in rows:
        wanted = f"{'>=' if row.at_least else '<='} {row.limit:g} {row.unit}"
        table.add_row(row.goal, row.what, wanted, f"{row.measured:.3g} {row.unit}", "yes" if row.met else "NO")
    return table


def _tables(measured: Measured) -> list[Table]:
    tables = []
    if measured.transport:
        table = Table("node", "p50 [us]", "p99 [us]", "CPU per message [us]", "of one core", "lost", title="1 kHz")
        for subject in transport.SUBJECTS:
            runs = [run for run in measured.transport if run.subject == subject.name]
            p50, cpu, share = (median(getattr(run, name) for run in runs) for name in ("p50_us", "cpu_us", "cpu_share"))
            lost = f"{sum(run.lost for run in runs)} of {sum(run.sent for run in runs)}"
            table.add_row(
                subject.name, f"{p50:.0f}", f"{report.lower_quartile(runs):.0f}", f"{cpu:.0f}", f"{share:.0%}", lost
            )
        tables.append(table)
    if measured.high_rate is not None:
        fast = measured.high_rate
        title = f"{fast.rate_hz * 1e-3:g} kHz"
        table = Table("sent", "not judged", "published states/s", "CPU per sample [us]", title=title)
        table.add_row(str(fast.sent), str(fast.lost), f"{fast.states / fast.seconds:.0f}", f"{fast.cpu_us:.0f}")
        tables.append(table)
    if measured.one_sample:
        heads = ("median", "p99", "worst", "median with state", "hardest prediction")
        table = Table("robot", *heads, title="one step of the supervisor, to the verdict [us]")
        for result in measured.one_sample:
            times = (result.median_us, result.p99_us, result.worst_us, result.with_state_us, result.hardest_us)
            table.add_row(result.robot, *[f"{taken:.1f}" for taken in times])
        tables.append(table)
    if measured.batch is not None:
        found = measured.batch
        rates = {
            "numpy [Msamples/s]": found.samples_per_s,
            "machine code": found.compiled_samples_per_s,
            f"{found.threads} threads": found.threaded_samples_per_s,
            "filled anew": found.anew_samples_per_s,
        }
        table = Table(*rates, "bytes per sample", "copy [GB/s]", "share of copy", title="batch")
        told = ["no compiler" if rate is None else f"{rate * 1e-6:.2f}" for rate in rates.values()]
        copied = f"{found.copied_bytes_per_s * 1e-9:.1f}"
        table.add_row(*told, f"{found.bytes_per_sample:.0f}", copied, f"{found.share_of_copy:.1%}")
        tables.append(table)
    if measured.offline is not None:
        table = Table(
            "robot", "offline [us]", "one by one [us]", "an hour at 1 kHz [s]", title="judged offline, per sample"
        )
        run = measured.offline
        each = (f"{seconds / run.samples * 1e6:.1f}" for seconds in (run.columns_s, run.one_by_one_s))
        table.add_row(run.robot, *each, f"{run.hour_s:.0f}")
        tables.append(table)
    if measured.recorder is not None:
        table = Table(
            "messages/s", "CPU per message [us]", "longest turn [ms]", "lost at SIGKILL [s]", title="recorder"
        )
        kept = measured.recorder
        table.add_row(
            f"{kept.messages_per_s:.0f}", f"{kept.cpu_us:.1f}", f"{kept.stall_s * 1e3:.2f}", f"{kept.lost_s:.3f}"
        )
        tables.append(table)
    if measured.loop_closure is not None:
        table = Table("ours [us]", "in a batch [us]", "Pinocchio [us]", title="one posture of the five-bar")
        one = measured.loop_closure
        theirs = f"{one.pinocchio_us:.1f}" if one.pinocchio_us > 0.0 else "not installed"
        table.add_row(f"{one.ours_us:.1f}", f"{one.batch_us:.2f}", theirs)
        tables.append(table)
    if measured.startup:
        table = Table("first verdict [s]", "first judgement [s]", "resident [MB]", title="start-up")
        for start in measured.startup:
            table.add_row(f"{start.first_verdict_s:.2f}", f"{start.first_judged_s:.2f}", f"{start.resident_mb:.0f}")
        tables.append(table)
    return tables


def _facts(measured: Measured, rows: list[Row], others: Others, quick: bool) -> dict[str, object]:
    return {
        "version": code_version(),
        "time": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        "compiled": are_used(),
        "quick": quick,
        "other_processes_cores": others.cores,
        "machine": {"python": platform.python_version(), "processors": os.cpu_count(), "system": platform.platform()},
        "goals": [{**row._asdict(), "met": row.met} for row in rows],
        "one_sample": [result._asdict() for result in measured.one_sample],
        "transport": [{**run._asdict(), "cpu_share": run.cpu_share} for run in measured.transport],
        "high_rate": measured.high_rate._asdict() if measured.high_rate is not None else None,
        "batch": measured.batch._asdict() if measured.batch is not None else None,
        "offline": measured.offline._asdict() if measured.offline is not None else None,
        "recorder": measured.recorder._asdict() if measured.recorder is not None else None,
        "loop_closure": measured.loop_closure._asdict() if measured.loop_closure is not None else None,
        "startup": [start._asdict() for start in measured.startup],
    }
