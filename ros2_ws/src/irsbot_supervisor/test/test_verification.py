"""Certificates of planned motions against dense sampling, and the first violation against bisection."""

from __future__ import annotations

import math
import re
from itertools import pairwise

import numpy as np
import pytest

import irsbot_kinematics as irs
from irsbot_msgs_py.records import Cause
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.trajectory.joint_path import BadTrajectory
from irsbot_supervisor.trajectory.verification import certify

SETTINGS, ROBOT = read_settings("irsbot2")


def _line(start: tuple[float, float], end: tuple[float, float], points: int) -> np.ndarray:
    poses = np.linspace(start, end, points)
    joints, status, _box = ROBOT.inverse_many(poses)
    assert not status.any(), "pose outside the workspace: the fixture proves nothing"
    return np.unwrap(joints, axis=0)


def _sampled(robot: irs.Robot, q: np.ndarray) -> tuple[float, float, float]:
    found = robot.evaluate_many(q)
    return found.type1_margin.min(), found.type2_margin.min(), found.constraint_margin.min()


def test_clean_work_is_certified_and_its_minima_bound_the_sampled_ones() -> None:
    q = _line((-0.2, -0.8), (0.2, -0.75), 200)
    found = certify(ROBOT, SETTINGS, np.linspace(0.0, 1.0, 200).tolist(), q.tolist())
    assert found.safe
    dense = np.concatenate([np.linspace(a, b, 20) for a, b in pairwise(q)])
    for (bound, _time), true in zip(found.minima, _sampled(ROBOT, dense), strict=False):
        assert 0.0 < bound <= true + 1e-12
    assert found.minima[3][0] == math.inf  # this robot has no limb margin


def test_the_first_violation_is_where_the_margin_falls_below_its_limit() -> None:
    """Straight along x at z = -0.8, out of the workspace side: the far leg stretches."""
    times = np.linspace(0.0, 2.0, 400)
    q = _line((0.0, -0.8), (0.878, -0.8), 400)
    found = certify(ROBOT, SETTINGS, times.tolist(), q.tolist())
    assert found.violation is not None
    assert found.violation.cause in (Cause.TYPE1, Cause.TYPE2)
    name = "type1_margin" if found.violation.cause == Cause.TYPE1 else "type2_margin"
    limit = found.violation.limit
    dense_t = np.linspace(0.0, 2.0, 200_000)
    dense_q = np.column_stack([np.interp(dense_t, times, column) for column in q.T])
    margin = getattr(ROBOT.evaluate_many(dense_q), name)
    margin = margin.min(axis=1) if margin.ndim == 2 else margin
    first = dense_t[np.argmax(margin < limit)]
    # Encoder errors count too: the certificate may end a little before the true crossing, never after it.
    assert first - 0.01 <= found.violation.time_s <= first + 1e-4


def test_a_violation_by_errors_of_encoders_is_explained() -> None:
    q = _line((0.3, -0.75), (0.92, -0.75), 200)
    found = certify(ROBOT, SETTINGS, np.linspace(0.0, 1.0, 200).tolist(), q.tolist())
    assert found.violation is not None
    lost = re.search(r", (\S+) less with errors of encoders and geometry, limit 0.1500$", found.violation.text)
    assert lost is not None
    assert 0.0 <= found.violation.value - found.violation.limit <= float(lost[1]) * 1.01


def test_cubics_are_followed_between_their_points() -> None:
    """Two points at the same place, but with a velocity that swings the legs far out in between and back."""
    q = ROBOT.inverse((0.0, -0.8)).tolist()
    still = certify(ROBOT, SETTINGS, [0.0, 1.0], [q, q])
    swinging = certify(ROBOT, SETTINGS, [0.0, 1.0], [q, q], [[16.0, -16.0], [16.0, -16.0]])
    assert still.safe
    assert swinging.violation is not None
    assert 0.0 < swinging.violation.time_s < 1.0


@pytest.mark.parametrize("seed", range(6))
def test_no_certificate_is_contradicted_by_dense_sampling(seed: int) -> None:
    rng = np.random.default_rng(seed)
    start = ROBOT.inverse(rng.uniform((-0.5, -0.95), (0.5, -0.55)))
    knots = start + np.cumsum(rng.normal(0.0, 0.12, (12, 2)), axis=0)
    rates = rng.normal(0.0, 1.0, (12, 2))
    times = np.linspace(0.0, 1.1, 12)
    found = certify(ROBOT, SETTINGS, times.tolist(), knots.tolist(), rates.tolist())
    from scipy.interpolate import CubicHermiteSpline

    end = found.violation.time_s if found.violation else times[-1]
    dense = CubicHermiteSpline(times, knots, rates)(np.linspace(0.0, end, 20_000)[:-1])
    if len(dense):
        limits = (SETTINGS.type1_stop, SETTINGS.type2_stop, SETTINGS.constraint_stop)
        for true, limit in zip(_sampled(ROBOT, dense), limits, strict=True):
            assert true >= limit


def test_a_motion_that_begins_in_another_mode_is_not_certified() -> None:
    q = ROBOT.inverse((0.3, -0.75), (-1, 1)).tolist()
    found = certify(ROBOT, SETTINGS, [0.0, 1.0], [q, q], assembly_mode=1)  # sheet W1: sin(psi_I - psi_II) > 0
    assert found.violation is not None
    assert found.violation.cause == Cause.BRANCH


@pytest.mark.parametrize(
    ("times", "positions", "velocities"),
    [
        ([], [], []),
        ([0.0, 0.0], [[0.0, 0.0]] * 2, []),
        ([0.0, 1.0], [[0.0], [0.0]], []),
        ([0.0, 1.0], [[0.0, math.nan]] * 2, []),
        ([0.0, math.inf], [[0.0, 0.0]] * 2, []),
        ([0.0, 1.0], [[0.0, 0.0]] * 2, [[0.0, 0.0]]),
        ([0.0, 1.0], [[0.0, 0.0]] * 2, [[0.0, math.nan]] * 2),
    ],
)
def test_points_that_are_no_motion_are_refused(
    times: list[float], positions: list[list[float]], velocities: list[list[float]]
) -> None:
    with pytest.raises(BadTrajectory):
        certify(ROBOT, SETTINGS, times, positions, velocities)
