"""Subscriptions that are emptied at a pace of our own instead of waking the process for every message.

Taking all that has arrived costs a third of a callback per message, and it comes with both times of the middleware and
the number the publisher gave it, which callbacks with the EventsExecutor do not get.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
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


class Taps:
    """Reliable subscriptions with a deep history, on a hidden node that no executor serves."""

    def __init__(self, node: Node, sources: Sequence[Source], depth: int) -> None:
        self.lost = 0  # messages that a publisher numbered and we never saw
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
        self._numbers = [0] * len(sources)
        self._late: list[Taken] = []

    def take(self) -> list[Taken]:
        """All that has arrived, in the order of reception over all topics."""
        begin_ns = time.time_ns()
        taken, self._late = self._late, []
        for source, subscription in enumerate(self._subscriptions):
            handle = subscription.handle
            with handle:
                while (found := handle.take_message(subscription.msg_type, True)) is not None:
                    data, info = found
                    self._count(source, info["publication_sequence_number"])
                    message = Taken(info["received_timestamp"] or begin_ns, info["source_timestamp"], source, data)
                    # what arrives while we take waits: messages of topics taken before may be older
                    (taken if message.received_ns <= begin_ns else self._late).append(message)
        taken.sort(key=_received)
        return taken

    def close(self) -> None:
        """Unsubscribe."""
        self._node.destroy_node()

    def _count(self, source: int, number: int | None) -> None:
        """A gap in the numbers of a publisher is a loss; with several publishers nobody knows whose number it is."""
        if number is None:
            return
        expected = self._numbers[source] + 1
        if 1 < expected < number and self._subscriptions[source].get_publisher_count() == 1:
            self.lost += number - expected
        self._numbers[source] = number


def _qos(source: Source, depth: int) -> QoSProfile:
    durability = DurabilityPolicy.TRANSIENT_LOCAL if source.latched else DurabilityPolicy.VOLATILE
    return QoSProfile(depth=depth, reliability=ReliabilityPolicy.RELIABLE, durability=durability)


def _received(message: Taken) -> int:
    return message.received_ns


def _nothing(data: bytes) -> None:
    """Never called: no executor serves the node."""
