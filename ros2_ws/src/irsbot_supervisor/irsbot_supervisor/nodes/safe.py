"""~/safe: whether the robot may move, as one std_msgs/Bool, for gateways and relays without irsbot_msgs."""

from __future__ import annotations

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Bool

from irsbot_msgs_py.records import Level

PROMISE_S = 0.05
"""s: longest silence in normal operation: two and a half of the slowest heartbeat, and half of a consumer's timeout.
Requests of this deadline and liveliness, or longer, are served."""

HEARD_S = 0.2
"""s: longest time that the end of the node waits until its last message is acknowledged."""

PROMISED = QoSProfile(
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
    deadline=Duration(seconds=PROMISE_S),
    liveliness=LivelinessPolicy.MANUAL_BY_TOPIC,  # by speaking: a process that lives and says nothing is not alive
    liveliness_lease_duration=Duration(seconds=PROMISE_S),
)
"""Quality of service of messages that are repeated with every heartbeat."""


class SafePublisher:
    """True below STOP, false at STOP and UNKNOWN, with every verdict; false as the first and as the last message. The
    publisher outlives activations: a late subscriber gets false from a supervisor that is inactive."""

    def __init__(self, node: Node) -> None:
        self._publisher = node.create_publisher(Bool, "~/safe", PROMISED)
        self.tell(Level.UNKNOWN)

    def tell(self, level: Level) -> None:
        """Publish with every verdict."""
        self._stated = level < Level.STOP
        self._publisher.publish(Bool(data=self._stated))

    def close(self) -> None:
        """Publish the last message of an activation."""
        if self._stated:
            self.tell(Level.UNKNOWN)

    def end(self) -> None:
        """Called before the node is destroyed; waits for messages that have not arrived yet."""
        self._publisher.wait_for_all_acked(Duration(seconds=HEARD_S))
