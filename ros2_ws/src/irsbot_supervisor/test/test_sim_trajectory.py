"""Trajectories keep their limits, their path and their turn; checked on dense samples, not by their own arithmetic."""

from __future__ import annotations

import numpy as np
import pytest

from irsbot_kinematics import Robot, make_robot
from irsbot_supervisor.sim.errors import BadPath
from irsbot_supervisor.sim.paths import RoundedPath, corners_of
from irsbot_supervisor.sim.trajectory import MotionSequence, joint_move, nearest_turn, stand, task_move
from irsbot_supervisor.trajectory.joint_path import BadTrajectory, JointLimits, JointPath

LIMITS = JointLimits((12.0, 12.0), (400.0, 400.0), (400.0, 400.0))
START = (-0.1525, -0.85)
CYCLE = corners_of(START, [(0.0, 0.025), (0.305, 0.0), (0.0, -0.025)])
ROUNDING_M = 0.02


@pytest.fixture(scope="module")
def robot() -> Robot:
    return make_robot("irsbot2")


@pytest.fixture(scope="module")
def across(robot: Robot) -> JointPath:
    path = RoundedPath(CYCLE, ROUNDING_M, (1.0, 1.0))
    return task_move(robot.mechanism, path, (1, -1), tuple(robot.inverse(START)), LIMITS)


def sampled(path: JointPath, step_s: float) -> np.ndarray:
    return np.array([path.at(t).position for t in np.arange(0.0, path.duration_s, step_s)])


def distance_to_polyline(points: np.ndarray, corners: list[tuple[float, ...]]) -> np.ndarray:
    nearest = np.full(len(points), np.inf)
    for a, b in zip(np.array(corners[:-1]), np.array(corners[1:]), strict=True):
        share = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        nearest = np.minimum(nearest, np.linalg.norm(points - (a + share[:, None] * (b - a)), axis=1))
    return nearest


# --- paths in task space ----------------------------------------------------------------------------------------


def test_a_rounded_path_begins_and_ends_at_its_poses_and_cuts_corners_by_less_than_the_rounding():
    path = RoundedPath(CYCLE, ROUNDING_M, (1.0, 1.0))
    poses = path.at(np.linspace(0.0, path.length_m, 5001))
    assert np.allclose(poses[[0, -1]], [CYCLE[0], CYCLE[-1]], atol=1e-15)
    off = distance_to_polyline(poses, CYCLE)
    assert 0.0 < off.max() < ROUNDING_M
    # Exactly on the line wherever it is farther from a corner than the rounding.
    corner_distance = np.min([np.linalg.norm(poses - corner, axis=1) for corner in CYCLE[1:-1]], axis=0)
    assert off[corner_distance > ROUNDING_M].max() < 1e-15


def test_a_rounded_path_has_no_kink_and_no_jump_of_its_curvature():
    path = RoundedPath(CYCLE, ROUNDING_M, (1.0, 1.0))

    def largest_jumps(count: int) -> tuple[float, float]:
        s, step = np.linspace(0.0, path.length_m, count, retstep=True)
        first = np.diff(path.at(s), axis=0) / step
        second = np.diff(first, axis=0) / step
        return np.abs(np.diff(first, axis=0)).max(), np.abs(np.diff(second, axis=0)).max()

    # A kink would stay as large when the samples come ten times closer; a smooth curve changes ten times less.
    (kink, jump), (finer_kink, finer_jump) = largest_jumps(2001), largest_jumps(20001)
    assert finer_kink < 0.12 * kink
    assert finer_jump < 0.12 * jump


@pytest.mark.parametrize(
    ("corners", "rounding", "reason"),
    [
        ([(0.0, 0.0), (0.0, 0.0)], 0.0, "different poses"),
        ([(0.0, 0.0)], 0.0, "two or more"),
        ([(0.0, 0.0), (0.0, float("nan"))], 0.0, "different poses"),
        (CYCLE, 0.03, "piece 1, which is 0.025 m"),
        (CYCLE, -0.01, "rounding_m"),
        (CYCLE, float("nan"), "rounding_m"),
    ],
)
def test_a_path_that_cannot_be_driven_is_refused(corners, rounding, reason):
    with pytest.raises(BadPath, match=reason):
        RoundedPath(corners, rounding, (1.0, 1.0))


# --- strokes and swings -----------------------------------------------------------------------------------------


def test_finite_differences_of_a_stroke_stay_within_the_limits_and_reach_one(across):
    step = 2e-5
    q = sampled(across, step)
    velocity = np.abs(np.diff(q, axis=0)).max() / step
    acceleration = np.abs(np.diff(q, 2, axis=0)).max() / step**2
    assert velocity <= 12.0
    assert acceleration <= 400.0 * (1.0 + 1e-4)  # rounding of the second difference: 1e-16 rad / step^2
    assert acceleration >= 0.99 * 400.0, "no limit is used up: the motion could be faster"


def test_a_long_swing_is_limited_by_velocity_and_keeps_it_most_of_the_time():
    path = joint_move((0.0, 0.0), (5.0, 0.5), LIMITS)
    q = sampled(path, 1e-4)
    velocity = np.diff(q, axis=0) / 1e-4
    assert 0.98 * 12.0 < velocity.max() <= 12.0 * (1.0 + 1e-9)
    assert np.mean(velocity[:, 0] > 0.98 * 12.0) > 0.75
    # Straight in joint space: the joints keep their proportion.
    assert np.allclose(q[:, 1], 0.1 * q[:, 0], atol=1e-12)


def test_speed_scales_velocity_linearly_and_acceleration_quadratically(robot):
    fast, slow = (joint_move((0.0, 0.0), (1.0, -2.0), LIMITS, speed) for speed in (1.0, 0.5))
    assert np.allclose(slow.peaks[0], np.array(fast.peaks[0]) / 2.0)
    assert np.allclose(slow.peaks[1], np.array(fast.peaks[1]) / 4.0)


def test_the_platform_follows_the_path_and_rests_at_both_ends(robot, across):
    poses = robot.evaluate_many(sampled(across, 1e-4)).pose
    assert distance_to_polyline(poses, CYCLE).max() < ROUNDING_M
    for time, pose in ((0.0, CYCLE[0]), (across.duration_s, CYCLE[-1])):
        assert np.allclose(robot.direct(across.at(time).position), pose, atol=1e-12)
        assert across.at(time).velocity == (0.0, 0.0)


def test_a_joint_that_passes_half_a_turn_does_not_jump(robot):
    # Arm I is horizontal, q_I = pi, on the way: the inverse kinematics alone jumps there by a whole turn.
    corners = [(-0.1525, -0.85), (-0.1525, -0.65)]
    raw = np.array([robot.inverse((-0.1525, z))[0] for z in np.linspace(-0.85, -0.65, 50)])
    assert np.abs(np.diff(raw)).max() > 6.0, "the fixture does not cross half a turn"
    near = tuple(robot.inverse(corners[0]))
    path = task_move(robot.mechanism, RoundedPath(corners, 0.0, (1.0, 1.0)), (1, -1), near, LIMITS)
    assert np.abs(np.diff(sampled(path, 1e-4), axis=0)).max() < 12.0 * 1e-4 * (1.0 + 1e-9)


def test_a_stroke_begins_in_the_turn_the_joints_are_in(robot):
    begin = tuple(robot.inverse(START) + np.array([2.0, -4.0]) * np.pi)
    path = task_move(robot.mechanism, RoundedPath(CYCLE, ROUNDING_M, (1.0, 1.0)), (1, -1), begin, LIMITS)
    assert np.allclose(path.at(0.0).position, begin, atol=1e-12)
    assert np.allclose(nearest_turn(robot.mechanism, robot.inverse(START), begin), begin, atol=1e-12)


def test_a_stroke_out_of_the_workspace_is_refused_with_place_and_distance(robot):
    path = RoundedPath([(0.0, -0.8), (0.0, -1.25)], 0.0, (1.0, 1.0))
    with pytest.raises(BadPath, match=r"leaves the workspace at \(0, -1\.25\) by 50\.1 mm"):  # W2: 50.08 mm
        task_move(robot.mechanism, path, (1, -1), (0.0, 0.0), LIMITS)


def test_peaks_are_those_of_dense_samples_even_between_knots():
    rng = np.random.default_rng(0)
    path = JointPath((0.0, 0.3, 1.0), *(tuple(map(tuple, rng.normal(size=(3, 2)))) for _ in range(2)))
    points = [path.at(t) for t in np.linspace(0.0, 1.0, 20000, endpoint=False)]
    for peaks, kind in ((path.peaks[0], "velocity"), (path.peaks[1], "acceleration")):
        dense = np.abs([getattr(point, kind) for point in points]).max(axis=0)
        assert np.allclose(peaks, dense, rtol=1e-3)
        assert (np.array(peaks) >= dense * (1.0 - 1e-12)).all()


def test_a_joint_path_passes_its_points_with_their_velocities():
    path = JointPath((0.0, 0.5, 2.0), ((0.0,), (1.0,), (-1.0,)), ((0.0,), (3.0,), (0.0,)))
    assert path.at(0.5).position == (1.0,)
    assert path.at(0.5).velocity == (3.0,)
    assert path.at(0.5 - 1e-9).position == pytest.approx((1.0,), abs=1e-8)
    assert path.at(0.5 - 1e-9).velocity == pytest.approx((3.0,), abs=1e-6)
    for outside, position in ((-1.0, (0.0,)), (2.0, (-1.0,)), (9.0, (-1.0,))):
        assert path.at(outside) == (position, (0.0,), (0.0,))


@pytest.mark.parametrize(
    ("times", "rows"), [((0.0, 0.0), 2), ((0.1, 0.2), 2), ((0.0, float("nan")), 2), ((0.0, float("inf")), 2), ((), 0)]
)
def test_a_joint_path_needs_finite_increasing_times_from_0(times, rows):
    with pytest.raises(BadTrajectory):
        JointPath(times, ((0.0,),) * rows, ((0.0,),) * rows)


@pytest.mark.parametrize("bad", [0.0, -1.0, float("nan"), float("inf")])
def test_limits_must_be_positive_and_finite(bad):
    with pytest.raises(BadTrajectory):
        JointLimits((1.0,), (bad,), (1.0,))


# --- courses ----------------------------------------------------------------------------------------------------


def test_a_course_repeats_its_parts_and_then_rests():
    there, back = joint_move((0.0,), (1.0,), _one(LIMITS)), joint_move((1.0,), (0.0,), _one(LIMITS))
    cycle = MotionSequence([(there, 1), (back, 1)])
    sequence = MotionSequence([(stand((0.0,), 0.5), 1), (cycle, 3), (there, 1)])
    period = there.duration_s + back.duration_s
    assert sequence.duration_s == pytest.approx(0.5 + 3.0 * period + there.duration_s)
    for k in range(3):
        assert sequence.at(0.5 + k * period + there.duration_s + 0.01).position == pytest.approx(back.at(0.01).position)
    assert sequence.at(0.25).position == (0.0,)
    assert sequence.at(1e9) == ((1.0,), (0.0,), (0.0,))


def test_a_motion_may_be_repeated_without_end():
    cycle = MotionSequence(
        [(joint_move((0.0,), (1.0,), _one(LIMITS)), 1), (joint_move((1.0,), (0.0,), _one(LIMITS)), 1)]
    )
    sequence = MotionSequence([(cycle, float("inf"))])
    assert sequence.duration_s == float("inf")
    assert sequence.at(12345 * cycle.duration_s + 0.01).position == pytest.approx(cycle.at(0.01).position, abs=1e-6)


def _one(limits: JointLimits) -> JointLimits:
    return JointLimits(limits.velocity[:1], limits.acceleration[:1], limits.deceleration[:1])
