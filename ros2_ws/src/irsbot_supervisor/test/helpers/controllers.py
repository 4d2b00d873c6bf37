"""Stand-ins with the published contracts of two controllers of ros2_controllers, Jazzy. The real ones have no wheels.

JointTrajectoryController with its defaults: refuses what is no complete trajectory of all its joints, and goes on with
what it has. forward_command_controller: keeps the last command for ever.
"""

from __future__ import annotations

from itertools import pairwise

from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from irsbot_msgs_py.records import Floats
from irsbot_msgs_py.stamps import nanoseconds

AT_REST = 1e-6
"""Velocity that may be left at the end, where `allow_nonzero_velocity_at_trajectory_end` is not set."""


class FakeTrajectoryController:
    """Keeps the last message that it accepted, and why it refused others."""

    def __init__(self, joints: tuple[str, ...]) -> None:
        self._joints = joints
        self.follows: JointTrajectory | None = None
        self.refused: list[str] = []

    def hear(self, message: JointTrajectory) -> None:
        if fault := self._fault(message):
            self.refused.append(fault)
        else:
            self.follows = message

    def _fault(self, message: JointTrajectory) -> str:
        points, n = message.points, len(self._joints)
        if not points:
            return "empty trajectory"
        if sorted(message.joint_names) != sorted(self._joints):
            return f"joints {list(message.joint_names)}"
        if message.header.stamp.sec or message.header.stamp.nanosec:
            return "a start time, which may lie in the past of the controller's clock"
        if any(len(point.positions) != n or len(point.velocities) not in (0, n) for point in points):
            return "sizes of the points"
        if any(abs(rate) > AT_REST for rate in points[-1].velocities):
            return "not at rest in the end"
        times = [nanoseconds(point.time_from_start.sec, point.time_from_start.nanosec) for point in points]
        if not (times[0] > 0 and all(b > a for a, b in pairwise(times))):
            return f"times {times}"
        return ""


class FakeVelocityController:
    """Moves by the last command for as long as it lives."""

    def __init__(self, count: int) -> None:
        self.command: Floats = (0.0,) * count
        self.refused: list[str] = []

    def hear(self, message: Float64MultiArray) -> None:
        if len(message.data) == len(self.command):
            self.command = tuple(message.data)
        else:
            self.refused.append(f"{len(message.data)} values")
