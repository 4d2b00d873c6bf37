"""Trajectories through the command gate: passed, slowed down, ended early, or held."""

from __future__ import annotations

from math import inf, nan

import numpy as np
import pytest
from supervised import joints_of, ready, sample, settings_of, supervisor_of

from irsbot_kinematics import Robot
from irsbot_msgs_py.gate_status import GateOutcome, GateReason
from irsbot_msgs_py.records import Level
from irsbot_supervisor.core.margins import margins_of
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.stopping import limits_of
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.gate.answer import PASSED
from irsbot_supervisor.gate.trajectory_gate import GatedMotion, MotionGate, Situation
from irsbot_supervisor.gate.velocity_gate import Gate
from irsbot_supervisor.sim.trajectory import joint_move
from irsbot_supervisor.trajectory.joint_path import Command, JointPath, joint_limits_of
from irsbot_supervisor.trajectory.verification import certify
from irsbot_supervisor.validation.harness.oracle import good_postures

SAFE = (0.1, -0.8)
START = (0.0, -0.85)


def situation_of(supervisor: Supervisor, **changes) -> Situation:
    view = supervisor.view
    assert view is not None
    gate = Gate(supervisor.settings, supervisor.robot.mechanism)
    found = Situation(view.at, view.velocity, *gate.allowance(view), view.prediction_delay_s)
    return found._replace(**changes)


def passed(supervisor: Supervisor, command: Command, **changes) -> GatedMotion:
    gate = MotionGate(supervisor.settings, supervisor.robot)
    return gate.motion(command, situation_of(supervisor, **changes))


def to(supervisor: Supervisor, goal, share: float = 0.3) -> JointPath:
    """A swing to joint positions at a share of what the joints can do."""
    settings = supervisor.settings
    limits = joint_limits_of(settings)
    view = supervisor.view
    assert view is not None
    return joint_move(view.at.joints, tuple(goal), limits, speed=share)


def command_of(path: JointPath) -> Command:
    return Command(path.times, path.positions, path.velocities)


def followed(name: str) -> Supervisor:
    """A supervisor whose robot has left the branch that the settings' label tells of its joints, and stands there."""
    settings, robot = settings_of(name)
    mechanism, rng = robot.mechanism, np.random.default_rng(2)
    wanted = 2.0 * np.array(limits_of(settings, "warn"))
    while True:
        start = good_postures(robot, settings, 1, rng)[0]
        direction = rng.uniform(-1.0, 1.0, len(start))
        at, way = mechanism.posture(tuple(start.tolist()), settings.assembly_mode), [start]
        while at.status == 0 and (np.array(margins_of(at)) >= wanted).all():
            if len(way) > 40 and len(way) % 20 == 0:  # often enough
                label = mechanism.posture(at.joints, settings.assembly_mode)
                if label.status == 0 and abs(label.pose[0] - at.pose[0]) > 1e-2:
                    return watched(robot, settings, way)
            if len(way) > 400:
                break
            way.append(way[-1] + 2e-3 * direction)
            at = mechanism.track(tuple(way[-1].tolist()), at)


def watched(robot: Robot, settings: Settings, way: list[np.ndarray]) -> Supervisor:
    supervisor, names, n = Supervisor(settings, robot), settings.joint_names, len(way)
    for ms, q in enumerate([*way, *[way[-1]] * 300]):
        velocity = (way[1] - way[0]) / 1e-3 if ms < n else np.zeros(len(q))
        supervisor.step(sample(ms, tuple(q.tolist()), tuple(velocity.tolist()), names=names))
    return supervisor


@pytest.mark.parametrize("name", ["ruu4", "rrr3_base"])
def test_a_motion_is_judged_on_the_branch_that_is_followed_not_on_that_of_a_label(name):
    supervisor = followed(name)
    view = supervisor.view
    assert view is not None
    mechanism, stop = supervisor.robot.mechanism, np.array(limits_of(supervisor.settings, "stop"))
    rng, judged = np.random.default_rng(4), 0
    for _ in range(2):
        goal = np.array(view.at.joints) + 0.2 * rng.uniform(-1.0, 1.0, len(view.at.joints))
        found = passed(supervisor, command_of(to(supervisor, goal)))
        if found.path is None:
            continue
        at, judged = view.at, judged + 1
        for t in np.linspace(0.0, found.path.duration_s, 400):
            at = mechanism.track(found.path.at(float(t)).position, at)
            assert at.status == 0
            assert (np.array(margins_of(at)) >= stop).all()
    assert judged


@pytest.mark.parametrize("rates", [(0.0, 0.0), (0.5, -0.5)], ids=["at rest", "moving"])
@pytest.mark.parametrize("there", [True, False], ids=["where it is", "elsewhere"])
def test_a_motion_that_takes_no_time_is_refused(rates, there):
    """It has no part that could pass, not even where the robot already is: a hold is what is left."""
    supervisor, q = ready()
    for ms in range(100):
        q = tuple(a + 1e-3 * rate for a, rate in zip(q, rates, strict=True))
        supervisor.step(sample(ms, q, rates))
    assert supervisor.view is not None
    goal = q if there else joints_of(supervisor, *SAFE)
    found = passed(supervisor, Command((0.0,), (goal,), ((0.0, 0.0),)))
    assert found.path is None
    assert (found.answer.outcome, found.answer.reason) == (GateOutcome.HELD, GateReason.INVALID)
    assert "time_from_start" in found.answer.text


def straightened(supervisor: Supervisor) -> np.ndarray:
    """Joint positions in which leg 1 would be straight, or nearly: beyond the Type 1 limit."""
    view = supervisor.view
    assert view is not None
    q = np.array(view.at.joints)
    while True:
        q[0] += 0.01
        at = supervisor.robot.mechanism.posture(tuple(q), supervisor.settings.assembly_mode)
        if not (at.status == 0 and min(map(abs, at.normalised_levers)) > 0.5 * supervisor.settings.type1_stop):
            return q


def test_a_safe_motion_passes_as_it_is():
    supervisor, _ = ready("irsbot2", START)
    path = to(supervisor, joints_of(supervisor, *SAFE))
    found = passed(supervisor, command_of(path))
    assert found.answer == PASSED
    assert found.path is not None
    assert found.path.times == path.times
    assert np.allclose(found.path.positions, path.positions, atol=0.0, rtol=1e-15)


@pytest.mark.parametrize("changes", [{}, {"acceleration_limit": 50.0}], ids=str)
def test_a_motion_through_a_limit_ends_at_rest_in_front_of_it_on_its_way(changes):
    supervisor, _ = ready("irsbot2", START, **changes)
    settings, robot = supervisor.settings, supervisor.robot
    goal = straightened(supervisor)
    path = to(supervisor, goal)
    assert not certify(robot, settings, path.times, path.positions, path.velocities).safe
    found = passed(supervisor, command_of(path))
    assert found.path is not None
    assert "ends early: Type 1 margin" in found.answer.text
    assert not any(found.path.velocities[-1])
    assert found.path.excess(joint_limits_of(settings)) <= 1.0 + 1e-5
    way = np.array([found.path.at(t).position for t in np.linspace(0.0, found.path.duration_s, 500)])
    start = np.array(path.positions[0])
    straight = (goal - start) / np.linalg.norm(goal - start)
    aside = (way - start) - np.outer((way - start) @ straight, straight)
    assert np.abs(aside).max() < 1e-9  # on the commanded line
    margins = robot.evaluate_many(way, settings.assembly_mode)
    least = margins.type1_margin.min()
    assert settings.type1_stop <= least <= settings.type1_stop + 0.2  # from there it can just be stopped
    assert np.linalg.norm(way[-1] - start) > 0.5 * np.linalg.norm(goal - start)


@pytest.mark.parametrize("changes", [{}, {"acceleration_limit": 50.0}], ids=str)
def test_a_motion_that_is_too_fast_for_the_joints_is_slowed_down_on_the_same_way(changes):
    supervisor, _ = ready("irsbot2", START, **changes)
    settings = supervisor.settings
    path = to(supervisor, joints_of(supervisor, *SAFE), share=1.0).stretched(0.2)
    found = passed(supervisor, command_of(path))
    assert found.path is not None
    assert found.answer[:2] == (GateOutcome.SLOWED, GateReason.SPEED)
    assert found.path.positions == path.positions
    limits = joint_limits_of(settings)
    assert found.path.excess(limits) <= 1.0 + 1e-9


@pytest.mark.parametrize("seed", range(8))
def test_nowhere_on_an_allowed_motion_would_the_supervisor_stop_the_robot(seed):
    """Swings at full speed beyond the limits: the first straight at Type 1, the others anywhere."""
    supervisor, joints = ready("irsbot2", START)
    goal = straightened(supervisor)
    if seed:
        goal = np.array(joints) + 2.0 * np.random.default_rng(seed).uniform(-1.0, 1.0, 2)
    found = passed(supervisor, command_of(to(supervisor, goal, share=1.0)))
    assert found.path is not None
    for ms in range(round(found.path.duration_s * 1e3) + 50):
        point = found.path.at(ms * 1e-3)
        step = supervisor.step(sample(ms, point.position, point.velocity))
        assert step.state is not None
        assert step.state.level < Level.STOP, supervisor._latch.now.findings
    assert np.abs(np.array(point.position) - joints).max() > 0.1


def test_with_a_small_share_a_motion_is_slow():
    supervisor, _ = ready("irsbot2", START)
    path = to(supervisor, joints_of(supervisor, *SAFE), share=1.0)
    found = passed(supervisor, command_of(path), share=0.05)
    assert found.path is not None
    assert max(found.path.peaks[0]) <= 0.05 * supervisor.settings.velocity_limit[0] * (1.0 + 1e-9)


def test_on_the_way_out_a_motion_that_loses_margin_is_held_and_one_that_gains_passes():
    supervisor, joints = ready("irsbot2", START)
    q = np.array(joints)
    at = supervisor.robot.mechanism.posture(tuple(q), supervisor.settings.assembly_mode)
    margin = min(map(abs, at.normalised_levers))
    inside = np.array(straightened(supervisor))
    keep = (margin - 0.002, *limits_of(supervisor.settings, "stop")[1:])
    toward = Command((1.0,), (tuple(q + 0.3 * (inside - q)),), ())
    away = Command((1.0,), (tuple(q - 0.1 * (inside - q)),), ())
    held = passed(supervisor, toward, limits=keep, share=0.05, prediction_delay_s=None)
    assert held.path is None or np.abs(np.array(held.path.positions[-1]) - q).max() < 0.01
    gains = [
        min(
            map(
                abs,
                supervisor.robot.mechanism.posture(c.positions[0], supervisor.settings.assembly_mode).normalised_levers,
            )
        )
        for c in (toward, away)
    ]
    assert gains[0] < margin < gains[1], "the two ways do not lose and gain: the test proves nothing"
    assert passed(supervisor, away, limits=keep, share=0.05, prediction_delay_s=None).path is not None


@pytest.mark.parametrize(
    "command",
    [
        Command((1.0,), ((nan, 0.0),), ()),
        Command((1.0,), ((inf, 0.0),), ()),
        Command((nan,), ((0.1, 0.2),), ()),
        Command((-1.0,), ((0.1, 0.2),), ()),
        Command((1.0, 0.5), ((0.1, 0.2), (0.1, 0.2)), ()),
        Command((1.0,), ((0.1, 0.2, 0.3),), ()),
        Command((1.0,), ((0.1, 0.2),), ((1.0, 1.0),)),  # does not end at rest
    ],
)
def test_an_invalid_motion_is_held_with_a_reason(command):
    supervisor, _ = ready("irsbot2", START)
    found = passed(supervisor, command)
    assert found.path is None
    assert found.answer.text.startswith("held: ")


def test_no_points_and_no_permission_mean_hold():
    supervisor, _ = ready("irsbot2", START)
    assert passed(supervisor, Command((), (), ())).path is None
    path = to(supervisor, joints_of(supervisor, *SAFE))
    assert passed(supervisor, command_of(path), share=0.0).path is None


def test_a_moving_robot_is_not_sent_where_it_cannot_turn_to():
    supervisor, joints = ready("irsbot2", START)
    back = Command((0.001, 0.01), (tuple(np.array(joints) - 0.5), joints), ())
    found = passed(supervisor, back, velocity=(10.0, -10.0))
    assert found.path is None
    assert "cannot be joined" in found.answer.text


@pytest.mark.parametrize("points", [1, 40])
@pytest.mark.parametrize(("seconds", "outcome"), [(0.3, GateOutcome.SLOWED), (1.0, GateOutcome.SHORTENED)])
def test_what_a_moving_robot_drives_is_what_was_certified(seconds, outcome, points):
    """A controller begins with the present velocity, however slow the points are that it gets."""
    supervisor = supervisor_of("irsbot2")
    begin, ahead = (joints_of(supervisor, 0.6 + step, -0.8) for step in (0.0, 1e-5))
    velocity = tuple([1.5 * (b - a) / 1e-5 for a, b in zip(begin, ahead, strict=True)])  # 1.5 m/s
    for ms in range(-220, 1):
        q = tuple([a + 1e-3 * ms * rate for a, rate in zip(begin, velocity, strict=True)])
        supervisor.step(sample(ms, q, velocity))
    situation = situation_of(supervisor)
    assert situation.velocity == pytest.approx(velocity)
    goal, rest = joints_of(supervisor, 0.85, -0.8), (0.0, 0.0)
    whole = JointPath((0.0, seconds), (situation.at.joints, goal), (situation.velocity, rest))
    times = tuple(np.linspace(0.0, seconds, points + 1)[1:].tolist())
    found = passed(
        supervisor,
        Command(
            times,
            tuple([whole.at(time).position for time in times[:-1]] + [goal]),
            tuple([whole.at(time).velocity for time in times[:-1]] + [rest]),
        ),
    )
    assert found.path is not None or points > 1
    if found.path is None:
        return
    if points == 1:
        assert found.answer.outcome == outcome, "it passed as it was: the test proves nothing"
    driven = JointPath(found.path.times, found.path.positions, (situation.velocity, *found.path.velocities[1:]))
    assert driven.excess(joint_limits_of(supervisor.settings)) <= 1.0 + 1e-5
    kept = certify(
        supervisor.robot,
        supervisor.settings,
        driven.times,
        driven.positions,
        driven.velocities,
        limits=situation.limits,
        begin=situation.at,
        prediction_delay_s=situation.prediction_delay_s,
    )
    assert kept.safe, kept.violation
