"""Smallest and largest margins of states that come one by one, as the summaries of a supervisor have them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from struct import Struct

from irsbot_msgs_py.cdr_places import state_layout
from irsbot_msgs_py.errors import CdrError
from irsbot_msgs_py.records import Floats
from irsbot_supervisor.core.summary import extremes_of

FIELDS = ("type1_margin", "type2_margin", "constraint_margin", "limb_margin", "stop_margin")
"""Of a state, in the order of `StateSummary.smallest`; of several numbers the smallest counts."""

Columns = list[list[float]]
"""Values of each of FIELDS."""


class Extremes:
    """Reads nothing of a state but FIELDS, at the places where they were in the states before: a tenth of the time of
    decoding it."""

    def __init__(self) -> None:
        self._form = Struct("")
        self._mask = self._texts = 0  # bits of all texts of a state as one number, and what states of the layout have
        self._numbers: list[range] = []  # places of each field in what is unpacked

    def of(self, states: Sequence[bytes]) -> tuple[Floats, Floats]:
        """Smallest and largest values of FIELDS over the states, as CDR; NaN where none is known."""
        found: Columns = [[] for _ in FIELDS]
        for _size, group in groupby(states, len):
            alike = list(group)
            read = self._read(alike)
            if read is not None:
                _append(found, read)
                continue
            for one in alike:  # of several layouts
                _append(found, self._read([one]) or self._learned(one))
        return extremes_of(found)

    def _read(self, states: Sequence[bytes]) -> Columns | None:
        """Values of states of one size; None if one of them has not the learned layout."""
        mask, texts, number = self._mask, self._texts, int.from_bytes
        if len(states[0]) != self._form.size or any(number(data, "little") & mask != texts for data in states):
            return None
        columns = list(zip(*self._form.iter_unpack(b"".join(states)), strict=True))
        values = [columns[places.start : places.stop] for places in self._numbers]
        return [list(each[0] if len(each) == 1 else map(min, *each)) if each else [] for each in values]

    def _learned(self, data: bytes) -> Columns:
        """Values of a state of another layout, which is that of the next ones; none of what is no state."""
        try:
            layout = state_layout(data)
        except CdrError:
            return [[] for _ in FIELDS]
        mask = bytearray(len(data))
        for part in layout.fixed:
            mask[part] = b"\xff" * (part.stop - part.start)
        self._mask = int.from_bytes(mask, "little")
        self._texts = int.from_bytes(data, "little") & self._mask
        form, end, place, numbers = "<", 0, 0, dict.fromkeys(FIELDS, range(0))
        for start, name in sorted((layout.numbers[name].start, name) for name in FIELDS):
            stop = layout.numbers[name].stop
            count = (stop - start) // 8
            form += f"{start - end}x{count}d"
            numbers[name] = range(place, place + count)
            place, end = place + count, stop
        self._form = Struct(f"{form}{len(data) - end}x")
        self._numbers = [numbers[name] for name in FIELDS]
        return self._read([data]) or []


def _append(found: Columns, more: Columns) -> None:
    for values, added in zip(found, more, strict=True):
        values += added
