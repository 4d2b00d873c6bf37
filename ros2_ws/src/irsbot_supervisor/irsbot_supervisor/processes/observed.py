"""State of a running suite from received messages: newest state and verdict, limits, rates, ages, changes. Without ROS
and without a clock: times are arguments, s on any steady clock."""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Mapping, Sequence
from math import inf
from typing import Any, NamedTuple

from irsbot_msgs_py.cdr import VerdictReader, decode_state
from irsbot_msgs_py.errors import CdrError
from irsbot_msgs_py.records import CONSUMER_TIMEOUT_S, Level, SingularityState, Verdict
from irsbot_supervisor.bag.journal import Configuration, JournalError, read_entry

RATE_S = 1.0
"""s over which rates are counted."""

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
    states: tuple[bytes, ...]  # since the snapshot before, as CDR


class Observed:
    """Collects received messages."""

    def __init__(self) -> None:
        self._verdict: Verdict | None = None
        self._reader = VerdictReader()
        self._state = b""
        self._states: list[bytes] = []
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
        """Take in states, as CDR, and when each came; only the newest is decoded here."""
        if states:
            self._state = states[-1]
            self._states += states
            self._count("state", times_s)

    def hear_journal(self, line: str) -> None:
        """Take in a line of the journal, which contains the limits and the robot."""
        with contextlib.suppress(JournalError):
            entry = read_entry(line)
            if isinstance(entry, Configuration):
                self._limits, self._machine = entry.values, entry.machine

    def look(self, now_s: float) -> Seen:
        """The present snapshot."""
        state = None
        with contextlib.suppress(CdrError):
            state = decode_state(self._state) if self._state else None
        ages = {name: now_s - times[-1] if times else inf for name, times in self._times.items()}
        fresh = self._verdict is not None and ages["verdict"] <= CONSUMER_TIMEOUT_S
        level = self._verdict.level if self._verdict is not None and fresh else Level.UNKNOWN
        worst, self._worst = max(self._worst, level), Level.OK
        states, self._states = tuple(self._states), []
        return Seen(
            level,
            self._verdict,
            state,
            self._limits,
            self._machine,
            ages["verdict"],
            ages["state"],
            self._rate("verdict", now_s),
            self._rate("state", now_s),
            tuple(self._changes),
            worst,
            states,
        )

    def _count(self, name: str, times_s: Sequence[float]) -> None:
        times = self._times[name]
        times.extend(times_s)
        while times[-1] - times[0] > RATE_S:
            times.popleft()

    def _rate(self, name: str, now_s: float) -> float:
        times = self._times[name]
        old = next((count for count, time_s in enumerate(times) if now_s - time_s <= RATE_S), len(times))
        return (len(times) - old) / RATE_S


def _essence(verdict: Verdict) -> tuple[Any, ...]:
    return verdict.level, verdict.causes, verdict.latched, verdict.event, verdict.bypassed
