"""State of a running suite from received messages: newest state and verdict, limits, rates, ages, changes, extremes.
Without ROS and without a clock: times are arguments, s on any steady clock.

States are heard as summaries, or one by one where there are none: what is seen is the same.
"""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Mapping, Sequence
from math import inf
from typing import Any, NamedTuple

from irsbot_msgs_py.cdr import VerdictReader, decode_state, decode_summary
from irsbot_msgs_py.errors import CdrError
from irsbot_msgs_py.records import CONSUMER_TIMEOUT_S, Floats, Level, SingularityState, Verdict
from irsbot_supervisor.bag.journal import Configuration, JournalError, read_entry
from irsbot_supervisor.core.summary import extremes_of
from irsbot_supervisor.processes.extremes import Extremes

RATE_S = 1.0
"""s over which rates are counted."""

MOST = 100_000
"""States of one second that are counted at most: a damaged message must not take all memory."""

CHANGES = 100
"""Number of changes of the verdict that are remembered."""


class Change(NamedTuple):
    """A verdict that differs from the one before in level, causes, latch or bypass."""

    time_s: float
    level: Level
    causes: int
    text: str


class Seen(NamedTuple):
    """A snapshot of a suite. Ages are inf and rates 0 for messages that never came."""

    level: Level  # level for a consumer: UNKNOWN also if verdicts are missing or too old
    verdict: Verdict | None
    state: SingularityState | None
    limits: Mapping[str, Any]  # settings by name; empty before the first journal entry
    machine: Mapping[str, Any]  # record of the robot; likewise
    verdict_age_s: float
    state_age_s: float
    verdict_hz: float
    state_hz: float
    changes: tuple[Change, ...]
    worst: Level  # since the snapshot before: `level`, and of the verdicts in between
    smallest: Floats  # since the snapshot before, as in StateSummary; empty if no state came
    largest: Floats  # likewise


class Observed:
    """Collects received messages."""

    def __init__(self) -> None:
        self._verdict: Verdict | None = None
        self._reader = VerdictReader()
        self._state: SingularityState | None = None
        self._states: list[bytes] = []  # since the snapshot before, one by one
        self._ends: list[Floats] = []  # of the summaries since then
        self._total = 0  # states of all summaries
        self._extremes = Extremes()
        self._worst = Level.OK
        self._limits: Mapping[str, Any] = {}
        self._machine: Mapping[str, Any] = {}
        self._times: dict[str, deque[float]] = {"verdict": deque(), "state": deque()}
        self._changes: deque[Change] = deque(maxlen=CHANGES)

    def hear_verdicts(self, verdicts: Sequence[bytes], times_s: Sequence[float]) -> None:
        """Take in verdicts, as CDR, and when each came; read are those that may be a change, and the newest."""
        last = len(verdicts) - 1
        for number, (data, time_s) in enumerate(zip(verdicts, times_s, strict=True)):
            before = self._verdict
            if before is not None and self._reader.says_the_same(data):
                self._worst = max(self._worst, before.level)
                if number < last:
                    continue
            verdict = self._verdict = self._reader.read(data)
            self._worst = max(self._worst, verdict.level)
            if before is None or _essence(before) != _essence(verdict):
                self._changes.append(Change(time_s, verdict.level, verdict.causes, verdict.text))
        if verdicts:
            self._count("verdict", times_s)

    def hear_states(self, states: Sequence[bytes], times_s: Sequence[float]) -> None:
        """Take in states, as CDR, and when each came."""
        if states:
            self._states += states
            self._count("state", times_s)

    def hear_summaries(self, summaries: Sequence[bytes], times_s: Sequence[float]) -> None:
        """Take in summaries of states, as CDR, and when each came."""
        self._take_states()
        for data, time_s in zip(summaries, times_s, strict=True):
            with contextlib.suppress(CdrError):
                summary = decode_summary(data)
                self._state = summary.state
                self._ends += summary.smallest, summary.largest
                count = summary.state_count
                if self._total:  # with the states of summaries that were lost, unless the supervisor was started again
                    count = max(count, summary.state_total - self._total)
                self._total = summary.state_total
                self._count("state", self._spread(count, time_s))

    def hear_journal(self, line: str) -> None:
        """Take in a line of the journal, which contains the limits and the robot."""
        with contextlib.suppress(JournalError):
            entry = read_entry(line)
            if isinstance(entry, Configuration):
                self._limits, self._machine = entry.values, entry.machine

    def look(self, now_s: float) -> Seen:
        """The present snapshot."""
        self._take_states()
        smallest, largest = extremes_of(list(zip(*self._ends, strict=True)))
        self._ends = []
        ages = {name: now_s - times[-1] if times else inf for name, times in self._times.items()}
        fresh = self._verdict is not None and ages["verdict"] <= CONSUMER_TIMEOUT_S
        level = self._verdict.level if self._verdict is not None and fresh else Level.UNKNOWN
        worst, self._worst = max(self._worst, level), Level.OK
        return Seen(
            level,
            self._verdict,
            self._state,
            self._limits,
            self._machine,
            ages["verdict"],
            ages["state"],
            self._rate("verdict", now_s),
            self._rate("state", now_s),
            tuple(self._changes),
            worst,
            smallest,
            largest,
        )

    def _take_states(self) -> None:
        """The newest of the states that came one by one, and their extremes."""
        states, self._states = self._states, []
        if states:
            self._ends += self._extremes.of(states)
            self._state = None
            with contextlib.suppress(CdrError):
                self._state = decode_state(states[-1])

    def _spread(self, count: int, time_s: float) -> list[float]:
        """Times of the states of a summary, the last of which came at this time: evenly since the state before."""
        times = self._times["state"]
        gap_s = max(time_s - times[-1], 0.0) if times else 0.0
        counted_s = min(gap_s, RATE_S)
        shown = min(count if gap_s <= RATE_S else max(round(count * RATE_S / gap_s), 1), MOST)
        return [time_s - counted_s * back / shown for back in range(shown - 1, -1, -1)]

    def _count(self, name: str, times_s: Sequence[float]) -> None:
        times = self._times[name]
        times.extend(times_s)
        while times and times[-1] - times[0] > RATE_S:
            times.popleft()

    def _rate(self, name: str, now_s: float) -> float:
        """Until the newest message, as long as it counts as present: the next summary has not come yet."""
        times = self._times[name]
        end_s = times[-1] if times and now_s - times[-1] <= CONSUMER_TIMEOUT_S else now_s
        old = next((count for count, time_s in enumerate(times) if end_s - time_s < RATE_S), len(times))
        return (len(times) - old) / RATE_S


def _essence(verdict: Verdict) -> tuple[Any, ...]:
    return verdict.level, verdict.causes, verdict.latched, verdict.event, verdict.bypassed
