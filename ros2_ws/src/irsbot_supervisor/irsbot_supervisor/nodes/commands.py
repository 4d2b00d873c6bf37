"""JointTrajectory messages as commands in the order of a robot's joints."""

from __future__ import annotations

from collections.abc import Sequence

from trajectory_msgs.msg import JointTrajectory

from irsbot_msgs_py.stamps import NS_PER_S, nanoseconds
from irsbot_supervisor.core.motion import Command, commanded


def command_of(message: JointTrajectory, joints: Sequence[str]) -> Command:
    """The points of a message. Raises BadTrajectory."""
    times = [nanoseconds(p.time_from_start.sec, p.time_from_start.nanosec) / NS_PER_S for p in message.points]
    positions = [tuple(point.positions) for point in message.points]
    velocities = [tuple(point.velocities) for point in message.points]
    return commanded(joints, message.joint_names, times, positions, velocities)
