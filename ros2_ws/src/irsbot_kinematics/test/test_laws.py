"""Laws that hold for every robot of the library, against loop closures written independently (oracles/closures.py)."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from closures import CLOSURES, close, unit_jacobians
from hypothesis import given
from hypothesis import strategies as st
from postures import NAMES, ROBOTS, Sample, apart, random_joints, samples, vectors

from irsbot_kinematics.mechanisms import TOPOLOGIES

pytestmark = pytest.mark.slow

ROUNDING = 1e-12
"""Relative: some ten thousand units in the last place, for chains of a few dozen operations."""
STENCIL_S = 2e-4
"""s: step of the five-point stencils; rounding is then about 1e-15/h^2 = 3e-8 in an acceleration."""
STENCIL_TOL = 1e-5
"""Relative: truncation is below h^4 x 1e9, the size of the sixth derivative at margins of 0.1."""

every_robot = pytest.mark.parametrize("name", NAMES)


def closure_of(name):
    mechanism = ROBOTS[name].mechanism
    return CLOSURES[mechanism.kind], mechanism.geometry


def test_every_topology_has_a_preset_and_an_independent_closure():
    assert set(TOPOLOGIES) <= set(NAMES)
    assert set(TOPOLOGIES) <= set(CLOSURES)


@every_robot
@given(data=st.data())
def test_every_solution_of_the_inverse_kinematics_closes_the_loops(name, data):
    robot = ROBOTS[name]
    closure, geometry = closure_of(name)
    s = data.draw(samples(robot))
    solutions = robot.inverse_all(s.x)
    assert solutions
    for q in solutions:
        assert np.abs(closure(geometry, q, s.x)).max() < ROUNDING * robot.mechanism.length_m**2 / min(s.at.type1)


@every_robot
@given(data=st.data())
def test_the_joints_are_among_the_solutions_of_their_own_pose_and_in_the_mode_that_they_carry(name, data):
    robot = ROBOTS[name]
    s = data.draw(samples(robot))
    q = robot.inverse(s.x, s.at.working_mode)
    assert apart(robot, q, s.q, joints=True).max() < ROUNDING / (min(s.at.type1) * s.at.type2)


@every_robot
@given(data=st.data())
def test_the_direct_kinematics_gives_back_the_pose_in_exactly_one_assembly_mode(name, data):
    robot = ROBOTS[name]
    s = data.draw(samples(robot, type1=0.01, type2=0.01))
    for q in robot.inverse_all(s.x):
        found = []
        for mode in robot.mechanism.assembly_modes:
            at = robot.mechanism.posture(tuple(q.tolist()), mode)
            if at.status == 0 and apart(robot, at.pose, s.x).max() < ROUNDING / at.type2:
                found.append(mode)
        A, _ = unit_jacobians(*closure_of(name), q, s.x)
        singular = abs(np.linalg.det(A)) < 1e-6 * robot.mechanism.length_m  # then two modes meet
        assert len(found) == 1 or (singular and (found or not robot.mechanism.label_is_invariant))


@every_robot
@given(data=st.data())
def test_poses_of_different_assembly_modes_all_close_and_differ(name, data):
    robot = ROBOTS[name]
    closure, geometry = closure_of(name)
    s = data.draw(samples(robot, type2=0.01))
    poses = robot.direct_all(s.q)
    for i, x in enumerate(poses):
        assert np.abs(closure(geometry, s.q, x)).max() < ROUNDING * max(robot.mechanism.length_m**2, 1.0) * 10
        for other in poses[:i]:
            assert apart(robot, x, other).max() > 1e-6


@every_robot
@given(data=st.data())
def test_jacobians_are_the_gradients_of_the_closure_per_unit_of_force(name, data):
    robot = ROBOTS[name]
    s = data.draw(samples(robot))
    A, B = robot.jacobians(s.x, s.q)
    A_expected, B_expected = unit_jacobians(*closure_of(name), s.q, s.x)
    folded = s.at.gaps[1] / robot.mechanism.length_m  # a leg folded to nothing has no direction
    tolerance = ROUNDING * robot.mechanism.length_m / min(*s.at.type1, folded)
    sign = np.sign(np.sum(A * A_expected, axis=1, keepdims=True))  # a screw may point either way, its lever with it
    np.testing.assert_allclose(sign * A, A_expected, rtol=0, atol=tolerance)
    np.testing.assert_allclose(sign * B, B_expected, rtol=0, atol=tolerance)


def calm(robot, s: Sample, rates):
    """Rates at which the platform is no faster than 5 m/s or rad/s: the truncation of the stencils grows with its
    fifth power, and a small det A makes a platform fast."""
    return rates / max(1.0, np.abs(robot.velocity(s.x, s.q, rates)).max() / 5.0)


def motion(s: Sample, rates, accelerations):
    """q(t) with the given derivatives at t = 0, with a jerk, so that a wrong order of terms shows."""
    return lambda t: s.q + rates * t + accelerations * t * t / 2.0 + rates * t**3


def poses_along(name, s, path):
    closure, geometry = closure_of(name)
    return [close(closure, geometry, path(i * STENCIL_S), s.x) for i in (-2, -1, 0, 1, 2)]


@every_robot
@given(data=st.data())
def test_velocity_is_the_first_difference_of_the_poses_along_a_motion(name, data):
    robot = ROBOTS[name]
    s = data.draw(samples(robot, type1=0.1, type2=0.1))
    rates, accelerations = (data.draw(vectors(len(s.q), 3.0)) for _ in range(2))
    rates = calm(robot, s, rates)
    a, b, _, d, e = poses_along(name, s, motion(s, rates, accelerations))
    expected = (a - 8 * b + 8 * d - e) / (12 * STENCIL_S)
    velocity = robot.velocity(s.x, s.q, rates)
    np.testing.assert_allclose(velocity, expected, rtol=STENCIL_TOL, atol=STENCIL_TOL)


@every_robot
@given(data=st.data())
def test_acceleration_is_the_second_difference_of_the_poses_along_a_motion(name, data):
    robot = ROBOTS[name]
    s = data.draw(samples(robot, type1=0.1, type2=0.2))
    rates, accelerations = (data.draw(vectors(len(s.q), 3.0)) for _ in range(2))
    rates = calm(robot, s, rates)
    a, b, c, d, e = poses_along(name, s, motion(s, rates, accelerations))
    expected = (-a + 16 * b - 30 * c + 16 * d - e) / (12 * STENCIL_S**2)
    acceleration = robot.acceleration(s.x, s.q, rates, accelerations)
    scale = 1.0 + np.abs(expected).max()
    np.testing.assert_allclose(acceleration, expected, rtol=0, atol=STENCIL_TOL * scale)


@every_robot
@given(data=st.data())
def test_motor_efforts_do_the_work_that_the_external_wrench_takes(name, data):
    robot = ROBOTS[name]
    s = data.draw(samples(robot))
    rates, wrench = data.draw(vectors(len(s.q), 3.0)), data.draw(vectors(len(s.x), 50.0))
    A, B = unit_jacobians(*closure_of(name), s.q, s.x)
    twist = np.linalg.solve(A, -B @ rates)
    efforts = robot.efforts(s.x, s.q, wrench)
    scale = 1.0 + np.abs(efforts) @ np.abs(rates) + np.abs(wrench) @ np.abs(twist)
    assert abs(efforts @ rates + wrench @ twist) < ROUNDING * scale / s.at.type2 / min(s.at.type1)


@every_robot
@given(data=st.data())
def test_leg_forces_balance_the_external_wrench_on_the_platform(name, data):
    robot = ROBOTS[name]
    s = data.draw(samples(robot))
    wrench = data.draw(vectors(len(s.x), 50.0))
    forces = robot.reactions(s.x, s.q, wrench)
    A, _ = robot.jacobians(s.x, s.q)  # checked above against the closure
    assert np.abs(A.T @ forces + wrench).max() < ROUNDING * (1.0 + np.abs(forces).max()) / s.at.type2


def directions(size: int) -> np.ndarray:
    """Unit vectors all around: every tenth of a degree in the plane, a Fibonacci spiral on the sphere."""
    if size == 2:
        angle = np.arange(3600) * np.pi / 1800
        return np.stack([np.cos(angle), np.sin(angle)], axis=1)
    i = np.arange(20000) + 0.5
    height, turn = 1 - 2 * i / 20000, np.pi * (1 + 5**0.5) * i
    radius = np.sqrt(1 - height**2)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)


def worst_forces(A, turns, force, moment):
    size = A.shape[1] - 1 if turns else A.shape[1]
    wrenches = force * directions(size)
    if turns:
        wrenches = np.concatenate([np.insert(wrenches, size, sign * moment, axis=1) for sign in (-1, 1)])
    return np.abs(np.linalg.solve(A.T, wrenches.T)).max(axis=1)


@every_robot
@given(data=st.data())
def test_the_largest_leg_force_is_the_largest_over_all_directions_of_the_load(name, data):
    robot = ROBOTS[name]
    s = data.draw(samples(robot, type2=0.01))
    force, moment = data.draw(st.floats(0.1, 100.0)), data.draw(st.floats(0.0, 10.0))
    turns = robot.mechanism.task[-1].is_angle
    A, _ = unit_jacobians(*closure_of(name), s.q, s.x)
    tried = worst_forces(A, turns, force, moment)
    stated = robot.reaction_max(s.x, s.q, force, moment)
    spacing = np.deg2rad(0.05) if len(s.x) - turns == 2 else 0.02  # no direction is farther from a tried one
    assert (tried <= stated * (1 + 1e-9)).all()
    assert (tried >= stated * (1 - spacing**2)).all()
    at = robot.evaluate(s.q, s.assembly, force=force, moment=moment)
    np.testing.assert_allclose(at.reaction_max, stated, rtol=1e-9)


@pytest.mark.parametrize("name", [name for name in NAMES if not ROBOTS[name].mechanism.task[-1].is_angle])
@given(data=st.data())
def test_a_pure_force_is_carried_with_the_reciprocal_of_the_cosine_where_the_platform_cannot_turn(name, data):
    robot = ROBOTS[name]
    s = data.draw(samples(robot))
    at = robot.evaluate(s.q, s.assembly, force=7.0)
    np.testing.assert_allclose(7.0 / np.cos(at.pressure_angle), at.reaction_max, rtol=1e-9 / s.at.type2)


@cache
def largest_lever(name):
    """Largest |B_ii| met in a dense scan of the joints: m/rad, or 1 for a slide. Of the closure, at the postures that
    the library calls farthest from Type 1."""
    robot = ROBOTS[name]
    scan = robot.evaluate_many(random_joints(robot, np.random.default_rng(1), 20000))
    margins = np.nan_to_num(scan.type1_margin).max(axis=1)
    levers = []
    for i in np.argsort(margins)[-200:]:
        _, B = unit_jacobians(*closure_of(name), scan.joint_position[i], scan.pose[i])
        levers.append(np.abs(np.diag(B)).max())
    return max(levers)


@every_robot
@given(data=st.data())
def test_margins_are_the_sizes_they_claim_to_be(name, data):
    """Type 1: lever over its largest size. Type 2: smallest cosine, 0..1. The labels are signs of these."""
    robot = ROBOTS[name]
    s = data.draw(samples(robot))
    at = robot.evaluate(s.q, s.assembly)
    _, B = unit_jacobians(*closure_of(name), s.q, s.x)
    np.testing.assert_allclose(np.abs(np.diag(B)) / at.type1_margin, largest_lever(name), rtol=0.01)
    for margin in (*at.type1_margin, at.type2_margin, *at.limb_margin):
        assert 0.0 <= margin <= 1.0 + ROUNDING
    assert at.type2_margin == pytest.approx(np.cos(max(at.pressure_angle)), abs=1e-9)
    assert set(at.working_mode) <= {-1, 1}
    assert at.assembly_mode == s.assembly
    assert at.closure_residual < ROUNDING * max(robot.mechanism.length_m, 1.0) * 10
