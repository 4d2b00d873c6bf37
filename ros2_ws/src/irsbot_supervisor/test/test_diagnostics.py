"""What the diagnostics say of joint positions that may be in another unit, and of samples that are judged late."""

from __future__ import annotations

import math

import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

from diagnostic_msgs.msg import DiagnosticStatus

from irsbot_kinematics import make_robot
from irsbot_supervisor.nodes.diagnostics import of_units
from irsbot_supervisor.nodes.judging_times import JudgingTimes

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


def test_samples_that_took_longer_to_judge_than_allowed_are_reported_once_and_counted():
    times = JudgingTimes()
    for took_s, allowed_s in ((0.004, 0.005), (0.0072, 0.005), (0.006, 0.001), (0.05, math.inf), (0.001, 0.001)):
        times.note(took_s, allowed_s)
    found = times.report()
    assert found.level == DiagnosticStatus.WARN
    assert found.text.startswith("2 samples took longer to judge than the certified box allows, up to 7.2 ms of 5.0 ms")
    assert (times.late, times.longest_s) == (2, 0.05)
    assert times.report().level == DiagnosticStatus.OK
    assert times.late == 2


def test_a_judging_time_that_is_not_a_number_is_late():
    times = JudgingTimes()
    times.note(math.nan, 0.005)
    assert times.report().level == DiagnosticStatus.WARN
