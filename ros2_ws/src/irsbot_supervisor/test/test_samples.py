"""Which samples are judged when more come than can be judged: the newest. Without DDS: the queue is a list."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

from rclpy.qos import QoSProfile

from irsbot_msgs_py.cdr import encode_joint_state
from irsbot_msgs_py.records import JointSample
from irsbot_supervisor.nodes import clocks, supervisor
from irsbot_supervisor.nodes import samples as module
from irsbot_supervisor.nodes.allowance import Allowance
from irsbot_supervisor.nodes.clocks import both_clocks
from irsbot_supervisor.nodes.samples import BURST_S, LATE_NS, MOST_BYTES, SAVED_S, SHARE, WAITED_NS, Samples
from irsbot_supervisor.nodes.supervisor import STATES_AT_ONCE, STATES_HZ, SupervisorNode

BEGIN_NS = 10**18
BURST_NS = round(BURST_S * 1e9)

STEP_NS = 50_000
"""ns that the judging of a sample takes here, unless a test says otherwise."""


class FakeQueue:
    """What the middleware holds."""

    def __init__(self) -> None:
        self.waiting: list[bytes] = []

    def __enter__(self) -> None: ...

    def __exit__(self, *_: Any) -> None: ...

    def take_message(self, kind: Any, raw: bool) -> tuple[bytes, None] | None:
        return (self.waiting.pop(0), None) if self.waiting else None


class FakeNode:
    """A node with one queue and a clock that is set; the logger keeps what it hears."""

    def __init__(self) -> None:
        self.queue, self.now_ns, self.warnings = FakeQueue(), 0, []
        self.judged: list[int] = []
        self.step_ns = 0  # that the judging of a sample takes
        self.judging_ns = 0  # in all

    def get_clock(self) -> Any:
        simulated = SimpleNamespace(get_ros_time_override_is_enabled=lambda: True)
        return SimpleNamespace(handle=simulated, now=lambda: SimpleNamespace(nanoseconds=BEGIN_NS + self.now_ns))

    def get_logger(self) -> Any:
        return SimpleNamespace(warning=lambda text, **_: self.warnings.append(text))

    def judge(self, sample: JointSample) -> None:
        self.judged.append(sample.stamp_ns - BEGIN_NS)
        self.now_ns += self.step_ns
        self.judging_ns += self.step_ns

    def create_subscription(
        self, kind: Any, topic: str, callback: Any, qos: QoSProfile, raw: bool, **_more: Any
    ) -> Any:
        return SimpleNamespace(handle=self.queue, msg_type=kind, callback=callback)


@pytest.fixture
def node(monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeNode]:
    node = FakeNode()
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic_ns=lambda: node.now_ns))
    return node


def stream_of(node: FakeNode) -> Samples:
    samples = Samples(node, QoSProfile(depth=12), node.judge)
    samples.open()
    return samples


def message(after_ns: int, size: int = 2) -> bytes:
    return encode_joint_state(JointSample(BEGIN_NS + after_ns, 0, 0, ("joint",) * size, (0.0,) * size))


def send(node: FakeNode, stream: Samples, number: int, rate_hz: float) -> list[int]:
    """Samples that come at this rate, and wait while another one is judged; returns their stamps."""
    begin_ns = node.now_ns
    stamps = [begin_ns + round(k * 1e9 / rate_hz) for k in range(1, number + 1)]
    for stamp in stamps:
        node.now_ns = max(node.now_ns, stamp)
        stream.subscription.callback(message(stamp))
    return stamps


def test_every_sample_is_judged_as_long_as_that_takes_its_share_of_the_time(node: FakeNode):
    stream, node.step_ns = stream_of(node), STEP_NS
    sent = send(node, stream, 20_000, SHARE * 1e9 / STEP_NS)
    assert node.judged == sent
    assert stream.skipped == 0


def test_a_step_that_is_interrupted_costs_no_sample(node: FakeNode):
    stream, node.step_ns = stream_of(node), STEP_NS
    sent = send(node, stream, 1, 1000.0)
    node.step_ns = LATE_NS - 1_000_000
    sent += send(node, stream, 1, 1000.0)
    node.step_ns = STEP_NS
    sent += [sent[-1] + k * 1_000_000 for k in range(1, 5)]
    for stamp in sent[2:]:  # those that waited meanwhile
        stream.subscription.callback(message(stamp))
    assert node.judged == sent
    assert stream.skipped == 0


@pytest.mark.parametrize("rate_hz", [12_000.0, 20_000.0])
def test_of_a_flood_as_many_are_judged_as_the_share_allows_and_the_newest_is_never_left_over(
    node: FakeNode, rate_hz: float
):
    stream, node.step_ns = stream_of(node), STEP_NS
    begin_ns = node.now_ns
    sent = send(node, stream, round(2.0 * rate_hz), rate_hz)  # two seconds
    passed_ns = node.now_ns - begin_ns
    assert SHARE * passed_ns - STEP_NS <= node.judging_ns <= SHARE * passed_ns + BURST_NS + STEP_NS
    assert max(b - a for a, b in zip(node.judged, node.judged[1:], strict=False)) <= 2.0 * STEP_NS / SHARE
    stream.settle()
    assert node.judged[-1] == sent[-1]
    assert len(node.judged) + stream.skipped == len(sent)
    stream.settle()
    assert len(node.judged) + stream.skipped == len(sent)  # nothing is judged twice


def exhaust(node: FakeNode, stream: Samples) -> None:
    """Judge for as long as may be at once: a single step that takes long."""
    node.step_ns = round(BURST_NS / (1.0 - SHARE)) + 1
    send(node, stream, 1, 1000.0)
    node.step_ns = 0


def test_if_no_time_is_left_all_that_waits_is_taken_at_once(node: FakeNode):
    stream = stream_of(node)
    exhaust(node, stream)
    judged, now_ns = list(node.judged), node.now_ns
    node.queue.waiting = [message(now_ns + k) for k in range(5)]
    stream.subscription.callback(message(now_ns))
    assert not node.queue.waiting
    assert node.judged == judged
    stream.settle()
    assert node.judged == [*judged, now_ns + 4]
    assert stream.skipped == 5


def test_of_the_samples_that_wait_behind_a_late_one_those_in_time_are_judged(node: FakeNode):
    stream = stream_of(node)
    node.now_ns = LATE_NS + 2_000_000
    node.queue.waiting = [message(k * 1_000_000) for k in range(1, 6)]
    stream.subscription.callback(message(0))
    assert node.judged == [k * 1_000_000 for k in range(2, 6)]
    assert stream.skipped == 2
    assert not node.queue.waiting


def test_a_late_sample_is_skipped_for_the_newest_that_waits(node: FakeNode):
    stream = stream_of(node)
    node.now_ns = LATE_NS + 2_000_000
    node.queue.waiting = [message(1_000_000), message(2_000_000)]
    stream.subscription.callback(message(0))
    assert node.judged == [2_000_000]
    assert stream.skipped == 2
    stream.subscription.callback(message(0))  # late, but nothing is newer: it says what is known
    assert node.judged == [2_000_000, 0]
    assert stream.skipped == 2


def test_behind_a_sample_that_has_waited_all_that_wait_are_judged_at_once(node: FakeNode):
    stream = stream_of(node)
    node.now_ns = WAITED_NS + 1
    node.queue.waiting = [message(200_000), message(400_000)]
    stream.subscription.callback(message(0))
    assert node.judged == [0, 200_000, 400_000]
    assert not node.queue.waiting
    assert stream.skipped == 0


def test_a_sample_that_has_not_waited_is_judged_alone(node: FakeNode):
    stream = stream_of(node)
    node.now_ns = WAITED_NS
    node.queue.waiting = [message(200_000)]
    stream.subscription.callback(message(0))
    assert node.judged == [0]
    assert len(node.queue.waiting) == 1


def test_time_is_scarce_before_a_sample_is_skipped(node: FakeNode):
    """The rate is a tenth above that of the share: what was saved goes, and the last of it is for samples."""
    stream, node.step_ns = stream_of(node), STEP_NS
    scarce = []
    while len(node.judged) == len(scarce):
        scarce.append(stream.time_is_scarce)
        node.now_ns = round(len(scarce) * STEP_NS / (1.1 * SHARE))
        stream.subscription.callback(message(node.now_ns))
    lost_per_sample_s = STEP_NS * 1e-9 * (1.0 - 1.0 / 1.1)
    assert scarce == sorted(scarce)
    assert scarce.count(False) == pytest.approx((BURST_S - SAVED_S) / lost_per_sample_s, rel=0.01)
    assert scarce.count(True) == pytest.approx(SAVED_S / lost_per_sample_s, rel=0.05)


Telling = Callable[[bool, int, set[int]], list[int]]


@pytest.fixture
def told_of(monkeypatch: pytest.MonkeyPatch) -> Telling:
    """Gives a function: numbers of the published states of samples at 5 kHz, some of which are judged otherwise than
    those before."""
    monkeypatch.setattr(supervisor, "encode_state", lambda state: state)

    def told_of(scarce: bool, number: int, changes: set[int]) -> list[int]:
        told: list[int] = []
        node = SupervisorNode.__new__(SupervisorNode)
        node._samples = SimpleNamespace(time_is_scarce=scarce)
        node._publishing, node._unpublished = Allowance(STATES_HZ, STATES_AT_ONCE, 0), None
        node._states = SimpleNamespace(publish=lambda state: told.append(state.sequence))
        for k in range(number):
            node._tell(SimpleNamespace(sequence=k, seen_ns=round(k * 1e9 / 5000.0)), k in changes)
        return told

    return told_of


@pytest.mark.parametrize(("scarce", "states_hz", "at_once"), [(False, 2500, 25), (True, 1000, 10)])
def test_fewer_states_are_published_while_time_is_scarce(told_of: Telling, scarce: bool, states_hz: int, at_once: int):
    told = told_of(scarce, 50_000, set())
    assert told == sorted(set(told))
    assert len(told) == pytest.approx(10 * states_hz + at_once, abs=1)


@pytest.mark.parametrize("scarce", [False, True])
def test_the_states_beside_a_change_are_published_whatever_their_turn(told_of: Telling, scarce: bool):
    changes = set(range(1000, 20_000, 101))
    told = told_of(scarce, 20_000, changes)
    assert told == sorted(set(told))
    assert changes | {number - 1 for number in changes} <= set(told)


def test_states_that_change_with_every_sample_have_the_same_limit(told_of: Telling):
    assert len(told_of(False, 50_000, set(range(50_000)))) == pytest.approx(25_050, abs=3)


def test_messages_that_are_too_large_or_no_joint_states_are_rejected(node: FakeNode):
    stream = stream_of(node)
    for data in (message(0, size=5000), b"", b"\x00\x01\x00\x00", message(0)[:-5]):
        stream.subscription.callback(data)
    assert node.judged == [-BEGIN_NS] * 4  # stamp zero: the intake rejects it
    assert str(MOST_BYTES) in node.warnings[0]
    assert len(node.warnings) == 4


def test_samples_during_a_closed_intake_and_held_ones_are_never_judged(node: FakeNode):
    stream = stream_of(node)
    exhaust(node, stream)
    judged = list(node.judged)
    stream.subscription.callback(message(node.now_ns))  # this one is held
    stream.close()
    node.now_ns += BURST_NS
    node.queue.waiting = [message(node.now_ns - 1)]
    stream.subscription.callback(message(node.now_ns))
    stream.open()
    stream.settle()
    assert node.judged == judged
    assert len(node.queue.waiting) == 1
    node.queue.waiting = []
    assert send(node, stream, 1, 1000.0) == node.judged[len(judged) :]


def test_a_pause_between_the_two_clocks_is_no_clock_that_was_set(monkeypatch: pytest.MonkeyPatch):
    """The process is not served for 4 ms between two readings; all are repeated."""
    now_ns, pauses = [1_000_000_000], [0, 4_000_000, 0, 0, 0]

    def read(offset_ns: int) -> int:
        now_ns[0] += 1000 + (pauses.pop(0) if pauses else 0)
        return now_ns[0] + offset_ns

    monkeypatch.setattr(clocks.time, "time_ns", lambda: read(BEGIN_NS))
    monkeypatch.setattr(clocks.time, "monotonic_ns", lambda: read(0))
    system = SimpleNamespace(handle=SimpleNamespace(get_ros_time_override_is_enabled=lambda: False))
    ros_ns, steady_ns = both_clocks(SimpleNamespace(get_clock=lambda: system))
    assert abs(ros_ns - steady_ns - BEGIN_NS) <= 1000


def test_without_simulated_time_ros_time_is_that_of_the_system():
    node = FakeNode()
    assert both_clocks(node)[0] == BEGIN_NS + node.now_ns, "simulated"
    system = SimpleNamespace(handle=SimpleNamespace(get_ros_time_override_is_enabled=lambda: False))
    node.get_clock = lambda: system
    before = time.time_ns(), time.monotonic_ns()
    found = both_clocks(node)
    after = time.time_ns(), time.monotonic_ns()
    assert all(begin <= now <= end for begin, now, end in zip(before, found, after, strict=True))
