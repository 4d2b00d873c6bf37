"""Subscriptions that are emptied at our own pace, so that a message does not wake the process.

This takes a third of the time of a callback per message. It also gives both times of the middleware and the sequence
number of the publisher, which callbacks with the EventsExecutor do not get.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable, Sequence
from functools import partial
from typing import Any, NamedTuple

import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription


class Source(NamedTuple):
    """A topic to be recorded."""

    topic: str  # as resolved by the node
    type: Any
    latched: bool


class Taken(NamedTuple):
    """A serialised message. received_ns: system clock of the middleware; source: index of its Source."""

    received_ns: int
    sent_ns: int
    source: int
    data: bytes


SURE = 100
"""Number of messages in sequence before and after a gap in the numbers for it to count as a loss. The numbers of two
publishers are interleaved and never run in sequence for so long."""


class LostMessages:
    """Lost messages of one topic, counted by the sequence numbers of its only publisher. Doubtful cases do not count as
    loss."""

    def __init__(self, publisher: Callable[[], Hashable | None]) -> None:
        """publisher: identifies the only publisher; None if there is not exactly one."""
        self.lost = 0  # messages that were numbered and never seen
        self._publisher = publisher
        self._last = self._run = self._missing = 0
        self._whose: Hashable | None = None

    def hear(self, number: int) -> None:
        """Take in the number of the next message."""
        step, self._last = number - self._last, number
        if step == 1:
            self._run += 1
            if self._run == SURE:
                whose = self._publisher()
                if whose is not None and whose == self._whose:
                    self.lost += self._missing
                self._whose, self._missing = whose, 0
        elif step > 1 and self._whose is not None:
            self._run, self._missing = 0, self._missing + step - 1
        else:
            self.doubt()

    def doubt(self) -> None:
        """Take in that there is, or was, not exactly one publisher."""
        self._run, self._missing, self._whose = 0, 0, None


class PolledSubscriptions:
    """Subscriptions with a deep history, on a hidden node without executor. They are reliable; that of a topic whose
    publishers all offer best effort only is best effort from then on, and hears both kinds."""

    def __init__(self, node: Node, sources: Sequence[Source], depth: int) -> None:
        self._sources, self._depth = sources, depth
        self._node = rclpy.create_node(
            f"_{node.get_name()}_taps",
            namespace=node.get_namespace(),
            use_global_arguments=False,  # a remapped node name would name this one too
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._subscriptions = [self._subscribed(source, ReliabilityPolicy.RELIABLE) for source in sources]
        self._gaps = [LostMessages(partial(self._only_publisher, source.topic)) for source in sources]
        self._late: list[Taken] = []

    @property
    def lost(self) -> int:
        """Messages that a publisher numbered and that did not arrive."""
        return sum(lost.lost for lost in self._gaps)

    def take(self) -> list[Taken]:
        """All messages that have arrived, in the order of reception over all topics."""
        begin_ns = time.time_ns()
        taken, self._late = self._late, []
        for source, subscription in enumerate(self._subscriptions):
            handle, lost = subscription.handle, self._gaps[source]
            if subscription.get_publisher_count() != 1:
                lost.doubt()
            with handle:
                while (found := handle.take_message(subscription.msg_type, True)) is not None:
                    data, info = found
                    if (number := info["publication_sequence_number"]) is not None:
                        lost.hear(number)
                    message = Taken(info["received_timestamp"] or begin_ns, info["source_timestamp"], source, data)
                    # later arrivals wait: messages of topics that were taken before may be older
                    (taken if message.received_ns <= begin_ns else self._late).append(message)
            if self._unheard(source):
                self._node.destroy_subscription(subscription)
                self._subscriptions[source] = self._subscribed(self._sources[source], ReliabilityPolicy.BEST_EFFORT)
        taken.sort(key=_received)
        return taken

    def close(self) -> None:
        """Unsubscribe."""
        self._node.destroy_node()

    def _subscribed(self, source: Source, reliability: ReliabilityPolicy) -> Subscription:
        durability = DurabilityPolicy.TRANSIENT_LOCAL if source.latched else DurabilityPolicy.VOLATILE
        qos = QoSProfile(depth=self._depth, reliability=reliability, durability=durability)
        return self._node.create_subscription(source.type, source.topic, _nothing, qos, raw=True)

    def _unheard(self, source: int) -> bool:
        """True if a topic is not heard because its publishers offer best effort only."""
        subscription, topic = self._subscriptions[source], self._sources[source].topic
        reliable = subscription.qos_profile.reliability == ReliabilityPolicy.RELIABLE
        if not reliable or subscription.get_publisher_count() or not self._node.count_publishers(topic):
            return False
        offered = {end.qos_profile.reliability for end in self._node.get_publishers_info_by_topic(topic)}
        return offered == {ReliabilityPolicy.BEST_EFFORT}

    def _only_publisher(self, topic: str) -> Hashable | None:
        found = self._node.get_publishers_info_by_topic(topic)
        return tuple(found[0].endpoint_gid) if len(found) == 1 else None


def _received(message: Taken) -> int:
    return message.received_ns


def _nothing(data: bytes) -> None:
    """Never called: no executor serves the node."""
