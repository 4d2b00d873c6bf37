"""The drives follow exactly, brake as the stopping prediction assumes, and never exceed their limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from irsbot_supervisor.sim.joints import Drives
from irsbot_supervisor.sim.trajectory import MotionSequence, joint_move, stand
from irsbot_supervisor.trajectory.joint_path import BadTrajectory, JointLimits, JointPoint, commanded

LIMITS = JointLimits((12.0, 12.0), (400.0, 400.0), (400.0, 250.0))
PERIOD_S = 0.001


@dataclass(frozen=True)
class Steady:
    """A motion at constant velocity."""

    rates: tuple[float, ...]
    duration_s: float = float("inf")

    def at(self, time_s: float) -> JointPoint:
        return JointPoint(tuple(rate * time_s for rate in self.rates), self.rates, (0.0,) * len(self.rates))


def to_and_fro() -> MotionSequence:
    there = joint_move((0.0, 0.0), (1.0, -0.7), LIMITS)
    return MotionSequence(
        [(MotionSequence([(there, 1), (joint_move((1.0, -0.7), (0.0, 0.0), LIMITS), 1)]), float("inf"))]
    )


def running(rates: tuple[float, ...], latency_s: float = 0.0) -> Drives:
    """Drives at constant velocity, long after their start."""
    drives = Drives(Steady(rates), LIMITS, latency_s)
    for _ in range(200):
        drives.step(PERIOD_S, 1.0)
    assert drives.now.velocity == rates, "the drives do not run steadily: the fixture proves nothing"
    return drives


def stop(drives: Drives, period_s: float = PERIOD_S, limit: int = 1000) -> int:
    """Brake until standstill; returns the number of periods."""
    for count in range(limit):
        if drives.stands:
            return count
        drives.step(period_s, 0.0)
    raise AssertionError("the joints do not stop")


# --- following --------------------------------------------------------------------------------------------------


def test_drives_that_may_move_are_exactly_on_their_motion():
    motion = to_and_fro()
    drives = Drives(motion, LIMITS)
    for k in range(1, 1500):
        assert drives.step(PERIOD_S, 1.0).position == pytest.approx(motion.at(k * PERIOD_S).position, abs=1e-12)


def test_drives_stand_until_they_may_move():
    drives = Drives(to_and_fro(), LIMITS)
    for _ in range(100):
        assert drives.step(PERIOD_S, 0.0) == ((0.0, 0.0), (0.0, 0.0), (0.0, 0.0))
    drives.step(PERIOD_S, 1.0)
    drives.step(PERIOD_S, 1.0)
    assert not drives.stands


def test_a_speed_scale_slows_the_motion_on_its_path():
    drives = Drives(to_and_fro(), LIMITS)
    for _ in range(60):
        drives.step(PERIOD_S, 1.0)
    fast = abs(drives.now.velocity[0])
    speeds = []
    for _ in range(2000):
        q = drives.step(PERIOD_S, 0.25)
        assert q.position[1] == pytest.approx(-0.7 * q.position[0], abs=1e-9)  # still on the straight line
        speeds.append(abs(q.velocity[0]))
    assert max(speeds[200:]) == pytest.approx(0.25 * joint_move((0.0, 0.0), (1.0, -0.7), LIMITS).peaks[0][0], rel=0.01)
    assert fast > 2.0 * max(speeds[200:])


# --- braking ----------------------------------------------------------------------------------------------------


@given(
    st.tuples(st.floats(-12.0, 12.0), st.floats(-12.0, 12.0)).filter(lambda v: all(abs(x) > 1e-3 for x in v)),
    st.floats(1e-4, 0.05),
)
def test_every_joint_brakes_over_v2_by_2a_for_every_step(rates, period_s):
    drives = running(rates)
    begin = drives.now.position
    drives.step(period_s, 0.0)
    stop(drives, period_s)
    travel = np.subtract(drives.now.position, begin)
    assert travel == pytest.approx([v * abs(v) / (2.0 * a) for v, a in zip(rates, (400.0, 250.0), strict=True)])


def test_each_joint_stands_after_its_own_time_v_by_a():
    drives = running((12.0, 12.0))  # 30 ms at 400 rad/s2, 48 ms at 250 rad/s2
    rates = np.array([drives.step(PERIOD_S, 0.0).velocity for _ in range(60)])
    expected = np.maximum(12.0 - np.outer(np.arange(1, 61) * PERIOD_S, [400.0, 250.0]), 0.0)
    assert np.allclose(rates, expected, atol=1e-9)


@pytest.mark.parametrize("latency_s", [0.0, 0.0004, 0.001, 0.0107])
def test_latency_adds_v_times_latency_to_the_way_of_braking(latency_s):
    drives = running((6.0, -8.0), latency_s)
    begin = drives.now.position
    for _ in range(100):
        drives.step(PERIOD_S, 0.0)
    assert drives.stands
    travel = np.subtract(drives.now.position, begin)
    expected = [6.0 * latency_s + 36.0 / 800.0, -8.0 * latency_s - 64.0 / 500.0]
    assert travel == pytest.approx(expected, abs=1e-12)


def test_a_share_that_is_not_a_number_brakes():
    drives = running((5.0, 5.0))
    drives.step(PERIOD_S, float("nan"))
    assert drives.now.velocity == pytest.approx((5.0 - 0.4, 5.0 - 0.25))


def test_released_joints_return_to_where_they_left_and_go_on():
    motion = to_and_fro()
    drives = Drives(motion, LIMITS)
    for _ in range(60):
        drives.step(PERIOD_S, 1.0)
    left = drives.now.position
    stop(drives)
    assert abs(drives.now.position[0] - left[0]) > 0.01, "braking did not lead away: the fixture proves nothing"
    passed = []
    for _ in range(3000):
        drives.step(PERIOD_S, 1.0)
        passed.append(drives.now.position)
    assert np.abs(np.subtract(passed, left)).max(axis=1).min() < 1e-9
    assert np.max(passed, axis=0)[0] == pytest.approx(1.0, abs=1e-3)  # the whole motion again
    assert np.min(passed, axis=0)[0] == pytest.approx(0.0, abs=1e-3)


def test_joints_released_while_they_brake_stop_before_they_move_on():
    drives = Drives(to_and_fro(), LIMITS)
    for _ in range(60):
        drives.step(PERIOD_S, 1.0)
    drives.step(PERIOD_S, 0.0)
    for _ in range(100):
        drives.step(PERIOD_S, 1.0)
        if drives.stands:
            return
    raise AssertionError("the joints never stood")


@pytest.mark.parametrize("seed", range(4))
def test_velocity_and_acceleration_stay_within_limits_for_every_allowed_share(seed):
    rng = np.random.default_rng(seed)
    drives = Drives(to_and_fro(), LIMITS, latency_s=0.0023)
    positions, rates = [], []
    allowed = 1.0
    for _ in range(8000):
        if rng.random() < 0.02:
            allowed = rng.choice([0.0, 1.0, 1.0, 0.1, 0.7, float("nan")])
        positions.append(drives.step(PERIOD_S, allowed).position)
        rates.append(drives.now.velocity)
    q, v = np.array(positions), np.array(rates)
    assert np.ptp(q[:, 0]) > 0.9, "the joints hardly moved: the fixture proves nothing"
    assert np.abs(np.diff(q, axis=0)).max() / PERIOD_S <= 12.0 * (1.0 + 1e-9)
    assert np.abs(np.diff(v, axis=0)).max() / PERIOD_S <= 400.0 * (1.0 + 1e-6)
    # Positions are the integral of the velocities: no joint is ever moved without them saying so.
    assert np.abs(np.diff(q, axis=0) - 0.5 * PERIOD_S * (v[1:] + v[:-1])).max() < 400.0 * PERIOD_S**2


# --- commands ---------------------------------------------------------------------------------------------------


def drive(drives: Drives, periods: int) -> np.ndarray:
    return np.array([drives.step(PERIOD_S, 1.0).position for _ in range(periods)])


def test_a_command_is_followed_from_standstill():
    drives = Drives(stand((0.0, 0.0)), LIMITS)
    drives.follow((0.5, 1.0), ((0.5, 0.0), (1.0, 0.1)), ())
    passed = drive(drives, 1100)
    assert passed[499] == pytest.approx((0.5, 0.0), abs=1e-9)
    assert passed[-1] == pytest.approx((1.0, 0.1), abs=1e-12)


def test_a_command_that_asks_too_much_is_slowed_down_to_the_limits():
    drives = Drives(stand((0.0, 0.0)), LIMITS)
    drives.follow((0.0, 0.01, 0.02), ((0.1, 0.1), (1.0, 0.0), (0.0, 0.0)), ())
    q = drive(drives, 3000)
    assert q.max() == pytest.approx(1.0, abs=1e-3)
    assert q[-1] == pytest.approx((0.0, 0.0), abs=1e-9)
    assert np.abs(np.diff(q, axis=0)).max() / PERIOD_S <= 12.0 * (1.0 + 1e-9)
    assert np.abs(np.diff(q, 2, axis=0)).max() / PERIOD_S**2 <= 400.0 * 1.01


def test_a_command_within_limits_is_joined_without_stopping():
    drives = running((2.0, -1.0))
    q1, q2 = drives.now.position
    drives.follow((0.1, 0.3), ((q1 + 0.2, q2 - 0.1), (q1 + 0.4, q2 - 0.2)), ((2.0, -1.0), (0.0, 0.0)))
    drives.step(0.05, 1.0)
    assert drives.now.velocity == pytest.approx((2.0, -1.0), abs=1e-6)


def test_an_impossible_turn_is_made_from_standstill():
    drives = running((10.0, 0.0))
    target = (drives.now.position[0] - 1.0, 0.0)
    drives.follow((0.01,), (target,), ())
    rates = np.diff(drive(drives, 1500)[:, 0]) / PERIOD_S
    assert np.abs(np.diff(rates)).max() / PERIOD_S <= 400.0 * 1.01
    assert drives.now.position == pytest.approx(target, abs=1e-9)


def test_an_empty_command_stops_the_joints_and_they_stay():
    drives = running((8.0, -8.0))
    begin = np.array(drives.now.position)
    drives.follow((), (), ())
    drive(drives, 300)
    assert drives.now.position - begin == pytest.approx((64.0 / 800.0, -64.0 / 500.0), abs=1e-9)
    assert drives.stands


def test_a_command_does_not_move_joints_that_must_brake():
    drives = Drives(stand((0.0, 0.0)), LIMITS)
    drives.follow((0.5,), ((1.0, 1.0),), ())
    for _ in range(600):
        drives.step(PERIOD_S, 0.0)
    assert drives.now.position == (0.0, 0.0)


@pytest.mark.parametrize(
    ("times", "positions", "velocities", "reason"),
    [
        ((1.0,), ((0.0,),), (), "2 positions"),
        ((1.0,), ((0.0, 0.0),), ((0.0,),), "2 velocities"),
        ((1.0, 0.5), ((0.0, 0.0),) * 2, (), "increase"),
        ((-1.0,), ((0.0, 0.0),), (), "past"),
        ((float("nan"),), ((0.0, 0.0),), (), "past"),
        ((1.0,), ((0.0, float("inf")),), (), "finite"),
        ((1.0,), ((0.0, 0.0),), ((1.0, 0.0),), "at rest"),
    ],
)
def test_a_command_that_is_no_motion_is_refused_and_changes_nothing(times, positions, velocities, reason):
    drives = running((1.0, 1.0))
    with pytest.raises(BadTrajectory, match=reason):
        drives.follow(times, positions, velocities)
    drives.step(PERIOD_S, 1.0)
    assert drives.now.velocity == (1.0, 1.0)


def test_joints_of_a_command_are_picked_by_name():
    command = commanded(("a", "b"), ["b", "a"], [1.0, 2.0], [[1.0, 2.0], [3.0, 4.0]], [[5.0, 6.0], [0.0, 0.0]])
    assert command == ((1.0, 2.0), ((2.0, 1.0), (4.0, 3.0)), ((6.0, 5.0), (0.0, 0.0)))


@pytest.mark.parametrize("names", [["a"], ["a", "c"], ["a", "a"], ["a", "b", "c"], []])
def test_a_command_that_does_not_name_every_joint_once_is_refused(names):
    with pytest.raises(BadTrajectory, match="the joints are a, b"):
        commanded(("a", "b"), names, [1.0], [[0.0] * len(names)], [[]])
