"""Branches whose label changes along a motion without a singularity: they are followed, and judged as what they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from supervised import at_ns, feed, reset, sample, settings_of, supervisor_of, tick

from irsbot_kinematics import Status, make_robot
from irsbot_msgs_py.records import Cause, Level, Restart
from irsbot_supervisor.core.assessment import CONTACT_TOL_M, Assessor
from irsbot_supervisor.core.estimation.estimate import Speeds
from irsbot_supervisor.core.margins import margins_of
from irsbot_supervisor.core.seed_pose import seen_posture
from irsbot_supervisor.core.stopping import StoppingPredictor, limits_of
from irsbot_supervisor.trajectory.verification import certify

START, WAY = np.array([-0.1477, 2.1584, -1.4992]), np.array([0.7028, -0.4716, 1.0])
"""rad: joints of the rrr3_base and a way on which label -1 goes over to another branch, far from Type 2; at its end the
pose with that label is near Type 2, and the platform is not there."""
LABEL, FAR_RAD, STEPS = -1, 0.51, 510


def followed(robot):
    """Postures along the way in steps of a thousandth of a radian."""
    at = robot.mechanism.posture(tuple(START), LABEL)
    postures = [at]
    for k in range(1, STEPS + 1):
        at = robot.mechanism.track(tuple((START + k * FAR_RAD / STEPS * WAY).tolist()), at)
        postures.append(at)
    return postures


def test_the_label_changes_on_the_way_and_no_singularity_is_near():
    settings, robot = settings_of("rrr3_base")
    postures = followed(robot)
    assert all(at.status == Status.SOLVED and at.type2 > 0.4 and min(at.type1) > 0.3 for at in postures)
    labelled = robot.mechanism.posture(postures[-1].joints, LABEL)
    assert labelled.type2 < settings.type2_stop
    assert abs(np.angle(np.exp(1j * (labelled.pose[2] - postures[-1].pose[2])))) > 0.1


def test_a_supervisor_follows_the_branch_and_allows_motion():
    supervisor = supervisor_of("rrr3_base", working_mode=followed_mode(), assembly_mode=LABEL)
    names = supervisor.settings.joint_names
    expected = followed(supervisor.robot)
    rates = tuple((FAR_RAD / STEPS * 1e3 * WAY).tolist())
    feed(supervisor, [sample(ms, tuple(START), names=names) for ms in range(-200, 0)])
    for ms, at in enumerate(expected):
        state = supervisor.step(sample(ms, at.joints, rates, names=names)).state
        assert state.level <= Level.WARN, ms
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


def test_the_reachable_box_is_bounded_on_its_own_branch():
    """The box of a resting robot holds the way from before the label changes, 0.33 rad from the start, to behind it;
    there the pose of the first label is nearly singular."""
    settings, robot = settings_of("rrr3_base", working_mode=followed_mode(), assembly_mode=LABEL, type2_warn=1.0)
    way = followed(robot)[320:341]
    free_s = 0.01  # joint j gets 0.5 a (1 + a/d) T^2 in each direction
    gains = tuple((np.abs(np.subtract(way[-1].joints, way[0].joints)) / 2.0 / free_s**2).tolist())
    middle = robot.mechanism.track(tuple(np.mean([way[0].joints, way[-1].joints], axis=0).tolist()), way[0])
    slow = replace(settings, acceleration_limit=gains, deceleration_limit=gains, latency_s=free_s, stamp_jitter_s=0.0)
    rest = (0.0,) * len(gains)
    labelled = [robot.mechanism.posture(at.joints, LABEL) for at in way]
    apart = [abs(np.angle(np.exp(1j * (a.pose[2] - b.pose[2])))) for a, b in zip(labelled, way, strict=True)]
    assert apart[0] < 1e-6 < 0.1 < apart[-1]
    met = min(at.type2 for at in way)
    predictor = StoppingPredictor(slow, robot.mechanism)
    assert 0.4 <= predictor.predict(middle, Speeds(rest, rest), 0.0, (0.0, 0.4, 0.0, 0.0))[1] <= met


def test_an_operator_who_sees_the_platform_on_another_branch_is_refused():
    robot, followed_pose = make_robot("rrr3_base"), (0.0, 0.0, 0.3)
    q = tuple(robot.inverse(followed_pose).tolist())
    other = tuple(robot.direct(q, -1).tolist())
    refused = (None, "the seed pose is nearest to another branch")
    assert seen_posture(robot.mechanism, q, other, 1, followed_pose) == refused
    assert seen_posture(robot.mechanism, q, followed_pose, 1, other) == refused
    assert seen_posture(robot.mechanism, q, (0.01, 0.0, 0.3), 1, followed_pose) == (None, "")


def test_a_lost_branch_is_the_one_in_which_an_operator_sees_the_platform():
    """At the end of the way, where the label of the settings means another pose. Without a look nobody can go on."""
    supervisor = supervisor_of("rrr3_base", working_mode=followed_mode(), assembly_mode=LABEL)
    names, there = supervisor.settings.joint_names, followed(supervisor.robot)[-1]
    feed(supervisor, [sample(ms, tuple(START), names=names) for ms in range(-200, 0)])
    feed(supervisor, [sample(ms, there.joints, names=names) for ms in range(0, 400)])  # half a radian in 1 ms
    verdict = supervisor.step(tick(400)).verdict
    assert verdict is not None
    assert verdict.level == Level.UNKNOWN
    assert verdict.causes & Cause.BRANCH
    assert supervisor.step(reset(400, verdict.event)).refusal
    seen = tuple(np.add(there.pose, (0.01, -0.01, 0.02)).tolist())
    assert supervisor.step(reset(401, verdict.event)._replace(seed_pose=seen)).refusal == ""
    steps = feed(supervisor, [sample(ms, there.joints, names=names) for ms in range(402, 700)])
    assert supervisor._latch.now.level == Level.OK
    np.testing.assert_allclose(steps[-1].state.pose, there.pose, atol=1e-9)


def test_after_a_restart_the_branch_is_the_one_in_which_an_operator_sees_the_platform():
    supervisor = supervisor_of("rrr3_base", working_mode=followed_mode(), assembly_mode=LABEL)
    names, there = supervisor.settings.joint_names, followed(supervisor.robot)[-1]
    supervisor.step(Restart(*at_ns(-1), 7))
    feed(supervisor, [sample(ms, there.joints, names=names) for ms in range(0, 400)])
    assert supervisor.step(reset(400, 7)).refusal  # the label of the settings means another pose
    assert supervisor.step(reset(401, 7)._replace(seed_pose=there.pose)).refusal == ""
    steps = feed(supervisor, [sample(ms, there.joints, names=names) for ms in range(402, 700)])
    assert supervisor._latch.now.level == Level.OK
    np.testing.assert_allclose(steps[-1].state.pose, there.pose, atol=1e-9)


@pytest.mark.parametrize("beside", [0.5, 0.2, 0.01])
def test_a_type2_locus_that_is_touched_between_two_samples_is_noticed(beside):
    """Mirrored cranks of an IRSBot-2 swing smoothly to where its elbows meet (b0 + l1 cos q2 = 0) and back, half the
    deceleration limit at most; no sample sees the gap closed."""
    supervisor = supervisor_of("irsbot2_beta45")
    geometry = supervisor.robot.mechanism.geometry
    locus = -float(np.arccos(-geometry.b0 / geometry.l1))
    away = float(supervisor.robot.inverse((0.0, -0.8))[1])
    half, pace = 0.5 * (away - locus), np.sqrt(200.0 / (0.5 * abs(away - locus)))
    last, least = int(np.pi / pace * 1e3), 1.0
    for ms in range(-last, last):
        t = (ms + beside) * 1e-3
        q, rate = locus + half * (1.0 - np.cos(pace * t)), half * pace * np.sin(pace * t)
        state = supervisor.step(sample(3000 + ms + beside, (-np.pi - q, q), (-rate, rate))).state
        assert state is not None
        at = supervisor.robot.mechanism.posture(state.joint_position, supervisor.settings.assembly_mode)
        least = min(least, *at.gaps)
    assert 1e-9 < least < 1e-4, "a sample met the locus, or none came near: the test proves nothing"
    verdict = supervisor.step(tick(3000.0 + last + 20.0)).verdict
    assert verdict is not None
    assert verdict.causes & Cause.BRANCH
    assert verdict.level == Level.UNKNOWN


@pytest.mark.parametrize("name", ["ruu4", "rrr3_base"])
def test_a_confirmed_branch_holds_at_once_for_the_command_gate(name):
    """Two solutions of the same joints; the encoders have jumped, the operator sees the platform in the other one."""
    settings, robot = settings_of(name)
    mechanism, rng = robot.mechanism, np.random.default_rng(3)
    low = np.array([-np.pi] * len(mechanism.joints))
    wanted = np.array(limits_of(settings, "warn"))
    while True:
        q = tuple(rng.uniform(low, -low).tolist())
        solved = [at for label in mechanism.assembly_modes if (at := mechanism.posture(q, label)).status == 0]
        good = [
            at
            for at in solved
            if at.working_mode == settings.working_mode and (np.array(margins_of(at)) > 1.1 * wanted).all()
        ]
        mine = [at for at in good if at.assembly_mode == settings.assembly_mode]
        if mine and len(good) > 1:
            break
    other = next(at for at in good if at is not mine[0])
    supervisor = supervisor_of(name)
    names = settings.joint_names
    off = tuple(x + 0.3 for x in q)
    feed(supervisor, [sample(ms, off, names=names) for ms in range(100)])
    feed(supervisor, [sample(ms, q, names=names) for ms in range(100, 500)])
    event = supervisor.step(tick(500.0)).verdict.event
    asked = reset(500.5, event)._replace(seed_pose=other.pose)
    assert supervisor.step(asked).refusal == ""
    assert supervisor.view is not None
    np.testing.assert_allclose(supervisor.view.at.pose, other.pose, atol=1e-6)


@pytest.mark.parametrize(("robot", "lever_m"), [("orthoglide", 1.0), ("rrr3", make_robot("rrr3").mechanism.length_m)])
def test_an_encoder_offset_moves_a_slide_by_itself_and_a_platform_by_its_length(robot, lever_m):
    settings, machine = settings_of(robot, encoder_offset=2e-4)
    assessor = Assessor(settings, machine.mechanism)
    assert assessor.contact_m == pytest.approx(CONTACT_TOL_M + lever_m * 2e-4 + settings.slack_m, rel=1e-12)
