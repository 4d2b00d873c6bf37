"""Branches whose label changes along a motion without a singularity: they are followed, and judged as what they are."""

from __future__ import annotations

import numpy as np
from supervised import feed, sample, settings_of, supervisor_of

from irsbot_kinematics import Status
from irsbot_msgs_py.records import Level
from irsbot_supervisor.core.certify import certify

START, WAY = np.array([1.4268, -3.1222, -0.3313]), np.array([0.4916, 1.0, -0.8101])
"""rad: joints of the rrr3_base and a way of 0.8 rad on which label -1 becomes another one, far from Type 2."""
LABEL, FAR_RAD, STEPS = -1, 0.8, 800


def followed(robot):
    """Postures along the way in steps of a thousandth of a radian."""
    at = robot.mechanism.posture(tuple(START), LABEL)
    postures = [at]
    for k in range(1, STEPS + 1):
        at = robot.mechanism.track(tuple((START + k * FAR_RAD / STEPS * WAY).tolist()), at)
        postures.append(at)
    return postures


def test_the_label_changes_on_the_way_and_no_singularity_is_near():
    _settings, robot = settings_of("rrr3_base")
    postures = followed(robot)
    assert all(at.status == Status.SOLVED and at.type2 > 0.5 and min(at.type1) > 0.3 for at in postures)
    end = robot.mechanism.posture(postures[-1].joints, LABEL)
    assert end.status != Status.SOLVED or np.abs(np.subtract(end.pose, postures[-1].pose)).max() > 0.1


def test_a_supervisor_follows_the_branch_and_says_ok():
    supervisor = supervisor_of("rrr3_base", working_mode=followed_mode(), assembly_mode=LABEL)
    names = supervisor.settings.joint_names
    expected = followed(supervisor.robot)
    rates = tuple((FAR_RAD / STEPS * 1e3 * WAY).tolist())
    feed(supervisor, [sample(ms, tuple(START), names=names) for ms in range(-200, 0)])
    for ms, at in enumerate(expected):
        state = supervisor.step(sample(ms, at.joints, rates, names=names)).state
        assert state.level == Level.OK, ms
        np.testing.assert_allclose(state.pose, at.pose, atol=1e-9)
        assert state.assembly_mode == LABEL


def followed_mode():
    _settings, robot = settings_of("rrr3_base")
    return list(robot.mechanism.posture(tuple(START), LABEL).working_mode)


def test_a_planned_motion_is_certified_on_its_own_branch():
    settings, robot = settings_of("rrr3_base", working_mode=followed_mode(), assembly_mode=LABEL)
    points = [START + share * FAR_RAD * WAY for share in np.linspace(0.0, 1.0, 40)]
    found = certify(robot, settings, np.linspace(0.0, 2.0, 40), points)
    assert found.safe, found.violation
    met = min(at.type2 for at in followed(robot))
    assert settings.type2_stop <= found.minima[1][0] <= met


def test_an_operator_who_sees_the_platform_on_another_branch_is_refused():
    supervisor = supervisor_of("rrr3_base")
    robot, names = supervisor.robot, supervisor.settings.joint_names
    q = tuple(robot.inverse((0.0, 0.0, 0.3)).tolist())
    feed(supervisor, [sample(ms, q, names=names) for ms in range(-200, 0)])
    other = robot.direct(q, -1)
    assert supervisor._other_branch(q, tuple(other)) == "the seed pose is nearest to another branch"
    assert supervisor._other_branch(q, (0.01, 0.0, 0.3)) == ""
