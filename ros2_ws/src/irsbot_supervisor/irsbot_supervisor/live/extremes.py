"""Smallest and largest margins of states that come between two looks: no dip is too short to be shown."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import isfinite, nan
from operator import itemgetter
from struct import Struct
from typing import Any

from irsbot_msgs_py.cdr import CdrError, state_layout

FIELDS = ("type1_margin", "type2_margin", "constraint_margin", "limb_margin", "stop_margin")
"""Of a state, in the order of `scene.COLUMNS`; of several numbers the smallest counts."""


class Extremes:
    """Reads nothing of a state but FIELDS, at the places where they were in the state before: a tenth of the time of
    decoding it."""

    def __init__(self) -> None:
        self._size = 0
        self._unpack: Callable[[bytes], tuple[Any, ...]] = Struct("").unpack
        self._fixed: Callable[[Sequence[Any]], Any] = tuple
        self._expected: Any = ()
        self._columns: list[list[int]] = []  # places of each field in what is unpacked

    def of(self, states: Sequence[bytes]) -> tuple[list[float], list[float]]:
        """Smallest and largest values of FIELDS over the states, as CDR; NaN where none is known."""
        found: list[list[float]] = [[] for _ in FIELDS]
        for rows, columns in self._runs(states):
            each = list(zip(*rows, strict=True))
            for values, places in zip(found, columns, strict=True):
                if places:
                    of_field = [each[place] for place in places]
                    values += of_field[0] if len(of_field) == 1 else map(min, *of_field)
        known = [[value for value in values if isfinite(value)] for values in found]
        return [min(values, default=nan) for values in known], [max(values, default=nan) for values in known]

    def _runs(self, states: Sequence[bytes]) -> Iterator[tuple[list[tuple[Any, ...]], list[list[int]]]]:
        """What is unpacked of neighbouring states of one layout, and the places of the fields in it."""
        rows: list[tuple[Any, ...]] = []
        for data in states:
            row = self._unpack(data) if len(data) == self._size else ()
            if not row or self._fixed(row) != self._expected:
                if rows:
                    yield rows, self._columns
                rows = []
                try:
                    self._learn(data)
                except CdrError:
                    continue
                row = self._unpack(data)
            rows.append(row)
        if rows:
            yield rows, self._columns

    def _learn(self, data: bytes) -> None:
        """Take on the layout of a state. Raises CdrError."""
        layout = state_layout(data)
        fixed = [(part.start, part.stop, "") for part in layout.fixed]
        parts = sorted([*fixed, *((*_ends(layout.numbers[name]), name) for name in FIELDS)])
        form, end, texts, places, count = "<", 0, [], {name: [0] for name in FIELDS}, 0
        for start, stop, name in parts:
            numbers = (stop - start) // 8 if name else 1
            form += f"{start - end}x" + (f"{numbers}d" if name else f"{stop - start}s")
            if name:
                places[name] = list(range(count, count + numbers))
            else:
                texts.append(count)
            count, end = count + numbers, stop
        self._size = len(data)
        self._unpack = Struct(f"{form}{len(data) - end}x").unpack
        self._fixed = itemgetter(*texts)
        self._expected = self._fixed(self._unpack(data))
        self._columns = [places[name] for name in FIELDS]


def _ends(part: slice) -> tuple[int, int]:
    return part.start, part.stop
