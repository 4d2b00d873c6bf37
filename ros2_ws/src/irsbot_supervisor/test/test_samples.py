"""Which samples are judged when more come than can be judged: the newest. Without DDS: the queue is a list."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

from rclpy.qos import QoSProfile

from irsbot_msgs_py.cdr import encode_joint_state
from irsbot_msgs_py.records import JointSample
from irsbot_supervisor.nodes import samples as module
from irsbot_supervisor.nodes.samples import BURST, LATE_NS, MOST_BYTES, MOST_HZ, Samples

BEGIN_NS = 10**18


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

    def get_clock(self) -> Any:
        return SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=BEGIN_NS + self.now_ns))

    def get_logger(self) -> Any:
        return SimpleNamespace(warning=lambda text, **_: self.warnings.append(text))

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
    samples = Samples(node, QoSProfile(depth=12), lambda sample: node.judged.append(sample.stamp_ns - BEGIN_NS))
    samples.open()
    return samples


def message(after_ns: int, size: int = 2) -> bytes:
    return encode_joint_state(JointSample(BEGIN_NS + after_ns, 0, 0, ("joint",) * size, (0.0,) * size))


def send(node: FakeNode, stream: Samples, number: int, rate_hz: float) -> list[int]:
    """Samples that arrive when they are stamped; returns their stamps."""
    stamps = []
    for _ in range(number):
        node.now_ns += round(1e9 / rate_hz)
        stamps.append(node.now_ns)
        stream.subscription.callback(message(node.now_ns))
    return stamps


def test_up_to_its_rate_every_sample_is_judged(node: FakeNode):
    stream = stream_of(node)
    sent = send(node, stream, 2000, 0.99 * MOST_HZ)
    assert node.judged == sent
    assert stream.skipped == 0


def test_of_a_flood_as_many_are_judged_as_can_be_and_the_newest_is_never_left_over(node: FakeNode):
    stream = stream_of(node)
    sent = send(node, stream, 20_000, 20_000.0)  # one second
    assert MOST_HZ <= len(node.judged) <= MOST_HZ + BURST
    assert max(b - a for a, b in zip(node.judged, node.judged[1:], strict=False)) <= 1.2e9 / MOST_HZ
    stream.settle()
    assert node.judged[-1] == sent[-1]
    assert len(node.judged) + stream.skipped == len(sent)
    stream.settle()
    assert len(node.judged) + stream.skipped == len(sent)  # nothing is judged twice


def test_in_a_flood_all_that_waits_is_taken_at_once(node: FakeNode):
    stream = stream_of(node)
    sent = send(node, stream, BURST, 1e9)  # the burst that is judged whatever its rate
    assert node.judged == sent
    node.queue.waiting = [message(1_000_000 + k) for k in range(5)]
    stream.subscription.callback(message(900_000))
    assert not node.queue.waiting
    stream.settle()
    assert node.judged == [*sent, 1_000_004]
    assert stream.skipped == 5


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


def test_a_sample_in_time_is_judged_while_others_wait(node: FakeNode):
    stream = stream_of(node)
    node.now_ns = LATE_NS
    node.queue.waiting = [message(1_000_000)]
    stream.subscription.callback(message(0))
    assert node.judged == [0]
    assert len(node.queue.waiting) == 1


def test_messages_that_are_too_large_or_no_joint_states_are_rejected(node: FakeNode):
    stream = stream_of(node)
    for data in (message(0, size=5000), b"", b"\x00\x01\x00\x00", message(0)[:-5]):
        stream.subscription.callback(data)
    assert node.judged == [-BEGIN_NS] * 4  # stamp zero: the intake rejects it
    assert str(MOST_BYTES) in node.warnings[0]
    assert len(node.warnings) == 4


def test_samples_during_a_closed_intake_and_held_ones_are_never_judged(node: FakeNode):
    stream = stream_of(node)
    sent = send(node, stream, BURST + 1, 1e9)
    assert node.judged == sent[:-1]  # the last one is held
    stream.close()
    node.now_ns = LATE_NS + 1
    node.queue.waiting = [message(1_000_000)]
    stream.subscription.callback(message(0))
    stream.open()
    stream.settle()
    assert node.judged == sent[:-1]
    assert len(node.queue.waiting) == 1
    node.queue.waiting = []
    assert send(node, stream, 1, 1000.0) == node.judged[BURST:]
