"""`bench`: latency, CPU and memory of the suite, compared with its goals, in one run on this machine."""

from __future__ import annotations

import os
import platform
from enum import Enum
from statistics import median
from typing import Annotated

import typer
from rich.table import Table

from irsbot_supervisor.cli.common import err, out, print_json
from irsbot_supervisor.validation.bench import batch, offline, one_sample, report, startup, transport
from irsbot_supervisor.validation.bench.report import Measured, Row


class Part(str, Enum):
    """A part that can be measured alone."""

    ONE_SAMPLE = "one-sample"
    TRANSPORT = "transport"
    BATCH = "batch"
    STARTUP = "startup"
    OFFLINE = "offline"


def bench(
    only: Annotated[list[Part] | None, typer.Option(help="measure this part alone; may be repeated")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="seconds instead of minutes; shows that it works")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON")] = False,
) -> None:
    """Measure latency, loss, CPU, start-up, memory and throughput, and compare them with the goals.

    Takes about 5 minutes; close other programs first. A missed goal is reported but is not an error: exit code 0 means
    that everything was measured.

    Example: irsbot bench --only one-sample --only batch.
    """
    parts = set(only or Part)
    measured = Measured(
        one_sample.measure(_tell, quick=quick) if Part.ONE_SAMPLE in parts else (),
        transport.measure(_tell, quick=quick) if Part.TRANSPORT in parts else (),
        batch.measure(_tell, quick=quick) if Part.BATCH in parts else None,
        startup.measure(_tell, quick=quick) if Part.STARTUP in parts else (),
        offline.measure(_tell, quick=quick) if Part.OFFLINE in parts else None,
    )
    rows = report.rows(measured)
    if as_json:
        print_json(_facts(measured, rows))
        return
    for table in _tables(measured):
        out.print(table)
    out.print(_goals(rows))
    if quick:
        out.print("a quick run is too short for its numbers to count")


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
    if measured.one_sample:
        table = Table("robot", "median [us]", "p99 [us]", "worst [us]", title="one step of the supervisor")
        for result in measured.one_sample:
            table.add_row(result.robot, f"{result.median_us:.1f}", f"{result.p99_us:.1f}", f"{result.worst_us:.1f}")
        tables.append(table)
    if measured.batch is not None:
        table = Table("Msamples/s", "bytes per sample", "copy [GB/s]", "share of copy", title="batch")
        found = measured.batch
        rate, copied = found.samples_per_s * 1e-6, found.copied_bytes_per_s * 1e-9
        table.add_row(f"{rate:.2f}", f"{found.bytes_per_sample:.0f}", f"{copied:.1f}", f"{found.share_of_copy:.1%}")
        tables.append(table)
    if measured.offline is not None:
        table = Table(
            "robot", "offline [us]", "one by one [us]", "an hour at 1 kHz [s]", title="judged offline, per sample"
        )
        run = measured.offline
        each = (f"{seconds / run.samples * 1e6:.1f}" for seconds in (run.columns_s, run.one_by_one_s))
        table.add_row(run.robot, *each, f"{run.hour_s:.0f}")
        tables.append(table)
    if measured.startup:
        table = Table("first verdict [s]", "first judgement [s]", "resident [MB]", title="start-up")
        for start in measured.startup:
            table.add_row(f"{start.first_verdict_s:.2f}", f"{start.first_judged_s:.2f}", f"{start.resident_mb:.0f}")
        tables.append(table)
    return tables


def _facts(measured: Measured, rows: list[Row]) -> dict[str, object]:
    return {
        "machine": {"python": platform.python_version(), "processors": os.cpu_count(), "system": platform.platform()},
        "goals": [{**row._asdict(), "met": row.met} for row in rows],
        "one_sample": [result._asdict() for result in measured.one_sample],
        "transport": [{**run._asdict(), "cpu_share": run.cpu_share} for run in measured.transport],
        "batch": measured.batch._asdict() if measured.batch is not None else None,
        "offline": measured.offline._asdict() if measured.offline is not None else None,
        "startup": [start._asdict() for start in measured.startup],
    }
