"""Serialised messages <-> records without ROS: XCDR1 little-endian, as rclpy serialises.

`convert` is the reference: property tests hold this file equal to rclpy's serialisation. `cdr_layout` reads the bytes,
`cdr_codec` keeps the layouts of a stream.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from struct import unpack_from
from typing import Any

from irsbot_msgs_py.cdr_codec import Codec
from irsbot_msgs_py.cdr_layout import ORIGIN, SIZES, Bytes, Kinds, Walk
from irsbot_msgs_py.errors import CdrError
from irsbot_msgs_py.records import Cause, Finding, JointSample, Level, SingularityState, Verdict
from irsbot_msgs_py.stamps import nanoseconds
from irsbot_msgs_py.summary import StateSummary

JOINT_STATE: Kinds = ("header", "s*", "d*", "d*", "d*")
STATE: Kinds = (
    *("header", "s", "Q", "q", "q", "B", "I", "d*", "d*", "d*", "d*", "b*", "b", "d*", "d", "d", "d*"),
    *("d*", "d", "d", "d", "d*", "d*", "d*", "d", "I", "d", "d", "?", "d", "d", "d"),
)
SUMMARY: Kinds = (*STATE, "I", "Q", *("d",) * 10)  # a structure in a message is its fields
FINDING: Kinds = ("I", "B", "d", "d", "s", "s")
VERDICT: Kinds = ("header", "B", "I", "?", "I", "d*", "s", "Q", "s", "q", "d", FINDING, "I", "d", "I")


_joint_state = Codec(JOINT_STATE)
_state = Codec(STATE)
_summary = Codec(SUMMARY)
_VERDICT_ADDED = ((0, 0.0), (0,))  # bypassed and bypass_left; escape_cause: bags of earlier versions do not have them
_verdict = Codec(VERDICT, _VERDICT_ADDED)

_STATE_LEVEL = SingularityState._fields.index("level")
_STATE_CAUSES = SingularityState._fields.index("causes")
_STATE_STOP_CAUSE = SingularityState._fields.index("stop_cause")
_SUMMARY_STATE = len(SingularityState._fields) + 1  # numbers of the state: a stamp is two
_VERDICT_FIXED = Verdict._fields.index("findings")  # fields of the record before the findings
_VERDICT_SEQUENCE = [kind for kind in VERDICT if kind not in ("header", "s")].index("Q") + 2  # behind those of a stamp
_STAMP_END = ORIGIN + 2 * SIZES["I"]

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
    """Decode a sensor_msgs/JointState that arrived at `received_ns` (ROS clock), `seen_ns` (steady clock), ns. Raises
    CdrError."""
    sec, nanosec, names, position, velocity, effort = _joint_state.decode(data)
    return JointSample(nanoseconds(sec, nanosec), received_ns, seen_ns, names, position, velocity, effort)


def encode_joint_state(sample: JointSample) -> bytes:
    """Encode a sensor_msgs/JointState; the times of arrival are not part of it."""
    return _joint_state.encode((sample.stamp_ns, sample.names, sample.position, sample.velocity, sample.effort))


def decode_state(data: Bytes) -> SingularityState:
    """Decode an irsbot_msgs/SingularityState. Raises CdrError."""
    return _state_of(_state.decode(data))


def _state_of(found: Sequence[Any]) -> SingularityState:
    """found: the fields as the codec gives them."""
    sec, nanosec, *rest = found
    fields = [nanoseconds(sec, nanosec), *rest]
    fields[_STATE_LEVEL] = _level(fields[_STATE_LEVEL])
    fields[_STATE_CAUSES] = _cause(fields[_STATE_CAUSES])
    fields[_STATE_STOP_CAUSE] = _cause(fields[_STATE_STOP_CAUSE])
    return SingularityState._make(fields)


def encode_state(state: SingularityState) -> bytes:
    """Encode an irsbot_msgs/SingularityState; its frame is empty. Raises CdrError for a record that does not fit."""
    return _state.encode(state)


def decode_summary(data: Bytes) -> StateSummary:
    """Decode an irsbot_msgs/StateSummary. Raises CdrError."""
    found = _summary.decode(data)
    return StateSummary(_state_of(found[:_SUMMARY_STATE]), *found[_SUMMARY_STATE:])


def encode_summary(summary: StateSummary) -> bytes:
    """Encode an irsbot_msgs/StateSummary; its frame is empty. Raises CdrError for a record that does not fit."""
    return _summary.encode((*summary.state, *summary[1:]))


def decode_verdict(data: Bytes) -> Verdict:
    """Decode an irsbot_msgs/Verdict, also of an earlier version, whose missing fields are 0. Raises CdrError."""
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
    """Encode an irsbot_msgs/Verdict; its frame is empty. Raises CdrError for a record that does not fit."""
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
        """Decode the next irsbot_msgs/Verdict. Raises CdrError; the verdict before stays known."""
        begin, end = self._sequence, self._sequence + SIZES["Q"]
        if self._verdict is not None and data[_STAMP_END:begin] == self._head and data[end:] == self._tail:
            (sec, nanosec), (sequence,) = unpack_from("<iI", data, ORIGIN), unpack_from("<Q", data, begin)
            return self._verdict._replace(stamp_ns=nanoseconds(sec, nanosec), sequence=sequence)
        self._verdict = decode_verdict(data)
        _code, begin, _count = _verdict.numbers[_VERDICT_SEQUENCE]
        self._sequence, self._head, self._tail = begin, data[_STAMP_END:begin], data[begin + SIZES["Q"] :]
        _code, begin, _count = _verdict.numbers[_VERDICT_EVENT]
        self._event = begin + SIZES["I"]
        self._order, self._bypass = data[_STAMP_END : self._event], data[_VERDICT_BYPASS]
        return self._verdict


def decode_string(data: Bytes) -> str:
    """Decode a std_msgs/String. Raises CdrError."""
    (text,) = Walk(data, ("s",)).texts
    assert isinstance(text, str)
    return text


def encode_string(text: str) -> bytes:
    """Encode a std_msgs/String. Raises CdrError for a text with a zero inside."""
    return Codec(("s",)).encode((text,))
