"""Records, messages and bytes agree: `convert` both ways, `cdr` against rclpy's own serialisation."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from irsbot_msgs_py import cdr
from irsbot_msgs_py.gate_status import GateCommand, GateOutcome, GateReason, GateStatus
from irsbot_msgs_py.health import RecorderHealth, RecorderState
from irsbot_msgs_py.records import Cause, Finding, JointSample, Level, SingularityState, Verdict
from irsbot_msgs_py.summary import StateSummary

pytest.importorskip("irsbot_msgs", reason="needs the built workspace")

from irsbot_msgs import msg as ros
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from irsbot_msgs_py import convert

pytestmark = pytest.mark.ros

# Every field takes any value of its type; a text has no zero inside and no half of a surrogate pair.
real = st.floats(width=64)  # NaN and infinities too
reals = st.lists(real, max_size=4).map(tuple)
text = st.text(st.characters(exclude_characters="\0", exclude_categories=("Cs",)), max_size=12)
stamp = st.integers(-(2**31) * 10**9, 2**31 * 10**9 - 1)
uint32, uint64, int64 = st.integers(0, 2**32 - 1), st.integers(0, 2**64 - 1), st.integers(-(2**63), 2**63 - 1)
int8 = st.integers(-128, 127)
level, cause = st.sampled_from(Level), uint32.map(Cause)

samples = st.builds(
    JointSample, stamp, st.just(1), st.just(2), st.lists(text, max_size=4).map(tuple), reals, reals, reals
)
findings = st.builds(Finding, cause, level, real, real, text, text)
verdicts = st.builds(
    *(Verdict, stamp, level, cause, st.booleans(), uint32, reals, text, uint64, text, int64, real),
    st.lists(findings, max_size=3).map(tuple),
    *(cause, real, cause),
)
states = st.builds(
    *(SingularityState, stamp, text, uint64, int64, int64, level, cause, reals, reals, reals, reals),
    *(st.lists(int8, max_size=4).map(tuple), int8, reals, real, real, reals, reals, real, real, real),
    *(reals, reals, reals, real, cause, real, real, st.booleans(), real, real, real),
)
summaries = st.builds(StateSummary, states, uint32, uint64, *(real,) * 10)
healths = st.builds(
    *(RecorderHealth, stamp, st.sampled_from(RecorderState), text, uint64, uint64, uint64, uint64, real, text)
)
statuses = st.builds(
    *(GateStatus, stamp, st.sampled_from(GateCommand), st.sampled_from(GateOutcome), st.sampled_from(GateReason)),
    *(cause, real, text),
)


def same(left: object, right: object) -> bool:
    """Equal with NaN equal to NaN, and of the same types all the way down."""
    return repr(left) == repr(right)


@given(samples)
def test_a_sample_becomes_a_message_and_the_same_sample_again(sample: JointSample):
    assert same(convert.joint_sample(convert.joint_state_msg(sample), 1, 2), sample)


@given(states)
def test_a_state_becomes_a_message_and_the_same_state_again(state: SingularityState):
    assert same(convert.state_record(convert.state_msg(state)), state)


@given(verdicts)
def test_a_verdict_becomes_a_message_and_the_same_verdict_again(verdict: Verdict):
    assert same(convert.verdict_record(convert.verdict_msg(verdict)), verdict)


@given(summaries)
def test_a_summary_becomes_a_message_and_the_same_summary_again(summary: StateSummary):
    assert same(convert.summary_record(convert.summary_msg(summary)), summary)


@given(healths)
def test_the_health_of_the_recorder_becomes_a_message_and_the_same_record_again(health: RecorderHealth):
    assert same(convert.health_record(convert.health_msg(health)), health)


@given(statuses)
def test_the_status_of_the_gate_becomes_a_message_and_the_same_record_again(status: GateStatus):
    assert same(convert.gate_status_record(convert.gate_status_msg(status)), status)


@given(samples)
def test_a_joint_state_is_read_from_the_bytes_of_rclpy(sample: JointSample):
    data = serialize_message(convert.joint_state_msg(sample))
    assert same(cdr.decode_joint_state(data, 1, 2), sample)


@given(states)
def test_a_state_is_read_from_the_bytes_of_rclpy(state: SingularityState):
    assert same(cdr.decode_state(serialize_message(convert.state_msg(state))), state)


@given(summaries)
def test_a_summary_is_read_from_the_bytes_of_rclpy(summary: StateSummary):
    assert same(cdr.decode_summary(serialize_message(convert.summary_msg(summary))), summary)


@given(verdicts)
def test_a_verdict_is_read_from_the_bytes_of_rclpy(verdict: Verdict):
    assert same(cdr.decode_verdict(serialize_message(convert.verdict_msg(verdict))), verdict)


@given(samples)
def test_rclpy_reads_the_joint_state_that_was_written(sample: JointSample):
    message = deserialize_message(cdr.encode_joint_state(sample), JointState)
    assert same(convert.joint_sample(message, 1, 2), sample)


@given(states)
def test_rclpy_reads_the_state_that_was_written(state: SingularityState):
    assert same(convert.state_record(deserialize_message(cdr.encode_state(state), ros.SingularityState)), state)


@given(summaries)
def test_rclpy_reads_the_summary_that_was_written(summary: StateSummary):
    message = deserialize_message(cdr.encode_summary(summary), ros.StateSummary)
    assert same(convert.summary_record(message), summary)


@given(verdicts)
def test_rclpy_reads_the_verdict_that_was_written(verdict: Verdict):
    assert same(convert.verdict_record(deserialize_message(cdr.encode_verdict(verdict), ros.Verdict)), verdict)


@given(text)
def test_a_string_is_written_and_read_as_rclpy_does(content: str):
    assert cdr.decode_string(serialize_message(String(data=content))) == content
    assert deserialize_message(cdr.encode_string(content), String).data == content


@given(samples, st.text(max_size=5))
def test_a_frame_changes_nothing_in_the_sample(sample: JointSample, frame: str):
    message = convert.joint_state_msg(sample)
    message.header.frame_id = frame.replace("\0", "").encode("ascii", "ignore").decode()
    assert same(cdr.decode_joint_state(serialize_message(message), 1, 2), sample)
