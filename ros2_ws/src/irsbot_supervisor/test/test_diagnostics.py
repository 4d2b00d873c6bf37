"""What the diagnostics say of joint positions that may be in another unit."""

from __future__ import annotations

import math

import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

from diagnostic_msgs.msg import DiagnosticStatus

from irsbot_kinematics import make_robot
from irsbot_supervisor.nodes.diagnostics import of_units

pytestmark = pytest.mark.ros

JOINTS = make_robot("irsbot2").mechanism.joints
SLIDES = make_robot("linear_delta").mechanism.joints
NAMES = ("joint_1", "joint_2")


def test_angles_more_than_a_turn_from_zero_are_reported_as_possible_degrees():
    found = of_units(JOINTS, NAMES, (math.degrees(2.9), math.degrees(0.05)))
    assert found.level == DiagnosticStatus.WARN
    assert found.text.startswith("'joint_1' is at 166.2 rad, 26.4 turns from zero: ")
    assert "if these are degrees" in found.text


@pytest.mark.parametrize("position", [(2.9, -6.2), (), (math.nan, 0.0)])
def test_angles_within_a_turn_and_no_angles_are_fine(position: tuple[float, ...]):
    assert of_units(JOINTS, NAMES, position).level == DiagnosticStatus.OK


def test_a_slide_has_no_turns():
    assert of_units(SLIDES, ("a", "b", "c"), (7.0, 0.0, 0.0)).level == DiagnosticStatus.OK
