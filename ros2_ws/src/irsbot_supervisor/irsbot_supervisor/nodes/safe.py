"""~/safe: may the robot move, as one std_msgs/Bool, for gateways and relays that know no irsbot_msgs."""

from __future__ import annotations

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Bool

from irsbot_msgs_py.records import Level

PROMISE_S = 0.05
"""s: silence that is never exceeded while all goes well: two and a half of the slowest heartbeat, and half of what a
consumer waits before it brakes. Who asks for as much or more as deadline or liveliness is served."""

HEARD_S = 0.2
"""s: longest that the end of the node waits until the last word has arrived."""

PROMISED = QoSProfile(
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
    deadline=Duration(seconds=PROMISE_S),
    liveliness=LivelinessPolicy.MANUAL_BY_TOPIC,  # by speaking: a process that lives and says nothing is not alive
    liveliness_lease_duration=Duration(seconds=PROMISE_S),
)
"""Of what is repeated with every heartbeat."""


class SafePublisher:
    """True below STOP, false at STOP and UNKNOWN, with every verdict; false as the last word. It outlives activations:
    who comes late finds the last word of a supervisor that is not active."""

    def __init__(self, node: Node) -> None:
        self._publisher = node.create_publisher(Bool, "~/safe", PROMISED)
        self._said = False

    def tell(self, level: Level) -> None:
        """With every verdict."""
        self._said = level < Level.STOP
        self._publisher.publish(Bool(data=self._said))

    def close(self) -> None:
        """The last word of an activation."""
        if self._said:
            self.tell(Level.UNKNOWN)

    def end(self) -> None:
        """Before the node is destroyed, and what has not arrived yet with it."""
        self._publisher.wait_for_all_acked(Duration(seconds=HEARD_S))
