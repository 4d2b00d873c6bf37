"""The point at which a moving robot is held: what a controller makes of it, whenever the message reaches it."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from irsbot_supervisor.gate.hold import hold
from irsbot_supervisor.trajectory.joint_path import JointPath

BRAKES = (40.0, 400.0)
rates = st.floats(-12.0, 12.0).map(lambda rate: round(rate, 3))
times = st.floats(0.0, 0.05).map(lambda time: round(time, 4))


@given(st.tuples(rates, rates), times, times, st.floats(0.0, 1.0))
def test_a_controller_that_joins_the_point_by_a_cubic_brakes_every_joint_within_its_limit(velocity, age, latency, late):
    """JointTrajectoryController: a cubic from its state when the message comes to the point, at rest there."""
    start = (0.3, -0.7)
    found = hold(start, velocity, BRAKES, age, latency, 0.01)
    came_s = age + late * latency  # after the measurement
    here = tuple(q + v * came_s for q, v in zip(start, velocity, strict=True))
    path = JointPath((0.0, found.after_s), (here, found.position), (velocity, (0.0, 0.0)))
    speeds, accelerations = path.peaks
    for speed, rate, acceleration, brake in zip(speeds, velocity, accelerations, BRAKES, strict=True):
        assert acceleration <= brake * (1.0 + 1e-9)
        assert speed <= abs(rate) * (1.0 + 1e-9)  # never faster than it was
    for share in range(11):
        for now, rate in zip(path.at(found.after_s * share / 10).velocity, velocity, strict=True):
            assert now * rate >= -1e-9  # no joint turns round


def test_a_robot_at_rest_is_held_where_it_is():
    found = hold((0.3, -0.7), (0.0, 0.0), BRAKES, 0.005, 0.01, 0.01)
    assert found.position == (0.3, -0.7)
    assert found.after_s > 0.0


def test_without_latency_the_fastest_joint_brakes_with_all_it_has():
    """Constant deceleration d from v: v/d long, v^2/(2d) far."""
    found = hold((0.0, 0.0), (2.0, 0.0), BRAKES, 0.0, 0.0, 1e-3)
    assert found.after_s == pytest.approx(2.0 / 40.0)
    assert found.position == pytest.approx((2.0 * 2.0 / (2 * 40.0), 0.0))


def test_an_unknown_rate_is_none():
    assert hold((0.3, -0.7), (float("nan"), 0.0), BRAKES, 0.0, 0.01, 0.01).position == (0.3, -0.7)
