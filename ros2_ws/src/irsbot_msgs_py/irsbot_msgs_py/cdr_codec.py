"""Fields out of serialised messages, and messages out of fields. Made for the hot path.

The first message of a stream is walked, and its layout is kept. The next message costs one `unpack_from` and one
comparison of the places that all messages of this layout have in common; one that differs in any of them is walked
again.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from struct import Struct, error
from typing import Any

from irsbot_msgs_py.cdr_layout import ENCAPSULATION, NUMBERS, SEQUENCES, Added, Bytes, Format, Kinds, Layout, Walk
from irsbot_msgs_py.errors import CdrError
from irsbot_msgs_py.stamps import sec_nanosec

_MAX_PACKERS = 64  # a stream needs one or two: texts and sequences change their length rarely


class Codec:
    """One message type: fields out of bytes, and bytes out of fields, by the layouts learned so far."""

    def __init__(self, kinds: Kinds, added: Added = ()) -> None:
        """added: default values of the fields that later versions of the message have at its end."""
        self._kinds, self._added = kinds, added
        self._layout: Layout | None = None
        self._packers: dict[tuple[int, ...], Struct] = {}

    def decode(self, data: Bytes) -> tuple[Any, ...]:
        """The fields in order; a header is two, seconds and nanoseconds; structures follow one another."""
        layout = self._layout
        fields = layout.read(data) if layout is not None else None
        if fields is None:
            self._layout = layout = Layout(Walk(data, self._kinds, self._added))
            fields = layout.read(data)
            assert fields is not None, "a layout reads the message it was learned from"
        return fields

    @property
    def numbers(self) -> list[tuple[str, int, int]]:
        """Code, first byte and count of the numbers of the message that was decoded last."""
        return self._layout.numbers if self._layout is not None else []

    def encode(self, record: Iterable[Any]) -> bytes:
        """The bytes of a record whose fields are those of the message; a header is one field, nanoseconds."""
        flat: list[Any] = [ENCAPSULATION]
        lengths: list[int] = []
        try:
            _flatten(self._kinds, record, flat, lengths)
            key = tuple(lengths)
            packer = self._packers.get(key)
            if packer is None:
                if len(self._packers) >= _MAX_PACKERS:
                    self._packers.clear()
                packer = self._packers[key] = _packer(self._kinds, lengths)
            return packer.pack(*flat)
        except (error, TypeError, ValueError) as problem:
            raise CdrError(f"does not fit its message: {problem}") from None


def _flatten(kinds: Kinds, record: Iterable[Any], flat: list[Any], lengths: list[int]) -> None:
    """Append what `_packer` packs: lengths before sequences and texts, a header as stamp and empty frame."""
    for kind, value in zip(kinds, record, strict=True):
        if kind in NUMBERS:
            flat.append(value)
        elif kind in SEQUENCES:
            lengths.append(len(value))
            flat.append(len(value))
            flat += value
        elif kind == "s":
            raw = value.encode() + b"\0"
            if raw.find(0) != len(raw) - 1:
                raise ValueError(f"text with a zero inside: {value!r}")
            lengths.append(len(raw))
            flat += (len(raw), raw)
        elif kind == "header":
            flat += (*sec_nanosec(value), 1, b"\0")
        else:
            lengths.append(len(value))
            flat.append(len(value))
            for item in value:
                if kind == "s*":
                    _flatten(("s",), (item,), flat, lengths)
                else:
                    _flatten(kind, item, flat, lengths)


def _packer(kinds: Kinds, lengths: Iterable[int]) -> Struct:
    """The `struct` of the messages whose sequences and texts have these lengths."""
    form = Format()
    _grow(form, kinds, iter(lengths))
    return form.compile()


def _grow(form: Format, kinds: Kinds, lengths: Iterator[int]) -> None:
    for kind in kinds:
        if kind in NUMBERS:
            form.add(kind)
        elif kind == "header":
            for code in ("i", "I", "I", "s"):
                form.add(code)
        else:
            form.add("I")
            count = next(lengths)
            if kind == "s":
                form.add("s", count)
            elif kind in SEQUENCES:
                form.add(SEQUENCES[kind], count)
            else:
                for _ in range(count):
                    _grow(form, ("s",) if kind == "s*" else kind, lengths)
