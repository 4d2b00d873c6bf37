"""The two times of every event."""

from __future__ import annotations

import time

from rclpy.node import Node

TOGETHER_NS = 200_000
"""ns: readings that are farther apart are repeated. A pause between them would look like a clock that was set."""

TRIES = 10
"""Number of readings; the last one counts in any case."""


def both_clocks(node: Node) -> tuple[int, int]:
    """ROS time and steady time, now, ns, read together. Unless time is simulated, ROS time is the time of the system,
    which is read directly at a fifth of the cost."""
    clock = node.get_clock()
    simulated = clock.handle.get_ros_time_override_is_enabled()
    for _ in range(TRIES):
        before_ns = time.monotonic_ns()
        ros_ns = clock.now().nanoseconds if simulated else time.time_ns()
        steady_ns = time.monotonic_ns()
        if steady_ns - before_ns <= TOGETHER_NS:
            break
    return ros_ns, steady_ns
