"""Certifies a planned path of the platform as a controller follows it: as closely spaced joint positions."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, nan

import numpy as np
from numpy.typing import NDArray

from irsbot_kinematics import Robot, Status
from irsbot_kinematics.batch import inverse_many
from irsbot_kinematics.branches import nearest_solutions
from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_msgs_py.records import Cause
from irsbot_supervisor.core.margins import MARGIN_CAUSES
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.trajectory.certificate import Certificate, Violation
from irsbot_supervisor.trajectory.joint_path import BadTrajectory
from irsbot_supervisor.trajectory.survey import Run, Survey, survey
from irsbot_supervisor.trajectory.verification import certify

SPACING_M = 1e-3
"""m: largest motion of the platform between two joint positions (angles times the mechanism's length). Between them the
joints move on straight lines, which deviate from the platform's line by the square of this over the size of the
robot."""

MOST_POINTS = 2_000_000
"""Largest number of points: a path of kilometres is a unit error."""


def certify_poses(
    robot: Robot,
    settings: Settings,
    times_s: Sequence[float],
    poses: Sequence[Sequence[float]],
    assembly_mode: int = 0,
) -> Certificate:
    """Certify a path of the platform, straight between poses, in the configured working mode.

    times_s: (N,) s, increasing. poses: (N, m) m or rad, task coordinates. A pose that cannot be reached is a violation.
    assembly_mode: of the first pose; 0: that of the settings or, if labels do not determine the branch, that of the
    first pose. The stopping distance is not included, and speeds are not compared with velocity_limit. Raises
    BadTrajectory.
    """
    path = _Joints(robot, settings, times_s, poses)
    nothing = ((inf, 0.0),) * len(MARGIN_CAUSES)
    beyond = path.beyond(0)
    if beyond is not None and path.end(0) == 0:
        return Certificate(beyond, nothing)
    wanted, violation = path.branch(assembly_mode)
    if violation is not None:
        return Certificate(violation, nothing)
    found = certify(robot, settings, *path.part(0), assembly_mode=wanted)
    return found if found.violation is not None else found._replace(violation=beyond)


def survey_poses(
    robot: Robot,
    settings: Settings,
    times_s: Sequence[float],
    poses: Sequence[Sequence[float]],
    assembly_mode: int = 0,
) -> Survey:
    """Survey a whole path of the platform; arguments as those of `certify_poses`. After poses that cannot be reached,
    the path continues in the assembly mode of its next pose. Raises BadTrajectory."""
    path = _Joints(robot, settings, times_s, poses)
    zeros = ((0.0, float(path.times[0])),) * len(MARGIN_CAUSES)
    wanted, violation = path.branch(assembly_mode) if path.end(0) else (0, None)
    if violation is not None:
        end_s, still = float(path.times[-1]), ((0.0, float(path.times[0])),) * len(robot.mechanism.joints)
        return Survey((Run(violation, end_s, violation),), ((inf, 0.0),) * len(MARGIN_CAUSES), zeros, still)
    found = Survey(
        (),
        ((inf, 0.0),) * len(MARGIN_CAUSES),
        ((inf, 0.0),) * len(MARGIN_CAUSES),
        ((0.0, 0.0),) * len(robot.mechanism.joints),
    )
    first = 0
    while first < len(path.times):
        end = path.end(first)
        if end > first:
            found = found.followed_by(
                survey(robot, settings, *path.part(first), assembly_mode=wanted or path.label(first))
            )
        beyond = path.beyond(first)
        first, wanted = path.reached_again(end), 0
        if beyond is not None:
            until_s = float(path.times[min(first, len(path.times) - 1)])
            found = found.followed_by(Survey((Run(beyond, until_s, beyond),), found.whole, zeros, found.speeds))
    return found


class _Joints:
    """A path of the platform as closely spaced joint positions, as far as they can be reached."""

    def __init__(
        self, robot: Robot, settings: Settings, times_s: Sequence[float], poses: Sequence[Sequence[float]]
    ) -> None:
        self._robot, self._assembly = robot, settings.assembly_mode
        self.times, self._points = _dense(robot, times_s, poses)
        self._joints, status, self._box = inverse_many(robot.mechanism, self._points, settings.working_mode)
        self._reached = status == Status.SOLVED

    def end(self, first: int) -> int:
        """Index of the first point from `first` on that cannot be reached, or the number of points."""
        return _first(~self._reached, first)

    def reached_again(self, first: int) -> int:
        """Index of the first point from `first` on that can be reached, or the number of points."""
        return _first(self._reached, first)

    def part(self, first: int) -> tuple[list[float], list[list[float]]]:
        """Times and joints from a point on, as far as they can be reached; angles do not jump by a turn."""
        joints = self._joints[first : self.end(first)].copy()
        for column, coordinate in enumerate(self._robot.mechanism.joints):
            if coordinate.is_angle:
                joints[:, column] = np.unwrap(joints[:, column])
        return self.times[first : self.end(first)].tolist(), joints.tolist()

    def beyond(self, first: int) -> Violation | None:
        """The fault of the point at which the part from `first` on ends."""
        last = self.end(first)
        if last == len(self.times):
            return None
        pose, reach, time_s = tuple(self._points[last].tolist()), float(self._box[last]), float(self.times[last])
        where = ", ".join(f"{value:.4g}" for value in pose)
        text = f"the pose ({where}) at {time_s:.4f} s is unreachable by {-reach * 1e3:.2f} mm"
        no_joints = (nan,) * len(self._robot.mechanism.joints)
        return Violation(time_s, int(Cause.TYPE1), reach, 0.0, no_joints, pose, text)

    def label(self, point: int) -> int:
        """The assembly mode of a point that can be reached."""
        first, pose = tuple(self._joints[point].tolist()), tuple(self._points[point].tolist())
        return int(nearest_solutions(self._robot.mechanism, np.array([first]), np.array(pose))[2][0])

    def branch(self, asked: int) -> tuple[int, Violation | None]:
        """The assembly mode of the first pose, and the fault if it is not the requested one."""
        mechanism, label = self._robot.mechanism, self.label(0)
        wanted = asked or (self._assembly if mechanism.label_is_invariant else label)
        if label == wanted or wanted not in mechanism.assembly_modes:
            return wanted, None
        text = f"the path begins in assembly mode {label:+d}, not in {wanted:+d}"
        joints, pose = tuple(self._joints[0].tolist()), tuple(self._points[0].tolist())
        return wanted, Violation(float(self.times[0]), int(Cause.BRANCH), nan, nan, joints, pose, text)


def _first(wanted: NDArray[np.bool_], begin: int) -> int:
    found = np.flatnonzero(wanted[begin:])
    return begin + int(found[0]) if len(found) else len(wanted)


def _dense(robot: Robot, times_s: Sequence[float], poses: Sequence[Sequence[float]]) -> tuple[Array, Array]:
    """Times and poses with a distance of at most SPACING_M between two."""
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
