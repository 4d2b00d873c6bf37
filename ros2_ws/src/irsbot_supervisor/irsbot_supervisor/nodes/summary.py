"""~/summary: the newest state and the extremes of the margins, for views that need no state in between."""

from __future__ import annotations

from irsbot_msgs.msg import StateSummary
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile

from irsbot_msgs_py.cdr import encode_summary
from irsbot_msgs_py.records import SingularityState
from irsbot_supervisor.core.summary import Summariser
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.nodes.endpoints import quality

SHORT = QoSProfile(depth=10)
"""A view wants the newest."""


class SummaryPublisher:
    """Sums up the states while there is a subscriber; it costs nothing else. The publisher lives as long as an
    activation."""

    def __init__(self, node: Node, supervisor: Supervisor) -> None:
        self._node, self._supervisor = node, supervisor
        self._quality = quality(node, StateSummary, "~/summary", SHORT)
        self._summariser = Summariser()
        self._publisher: Publisher | None = None
        self._listened = False

    def open(self) -> None:
        """Offer summaries, of the states from now on."""
        self._publisher = self._node.create_publisher(StateSummary, "~/summary", self._quality)

    def close(self) -> None:
        """Offer none."""
        if self._publisher is not None:
            self._node.destroy_publisher(self._publisher)
        self._publisher = None
        self.look()

    def look(self) -> None:
        """Notice whether there is a subscriber: with every heartbeat."""
        self._listened = self._publisher is not None and self._publisher.get_subscription_count() > 0
        if not self._listened:
            self._summariser.forget()

    def is_due(self, now_ns: int) -> bool:
        """True if the state of the next sample is needed. now_ns: steady clock."""
        return self._listened and self._summariser.is_due(now_ns)

    def hear(self, state: SingularityState | None, now_ns: int) -> None:
        """Take in the last sample of the supervisor, and publish if it is due. state: of the sample, if it was made."""
        if not self._listened or self._publisher is None:
            return
        self._summariser.add(self._supervisor.margins)
        if state is not None and self._summariser.is_due(now_ns):
            self._publisher.publish(encode_summary(self._summariser.take(state, now_ns)))
