"""Subscriptions that are emptied at a pace of our own instead of waking the process for every message.

Taking all that has arrived costs a third of a callback per message, and it comes with both times of the middleware and
the number the publisher gave it, which callbacks with the EventsExecutor do not get.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable, Sequence
from functools import partial
from typing import Any, NamedTuple

import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy


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
"""Messages in sequence that must come before and after a gap in the numbers: those of two publishers, of which a
message does not say whose it is, are interleaved and never run for so long."""


class Gaps:
    """Losses of one topic, told by the numbers that its only publisher gave its messages. Doubt counts as no loss."""

    def __init__(self, publisher: Callable[[], Hashable | None]) -> None:
        """publisher: identifies the only publisher; None if there is another number of them."""
        self.lost = 0  # messages that were numbered and never seen
        self._publisher = publisher
        self._last = self._run = self._missing = 0
        self._whose: Hashable | None = None

    def hear(self, number: int) -> None:
        """The number of the next message."""
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
        """There is, or was, another number of publishers than one."""
        self._run, self._missing, self._whose = 0, 0, None


class Taps:
    """Reliable subscriptions with a deep history, on a hidden node that no executor serves."""

    def __init__(self, node: Node, sources: Sequence[Source], depth: int) -> None:
        self._node = rclpy.create_node(
            f"_{node.get_name()}_taps",
            namespace=node.get_namespace(),
            use_global_arguments=False,  # a remapped node name would name this one too
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._subscriptions = [
            self._node.create_subscription(source.type, source.topic, _nothing, _qos(source, depth), raw=True)
            for source in sources
        ]
        self._gaps = [Gaps(partial(self._only_publisher, source.topic)) for source in sources]
        self._late: list[Taken] = []

    @property
    def lost(self) -> int:
        """Messages that a publisher numbered and we never saw."""
        return sum(gaps.lost for gaps in self._gaps)

    def take(self) -> list[Taken]:
        """All that has arrived, in the order of reception over all topics."""
        begin_ns = time.time_ns()
        taken, self._late = self._late, []
        for source, subscription in enumerate(self._subscriptions):
            handle, gaps = subscription.handle, self._gaps[source]
            if subscription.get_publisher_count() != 1:
                gaps.doubt()
            with handle:
                while (found := handle.take_message(subscription.msg_type, True)) is not None:
                    data, info = found
                    if (number := info["publication_sequence_number"]) is not None:
                        gaps.hear(number)
                    message = Taken(info["received_timestamp"] or begin_ns, info["source_timestamp"], source, data)
                    # what arrives while we take waits: messages of topics taken before may be older
                    (taken if message.received_ns <= begin_ns else self._late).append(message)
        taken.sort(key=_received)
        return taken

    def close(self) -> None:
        """Unsubscribe."""
        self._node.destroy_node()

    def _only_publisher(self, topic: str) -> Hashable | None:
        found = self._node.get_publishers_info_by_topic(topic)
        return tuple(found[0].endpoint_gid) if len(found) == 1 else None


def _qos(source: Source, depth: int) -> QoSProfile:
    durability = DurabilityPolicy.TRANSIENT_LOCAL if source.latched else DurabilityPolicy.VOLATILE
    return QoSProfile(depth=depth, reliability=ReliabilityPolicy.RELIABLE, durability=durability)


def _received(message: Taken) -> int:
    return message.received_ns


def _nothing(data: bytes) -> None:
    """Never called: no executor serves the node."""
