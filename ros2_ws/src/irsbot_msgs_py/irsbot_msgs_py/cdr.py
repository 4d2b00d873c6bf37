"""Serialised messages <-> records without ROS: XCDR1 little-endian, as rclpy serialises.

Made for the hot path. The first message of a stream is walked field by field, and the walk leaves a layout behind: one
`struct` for the whole message, and the places of all that messages of this layout have in common (lengths and texts).
The next message costs one `unpack_from` and one comparison of those places; one that differs in any of them is walked
again. Padding is skipped, never compared, because senders leave it uninitialised.

`convert` is the reference: property tests hold this file equal to rclpy's serialisation.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import lru_cache
from operator import itemgetter
from struct import Struct, error, unpack_from
from typing import Any, NamedTuple

from irsbot_msgs_py.records import Cause, Finding, JointSample, Level, SingularityState, Verdict
from irsbot_msgs_py.stamps import nanoseconds, sec_nanosec

Bytes = bytes | bytearray | memoryview

# What a field is made of: a `struct` code; with "*" a sequence of it; "s" is a text; "header" is stamp and frame;
# a tuple of kinds is a sequence of structures.
Kinds = tuple[Any, ...]

# For each later version of a message, the values of its added fields in messages of earlier versions.
Added = tuple[tuple[Any, ...], ...]

JOINT_STATE: Kinds = ("header", "s*", "d*", "d*", "d*")
STATE: Kinds = (
    *("header", "s", "Q", "q", "q", "B", "I", "d*", "d*", "d*", "d*", "b*", "b", "d*", "d", "d", "d*"),
    *("d*", "d", "d", "d", "d*", "d*", "d*", "d", "I", "d", "d", "?", "d", "d", "d"),
)
FINDING: Kinds = ("I", "B", "d", "d", "s", "s")
VERDICT: Kinds = ("header", "B", "I", "?", "I", "d*", "s", "Q", "s", "q", "d", FINDING, "I", "d", "I")

_SIZE = {"?": 1, "b": 1, "B": 1, "s": 1, "i": 4, "I": 4, "d": 8, "q": 8, "Q": 8}
_NUMBERS = frozenset("?bBiIdqQ")
_SEQUENCES = {"d*": "d", "b*": "b"}
_ENCAPSULATION = b"\x00\x01\x00\x00"  # little-endian XCDR1
_ORIGIN = len(_ENCAPSULATION)  # alignment counts from here
_SMALLEST = 4  # bytes: fewer behind the end of an earlier version are padding, as many are its successor's next field
_NEVER = 2**63  # no message is that long
_MAX_PACKERS = 64  # a stream needs one or two: texts and sequences change their length rarely


class CdrError(ValueError):
    """Bytes that are not the expected message, or a record that does not fit its message."""


class _Format:
    """The `struct` code of a message, grown field by field with the padding of XCDR1."""

    def __init__(self) -> None:
        self.parts = ["<4s"]
        self.end = _ORIGIN

    def add(self, code: str, count: int = 1) -> int:
        """Append `count` values; returns where they begin. Nothing is aligned for an empty sequence."""
        size = _SIZE[code]
        pad = -(self.end - _ORIGIN) % size if count else 0
        self.parts.append(f"{pad}x{count}{code}")
        start = self.end + pad
        self.end = start + count * size
        return start

    def compile(self) -> Struct:
        return Struct("".join(self.parts))


class _Layout:
    """Position of every field in messages that have the same lengths and texts as the learned one."""

    def __init__(self, walk: _Walk) -> None:
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


class _Walk:
    """Reads one message field by field with all checks, and notes the layout."""

    def __init__(self, data: Bytes, kinds: Kinds, added: Added = ()) -> None:
        """added: default values of the fields that later versions of the message have at its end."""
        self.data = data
        self.format = _Format()
        self.flat: list[Any] = [bytes(data[:_ORIGIN])]
        self.shared = [0]  # indices into flat of the encapsulation, lengths and texts
        self.texts: list[str | tuple[str, ...]] = []
        self.slots: list[int | slice] = []  # of each field in flat; text n has slot -1 - n
        if self.flat[0] != _ENCAPSULATION:
            raise CdrError(f"encapsulation {self.flat[0].hex(' ')}: expected 00 01 00 00, little-endian XCDR1")
        self.fixed = [slice(0, _ORIGIN)]  # bytes of the encapsulation, lengths and texts
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
            elif kind in _SEQUENCES:
                self.slots.append(self._number(_SEQUENCES[kind], self._length()))
            else:
                self.slots.append(self._number(kind).start)

    def _number(self, code: str, count: int = 1) -> slice:
        """Read the numbers of a field."""
        place = self._take(code, count)
        self.numbers.append((code, self.format.end - count * _SIZE[code], count))
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
        self.fixed.append(slice(self.format.end - _SIZE["I"], self.format.end))
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


class _Codec:
    """One message type: fields out of bytes, and bytes out of fields, by the layouts learned so far."""

    def __init__(self, kinds: Kinds, added: Added = ()) -> None:
        """added: default values of the fields that later versions of the message have at its end."""
        self._kinds, self._added = kinds, added
        self._layout: _Layout | None = None
        self._packers: dict[tuple[int, ...], Struct] = {}

    def decode(self, data: Bytes) -> tuple[Any, ...]:
        """The fields in order; a header is two, seconds and nanoseconds; structures follow one another."""
        layout = self._layout
        fields = layout.read(data) if layout is not None else None
        if fields is None:
            self._layout = layout = _Layout(_Walk(data, self._kinds, self._added))
            fields = layout.read(data)
            assert fields is not None, "a layout reads the message it was learned from"
        return fields

    @property
    def numbers(self) -> list[tuple[str, int, int]]:
        """Code, first byte and count of the numbers of the message that was decoded last."""
        return self._layout.numbers if self._layout is not None else []

    def encode(self, record: Iterable[Any]) -> bytes:
        """The bytes of a record whose fields are those of the message; a header is one field, nanoseconds."""
        flat: list[Any] = [_ENCAPSULATION]
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
        if kind in _NUMBERS:
            flat.append(value)
        elif kind in _SEQUENCES:
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
    form = _Format()
    _grow(form, kinds, iter(lengths))
    return form.compile()


def _grow(form: _Format, kinds: Kinds, lengths: Iterator[int]) -> None:
    for kind in kinds:
        if kind in _NUMBERS:
            form.add(kind)
        elif kind == "header":
            for code in ("i", "I", "I", "s"):
                form.add(code)
        else:
            form.add("I")
            count = next(lengths)
            if kind == "s":
                form.add("s", count)
            elif kind in _SEQUENCES:
                form.add(_SEQUENCES[kind], count)
            else:
                for _ in range(count):
                    _grow(form, ("s",) if kind == "s*" else kind, lengths)


_joint_state = _Codec(JOINT_STATE)
_state = _Codec(STATE)
_VERDICT_ADDED = ((0, 0.0), (0,))  # bypassed and bypass_left; escape_cause: bags of earlier versions do not have them
_verdict = _Codec(VERDICT, _VERDICT_ADDED)

_STATE_LEVEL = SingularityState._fields.index("level")
_STATE_CAUSES = SingularityState._fields.index("causes")
_STATE_STOP_CAUSE = SingularityState._fields.index("stop_cause")
_VERDICT_FIXED = Verdict._fields.index("findings")  # fields of the record before the findings
_VERDICT_SEQUENCE = [kind for kind in VERDICT if kind not in ("header", "s")].index("Q") + 2  # behind those of a stamp
_STAMP_END = _ORIGIN + 2 * _SIZE["I"]

_VERDICT_EVENT = [kind for kind in VERDICT if kind not in ("header", "s")].index("I", 2) + 2  # likewise
_VERDICT_BYPASS = slice(-20, -8)  # of the last bytes; which of them it is, depends on version and padding

_cause = lru_cache(maxsize=4096)(Cause)  # making a member takes as long as reading a whole message


@lru_cache(maxsize=len(Level))
def _level(value: int) -> Level:
    try:
        return Level(value)
    except ValueError:
        raise CdrError(f"level {value} is none of 0 to {max(Level)}") from None


def decode_joint_state(data: Bytes, received_ns: int, seen_ns: int) -> JointSample:
    """A sensor_msgs/JointState that arrived at `received_ns` (ROS clock), `seen_ns` (steady clock)."""
    sec, nanosec, names, position, velocity, effort = _joint_state.decode(data)
    return JointSample(nanoseconds(sec, nanosec), received_ns, seen_ns, names, position, velocity, effort)


class JointStateLayout(NamedTuple):
    """Places of the numbers in all JointState messages that have the lengths and texts of one message, in bytes."""

    names: tuple[str, ...]
    fixed: tuple[slice, ...]  # bytes that all these messages have in common
    seconds: int
    nanoseconds: int
    position: slice
    velocity: slice
    effort: slice


def joint_state_layout(data: Bytes) -> JointStateLayout:
    """The layout of a sensor_msgs/JointState. Raises CdrError."""
    walk = _Walk(data, JOINT_STATE)
    names = walk.texts[0]
    assert isinstance(names, tuple)
    (_, sec, _), (_, nanosec, _), *arrays = walk.numbers
    position, velocity, effort = (slice(start, start + count * _SIZE[code]) for code, start, count in arrays)
    return JointStateLayout(names, tuple(walk.fixed), sec, nanosec, position, velocity, effort)


class StateLayout(NamedTuple):
    """Places of the numbers in all SingularityState messages that have the lengths and texts of one message, in
    bytes."""

    fixed: tuple[slice, ...]  # bytes that all these messages have in common
    numbers: dict[str, slice]  # of each field of the record that is a number or several


def state_layout(data: Bytes) -> StateLayout:
    """The layout of an irsbot_msgs/SingularityState. Raises CdrError."""
    walk = _Walk(data, STATE)
    names = [name for name in SingularityState._fields if name not in ("stamp_ns", "robot")]
    places = [slice(start, start + count * _SIZE[code]) for code, start, count in walk.numbers[2:]]  # behind the stamp
    return StateLayout(tuple(walk.fixed), dict(zip(names, places, strict=True)))


def encode_joint_state(sample: JointSample) -> bytes:
    """Encode a sensor_msgs/JointState; the times of arrival are not part of it."""
    return _joint_state.encode((sample.stamp_ns, sample.names, sample.position, sample.velocity, sample.effort))


def decode_state(data: Bytes) -> SingularityState:
    """An irsbot_msgs/SingularityState."""
    sec, nanosec, *rest = _state.decode(data)
    fields = [nanoseconds(sec, nanosec), *rest]
    fields[_STATE_LEVEL] = _level(fields[_STATE_LEVEL])
    fields[_STATE_CAUSES] = _cause(fields[_STATE_CAUSES])
    fields[_STATE_STOP_CAUSE] = _cause(fields[_STATE_STOP_CAUSE])
    return SingularityState._make(fields)


def encode_state(state: SingularityState) -> bytes:
    """An irsbot_msgs/SingularityState."""
    return _state.encode(state)


def decode_verdict(data: Bytes) -> Verdict:
    """An irsbot_msgs/Verdict."""
    sec, nanosec, level, causes, *rest = _verdict.decode(data)
    behind = _VERDICT_FIXED - 3
    fixed, flat, (bypassed, left, escape) = rest[:behind], rest[behind:-3], rest[-3:]
    findings = tuple(
        Finding(_cause(flat[k]), _level(flat[k + 1]), *flat[k + 2 : k + len(FINDING)])
        for k in range(0, len(flat), len(FINDING))
    )
    begin = nanoseconds(sec, nanosec), _level(level), _cause(causes)
    return Verdict._make((*begin, *fixed, findings, _cause(bypassed), left, _cause(escape)))


def encode_verdict(verdict: Verdict) -> bytes:
    """An irsbot_msgs/Verdict."""
    return _verdict.encode(verdict)


class VerdictReader:
    """Decodes the verdicts of one supervisor. A heartbeat repeats the verdict before with another stamp and sequence:
    it costs a tenth of decoding."""

    def __init__(self) -> None:
        self._verdict: Verdict | None = None
        self._head = self._tail = b""  # of the last that was decoded, between stamp and sequence, and behind
        self._sequence = 0  # first byte of its sequence
        self._order = self._bypass = b""  # of the last that was decoded: stamp to event, and what holds the bypass
        self._event = 0  # first byte behind its event

    def says_the_same(self, data: bytes) -> bool:
        """Whether a verdict surely has level, causes, latch, event and bypass of the last that was read. Texts and
        findings, which change with every sample, are not looked at."""
        return data[_STAMP_END : self._event] == self._order and data[_VERDICT_BYPASS] == self._bypass

    def read(self, data: bytes) -> Verdict:
        """An irsbot_msgs/Verdict."""
        begin, end = self._sequence, self._sequence + _SIZE["Q"]
        if self._verdict is not None and data[_STAMP_END:begin] == self._head and data[end:] == self._tail:
            (sec, nanosec), (sequence,) = unpack_from("<iI", data, _ORIGIN), unpack_from("<Q", data, begin)
            return self._verdict._replace(stamp_ns=nanoseconds(sec, nanosec), sequence=sequence)
        self._verdict = decode_verdict(data)
        _code, begin, _count = _verdict.numbers[_VERDICT_SEQUENCE]
        self._sequence, self._head, self._tail = begin, data[_STAMP_END:begin], data[begin + _SIZE["Q"] :]
        _code, begin, _count = _verdict.numbers[_VERDICT_EVENT]
        self._event = begin + _SIZE["I"]
        self._order, self._bypass = data[_STAMP_END : self._event], data[_VERDICT_BYPASS]
        return self._verdict


def decode_string(data: Bytes) -> str:
    """A std_msgs/String."""
    (text,) = _Walk(data, ("s",)).texts
    assert isinstance(text, str)
    return text


def encode_string(text: str) -> bytes:
    """A std_msgs/String."""
    return _Codec(("s",)).encode((text,))
