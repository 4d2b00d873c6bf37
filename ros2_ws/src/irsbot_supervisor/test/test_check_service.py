"""Requests to check a planned motion: which motion is certified, on which branch, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

from irsbot_msgs.srv import CheckTrajectory
from trajectory_msgs.msg import JointTrajectoryPoint

from irsbot_kinematics import Posture
from irsbot_msgs_py.records import Floats, Level
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.core.estimation.estimate import Speeds
from irsbot_supervisor.core.latch import Judgement
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.view import View
from irsbot_supervisor.nodes.check import asked
from irsbot_supervisor.trajectory.certificate import Certificate
from irsbot_supervisor.trajectory.joint_path import BadTrajectory
from irsbot_supervisor.validation.harness.oracle import followed

RPR3, RPR3_ROBOT = read_settings("rpr3")
BEGIN, END = (0.17, 0.1891, 0.2667), (0.0926, 0.2392, 0.3328)
"""A straight way along which labels 1 and 2 belong to two branches; only one of them keeps the limits."""


def request(settings: Settings, *points: tuple[Floats, Floats], mode: int = 0) -> CheckTrajectory.Request:
    """A request: positions and velocities of points that are a second apart."""
    asked_for = CheckTrajectory.Request(assembly_mode=mode)
    asked_for.trajectory.joint_names = list(settings.joint_names)
    for second, (positions, velocities) in enumerate(points):
        point = JointTrajectoryPoint(positions=positions, velocities=velocities)
        point.time_from_start.sec = second
        asked_for.trajectory.points.append(point)
    return asked_for


def standing(at: Posture) -> View:
    """A robot at rest on a branch."""
    rest = (0.0,) * len(at.joints)
    return View(at, rest, Speeds(rest, rest), 0.002, 0.002, True, Judgement(Level.OK, 0, False, 0, 0, 1.0, ()), 0)


def checked(mode: int, view: View | None) -> Certificate:
    task = asked(RPR3_ROBOT, RPR3, request(RPR3, (BEGIN, ()), (END, ()), mode=mode), view)
    found = task.function(*task.arguments)
    assert isinstance(found, Certificate)
    return found


@pytest.mark.parametrize("label", [1, 2])
def test_the_motion_of_a_robot_with_labels_that_change_is_checked_on_its_branch(label: int) -> None:
    mechanism = RPR3_ROBOT.mechanism
    begin = mechanism.posture(BEGIN, label)
    way = np.linspace(BEGIN, END, 400)
    least = min(at.type2 if at.status == 0 else 0.0 for at in followed(RPR3_ROBOT, way, begin))
    found = checked(0, standing(begin))
    assert found.safe == (least > RPR3.type2_stop)
    other = standing(mechanism.posture(BEGIN, 3 - label))
    assert found.safe == checked(label, other).safe != checked(0, other).safe  # a mode that is asked for counts


def test_without_a_known_branch_the_mode_has_to_be_stated() -> None:
    with pytest.raises(BadTrajectory):
        checked(0, None)


@pytest.mark.parametrize("bare", [0, 1, 2])
def test_a_motion_of_which_one_point_has_no_velocities_is_refused(bare: int) -> None:
    settings, robot = read_settings("five_bar")
    joints = robot.inverse((0.0, -0.5), settings.working_mode)
    points = [(tuple(joints), () if number == bare else (0.1, -0.1)) for number in range(3)]
    with pytest.raises(BadTrajectory):
        asked(robot, settings, request(settings, *points), None)
