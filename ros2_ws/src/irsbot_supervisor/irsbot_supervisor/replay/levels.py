"""Levels and causes of the samples of a recording, in runs: an hour has millions of samples and few changes."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from irsbot_msgs_py.records import Level

Found = tuple[Level, int]
"""Level and causes."""


class _Run(NamedTuple):
    """Consecutive samples of one supervision with the same result."""

    part: int
    first: int
    last: int
    found: Found


class Levels(Mapping[tuple[int, int], Found]):
    """Level and causes by number of the supervision and of the sample, added in ascending order."""

    def __init__(self) -> None:
        self._runs: list[_Run] = []
        self._begins: list[tuple[int, int]] = []
        self._count = 0

    def add(self, part: int, numbers: Sequence[int], found: Found) -> None:
        """Add samples with one result. numbers: ascending."""
        at = 0
        while at < len(numbers):
            first = numbers[at]
            if len(numbers) - at == numbers[-1] - first + 1:
                self._append(part, first, numbers[-1], found)
                return
            self._append(part, first, first, found)
            at += 1

    def _append(self, part: int, first: int, last: int, found: Found) -> None:
        self._count += last - first + 1
        if self._runs:
            run = self._runs[-1]
            if (run.part, run.found, run.last + 1) == (part, found, first):
                self._runs[-1] = run._replace(last=last)
                return
        self._runs.append(_Run(part, first, last, found))
        self._begins.append((part, first))

    def __getitem__(self, key: tuple[int, int]) -> Found:
        place = bisect_right(self._begins, key) - 1
        if place >= 0:
            run = self._runs[place]
            if run.part == key[0] and run.first <= key[1] <= run.last:
                return run.found
        raise KeyError(key)

    def __iter__(self) -> Iterator[tuple[int, int]]:
        return ((run.part, number) for run in self._runs for number in range(run.first, run.last + 1))

    def __len__(self) -> int:
        return self._count

    def __eq__(self, other: object) -> bool:
        return self._runs == other._runs if isinstance(other, Levels) else super().__eq__(other)

    __hash__ = None  # type: ignore[assignment]
