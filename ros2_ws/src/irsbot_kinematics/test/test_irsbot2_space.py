"""The IRSBot-2 of the library against the robot in space (oracles/irsbot2_3d.py): closure, mobility, margins."""

from __future__ import annotations

from math import pi

import irsbot2_3d as space
import mpmath
import numpy as np
import pytest
from irsbot2_3d import Design
from scipy.optimize import least_squares
from singular_points import constraint_points, held_by_arms

import irsbot_kinematics as irs
from irsbot_kinematics.mechanisms.irsbot2 import Irsbot2
from irsbot_kinematics.mechanisms.irsbot2 import _largest_normal_turn as largest_normal_turn
from irsbot_kinematics.mechanisms.irsbot2 import _normal_over as normal_over
from irsbot_kinematics.mechanisms.irsbot2_space.geometry import Irsbot2Geometry

MARGIN_TOL = 1e-9
RANK_TOL = 1e-7
"""Singular values of unit wrenches: 1e-16 where they vanish, 1e-3 and more where they do not."""

PRESETS = ["irsbot2", "irsbot2_beta45", "irsbot2_csc", "irsbot2_strict"]


def design_of(robot):
    g = robot.mechanism.geometry
    return Design(g.l1, g.l2eq, g.b, g.p, g.a1, g.a2, g.beta, g.e)


def legs_at(d, q, psi):
    return space.leg(d, 0, q[0], psi[0]), space.leg(d, 1, q[1], psi[1])


def random_designs(rng, number):
    """Any proportions, loops that close; also l2eq < D, also b0 < 0."""
    found = []
    while len(found) < number:
        a1, p, l1, l2eq, b = np.exp(rng.uniform(np.log(0.03), np.log(1.0), 5))
        d = Design(l1, l2eq, b, p, a1, a1 * rng.uniform(0.05, 0.95), rng.uniform(0.05, 1.5), rng.uniform(-0.3, 0.3))
        if abs(d.b0) < 0.95 * (l1 + l2eq) and abs(d.b0) > 1e-3:
            found.append(d)
    return found


def robot_of(d):
    return irs.Robot(Irsbot2(Irsbot2Geometry(*(float(value) for value in d))))


def random_sample(robot, rng):
    """A posture with margins that a mobility analysis can tell from 0."""
    while True:
        q = rng.uniform(-pi, pi, 2)
        at = robot.mechanism.posture(tuple(q), int(rng.choice((-1, 1))))
        if at.status == irs.Status.SOLVED and min(*at.type1, at.type2, at.constraint) > 0.02:
            return at


@pytest.mark.parametrize("preset", PRESETS)
def test_the_four_rods_fit_at_every_pose_that_the_planar_equations_give(preset):
    robot, rng = irs.make_robot(preset), np.random.default_rng(1)
    d = design_of(robot)
    for _ in range(20):
        at = random_sample(robot, rng)
        pose = np.array([at.pose[0], 0.0, at.pose[1], 0.0, 0.0, 0.0])
        assert np.abs(space.rod_equations(d, np.array(at.joints), pose)).max() < 1e-14
        legs = legs_at(d, at.joints, robot.mechanism.rod_angles(at))
        for k, leg in enumerate(legs):
            assert space.platform_point(d, k, leg)[[0, 2]] == pytest.approx(at.pose, abs=1e-13)
            assert leg.E[0, 1] == pytest.approx(-leg.E[1, 1])  # the rods of a leg mirror each other
            sizes = np.linalg.norm(leg.F - leg.E, axis=1)
            assert sizes == pytest.approx(robot.mechanism.geometry.l2, abs=1e-13)


@pytest.mark.parametrize("preset", PRESETS)
def test_a_platform_disturbed_in_all_six_directions_closes_only_at_the_pose_of_the_library(preset):
    robot, rng = irs.make_robot(preset), np.random.default_rng(2)
    d = design_of(robot)
    for _ in range(8):
        at = random_sample(robot, rng)
        pose = np.array([at.pose[0], 0.0, at.pose[1], 0.0, 0.0, 0.0])
        start = pose + rng.uniform(-1.0, 1.0, 6) * np.array([1, 1, 1, 1, 1, 1]) * 0.01 * d.l2eq * min(
            at.type2, at.constraint
        )
        q = np.array(at.joints)
        found = least_squares(lambda v, q=q: space.rod_equations(d, q, v), start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
        assert found.x == pytest.approx(pose, abs=1e-7)


@pytest.mark.parametrize("preset", PRESETS)
def test_a_regular_posture_moves_in_the_plane_with_free_motors_and_not_at_all_with_locked_ones(preset):
    robot, rng = irs.make_robot(preset), np.random.default_rng(3)
    d = design_of(robot)
    for _ in range(10):
        at = random_sample(robot, rng)
        legs = legs_at(d, at.joints, robot.mechanism.rod_angles(at))
        free = space.freedom(d, legs, RANK_TOL, motors_locked=False)
        assert len(free) == 2
        assert np.abs(free[:, [0, 1, 2, 4]]).max() < 1e-9  # no rotation, no translation along y
        assert len(space.freedom(d, legs, RANK_TOL, motors_locked=True)) == 0
        by_all = space.complex_step(
            lambda v: space.rod_equations(d, v[:2], v[2:]), np.array([*at.joints, at.pose[0], 0, at.pose[1], 0, 0, 0])
        )
        assert np.linalg.matrix_rank(by_all, tol=RANK_TOL) == 6
        assert np.linalg.matrix_rank(by_all[:, 2:], tol=RANK_TOL) == 6


@pytest.mark.parametrize("preset", PRESETS)
def test_a_leg_with_a_free_motor_transmits_two_couples_and_a_force_along_y_through_its_rod_lines(preset):
    """The wrenches from which the constraint margin is made, found by reciprocity of the passive revolutes."""
    robot, rng = irs.make_robot(preset), np.random.default_rng(4)
    d = design_of(robot)
    for _ in range(10):
        at = random_sample(robot, rng)
        for leg in legs_at(d, at.joints, robot.mechanism.rod_angles(at)):
            found = space.leg_wrenches(leg, RANK_TOL, motor_locked=False)
            expected = [space.couple(leg.n[0]), space.couple(leg.n[1])]
            expected.append(space.force(space.AXIS_Y, space.rod_lines_meet(leg)))
            assert np.linalg.matrix_rank(found, tol=RANK_TOL) == 3
            assert np.linalg.matrix_rank(np.concatenate([found, expected]), tol=RANK_TOL) == 3


def test_all_margins_equal_those_of_the_robot_in_space_for_random_designs():
    rng = np.random.default_rng(5)
    compared = 0
    for d in random_designs(rng, 150):
        robot = robot_of(d)
        q = rng.uniform(-pi, pi, (60, 2))
        for assembly in (-1, 1):
            evs = robot.evaluate_many(q, assembly)
            with np.errstate(invalid="ignore"):
                psi1, psi2, x, z, _ = space.posture(d, q[:, 0], q[:, 1], assembly)
            assert ((evs.status == irs.Status.SOLVED) == np.isfinite(x)).all()
            on = np.isfinite(x)
            compared += int(on.sum())
            if not on.any():
                continue
            normalised_levers = [np.sin(q[on, k] - psi[on]) for k, psi in enumerate((psi1, psi2))]
            assert np.abs(evs.pose[on] - np.stack([x, z], axis=1)[on]).max() < 1e-10
            assert np.abs(evs.type1_margin[on] - np.abs(normalised_levers).T).max() < MARGIN_TOL
            assert np.abs(evs.type2_margin[on] - np.abs(np.sin(psi1 - psi2)[on])).max() < MARGIN_TOL
            assert np.abs(evs.constraint_margin[on] - space.kappa(d, psi1[on], psi2[on])).max() < MARGIN_TOL
    assert compared > 5000


SINGULAR = {
    "I": Design(0.35, 0.2, 0.1, 0.05, 0.2, 0.03, pi / 4),
    "II": Design(0.2, 0.09, 0.1, 0.01, 0.2, 0.05, pi / 4),
    "III": Design(0.2, 0.30, 0.1, 0.01, 0.2, 0.05, pi / 4),
    "C1a": Design(0.2, 0.30, 0.1, 0.01, 0.2, 0.05, pi / 4),
    "C1b": Design(0.35, 0.2, 0.1, 0.05, 0.2, 0.03, pi / 4, 0.02),
}


def singular_legs(kind):
    """(posture of the library, legs in space) at every point of one kind."""
    d = SINGULAR[kind]
    robot = robot_of(d)
    points = [point for point in constraint_points(d) if point.kind == kind]
    assert points, "out of reach: the fixture proves nothing"
    for point in points:
        at = robot.mechanism.at(point.q, (point.x, point.z), 1, (0.0, 0.0))
        assert at.residual < 1e-14
        yield d, at, legs_at(d, point.q, point.psi)


@pytest.mark.parametrize("kind", SINGULAR)
def test_the_constraint_margin_is_zero_where_the_platform_gains_a_rotation(kind):
    gained = {"I": 1, "II": 1, "III": 1, "C1a": 2, "C1b": 1}[kind]
    for d, at, legs in singular_legs(kind):
        assert at.constraint < MARGIN_TOL
        free = space.freedom(d, legs, RANK_TOL, motors_locked=False)
        assert len(free) == 2 + gained
        assert np.linalg.matrix_rank(free[:, :3], tol=RANK_TOL) == gained


@pytest.mark.parametrize("kind", ["I", "II", "III"])
def test_condition_2_gains_a_rotation_about_the_line_of_both_rod_intersections(kind):
    for d, _, legs in singular_legs(kind):
        P = space.platform_point(d, 0, legs[0])
        one, two = (space.rod_lines_meet(leg) for leg in legs)
        free = space.freedom(d, legs, RANK_TOL, motors_locked=False)
        rotation = free[np.argmax(np.linalg.norm(free[:, :3], axis=1))]
        turn, velocity = rotation[:3], rotation[3:] * d.Lc
        assert np.abs(np.cross(turn, two - one)).max() < 1e-8 * np.linalg.norm(turn)
        for point in (one, two):  # x and z velocities are free anyway
            assert abs((velocity + np.cross(turn, point - P))[1]) < 1e-8


def test_condition_1_gains_horizontal_rotations_with_legs_side_by_side_and_one_about_y_with_legs_opposed():
    for d, _, legs in singular_legs("C1a"):
        free = space.freedom(d, legs, RANK_TOL, motors_locked=False)
        assert np.abs(free[:, 2]).max() < 1e-8  # no rotation about z
    for d, at, legs in singular_legs("C1b"):
        free = space.freedom(d, legs, RANK_TOL, motors_locked=False)
        assert np.abs(free[:, [0, 2]]).max() < 1e-8  # about y alone
        assert at.type2 < MARGIN_TOL


@pytest.mark.parametrize("kind", ["II", "III", "C1a"])
def test_locked_motors_do_not_hold_the_platform_although_the_pressure_angle_is_good(kind):
    for d, at, legs in singular_legs(kind):
        assert at.type2 > 0.1
        assert len(space.freedom(d, legs, RANK_TOL, motors_locked=True)) >= 1


def test_one_upright_leg_alone_is_not_singular():
    """cos theta_I = 0 only: that leg loses a wrench, the robot keeps two degrees of freedom."""
    d = SINGULAR["III"]
    robot = robot_of(d)
    psi1 = np.pi - np.arccos(d.D / d.l2eq)  # l2eq cos psi_I + D = 0
    for psi2 in (0.2, 2.0, -1.0):
        for q1, q2, x, z in held_by_arms(d, psi1, psi2):
            at = robot.mechanism.at((q1, q2), (x, z), 1, (0.0, 0.0))
            assert at.constraint > 0.05
            legs = legs_at(d, (q1, q2), (psi1, psi2))
            assert len(space.freedom(d, legs, RANK_TOL, motors_locked=False)) == 2
            wrenches = [space.leg_wrenches(leg, RANK_TOL, motor_locked=False) for leg in legs]
            assert [np.linalg.matrix_rank(system, tol=RANK_TOL) for system in wrenches] == [2, 3]


def test_the_constraint_margin_grows_in_proportion_to_the_distance_from_its_zero():
    for kind in SINGULAR:
        d = SINGULAR[kind]
        point = next(point for point in constraint_points(d) if point.kind == kind)
        rates = [space.kappa(d, point.psi[0] + h, point.psi[1]) / h for h in (1e-3, 1e-5)]
        assert rates[0] == pytest.approx(rates[1], rel=0.02)
        assert rates[0] > 0.05


def test_the_constraint_guarantee_stands_on_the_fastest_turn_of_a_rod_normal():
    """|dn/dpsi| of the normals in space, scanned over psi, against the closed form."""
    rng = np.random.default_rng(6)
    psi = np.linspace(-pi, pi, 20_001)
    for d in random_designs(rng, 60):
        if abs(d.l2eq - d.D) < 0.05 * d.D:
            continue  # the scan is too coarse for a leg that nearly vanishes
        normals = [space.leg(d, k, 0.0, psi).n for k in (0, 1)]
        turns = [np.linalg.norm(np.diff(n, axis=0), axis=-1).max() / (psi[1] - psi[0]) for n in normals]
        assert largest_normal_turn(d.l2eq, d.D, np.cos(d.beta)) == pytest.approx(max(turns), rel=1e-4)


def test_nothing_is_promised_for_the_constraint_margin_if_a_leg_can_vanish():
    """l2eq = D: E_k and F_k coincide at psi_I = pi, and near it the rods turn without limit."""
    d = SINGULAR["III"]
    robot = robot_of(d._replace(l2eq=d.D))
    mechanism = robot.mechanism
    assert mechanism.geometry.l2eq == mechanism.geometry.D
    for q in ((0.2, 0.5), (-0.5, -0.1)):
        at = robot.posture(q)
        assert at.constraint > 0.0
        assert mechanism.certified_bounds(at, (1e-9, 1e-9)).constraint == 0.0


@pytest.mark.parametrize("width", [1e-9, 0.3, 2.0])
def test_the_bounds_of_a_rods_normal_hold_over_a_range_of_directions_and_are_its_derivatives_over_a_short_one(width):
    """n(psi), the unit normal, with 30 digits: its derivatives are quotients of differences of 1e-8 rad."""
    rng, loosest = np.random.default_rng(7), 0.0
    for _ in range(150):
        l2, D = rng.uniform(0.2, 2.0), rng.uniform(-1.0, 1.0)
        c, middle, sign = rng.uniform(0.1, 0.98), rng.uniform(-0.95, 0.95), rng.choice((-1.0, 1.0))
        low, high = max(middle - 0.5 * width, -1.0), min(middle + 0.5 * width, 1.0)
        found = normal_over(l2, D, c, low, high)
        assert found is not None
        least, rate, bend = found

        def normal(psi: mpmath.mpf, l2=l2, D=D, c=c) -> mpmath.matrix:
            vector = mpmath.matrix([c * (l2 * mpmath.cos(psi) + D), -l2 * mpmath.sin(psi)])
            return vector / mpmath.norm(vector)

        with mpmath.workdps(30):
            step = mpmath.mpf("1e-8")
            for cosine in np.linspace(low, high, 9):
                psi = sign * mpmath.acos(cosine)
                before, here, after = (normal(psi + k * step) for k in (-1, 0, 1))
                true = [
                    float(abs(here[0])),
                    float(mpmath.norm(after - before) / (2 * step)),
                    float(mpmath.norm(before + after - 2 * here) / step**2),
                ]
                assert least <= true[0] * (1.0 + 1e-7) + 1e-7
                assert rate >= true[1] * (1.0 - 1e-7)
                assert bend >= true[2] * (1.0 - 1e-7)
                loosest = max(loosest, true[0] - least, rate / true[1] - 1.0, bend / true[2] - 1.0)
    if width < 1e-6:
        assert loosest < 1e-6
