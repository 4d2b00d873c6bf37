"""Layouts of serialised messages: XCDR1 little-endian, as rclpy serialises.

A message is walked field by field with all checks. The walk leaves a layout behind: one `struct` for the whole message,
and the places of all that messages of this layout have in common (lengths and texts). Padding is skipped, never
compared, because senders leave it uninitialised.
"""

from __future__ import annotations

from operator import itemgetter
from struct import Struct, error, unpack_from
from typing import Any

from irsbot_msgs_py.errors import CdrError

Bytes = bytes | bytearray | memoryview

Kinds = tuple[Any, ...]
"""What the fields of a message are made of: a `struct` code; with "*" a sequence of it; "s" is a text; "header" is
stamp and frame; a tuple of kinds is a sequence of structures."""

Added = tuple[tuple[Any, ...], ...]
"""For each later version of a message, the values of its added fields in messages of earlier versions."""

SIZES = {"?": 1, "b": 1, "B": 1, "s": 1, "i": 4, "I": 4, "d": 8, "q": 8, "Q": 8}
NUMBERS = frozenset("?bBiIdqQ")
SEQUENCES = {"d*": "d", "b*": "b"}
ENCAPSULATION = b"\x00\x01\x00\x00"  # little-endian XCDR1
ORIGIN = len(ENCAPSULATION)  # alignment counts from here
_SMALLEST = 4  # bytes: fewer behind the end of an earlier version are padding, as many are its successor's next field
_NEVER = 2**63  # no message is that long


class Format:
    """The `struct` code of a message, grown field by field with the padding of XCDR1."""

    def __init__(self) -> None:
        self.parts = ["<4s"]
        self.end = ORIGIN

    def add(self, code: str, count: int = 1) -> int:
        """Append `count` values; returns where they begin. Nothing is aligned for an empty sequence."""
        size = SIZES[code]
        pad = -(self.end - ORIGIN) % size if count else 0
        self.parts.append(f"{pad}x{count}{code}")
        start = self.end + pad
        self.end = start + count * size
        return start

    def compile(self) -> Struct:
        """The compiled form of all that was added."""
        return Struct("".join(self.parts))


class Layout:
    """Position of every field in messages that have the same lengths and texts as the learned one."""

    def __init__(self, walk: Walk) -> None:
        self.numbers = walk.numbers
        self._absent = walk.absent
        self._end = walk.format.end if walk.absent else _NEVER
        self._unpack_from = walk.format.compile().unpack_from
        self._shared = itemgetter(*walk.shared)
        self._expected = self._shared(walk.flat)
        self._texts = tuple(reversed(walk.texts))
        self._fields = itemgetter(*walk.slots)

    def read(self, data: Bytes) -> tuple[Any, ...] | None:
        """The fields of `data`, or None if it has another layout."""
        try:
            flat = self._unpack_from(data)
        except error:
            return None
        if self._shared(flat) != self._expected or len(data) >= self._end + _SMALLEST:
            return None
        fields: tuple[Any, ...] = self._fields(flat + self._texts)
        return fields + self._absent


class Walk:
    """Reads one message field by field with all checks, and notes the layout."""

    def __init__(self, data: Bytes, kinds: Kinds, added: Added = ()) -> None:
        """added: default values of the fields that later versions of the message have at its end."""
        self.data = data
        self.format = Format()
        self.flat: list[Any] = [bytes(data[:ORIGIN])]
        self.shared = [0]  # indices into flat of the encapsulation, lengths and texts
        self.texts: list[str | tuple[str, ...]] = []
        self.slots: list[int | slice] = []  # of each field in flat; text n has slot -1 - n
        if self.flat[0] != ENCAPSULATION:
            raise CdrError(f"encapsulation {self.flat[0].hex(' ')}: expected 00 01 00 00, little-endian XCDR1")
        self.fixed = [slice(0, ORIGIN)]  # bytes of the encapsulation, lengths and texts
        self.numbers: list[tuple[str, int, int]] = []  # code, first byte and count of the other fields
        self.absent: tuple[Any, ...] = ()
        """Values of the last fields, for a message of an earlier version without them."""
        begin = len(kinds) - sum(map(len, added))
        self._fields(kinds[:begin])
        for version, values in enumerate(added):
            if len(data) < self.format.end + _SMALLEST:
                self.absent = sum(added[version:], ())
                break
            self._fields(kinds[begin : begin + len(values)])
            begin += len(values)

    def _fields(self, kinds: Kinds) -> None:
        for kind in kinds:
            if isinstance(kind, tuple):
                for _ in range(self._length()):
                    self._fields(kind)
            elif kind == "header":
                self._fields(("i", "I"))
                self._text()
            elif kind == "s":
                self._keep(self._text())
            elif kind == "s*":
                self._keep(tuple(self._text() for _ in range(self._length())))
            elif kind in SEQUENCES:
                self.slots.append(self._number(SEQUENCES[kind], self._length()))
            else:
                self.slots.append(self._number(kind).start)

    def _number(self, code: str, count: int = 1) -> slice:
        """Read the numbers of a field."""
        place = self._take(code, count)
        self.numbers.append((code, self.format.end - count * SIZES[code], count))
        return place

    def _take(self, code: str, count: int = 1) -> slice:
        """Read `count` numbers; returns their place in flat."""
        start = self.format.add(code, count)
        if self.format.end > len(self.data):
            raise CdrError(f"{len(self.data)} bytes end inside {count} x {code!r} at byte {start}")
        place = slice(len(self.flat), len(self.flat) + count)
        self.flat += unpack_from(f"<{count}{code}", self.data, start)
        return place

    def _length(self) -> int:
        place = self._take("I").start
        self.shared.append(place)
        self.fixed.append(slice(self.format.end - SIZES["I"], self.format.end))
        count: int = self.flat[place]
        return count

    def _text(self) -> str:
        start = self.format.add("s", self._length())
        raw = bytes(self.data[start : self.format.end])
        if self.format.end > len(self.data) or raw.find(0) != len(raw) - 1:
            raise CdrError(f"the text at byte {start} does not end where its length says")
        self.shared.append(len(self.flat))
        self.fixed.append(slice(start, self.format.end))
        self.flat.append(raw)
        return raw[:-1].decode(errors="replace")  # as rclpy does

    def _keep(self, text: str | tuple[str, ...]) -> None:
        self.texts.append(text)
        self.slots.append(-len(self.texts))
