"""The two times of every event."""

from __future__ import annotations

import time

from rclpy.node import Node


def both_clocks(node: Node) -> tuple[int, int]:
    """ROS time and steady time, now, ns."""
    return node.get_clock().now().nanoseconds, time.monotonic_ns()
