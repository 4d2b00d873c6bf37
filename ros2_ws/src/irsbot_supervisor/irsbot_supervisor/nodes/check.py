"""The service CheckTrajectory: request, certificate, response. A worker process computes the certificate."""

from __future__ import annotations

from math import inf, nan
from typing import NamedTuple

from irsbot_msgs.srv import CheckTrajectory

from irsbot_kinematics import Posture, Robot
from irsbot_msgs_py.records import Floats
from irsbot_msgs_py.stamps import NS_PER_S, nanoseconds
from irsbot_supervisor.core.margins import MARGIN_CAUSES
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.view import View
from irsbot_supervisor.processes.worker import Task
from irsbot_supervisor.trajectory.certificate import Certificate
from irsbot_supervisor.trajectory.joint_path import BadTrajectory
from irsbot_supervisor.trajectory.task_space import certify_poses
from irsbot_supervisor.trajectory.verification import certify


class Motion(NamedTuple):
    """A trajectory as plain values: points of the joints in robot order, or poses of the platform."""

    times_s: list[float]
    positions: list[Floats]
    velocities: list[Floats]  # empty for straight lines, and for poses
    assembly_mode: int
    is_of_platform: bool


def asked(robot: Robot, settings: Settings, request: CheckTrajectory.Request, view: View | None) -> Task:
    """The task that computes a certificate, or a text, for a request. Raises BadTrajectory.

    view: of the supervised robot; None if its state is not known.
    """
    motion, begin = _motion(robot, settings, request), None
    if not (robot.mechanism.label_is_invariant or motion.assembly_mode or motion.is_of_platform):
        if view is None:  # a label would name another branch wherever the labels have changed
            raise BadTrajectory("the branch that the robot is on is not known: state assembly_mode")
        begin = view.at
    prediction_delay_s = view.prediction_delay_s if view is not None else 0.0
    return Task(certificate, (robot, settings, motion, prediction_delay_s, begin))


def certificate(
    robot: Robot, settings: Settings, motion: Motion, prediction_delay_s: float, begin: Posture | None = None
) -> Certificate | str:
    """The certificate of a motion, or the reason why there is none.

    prediction_delay_s: time that the robot moves without supervision. begin: a posture on the branch of the motion, if
    it is known better than by the label.
    """
    times, positions, velocities, mode, is_of_platform = motion
    try:
        if is_of_platform:
            return certify_poses(robot, settings, times, positions, mode)
        return certify(
            robot, settings, times, positions, velocities, mode, begin=begin, prediction_delay_s=prediction_delay_s
        )
    except BadTrajectory as error:
        return str(error)


def answered(found: Certificate | str, response: CheckTrajectory.Response) -> CheckTrajectory.Response:
    """Fill in the response. An invalid trajectory is not safe, and the message has the reason."""
    if isinstance(found, str):
        return refused(response, found)
    response.violation_time = response.violation_value = response.violation_limit = nan
    response.safe = found.safe
    had = [(kind, *least) for kind, least in zip(MARGIN_CAUSES, found.minima, strict=True) if least[0] < inf]
    response.margin_cause = [int(kind) for kind, _value, _time in had]
    response.margin_min = [value for _kind, value, _time in had]
    response.margin_min_time = [time for _kind, _value, time in had]
    violation = found.violation
    response.message = violation.text if violation else ""
    if violation:
        response.violation_time, response.violation_cause = violation.time_s, violation.cause
        response.violation_value, response.violation_limit = violation.value, violation.limit
        response.violation_joints, response.violation_pose = violation.joints, violation.pose
    return response


def refused(response: CheckTrajectory.Response, why: str) -> CheckTrajectory.Response:
    """Response without a check: not safe, and all numbers are NaN."""
    response.safe, response.message = False, why
    response.violation_time = response.violation_value = response.violation_limit = nan
    return response


def _motion(robot: Robot, settings: Settings, request: CheckTrajectory.Request) -> Motion:
    trajectory = request.trajectory
    names = list(trajectory.joint_names)
    task = [coordinate.name for coordinate in robot.mechanism.task]
    wanted = task if sorted(names) == sorted(task) else list(settings.joint_names)
    if sorted(names) != sorted(wanted):
        raise BadTrajectory(f"joint names {names} must be {wanted}, or the task coordinates {task}, in any order")
    order = [names.index(name) for name in wanted]
    points = trajectory.points
    if any(len(point.positions) != len(names) or len(point.velocities) not in (0, len(names)) for point in points):
        raise BadTrajectory(f"every point needs {len(names)} positions, and {len(names)} velocities or none")
    times = [nanoseconds(p.time_from_start.sec, p.time_from_start.nanosec) / NS_PER_S for p in points]
    of_platform = wanted == task
    cubic = any(len(point.velocities) for point in points) and not of_platform
    if cubic and not all(len(point.velocities) for point in points):
        raise BadTrajectory("all points need velocities, or none")
    positions = [tuple([point.positions[i] for i in order]) for point in points]
    velocities = [tuple([point.velocities[i] for i in order]) for point in points] if cubic else []
    return Motion(times, positions, velocities, request.assembly_mode, of_platform)
