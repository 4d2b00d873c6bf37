"""A planned path of the platform, certified as a controller drives it: as closely spaced joint positions."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, nan

import numpy as np

from irsbot_kinematics import Robot, Status
from irsbot_kinematics.arithmetic import Array
from irsbot_kinematics.batch import inverse_many
from irsbot_kinematics.requests import solve_direct
from irsbot_msgs_py.records import Cause
from irsbot_supervisor.core.certify import Certificate, Violation, certify
from irsbot_supervisor.core.motion import BadTrajectory
from irsbot_supervisor.core.policy import KINDS
from irsbot_supervisor.core.settings import Settings

SPACING_M = 1e-3
"""m that the platform moves at most between two joint positions (angles times the mechanism's length). In between the
joints move straight; from the platform's line they stray by the square of this over the size of the robot."""

MOST_POINTS = 2_000_000
"""A path of kilometres is a unit error."""


def certify_poses(
    robot: Robot,
    settings: Settings,
    times_s: Sequence[float],
    poses: Sequence[Sequence[float]],
    assembly_mode: int = 0,
) -> Certificate:
    """Certify a path of the platform, straight between poses, in the configured working mode.

    times_s: (N,) s, increasing. poses: (N, m) m or rad, task coordinates. A pose that cannot be reached is a violation.
    assembly_mode: in which the path must begin; 0: the settings', or, where labels do not tell the branch, the one
    that the first pose tells. Raises BadTrajectory.
    """
    mechanism = robot.mechanism
    times, points = _dense(robot, times_s, poses)
    joints, status, reach = inverse_many(mechanism, points, settings.working_mode)
    missing = np.flatnonzero(status != Status.SOLVED)
    last = int(missing[0]) if len(missing) else len(times)
    for column, coordinate in enumerate(mechanism.joints):
        if coordinate.is_angle:
            joints[:last, column] = np.unwrap(joints[:last, column])
    beyond = None
    if last < len(times):
        pose = tuple(points[last].tolist())
        where = ", ".join(f"{value:.4g}" for value in pose)
        text = f"the pose ({where}) at {times[last]:.4f} s is unreachable by {-float(reach[last]) * 1e3:.2f} mm"
        no_joints = (nan,) * len(mechanism.joints)
        beyond = Violation(float(times[last]), int(Cause.TYPE1), float(reach[last]), 0.0, no_joints, pose, text)
    nothing = ((inf, 0.0),) * len(KINDS)
    if last == 0:
        assert beyond is not None
        return Certificate(beyond, nothing)
    first, pose = tuple(joints[0].tolist()), tuple(points[0].tolist())
    label = solve_direct(robot, first, 0, pose).assembly_mode[0]
    wanted = assembly_mode or (settings.assembly_mode if mechanism.labels_hold else label)
    if label != wanted and wanted in mechanism.assembly_modes:
        text = f"the path begins in assembly mode {label:+d}, not in {wanted:+d}"
        violation = Violation(float(times[0]), int(Cause.BRANCH), nan, nan, first, pose, text)
        return Certificate(violation, nothing)
    found = certify(robot, settings, times[:last].tolist(), joints[:last].tolist(), assembly_mode=wanted)
    return found if found.violation is not None else found._replace(violation=beyond)


def _dense(robot: Robot, times_s: Sequence[float], poses: Sequence[Sequence[float]]) -> tuple[Array, Array]:
    """Times and poses with no farther than SPACING_M between two."""
    task = robot.mechanism.task
    try:
        times = np.array(times_s, dtype=float)
        points = np.array(poses, dtype=float).reshape(len(times), -1)
    except ValueError:
        raise BadTrajectory("each time needs a pose") from None
    if not len(times) or points.shape[1] != len(task):
        names = ", ".join(coordinate.name for coordinate in task)
        raise BadTrajectory(f"a path needs poses with {len(task)} coordinates: {names}")
    if not (np.isfinite(times).all() and (np.diff(times) > 0.0).all()):
        raise BadTrajectory("the times must be finite and increase")
    if not np.isfinite(points).all():
        raise BadTrajectory("the poses must be finite")
    lever = np.array([robot.mechanism.length_m if coordinate.is_angle else 1.0 for coordinate in task])
    parts = np.maximum(np.ceil(np.abs(np.diff(points, axis=0) * lever).sum(axis=1) / SPACING_M), 1.0)
    if not parts.sum() <= MOST_POINTS:
        raise BadTrajectory(f"the path is {parts.sum() * SPACING_M:.3g} m long, at most {MOST_POINTS * SPACING_M:g} m")
    where = np.concatenate([np.zeros(1), *(k + np.arange(1, n + 1) / n for k, n in enumerate(parts.astype(int)))])
    whole = np.arange(len(times))
    columns = [np.interp(where, whole, column) for column in (times, *points.T)]
    return columns[0], np.column_stack(columns[1:])
