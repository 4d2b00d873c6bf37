"""Ranges of joints: a robot is stopped before it leaves them, returns when it is out, and is not led out of them."""

from __future__ import annotations

from math import inf, nan, tau

import numpy as np
import pytest
from supervised import feed, joints_of, ready, reset, resting, sample, settings_of, supervisor_of, tick

from irsbot_msgs_py.records import Cause, Level
from irsbot_supervisor.core.escape import NO_ESCAPE
from irsbot_supervisor.core.estimation.estimate import Estimate, Speeds
from irsbot_supervisor.core.position_limits import PositionLimits
from irsbot_supervisor.core.settings import InvalidSettings
from irsbot_supervisor.core.stopping import limits_of
from irsbot_supervisor.gate.trajectory_gate import MotionGate, Situation
from irsbot_supervisor.sim.closed_loop import GuidedRobot
from irsbot_supervisor.trajectory.joint_path import Command
from irsbot_supervisor.trajectory.verification import certify

MIDDLE = (0.0, -0.85)
Q = tuple(joints_of(supervisor_of(), *MIDDLE))
ROOM = 0.3
"""rad from the middle to each end of the ranges."""

RANGES = {"position_lower": [q - ROOM for q in Q], "position_upper": [q + ROOM for q in Q]}


def test_inside_is_ok_and_outside_is_a_latched_stop_that_ends_by_a_reset_inside():
    supervisor, q = ready(pose=MIDDLE, **RANGES)
    outside = (q[0] + ROOM + 0.01, q[1])
    way = np.linspace(0.0, 1.0, 500)
    feed(supervisor, [sample(ms, np.add(q, share * np.subtract(outside, q))) for ms, share in enumerate(way)])
    feed(supervisor, resting(500, 800, outside))
    verdict = supervisor.step(tick(800)).verdict
    assert verdict is not None
    assert (verdict.level, verdict.latched) == (Level.STOP, True)
    assert verdict.causes & Cause.POSITION
    assert "'joint_1'" in verdict.text
    assert "the cause is still there" in supervisor.step(reset(801, verdict.event)).refusal
    feed(
        supervisor, [sample(802 + ms, np.add(outside, share * np.subtract(q, outside))) for ms, share in enumerate(way)]
    )
    feed(supervisor, resting(1302, 1600, q))
    assert supervisor.step(reset(1600, verdict.event)).refusal == ""


def test_a_robot_that_is_switched_on_at_rest_is_not_stopped_for_speeds_that_are_not_known_yet():
    room = 0.09  # rad: more than the box of a resting robot, less than the box while its speed is hardly known
    supervisor, _q = ready(pose=MIDDLE, position_upper=[Q[0] + room, Q[1] + ROOM])
    assert supervisor.step(tick(1)).verdict.level == Level.OK


@pytest.mark.parametrize(("ranges", "known"), [({}, True), (RANGES, False)], ids=["no range", "a range"])
def test_a_reading_that_jumps_by_a_turn_is_wrong_where_the_joint_has_a_range(ranges, known):
    """Without a range an angle may be read modulo a turn; with one, the range would count from the wrong turn."""
    supervisor, q = ready(pose=MIDDLE, **ranges)
    turned = (q[0] - tau, q[1])
    steps = feed(supervisor, resting(0, 400, turned))
    newest = [step.verdict for step in steps if step.verdict is not None][-1]
    assert (newest.level == Level.OK) == known
    assert known or newest.causes & (Cause.IMPLAUSIBLE | Cause.BRANCH)
    assert all(step.verdict.level != Level.OK for step in steps[20:] if step.verdict is not None) or known


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("rate", [1.0, 6.0])
def test_a_joint_that_runs_at_its_limit_is_stopped_inside(sign: float, rate: float):
    """The drives are those of the simulation, told to run on past the gate until the verdict."""
    settings, robot = settings_of("irsbot2", **RANGES)
    guided = GuidedRobot(robot, settings, Q, latency_s=0.5 * settings.latency_s)
    for _ in range(20):
        guided.drift()
    farthest, ways = 0.0, []
    for _ in range(100):
        if guided.now.level < Level.STOP:
            guided.rush((0.0, sign * rate))
        else:
            ways.append(guided.supervisor.escape)
            guided.drift()
        farthest = max(farthest, abs(guided.drives.now.position[1] - Q[1]))
    assert guided.now.level == Level.STOP
    assert guided.now.causes & Cause.POSITION
    assert ways[0] == ((0.0, -sign), Cause.POSITION)
    assert ways[-1] == NO_ESCAPE, "it stands within its range"
    assert 0.4 * ROOM < farthest < ROOM


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"position_lower": [nan, 0.0]}, "position_lower is nan"),
        ({"position_lower": [0.0, 0.0], "position_upper": [1.0, 0.0]}, "must be below"),
        ({"position_lower": [0.0, 0.0, 0.0]}, "one per joint"),
    ],
)
def test_ranges_that_mean_nothing_are_refused(change, words):
    with pytest.raises(InvalidSettings, match=words):
        settings_of("irsbot2", **change)


def test_the_gate_ends_a_velocity_command_in_front_of_the_limit_and_the_robot_is_not_stopped():
    settings, robot = settings_of("irsbot2", **RANGES)
    guided = GuidedRobot(robot, settings, Q)
    for _ in range(20):
        guided.drift()
    for _ in range(300):
        guided.beat((0.0, 4.0))
    assert guided.now.level < Level.STOP
    assert 0.5 * ROOM < guided.drives.now.position[1] - Q[1] < ROOM


def test_planned_motions_that_leave_a_range_are_refused_and_named():
    settings, robot = settings_of("irsbot2", **RANGES)
    inside, beyond = (Q[0], Q[1] + 0.9 * ROOM), (Q[0], Q[1] + 1.1 * ROOM)
    assert certify(robot, settings, [0.0, 1.0], [Q, inside]).safe
    found = certify(robot, settings, [0.0, 0.5, 1.0], [Q, inside, beyond]).violation
    assert found is not None
    assert found.cause == Cause.POSITION
    assert 0.5 < found.time_s < 1.0
    back = certify(robot, settings, [0.0, 1.0], [beyond, Q])
    assert back.safe, back.violation
    assert not certify(robot, settings, [0.0, 1.0], [beyond, (Q[0], Q[1] + 1.2 * ROOM)]).safe


def test_a_commanded_trajectory_ends_inside():
    settings, robot = settings_of("irsbot2", **RANGES)
    at = robot.mechanism.posture(Q, settings.assembly_mode)
    goal = (Q[0], Q[1] + 1.2 * ROOM)
    command = Command((1.0,), (goal,), ())
    allowed = MotionGate(settings, robot).motion(
        command, Situation(at, (0.0, 0.0), 1.0, limits_of(settings, "stop"), 0.004)
    )
    assert "leaves its range" in allowed.answer.text
    assert allowed.path is not None
    assert 0.5 * ROOM < max(point[1] for point in allowed.path.positions) - Q[1] < ROOM


@pytest.mark.parametrize("joint", [0, 1])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_verdict_has_the_way_back_into_the_range(joint: int, sign: float):
    supervisor, q = ready(pose=MIDDLE, **RANGES)
    away = sign * (ROOM + 0.01) * np.eye(2)[joint]
    way = np.linspace(0.0, 1.0, 500)
    feed(supervisor, [sample(ms, q + share * away) for ms, share in enumerate(way)])
    feed(supervisor, resting(len(way), 800, tuple(q + away)))
    stop = supervisor.step(tick(800)).verdict
    assert stop is not None
    assert stop.latched
    assert stop.escape_cause == Cause.POSITION
    assert tuple(stop.escape_direction) == tuple(-sign * np.eye(2)[joint])
    back = np.linalg.norm(away) * np.array(stop.escape_direction)
    feed(supervisor, [sample(801 + ms, q + away + share * back) for ms, share in enumerate(np.linspace(0.0, 1.0, 500))])
    feed(supervisor, resting(1301, 1600, q))
    assert supervisor.step(reset(1600, stop.event)).refusal == ""


def test_a_joint_that_can_reach_both_ends_of_its_range_has_no_way_back():
    settings, robot = settings_of("irsbot2", **RANGES)
    fast = Speeds((6.0, 6.0), (6.0, 0.0))
    near = (Q[0], Q[1] + 0.9 * ROOM)
    estimate = Estimate(1, 1, 1, near, (0.0, 0.0), (), fast, 0.02, 0.0, inf, 0.0, 0.0)
    limits = PositionLimits(settings, robot.mechanism.joints)
    assert len(limits.judge(estimate)) == 2
    assert limits.into_range(estimate) == (0.0, -1.0)


@pytest.mark.parametrize("joint", [0, 1])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_finding_names_the_limit_and_how_far_beyond_it_the_joint_may_get(joint: int, sign: float):
    settings, robot = settings_of("irsbot2", **RANGES)
    along = np.eye(2)[joint]
    at = np.add(Q, 0.99 * sign * ROOM * along)
    fast = 2.0 * along
    speeds = Speeds(tuple(fast), (0.0, 0.0)) if sign > 0.0 else Speeds((0.0, 0.0), tuple(fast))
    estimate = Estimate(1, 1, 1, tuple(at), (0.0, 0.0), (), speeds, 0.001, 0.0, inf, 0.0, 0.0)
    (finding,) = PositionLimits(settings, robot.mechanism.joints).judge(estimate)
    assert finding.limit == Q[joint] + sign * ROOM
    braking = 2.0**2 / (2.0 * settings.deceleration_limit[joint])
    assert sign * (finding.value - at[joint]) >= braking
    assert f"{finding.value:.4g} rad before standstill, limit {finding.limit:.4g}" in finding.text


def test_after_a_first_sample_only_the_place_counts():
    supervisor = supervisor_of(**RANGES)
    state = supervisor.step(sample(0, Q)).state
    assert state is not None
    assert not state.causes & Cause.POSITION
