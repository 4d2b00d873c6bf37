"""Listens to one suite for `irsbot monitor`, in a terminal and as a page. Needs ROS."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import Any

import rclpy
from irsbot_msgs.msg import SingularityState as StateMessage
from irsbot_msgs.msg import Verdict as VerdictMessage
from rclpy.context import Context
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from std_msgs.msg import String

from irsbot_msgs_py.cdr import decode_verdict
from irsbot_msgs_py.process.fastdds import choose_transport
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.processes.listener import LATCHED
from irsbot_supervisor.processes.observed import Observed, Seen

NEWEST = QoSProfile(depth=200, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Quality of states and verdicts: the supervisor does not wait for this node, and a full queue loses its oldest
message. The depth covers the messages between two looks."""


class Monitor:
    """A node that only listens, and that no executor serves: every look takes what has come, which costs a third of a
    callback for each message. Close it, or use it as a context manager."""

    def __init__(self, domain: int = 0, namespace: str = "", name: str = "monitor") -> None:
        choose_transport(os.environ, rclpy.get_rmw_implementation_identifier())
        self._seen = Observed()
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain)
        self.node = rclpy.create_node(name, context=self._context, namespace=namespace)
        self._sources: list[tuple[Any, Callable[[bytes, float], None]]] = [
            (self.node.create_subscription(kind, f"supervisor/{topic}", _nothing, quality, raw=True), hear)
            for kind, topic, quality, hear in (
                (String, "journal", LATCHED, self._on_journal),
                (StateMessage, "state", NEWEST, self._seen.hear_state),
                (VerdictMessage, "verdict", NEWEST, self._on_verdict),
            )
        ]

    def look(self, seconds: float) -> Seen:
        """Wait for this time, then return the state of the suite."""
        time.sleep(seconds)
        return self.take()

    def take(self) -> Seen:
        """Take all messages that have arrived, then return the state of the suite."""
        for subscription, hear in self._sources:
            handle = subscription.handle
            with handle:
                while (found := handle.take_message(subscription.msg_type, True)) is not None:
                    data, info = found
                    waited_ns = time.time_ns() - info["received_timestamp"]  # the only clock that it has
                    hear(data, time.monotonic() - max(waited_ns, 0) / NS_PER_S)
        return self._seen.look(time.monotonic())

    def close(self) -> None:
        """Leave the domain."""
        self.node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def _on_verdict(self, data: bytes, now_s: float) -> None:
        self._seen.hear_verdict(decode_verdict(data), now_s)

    def _on_journal(self, data: bytes, _now_s: float) -> None:
        self._seen.hear_journal(deserialize_message(data, String).data)

    def __enter__(self) -> Monitor:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()


def _nothing(_data: bytes) -> None:
    """Never called: no executor serves the node."""
