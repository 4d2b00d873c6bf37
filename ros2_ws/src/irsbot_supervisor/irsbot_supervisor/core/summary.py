"""Sums up the states between two looks of a view: the newest one and the extremes, so that no dip is too short."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite, nan

from irsbot_msgs_py.records import Floats, SingularityState
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_msgs_py.summary import StateSummary

PERIOD_NS = NS_PER_S // 32
"""ns between two summaries: with the wait for a sample, 1 ms at 1 kHz, it is not longer than a frame of the live page,
so that every frame has news."""


def extremes_of(columns: Sequence[Sequence[float]]) -> tuple[Floats, Floats]:
    """Smallest and largest finite value of each column; NaN where there is none."""
    known = [values if isfinite(sum(values)) else [one for one in values if isfinite(one)] for values in columns]
    smallest = tuple([min(values) if values else nan for values in known])
    largest = tuple([max(values) if values else nan for values in known])
    return smallest, largest


class Summariser:
    """Collects states until a summary is due."""

    def __init__(self) -> None:
        self._margins: list[Floats] = []  # of the states that have some, since the summary before
        self._count = self._total = 0
        self._due_ns = 0

    def is_due(self, now_ns: int) -> bool:
        """True if the next state makes a summary. now_ns: steady clock, as everywhere here."""
        return now_ns >= self._due_ns

    def add(self, margins: Floats) -> None:
        """One more state. margins: `Supervisor.margins`, empty for a state without a pose."""
        self._count += 1
        if margins:
            self._margins.append(margins)

    def take(self, state: SingularityState, now_ns: int) -> StateSummary:
        """The summary of the states since the one before. state: the newest of them."""
        count = self._count
        self._total += count
        columns = list(zip(*self._margins, strict=True)) or [()] * 5
        smallest, largest = extremes_of(columns)
        ends = [end for pair in zip(smallest, largest, strict=True) for end in pair]
        self.forget()
        late_ns = now_ns - self._due_ns
        self._due_ns = PERIOD_NS + (self._due_ns if late_ns < PERIOD_NS else now_ns)  # the mean rate is kept
        return StateSummary(state, count, self._total, *ends)

    def forget(self) -> None:
        """Nobody listens to the states that were collected."""
        self._margins, self._count = [], 0
