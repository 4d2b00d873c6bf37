"""The simplest relay: default executor, message objects in and out, no computation."""

from __future__ import annotations

import contextlib

import rclpy
from rclpy.executors import ExternalShutdownException
from sensor_msgs.msg import JointState

from irsbot_msgs_py.process.priority import PRIORITY, take_priority
from irsbot_supervisor.nodes.supervisor import STREAM


def main() -> None:
    """Relay until SIGINT."""
    rclpy.init()
    node = rclpy.create_node("relay")
    outlet = node.create_publisher(JointState, "relayed", STREAM)
    node.create_subscription(JointState, "joint_states", outlet.publish, STREAM)
    take_priority(PRIORITY)
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)
    node.destroy_node()
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()
