"""More than a supervisor can take: joint states by the thousand and by the megabyte, a hundred clients at once."""

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
from irsbot_supervisor.campaign.rows import Job, Row, Tally
from irsbot_supervisor.suite import SUPERVISOR, Node, Suite, free_domain

if TYPE_CHECKING:  # needs ROS, which the list of rows does not
    from irsbot_supervisor.campaign.peer import Peer

NAME = "floods"
MUST = "2-20 kHz, 1 MB messages, 100 clients: the newest wins, age <= 50 ms, memory + < 20 MB"

AGE_MS = 50.0
"""ms a consumer may look back, in 99 of 100 looks: the rest is what a shared machine does to all processes."""

GROWTH_MB = 20.0
LOOK_S = 0.005
SETTLE_S = 2.0
"""s until counting begins: histories fill up, discovery is over."""

RATES_HZ = (2000.0, 5000.0, 10_000.0, 20_000.0)
LARGE_HZ, LARGE_JOINTS = 20.0, 18_000
"""Messages of 1.08 MB."""
CLIENTS = 100

Flood = Callable[["Peer", int, Tally], float]
"""Floods for so many seconds; returns the most memory that the supervisor held meanwhile, MB."""

CALM = Node("calm", "irsbot_supervisor.campaign.flood_source", {})
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
        with _supervised() as peer:
            before = peer.resident_mb("supervisor")
            peak = flood(peer, max(job.amount // len(kinds), 1), tally)
        growth = peak - before
        tally.largest(f"{kind}: memory [MB]", growth)
        fault = "" if growth < GROWTH_MB else f"{kind}: memory grew by {growth:.1f} MB"
        tally.many(0, failed=bool(fault), note=fault)
    return tally.row()


@contextmanager
def _supervised() -> Iterator[Peer]:
    """A supervisor that says OK of a robot at rest."""
    from irsbot_supervisor.campaign.peer import Peer

    domain = free_domain()
    with (
        TemporaryDirectory(prefix="irsbot-flood-") as folder,
        Suite(Path(folder), domain) as suite,
        Peer(suite, domain) as peer,
    ):
        suite.start(Node("supervisor", SUPERVISOR, {}))
        suite.start(CALM)
        peer.listen()
        peer.until(lambda: peer.verdicts and peer.verdicts[-1].level == Level.OK, "OK")
        peer.look(SETTLE_S)
        yield peer


def _fast(rate_hz: float) -> Flood:
    def flood(peer: Peer, seconds: int, tally: Tally) -> float:
        peer.suite.end("calm")
        peer.suite.start(Node("flood", CALM.module, {"rate_hz": rate_hz}))
        peer.until(lambda: peer.verdicts[-1].level > Level.WARN, "the gap between two publishers")
        peer.until(lambda: peer.verdicts[-1].level == Level.OK, "OK under the flood")
        peer.look(SETTLE_S)
        peer.newest_state()
        return _watch(peer, seconds, tally, f"{rate_hz:.0f} Hz")

    return flood


def _large(peer: Peer, seconds: int, tally: Tally) -> float:
    """Beside the robot somebody publishes what is too large: never OK for that, and OK again when it is over."""
    peer.suite.start(Node("flood", CALM.module, {"rate_hz": LARGE_HZ, "extra_joints": LARGE_JOINTS}))
    peer.until(lambda: peer.verdicts[-1].level > Level.WARN, "large messages are refused")
    peak = 0.0
    for _ in range(seconds):
        peer.look(1.0)
        peak = max(peak, peer.resident_mb("supervisor"))
        tally.case()
    peer.suite.end("flood")
    peer.until(lambda: peer.verdicts[-1].level == Level.OK, "OK after the flood")
    return peak


def _clients(peer: Peer, seconds: int, tally: Tally) -> float:
    """Every client asks again as soon as it has an answer."""
    from irsbot_msgs.srv import ResetStop

    clients = [peer.client(ResetStop, "supervisor/reset") for _ in range(CLIENTS)]
    answers: list[Any] = [None] * CLIENTS
    count = 0

    def ask() -> None:
        nonlocal count
        for k, client in enumerate(clients):
            if answers[k] is None or answers[k].done():
                count += answers[k] is not None
                answers[k] = client.call_async(ResetStop.Request(event=7))

    peak = _watch(peer, seconds, tally, f"{CLIENTS} clients", ask)
    peer.until(lambda: all(answer.done() for answer in answers), "all clients have answers")
    tally.add("answers to clients [1/s]", count / seconds)
    return peak


def _watch(peer: Peer, seconds: int, tally: Tally, kind: str, meanwhile: Callable[[], None] = lambda: None) -> float:
    """How old what the supervisor knows is, as a consumer sees it; only for what it calls OK."""
    first = last = None
    peak = 0.0
    ages: list[float] = []
    for _ in range(seconds):
        fresh = []
        end = time.monotonic() + 1.0
        while time.monotonic() < end:
            meanwhile()
            peer.look(LOOK_S)
            state = peer.newest_state()
            if state is not None:
                first, last = first or state, state
                fresh.append((time.time_ns() - state.stamp_ns) * 1e-6)
        peak = max(peak, peer.resident_mb("supervisor"))
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
    """What 99 of 100 looks do not exceed, ms."""
    return float(np.percentile(ages, 99.0)) if ages else inf
