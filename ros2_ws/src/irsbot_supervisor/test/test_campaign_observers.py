"""What the rows of the fault campaign that start nodes make of told observations: no node is started."""

from __future__ import annotations

import signal
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from irsbot_msgs_py.records import Level
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.validation.harness.rows import Job, Tally
from irsbot_supervisor.validation.with_nodes import outages, silence
from irsbot_supervisor.validation.with_nodes.silence_cell import Heard

BEAT_NS = 10_000_000


def tally() -> Tally:
    return Tally("told", Job(1, 1, lambda cases: None))


class Clock:
    """A clock that others set, in place of the module `time`."""

    def __init__(self, now_ns: int) -> None:
        self.now_ns = now_ns

    def time_ns(self) -> int:
        return self.now_ns

    def passes(self, ns: int) -> None:
        self.now_ns += ns


# --- silence ----------------------------------------------------------------------------------------------------------


def observed(
    monkeypatch: pytest.MonkeyPatch,
    sent: Callable[[int], list[tuple[int, int]]],
    event_ns: int,
    level: Level = Level.OK,
    samples: Callable[[int], list[int]] = lambda now_ns: [],
) -> tuple[str, list[float]]:
    """The fault of one case and the silences that it keeps. sent: of the time at which the event begins, ns: the
    verdicts from then on, as times and sequence numbers; event_ns: the event takes so long. level: of the verdicts.
    samples: when joint states were sent, ns."""
    clock = Clock(10**15)
    monkeypatch.setattr(silence, "time", clock)

    def heard(at_ns: int, sequence: int) -> Heard:
        return Heard(at_ns, at_ns, SimpleNamespace(sequence=sequence, level=level, text=""))

    def samples_ns() -> list[int]:
        there = [at_ns for at_ns in stamped if at_ns <= clock.now_ns]
        del stamped[: len(there)]
        return there

    def take() -> list[Heard]:
        there = [one for one in coming if one.sent_ns <= clock.now_ns]
        del coming[: len(there)]
        return there

    def until(happened: Callable[[], Any], _what: str) -> None:
        while not happened():
            clock.passes(BEAT_NS)

    def provoke(_cell: Any) -> str:
        clock.passes(event_ns)
        return ""

    coming, stamped = [heard(*one) for one in sent(clock.now_ns)], samples(clock.now_ns)
    cell: Any = SimpleNamespace(
        settle=lambda: None,
        ear=SimpleNamespace(last=[heard(clock.now_ns - 1, 10)], take=take, samples_ns=samples_ns),
        tester=SimpleNamespace(until=until, look=lambda seconds: clock.passes(round(seconds * NS_PER_S))),
        settings=SimpleNamespace(heartbeat_s=1e-9 * BEAT_NS, stale_s=5e-9 * BEAT_NS),
        log=SimpleNamespace(stated=b""),
    )
    kept: list[float] = []
    return silence._case(cell, "an event", provoke, kept, tally()), kept


def beats(begin_ns: int, first: int) -> list[tuple[int, int]]:
    return [(begin_ns + k * BEAT_NS, first + k) for k in range(100)]


@pytest.mark.parametrize(
    ("pause_ns", "fault"),
    [
        (BEAT_NS, ""),
        (4 * BEAT_NS, ""),  # the percentile judges it: a machine may cause one
        (50 * BEAT_NS, silence.SILENT),  # a consumer brakes
    ],
)
def test_verdicts_that_are_not_published_are_a_silence_of_the_supervisor(
    monkeypatch: pytest.MonkeyPatch, pause_ns: int, fault: str
) -> None:
    found, kept = observed(monkeypatch, lambda now_ns: beats(now_ns + pause_ns, 11), pause_ns)
    assert fault in found
    assert bool(found) == bool(fault)
    assert kept == [pytest.approx(1e-9 * pause_ns, rel=1e-6)]


@pytest.mark.parametrize("event_ns", [BEAT_NS, 50 * BEAT_NS])
def test_verdicts_that_are_published_and_do_not_arrive_are_no_silence(
    monkeypatch: pytest.MonkeyPatch, event_ns: int
) -> None:
    found, kept = observed(monkeypatch, lambda now_ns: beats(now_ns + 50 * BEAT_NS, 60), event_ns)
    assert silence.DEAF in found
    assert kept == []


def test_a_silence_that_begins_in_an_event_counts_to_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    pause_ns = 8 * BEAT_NS
    _found, kept = observed(
        monkeypatch, lambda now_ns: [(now_ns + 1, 11), *beats(now_ns + 1 + pause_ns, 12)], 3 * BEAT_NS
    )
    assert kept == [pytest.approx(1e-9 * pause_ns, rel=1e-6)]


@pytest.mark.parametrize(
    ("pause", "fault"),
    [
        ((0, 0), silence.UNKNOWN),
        ((10, 14), silence.UNKNOWN),  # not longer than the supervisor waits
        ((10, 16), silence.PAUSED),
        ((-3, 3), silence.PAUSED),  # it began before the event
        ((84, 200), silence.PAUSED),  # and ends after it
    ],
)
def test_a_state_is_unknown_without_a_fault_of_the_supervisor_where_the_robot_paused(
    monkeypatch: pytest.MonkeyPatch, pause: tuple[int, int], fault: str
) -> None:
    """pause: from beat to beat, without joint states."""

    def samples(now_ns: int) -> list[int]:
        return [now_ns + k * BEAT_NS for k in range(-10, 101) if not pause[0] < k < pause[1]]

    found, _kept = observed(monkeypatch, lambda now_ns: beats(now_ns + 1, 11), 90 * BEAT_NS, Level.UNKNOWN, samples)
    assert fault in found
    assert (silence.PAUSED in found) == (fault == silence.PAUSED)


@pytest.mark.parametrize(
    ("faults", "tries"),
    [
        ([silence.SILENT] * 5, silence.TRIES),
        ([silence.DEAF, silence.PAUSED] * 20, silence.BLIND_TRIES),
        ([silence.DEAF] * 5 + [silence.SILENT, ""], 7),
        (["refused", ""], 1),
        ([""], 1),
    ],
)
def test_what_says_nothing_of_the_supervisor_is_not_one_of_the_few_tries(
    monkeypatch: pytest.MonkeyPatch, faults: list[str], tries: int
) -> None:
    coming = iter(faults)
    monkeypatch.setattr(silence, "_case", lambda *_given: next(coming))
    cell: Any = None  # nobody looks at it
    assert silence._tried(cell, "an event", lambda _cell: "", [], tally()) == faults[tries - 1]
    assert len(list(coming)) == len(faults) - tries


# --- outages ----------------------------------------------------------------------------------------------------------


def test_a_pause_before_a_signal_does_not_make_a_robot_stand_later(monkeypatch: pytest.MonkeyPatch) -> None:
    """A node works until the signal is sent, however late that is."""
    clock = Clock(10**15)
    monkeypatch.setattr(outages, "time", clock)
    process: Any = SimpleNamespace(send_signal=lambda how: clock.passes(NS_PER_S))
    assert outages._struck(process, signal.SIGSTOP) == clock.now_ns
