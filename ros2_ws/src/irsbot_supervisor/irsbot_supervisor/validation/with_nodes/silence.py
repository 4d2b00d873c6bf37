"""Silence of a supervisor at work: the longest time between two verdicts while it has other requests.

The supervisors of the slowest robots judge 1000 samples per second of a robot at rest. Every case causes one event and
examines the times at which verdicts were published: source time stamps of the middleware, taken in the publisher's
process. `quiet` is the control: the delays that the machine causes itself.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import pairwise

import numpy as np

from irsbot_msgs_py.records import Level
from irsbot_supervisor.consumer import TIMEOUT_S
from irsbot_supervisor.processes.suite import SuiteError
from irsbot_supervisor.validation.harness.rows import Job, Row, Tally
from irsbot_supervisor.validation.with_nodes.silence_causes import CAUSES
from irsbot_supervisor.validation.with_nodes.silence_cell import Cell, Heard, supervised

NAME = "silence"
MUST = "calls, settings, others' life cycles, disk stalls: verdicts go on, 99.9 % of the longest times without <= 30 ms"

ROBOTS = ("rrr3_base", "ruu4")
"""The slowest robots: their branches have to be followed."""

LIMIT_S = 0.03
"""s between two verdicts, at the 99.9th percentile of the longest times of all cases."""

JUDGED = 300
"""Number of cases of a kind from which a 99.9th percentile is meaningful; with fewer cases only silences at which a
consumer brakes are judged, if they come with every try."""

UNKNOWN = Level.UNKNOWN.name
DEAF, SILENT = "the listener was deaf", "the supervisor was silent"
PAUSED = "the robot paused"
RESTLESS = "ask while it stands"
"""In a refusal by a supervisor for which a robot that stands may have moved since the last sample."""

TRIES, AGAIN = 3, (UNKNOWN, SILENT, RESTLESS)
"""Number of tries of a case, and the faults after which it is tried again: on a busy machine joint states may be
late, and a supervisor may have no processor time. Its silence counts in the percentiles all the same."""

BLIND_TRIES, BLIND = 20, (DEAF, PAUSED)
"""Number of further tries, and the faults that say nothing of the supervisor: a listener without processor time misses
verdicts, and a robot that pauses gives nothing to judge."""

LOST = "verdicts that did not arrive"
"""Figure: lost verdicts. A publisher of latched verdicts keeps only the newest."""


def run(job: Job) -> Row:
    """The row: a case is one cause of silence on one robot, in turn."""
    tally, longest = Tally(NAME, job), dict[str, list[float]]()
    rounds = max(job.amount // (len(ROBOTS) * len(CAUSES)), 1)
    for name in ROBOTS:
        with supervised(name) as cell:
            for number in range(rounds):
                for cause, provoke in CAUSES.items():
                    cell.turn = number
                    gaps = longest.setdefault(f"{name} {cause}", [])
                    tally.case(failed=_tried(cell, cause, provoke, gaps, tally))
            code = cell.tester.suite.end("supervisor")
            tally.many(0, failed=code != 0, note="" if code == 0 else f"{name}: exit code {code}")
    measured = {kind: gaps for kind, gaps in longest.items() if gaps}
    for kind, gaps in measured.items():
        for share in (50.0, 99.0, 99.9):
            tally.largest(f"{kind}: longest silence, {share:g} % [ms]", float(np.percentile(gaps, share)) * 1e3)
        tally.largest(f"{kind}: longest silence of all [ms]", max(gaps) * 1e3)
    for cause in CAUSES:
        gaps = [gap for name in ROBOTS for gap in measured.get(f"{name} {cause}", ())]
        if not gaps:  # every try failed, and said why
            continue
        most = float(np.percentile(gaps, 99.9))
        late = len(gaps) >= JUDGED and not most <= LIMIT_S
        tally.many(0, failed=late, note=f"{cause}: {most * 1e3:.0f} ms without a verdict" if late else "")
    return tally.row()


def _tried(cell: Cell, cause: str, provoke: Callable[[Cell], str], longest: list[float], tally: Tally) -> str:
    """A case, tried again where that is worth it; returns the fault of the last try."""
    tries, blind, fault = 0, 0, ""
    while tries < TRIES and blind < BLIND_TRIES:
        fault = _case(cell, cause, provoke, longest, tally)
        if any(word in fault for word in BLIND):
            blind += 1
        elif any(word in fault for word in AGAIN):
            tries += 1
        else:
            break
    return fault


def _case(cell: Cell, cause: str, provoke: Callable[[Cell], str], longest: list[float], tally: Tally) -> str:
    """Cause an event and observe: keeps the longest time without a verdict; returns the fault."""
    try:
        cell.settle()
        cell.ear.take()
        before, sent_ns, begin_ns = cell.ear.last, cell.ear.samples_ns()[-1:], time.time_ns()
        fault = provoke(cell)
        end_ns = time.time_ns()
        heard = [*before, *_heard_beyond(cell, end_ns)]
    except SuiteError as error:
        return f"{cause}: {error}: {cell.log.stated[-200:].decode()}"
    numbers = [one.verdict.sequence for one in heard]
    if any(b <= a for a, b in pairwise(numbers)):
        return f"{cause}: verdicts {numbers} are not in sequence"
    tally.add(LOST, float(sum(b - a - 1 for a, b in pairwise(numbers))))
    silence_s, lost = max(
        ((b.sent_ns - a.sent_ns) * 1e-9, b.verdict.sequence - a.verdict.sequence - 1)
        for a, b in pairwise(heard)
        if b.sent_ns > begin_ns and a.sent_ns < end_ns
    )
    if lost * cell.settings.heartbeat_s > LIMIT_S:
        return f"{cause}: {DEAF}, {lost} verdicts were published that it did not receive"
    longest.append(silence_s)
    if silence_s > TIMEOUT_S:
        return f"{cause}: {SILENT} for {silence_s:.3f} s"
    meanwhile = [one for one in heard if begin_ns < one.sent_ns < end_ns]
    unknown = [one.verdict.text for one in meanwhile if one.verdict.level == Level.UNKNOWN]
    if not unknown:
        return fault
    sent_ns = [*(sent_ns or [begin_ns]), *cell.ear.samples_ns(), end_ns]
    pause_s = max(b - a for a, b in pairwise(sent_ns)) * 1e-9
    why = f"{PAUSED} for {pause_s:.3f} s" if pause_s > cell.settings.stale_s else UNKNOWN
    return f"{cause}: {why}, {unknown[0]} {fault}".rstrip()


def _heard_beyond(cell: Cell, end_ns: int) -> list[Heard]:
    """The verdicts since the last look, until one that was published after a time. Raises SuiteError if there is
    none."""
    heard: list[Heard] = []

    def spoke() -> bool:
        heard.extend(cell.ear.take())
        return bool(heard) and heard[-1].sent_ns > end_ns

    cell.tester.until(spoke, "a verdict after the event")
    return heard
