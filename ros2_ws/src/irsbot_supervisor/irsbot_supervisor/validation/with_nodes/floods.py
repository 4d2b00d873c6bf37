"""More input than a supervisor can process: joint states by the thousand and by the megabyte, a hundred clients at
once."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from irsbot_msgs_py.records import Level
from irsbot_supervisor.processes.suite import SUPERVISOR, Node, Suite, free_domain
from irsbot_supervisor.validation.harness.rows import Job, Row, Tally

if TYPE_CHECKING:  # needs ROS, which the list of rows does not
    from irsbot_supervisor.validation.harness.client import Tester

NAME = "floods"
MUST = "2-20 kHz, 1 MB messages, 100 clients: the newest wins, age <= 50 ms, memory + < 20 MB"

AGE_MS = 50.0
"""ms: age of the supervisor's knowledge for a consumer, in 99 of 100 samples; a shared machine delays all processes in
the rest."""

GROWTH_MB = 20.0
LOOK_S = 0.005
SETTLE_S = 2.0
"""s until counting begins: histories fill up, discovery is over."""

RATES_HZ = (2000.0, 5000.0, 10_000.0, 20_000.0)
LARGE_HZ, LARGE_JOINTS = 20.0, 18_000
"""Messages of 1.08 MB."""
CLIENTS = 100

Flood = Callable[["Tester", int, Tally], float]
"""Flood for this number of seconds; returns the largest memory of the supervisor in this time, MB."""

CALM = Node("calm", "irsbot_supervisor.validation.harness.flood_source", {})
"""A robot at rest, 1 kHz."""


def run(job: Job) -> Row:
    """The row: a case is a second of flood, the same time for every kind of flood."""
    tally = Tally(NAME, job)
    kinds: list[tuple[str, Flood]] = [
        *((f"{rate:.0f} Hz", _fast(rate)) for rate in RATES_HZ),
        ("1 MB", _large),
        (f"{CLIENTS} clients", _clients),
    ]
    for kind, flood in kinds:
        with _supervised() as tester:
            before = tester.resident_mb("supervisor")
            peak = flood(tester, max(job.amount // len(kinds), 1), tally)
        growth = peak - before
        tally.largest(f"{kind}: memory [MB]", growth)
        fault = "" if growth < GROWTH_MB else f"{kind}: memory grew by {growth:.1f} MB"
        tally.many(0, failed=bool(fault), note=fault)
    return tally.row()


@contextmanager
def _supervised() -> Iterator[Tester]:
    """A supervisor that judges a robot at rest OK."""
    from irsbot_supervisor.validation.harness.client import Tester

    domain = free_domain()
    with (
        TemporaryDirectory(prefix="irsbot-flood-") as folder,
        Suite(Path(folder), domain) as suite,
        Tester(suite, domain) as tester,
    ):
        suite.start(Node("supervisor", SUPERVISOR, {}))
        suite.start(CALM)
        tester.listen()
        tester.until(lambda: tester.works(1), "OK")
        tester.look(SETTLE_S)
        yield tester


def _fast(rate_hz: float) -> Flood:
    def flood(tester: Tester, seconds: int, tally: Tally) -> float:
        tester.suite.end("calm")
        tester.suite.start(Node("flood", CALM.module, {"rate_hz": rate_hz}))
        tester.until(lambda: tester.verdicts[-1].level > Level.WARN, "the gap between two publishers")
        tester.until(lambda: tester.works(1), "OK under the flood")
        tester.look(SETTLE_S)
        tester.newest_state()
        return _watch(tester, seconds, tally, f"{rate_hz:.0f} Hz")

    return flood


def _large(tester: Tester, seconds: int, tally: Tally) -> float:
    """In addition to the robot, messages that are too large are published: they stop the robot, memory is
    bounded, and OK returns after them."""
    tester.suite.start(Node("flood", CALM.module, {"rate_hz": LARGE_HZ, "extra_joints": LARGE_JOINTS}))
    tester.until(lambda: tester.verdicts[-1].level > Level.WARN, "large messages are refused")
    peak = 0.0
    for _ in range(seconds):
        tester.look(1.0)
        peak = max(peak, tester.resident_mb("supervisor"))
        tally.case()
    tester.suite.end("flood")
    tester.until(lambda: tester.works(1), "OK after the flood")
    return peak


def _clients(tester: Tester, seconds: int, tally: Tally) -> float:
    """Every client asks again as soon as it has an answer."""
    from irsbot_msgs.srv import ResetStop

    clients = [tester.client(ResetStop, "supervisor/reset") for _ in range(CLIENTS)]
    answers: list[Any] = [None] * CLIENTS
    count = 0

    def ask() -> None:
        nonlocal count
        for k, client in enumerate(clients):
            if answers[k] is None or answers[k].done():
                count += answers[k] is not None
                answers[k] = client.call_async(ResetStop.Request(event=7))

    peak = _watch(tester, seconds, tally, f"{CLIENTS} clients", ask)
    tester.until(lambda: all(answer.done() for answer in answers), "all clients have answers")
    tally.add("answers to clients [1/s]", count / seconds)
    return peak


def _watch(
    tester: Tester, seconds: int, tally: Tally, kind: str, meanwhile: Callable[[], None] = lambda: None
) -> float:
    """Age of the supervisor's knowledge, as a consumer receives it; only for samples that are OK."""
    first = last = None
    peak = 0.0
    ages: list[float] = []
    for _ in range(seconds):
        fresh = []
        end = time.monotonic() + 1.0
        while time.monotonic() < end:
            meanwhile()
            tester.look(LOOK_S)
            state = tester.newest_state()
            if state is not None:
                first, last = first or state, state
                fresh.append((time.time_ns() - state.stamp_ns) * 1e-6)
        peak = max(peak, tester.resident_mb("supervisor"))
        tally.largest(f"{kind}: age, worst second [ms]", _age(fresh))
        tally.case(failed="" if fresh else f"{kind}: no state for a second")
        ages += fresh
    age = _age(ages)
    tally.largest(f"{kind}: age [ms]", age)
    tally.many(0, failed=not age <= AGE_MS, note="" if age <= AGE_MS else f"{kind}: age {age:.0f} ms")
    if first is not None and last is not None and last.stamp_ns > first.stamp_ns:
        judged = (last.sequence - first.sequence) / (last.stamp_ns - first.stamp_ns) * 1e9
        tally.largest(f"{kind}: judged [Hz]", judged)
    return peak


def _age(ages: list[float]) -> float:
    """Age that 99 of 100 samples do not exceed, ms."""
    return float(np.percentile(ages, 99.0)) if ages else inf
