"""The codec against bytes written by hand from the rules of XCDR1, and against damaged bytes."""

from __future__ import annotations

from contextlib import suppress
from math import inf, nan
from struct import pack
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from irsbot_msgs_py import cdr
from irsbot_msgs_py.errors import CdrError
from irsbot_msgs_py.records import Cause, Finding, JointSample, Level, SingularityState, Verdict
from irsbot_msgs_py.summary import StateSummary

SAMPLE = JointSample(5_000_000_007, 11, 12, ("q1", "long_name"), (1.5, nan), (), (-0.0,))
STATE = SingularityState(
    *(1_000_000_001, "irsbot2", 7, 8, 9, Level.WARN, Cause.TYPE2 | Cause.SPEED, (1.0, 2.0), (3.0, 4.0), (5.0,), ()),
    *((1, -1), -1, (0.1, 0.2), 0.3, nan, (), (0.4,), 0.5, 0.6, 0.7, (0.8, 0.9), (nan, nan), (1e3, 2e3), 0.25),
    *(Cause.TYPE2, 0.2, inf, True, 1e-9, 0.001, 1e-5),
)
SUMMARY = StateSummary(STATE, 32, 2**40, 0.1, 0.2, 0.3, 0.4, nan, nan, nan, nan, -0.5, 0.5)
FINDING = Finding(Cause.TYPE1, Level.STOP, 0.01, 0.05, "1", "leg 1 is nearly straight: 0.01 < 0.05")
VERDICT = Verdict(
    *(3, Level.STOP, Cause.TYPE1, True, 4, (0.6, -0.8), "stop", 99, "ab" * 32, -5, 0.0, (FINDING, FINDING)),
    *(Cause.LIMB, 7.5, Cause.POSITION),
)


def by_hand(sample: JointSample, padding: bytes) -> bytes:
    """A JointState of two names `q1`, `long_name`, two positions, no velocity and one effort.

    The encapsulation is 4 bytes and alignment counts behind it: stamp 0-8, frame length 8-12, frame 12-13.
    """
    pad = padding[0:1]
    return b"".join(
        (
            b"\x00\x01\x00\x00",
            pack("<iI", 5, 7),
            pack("<I", 1) + b"\0" + 3 * pad,  # frame "", up to 16
            pack("<I", 2),  # 20
            pack("<I", 3) + b"q1\0" + pad,  # 28
            pack("<I", 10) + b"long_name\0" + 2 * pad,  # 32 + 12 = 44
            pack("<I", 2) + pack("<2d", *sample.position),  # 48, a multiple of 8: no padding; up to 64
            pack("<I", 0),  # 68: an empty sequence aligns nothing
            pack("<I", 1) + pack("<d", sample.effort[0]),  # 72
        )
    )


@pytest.mark.parametrize("padding", [b"\x00", b"\xff", b"\x5a"])
def test_a_joint_state_is_decoded_by_the_standard_with_any_padding(padding: bytes):
    read = cdr.decode_joint_state(by_hand(SAMPLE, padding), 11, 12)
    assert repr(read) == repr(SAMPLE)  # NaN is not equal to itself


def test_a_joint_state_is_written_as_the_standard_lays_it_out():
    assert cdr.encode_joint_state(SAMPLE) == by_hand(SAMPLE, b"\0")


def test_streams_of_different_layout_may_alternate():
    other = SAMPLE._replace(names=("q1", "long_nami"), position=(7.0, 8.0))
    longer = SAMPLE._replace(velocity=(1.0, 2.0))
    stream = [SAMPLE, other, longer, SAMPLE, SAMPLE, longer, longer, other]
    read = [cdr.decode_joint_state(cdr.encode_joint_state(sample), 11, 12) for sample in stream]
    assert list(map(repr, read)) == list(map(repr, stream))


@pytest.mark.parametrize(
    ("record", "encode", "decode"),
    [
        (STATE, cdr.encode_state, cdr.decode_state),
        (SUMMARY, cdr.encode_summary, cdr.decode_summary),
        (VERDICT, cdr.encode_verdict, cdr.decode_verdict),
        (VERDICT._replace(findings=()), cdr.encode_verdict, cdr.decode_verdict),
        ("Grüße, 特異点", cdr.encode_string, cdr.decode_string),
        ("", cdr.encode_string, cdr.decode_string),
    ],
    ids=["state", "summary", "verdict", "verdict without findings", "text", "empty text"],
)
def test_a_written_record_is_read_back(record, encode, decode):
    assert repr(decode(encode(record))) == repr(record)


DECODERS = {
    "joint state": (cdr.encode_joint_state(SAMPLE), lambda data: cdr.decode_joint_state(data, 0, 0)),
    "state": (cdr.encode_state(STATE), cdr.decode_state),
    "summary": (cdr.encode_summary(SUMMARY), cdr.decode_summary),
    "verdict": (cdr.encode_verdict(VERDICT), cdr.decode_verdict),
    "text": (cdr.encode_string("a text"), cdr.decode_string),
}


EARLIER = DECODERS["verdict"][0].rindex(FINDING.text.encode()) + len(FINDING.text.encode()) + 1
"""Bytes of a verdict of the first version: it ends with the zero behind the text of the last finding."""

BYPASSED = len(DECODERS["verdict"][0]) - 4
"""Bytes of a verdict of the second version, without `escape_cause`."""


@pytest.mark.parametrize("name", DECODERS)
def test_a_message_cut_anywhere_is_refused(name: str):
    whole, decode = DECODERS[name]
    decode(whole)  # the layout of the whole is known
    for size in range(len(whole)):
        if name == "verdict" and EARLIER <= size < EARLIER + 4:  # whole for an earlier version, and padded
            assert decode(whole[:size]) == VERDICT._replace(
                bypassed=Cause.NONE, bypass_left=0.0, escape_cause=Cause.NONE
            )
            continue
        if name == "verdict" and size >= BYPASSED:
            assert decode(whole[:size]) == VERDICT._replace(escape_cause=Cause.NONE)
            continue
        with pytest.raises(CdrError):
            decode(whole[:size])


def test_verdicts_of_earlier_versions_and_ours_may_alternate():
    """What they have in common is laid out in the same way: the end alone tells them apart."""
    ours = cdr.encode_verdict(VERDICT)
    first, second = ours[:EARLIER], ours[:BYPASSED]
    stream = [(ours, Cause.LIMB, 7.5, Cause.POSITION), (first, 0, 0.0, 0), (first + b"\1\2\3", 0, 0.0, 0)]
    stream += [(second, Cause.LIMB, 7.5, 0), (second + b"\1", Cause.LIMB, 7.5, 0)]
    for data, bypassed, left, escape in 2 * stream:
        read = cdr.decode_verdict(data)
        assert (read.bypassed, read.bypass_left, read.escape_cause) == (bypassed, left, escape)
        assert read[:12] == VERDICT[:12]


CHANGES = st.fixed_dictionaries(
    {},
    optional={
        "stamp_ns": st.integers(0, 2**40),
        "sequence": st.integers(0, 2**64 - 1),
        "text": st.sampled_from(["", "stop", "halt"]),
        "escape_direction": st.sampled_from([(), (0.6, -0.8)]),
        "latched": st.booleans(),
        "findings": st.sampled_from([(), (FINDING,), (FINDING._replace(value=0.02),)]),
        "bypass_left": st.sampled_from([0.0, 7.5]),
    },
)


@given(st.lists(CHANGES, max_size=20))
def test_a_reader_of_a_stream_of_verdicts_reads_what_each_says(changes: list[dict[str, object]]):
    reader, verdict = cdr.VerdictReader(), VERDICT
    for change in changes:
        verdict = verdict._replace(**change)
        assert reader.read(cdr.encode_verdict(verdict)) == verdict


ORDERS = st.fixed_dictionaries(
    {"change": CHANGES},
    optional={
        "level": st.sampled_from([Level.OK, Level.STOP]),
        "causes": st.sampled_from([Cause.TYPE1, Cause.TYPE1 | Cause.LIMB]),
        "event": st.integers(3, 4),
        "bypassed": st.sampled_from([Cause.NONE, Cause.LIMB]),
        "escape_cause": st.sampled_from([Cause.NONE, Cause.POSITION]),
    },
)


def _ordered(change: dict[str, object], **order: object) -> Verdict:
    return VERDICT._replace(**change)._replace(**order)


@given(ORDERS, ORDERS, st.sampled_from(("", "1", "mm")))
def test_a_verdict_that_says_the_same_has_the_same_order(one: dict[str, Any], other: dict[str, Any], unit: str):
    reader, first, second = cdr.VerdictReader(), _ordered(**one), _ordered(**other)
    second = second._replace(findings=tuple(each._replace(unit=unit) for each in second.findings))
    reader.read(cdr.encode_verdict(first))
    order = ("level", "causes", "latched", "event", "bypassed")
    if reader.says_the_same(cdr.encode_verdict(second)):
        assert [getattr(first, name) for name in order] == [getattr(second, name) for name in order]


def test_a_verdict_with_other_numbers_and_texts_says_the_same_and_before_the_first_none_does():
    reader, told = cdr.VerdictReader(), VERDICT._replace(bypassed=Cause.NONE, bypass_left=0.0)
    other = told._replace(text="halt", sequence=7, findings=(FINDING, FINDING._replace(value=0.02, text=FINDING.text)))
    assert not reader.says_the_same(cdr.encode_verdict(told))
    reader.read(cdr.encode_verdict(told))
    assert reader.says_the_same(cdr.encode_verdict(other))


def test_a_reader_of_verdicts_refuses_what_is_cut_and_goes_on():
    reader, data = cdr.VerdictReader(), cdr.encode_verdict(VERDICT)
    assert reader.read(data) == VERDICT
    for end in (0, 3, 11, 40, len(data) - 40):
        with pytest.raises(CdrError):
            reader.read(data[:end])
    assert reader.read(data) == VERDICT


@pytest.mark.parametrize("name", DECODERS)
@given(edits=st.lists(st.tuples(st.integers(0, 10_000), st.binary(min_size=1, max_size=8)), min_size=1, max_size=6))
def test_damaged_bytes_are_read_or_refused_but_never_raise_anything_else(name: str, edits: list[tuple[int, bytes]]):
    whole, decode = DECODERS[name]
    damaged = bytearray(whole)
    for place, new in edits:
        damaged[place % len(whole) : place % len(whole) + len(new)] = new
    with suppress(CdrError):
        assert isinstance(decode(bytes(damaged)), (JointSample, SingularityState, StateSummary, Verdict, str))


@given(st.binary(max_size=200))
def test_noise_is_never_anything_but_refused(noise: bytes):
    with pytest.raises(CdrError):
        cdr.decode_state(b"\x00\x01\x00\x00" + noise)


@pytest.mark.parametrize(
    ("data", "word"),
    [
        (b"\x00\x00\x00\x00" + bytes(8), "encapsulation"),  # big-endian
        (b"\x00\x01\x00\x00" + pack("<I", 2**32 - 1), "text"),  # longer than the message
        (b"\x00\x01\x00\x00" + pack("<I", 3) + b"abc", "text"),  # without its zero
        (b"\x00\x01\x00\x00" + pack("<I", 4) + b"a\0b\0", "text"),  # with one inside
        (b"", "encapsulation"),
    ],
)
def test_a_refusal_names_the_fault(data: bytes, word: str):
    with pytest.raises(CdrError, match=word):
        cdr.decode_string(data)


def test_a_level_that_does_not_exist_is_refused():
    data = bytearray(cdr.encode_verdict(VERDICT))
    data[4 + 16 - 3] = 4  # stamp 8, frame 4 + 1, then the level
    with pytest.raises(CdrError, match="level 4"):
        cdr.decode_verdict(data)


@pytest.mark.parametrize(
    "state",
    [
        STATE._replace(sequence=-1),
        STATE._replace(robot="a\0b"),
        STATE._replace(robot="\ud800"),
        STATE._replace(stamp_ns=2**63),
        STATE._replace(pose=("x",)),
    ],
    ids=["negative count", "zero in text", "lone surrogate", "stamp beyond 2038", "text for a number"],
)
def test_a_record_that_does_not_fit_its_message_is_refused(state: SingularityState):
    with pytest.raises(CdrError, match="does not fit"):
        cdr.encode_state(state)
