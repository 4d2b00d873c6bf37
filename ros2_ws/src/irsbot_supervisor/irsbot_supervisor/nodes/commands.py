"""JointTrajectory messages: commands in robot order, and motions that passed the gate."""

from __future__ import annotations

from collections.abc import Sequence

from builtin_interfaces.msg import Duration
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from irsbot_msgs_py.stamps import NS_PER_S, nanoseconds, sec_nanosec
from irsbot_supervisor.trajectory.joint_path import BadTrajectory, Command, JointPath, commanded

LONGEST_NS = 2**31 * NS_PER_S
"""ns: latest time of a trajectory point in a message."""


def command_of(message: JointTrajectory, joints: Sequence[str]) -> Command:
    """The points of a message. Raises BadTrajectory."""
    times = [nanoseconds(p.time_from_start.sec, p.time_from_start.nanosec) / NS_PER_S for p in message.points]
    positions = [tuple(point.positions) for point in message.points]
    velocities = [tuple(point.velocities) for point in message.points]
    return commanded(joints, message.joint_names, times, positions, velocities)


def trajectory_msg(path: JointPath, joints: Sequence[str]) -> JointTrajectory:
    """A motion without its first point, which is the present position. Raises BadTrajectory if it takes longer than a
    message can state."""
    message = JointTrajectory(joint_names=list(joints))
    for after_s, position, velocity in list(zip(path.times, path.positions, path.velocities, strict=True))[1:]:
        if not after_s * NS_PER_S < LONGEST_NS:
            raise BadTrajectory(f"slowed down to the allowed speed it takes {after_s:.3g} s")
        message.points.append(point_msg(position, velocity, after_s))
    return message


def point_msg(position: Sequence[float], velocity: Sequence[float], after_s: float) -> JointTrajectoryPoint:
    """One point: joint positions (rad or m), velocities (rad/s or m/s), time from the start (s)."""
    sec, nanosec = sec_nanosec(round(after_s * NS_PER_S))
    point = JointTrajectoryPoint(positions=list(position), velocities=list(velocity))
    point.time_from_start = Duration(sec=sec, nanosec=nanosec)
    return point
