"""The limbs of the 4-RUU: wrenches, limb margins, couples."""

from __future__ import annotations

from math import cos, hypot, sin

import numpy as np
import pytest
from cranks import ROBOTS, closure, layout, random_poses, rods

from irsbot_kinematics import Status, limbs
from irsbot_kinematics.numerics.arithmetic import FLOATS

# --- the limbs of the 4-RUU ----------------------------------------------------------------------------------------


def test_the_wrenches_of_a_ruu_leg_do_no_work_on_the_joints_that_they_should_not_feel():
    """The force along the rod on the four passive joints, the couple about its horizontal direction on all five."""
    robot, rng = ROBOTS["4-RUU"], np.random.default_rng(15)
    A, _, l1, _ = layout(robot)
    for q, x, _ in random_poses(robot, rng, 10):
        for foot, angle, rod in zip(A, q, rods(robot, q, x), strict=True):
            b = foot + l1 * np.array([cos(angle), sin(angle), 0.0])
            m = np.cross((0, 0, 1), rod)
            twists = limbs.ruu_twists(foot, b, b + rod, (0, 0, 1), m)
            force = np.concatenate([rod, np.cross(b, rod)])
            couple = np.concatenate([np.zeros(3), [rod[0], rod[1], 0.0]])
            power = [twist[3:] @ force[:3] + twist[:3] @ force[3:] for twist in twists]
            np.testing.assert_allclose(power[1:], 0.0, atol=1e-12)
            assert abs(power[0]) > 1e-4
            np.testing.assert_allclose(twists[:, :3] @ couple[3:], 0.0, atol=1e-12)


def test_limb_margins_are_those_of_the_factors():
    robot, rng = ROBOTS["4-RUU"], np.random.default_rng(16)
    for q, x, _ in random_poses(robot, rng, 20):
        at = robot.mechanism.at(tuple(q), tuple(x), 1, (0.0, 1.0))
        for angle, rod, margin in zip(q, rods(robot, q, x), at.limb, strict=True):
            bc = (rod / np.linalg.norm(rod)).tolist()
            factors = limbs.ruu_factors(FLOATS, (cos(angle), sin(angle), 0.0), bc, (0.0, 0.0, 1.0))
            assert margin == pytest.approx(min(factors), abs=1e-12)


def test_the_constraint_margin_is_the_second_singular_value_of_the_couples():
    robot, rng = ROBOTS["4-RUU"], np.random.default_rng(17)
    for q, x, _ in random_poses(robot, rng, 20):
        level = rods(robot, q, x)[:, :2]
        level = level / np.linalg.norm(level, axis=1, keepdims=True)
        at = robot.mechanism.at(tuple(q), tuple(x), 1, (0.0, 1.0))
        assert at.constraint == pytest.approx(np.linalg.svd(level)[1][1] / np.sqrt(2), abs=1e-12)
    four = [(0.6, 0.8), (-0.6, -0.8), (0.6, 0.8), (0.6, 0.8)]
    assert robot.mechanism.constraint_margin(FLOATS, four) == 0.0
    assert robot.mechanism.constraint_margin(FLOATS, [(1.0, 0.0), (0.0, 1.0)] * 2) == 1.0


def test_symmetric_cranks_of_equal_sign_leave_the_4_ruu_free_to_screw():
    """phi and z change together while no crank moves: every turn closes, and no pose is given."""
    robot = ROBOTS["4-RUU"]
    q = robot.inverse((0.0, 0.0, -0.4, 0.0), (1, 1, 1, 1))
    for turn in (0.0, 0.1, 0.2):
        size = hypot(*rods(robot, q, (0.0, 0.0, 0.0, turn))[0])
        x = (0.0, 0.0, -np.sqrt(0.6**2 - size**2), turn)
        assert np.abs(closure(robot, q, x)).max() < 1e-12
    assert {robot.mechanism.posture(tuple(q), label).status for label in robot.mechanism.assembly_modes} == {
        Status.SINGULAR
    }
