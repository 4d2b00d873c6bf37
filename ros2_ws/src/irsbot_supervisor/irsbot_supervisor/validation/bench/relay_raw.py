"""The fastest relay in Python: events executor, serialised messages in and out, no computation."""

from __future__ import annotations

import sys

from rclpy.node import Node
from sensor_msgs.msg import JointState

from irsbot_msgs_py.process.priority import PRIORITY
from irsbot_msgs_py.process.run import run
from irsbot_supervisor.nodes.supervisor import STREAM


class RawRelay(Node):  # type: ignore[misc]
    """Publishes `joint_states` as `relayed`, byte for byte."""

    thread_priority = PRIORITY  # as the supervisor has it: equal for all nodes of the chain

    def __init__(self) -> None:
        super().__init__("relay")
        outlet = self.create_publisher(JointState, "relayed", STREAM)
        self.create_subscription(JointState, "joint_states", outlet.publish, STREAM, raw=True)


if __name__ == "__main__":
    sys.exit(run(RawRelay))
