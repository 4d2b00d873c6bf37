"""A node that only listens, and that no executor serves: every look takes what has come, which costs a third of a
callback for each message. Needs ROS."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from types import TracebackType
from typing import Any, TypeVar

import rclpy
from rclpy.context import Context
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from irsbot_msgs_py.process.fastdds import choose_transport

NEWEST = QoSProfile(depth=200, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Quality of listeners for which nobody waits: a full queue loses its oldest message. The depth covers the messages
between two looks."""


Kind = TypeVar("Kind", bound="Polling")


class Polling:
    """The node. Close it, or use it as a context manager."""

    def __init__(self, domain: int, namespace: str, name: str) -> None:
        choose_transport(os.environ, rclpy.get_rmw_implementation_identifier())
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain)
        self.node = rclpy.create_node(name, context=self._context, namespace=namespace)

    def listen(self, kind: type, topic: str, quality: QoSProfile) -> Subscription:
        """A subscription for `taken`."""
        return self.node.create_subscription(kind, topic, _nothing, quality, raw=True)

    def close(self) -> None:
        """Leave the domain."""
        self.node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def __enter__(self: Kind) -> Kind:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def taken(subscription: Subscription) -> Iterator[tuple[bytes, int]]:
    """The messages that have arrived, as CDR, each with the time of its arrival, ns of the system clock."""
    handle, kind = subscription.handle, subscription.msg_type
    with handle:
        take = handle.take_message
        while (found := take(kind, True)) is not None:
            data, info = found
            yield data, info["received_timestamp"]


def waited_ns(arrived_ns: int) -> int:
    """How long ago a message arrived, ns; 0 if the system clock went back."""
    return max(time.time_ns() - arrived_ns, 0)


def _nothing(_data: bytes) -> Any:
    """Never called: no executor serves the node."""
