"""Measures of the planar loop at random postures: singular values, differences along motions, scans, 3-D forces."""

from __future__ import annotations

from math import inf, pi

import irsbot2_3d as space
import numpy as np
import pytest
from irsbot2_3d import Design
from singular_points import parallel_rods

import irsbot_kinematics as irs
from irsbot_kinematics.analysis import planar_indices as measures
from irsbot_kinematics.mechanisms.planar_loop import coincident_elbows

PRESETS = ["irsbot2", "irsbot2_beta45", "irsbot2_csc", "irsbot2_strict"]
STEP_S = 1e-5
"""s: central differences; truncation and rounding are both about 1e-10."""

every_preset = pytest.mark.parametrize("preset", PRESETS)


def setting(preset, number=40, margin=0.05):
    """Robot, its design for the oracles, and random postures with some margin."""
    robot, rng = irs.make_robot(preset), np.random.default_rng(31)
    g = robot.mechanism.geometry
    found = []
    while len(found) < number:
        at = robot.mechanism.posture(tuple(rng.uniform(-pi, pi, 2)), int(rng.choice((-1, 1))))
        if at.status == irs.Status.SOLVED and min(*at.type1, at.type2) > margin:
            found.append(at)
    return robot, Design(g.l1, g.l2eq, g.b, g.p, g.a1, g.a2, g.beta, g.e), found, rng


def ratio(matrix):
    values = np.linalg.svd(matrix, compute_uv=False)
    return values[-1] / values[0]


@every_preset
def test_inverse_condition_numbers_are_ratios_of_singular_values(preset):
    robot, _, postures, _ = setting(preset)
    for at in postures:
        A, B = robot.jacobians(at.pose, at.joints)
        assert measures.inverse_condition_of_rods(at) == pytest.approx(ratio(A), abs=1e-12)
        assert measures.inverse_condition_of_jacobian(at) == pytest.approx(ratio(np.linalg.solve(A, B)), abs=1e-12)


@every_preset
def test_rates_of_rods_and_gap_are_differences_along_a_motion(preset):
    robot, d, postures, rng = setting(preset, margin=0.2)
    for at in postures:
        rates = rng.uniform(-3.0, 3.0, 2)
        ahead, behind = (
            space.posture(d, *(np.array(at.joints) + sign * STEP_S * rates), at.assembly_mode) for sign in (1.0, -1.0)
        )
        turn = np.angle(np.exp(1j * (np.array(ahead[:2]) - np.array(behind[:2])))) / (2.0 * STEP_S)
        pose_rates = robot.velocity(at.pose, at.joints, rates)
        assert measures.rod_rates(robot.mechanism, at, rates, pose_rates) == pytest.approx(turn, rel=1e-5, abs=1e-6)
        parted = (ahead[4] - behind[4]) / (2.0 * STEP_S)
        assert measures.gap_rate(robot.mechanism, at, rates) == pytest.approx(parted, rel=1e-5, abs=1e-6)


@every_preset
def test_elbows_coincide_at_the_isolated_points_and_their_distance_is_that_of_the_torus(preset):
    robot, d, postures, _ = setting(preset)
    points = coincident_elbows(robot.mechanism.loop)
    assert len(points) == (0 if abs(d.b0) > d.l1 else 2)
    for q1, q2 in points:
        one, two = (-sign * d.b0 + d.l1 * np.exp(-1j * q) for sign, q in zip(space.SIGMA, (q1, q2), strict=True))
        assert abs(one - two) < 1e-15
    for at in postures:
        turns = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)]) * 2.0 * pi
        all_distances = [np.hypot(*(turns + at.joints - np.array(point)).T).min() for point in points]
        stated = measures.joint_distance_to_parallel_rods(robot.mechanism, np.add(at.joints, (2.0 * pi, -4.0 * pi)))
        assert stated == pytest.approx(min(all_distances, default=inf))


@every_preset
def test_the_distance_to_parallel_rods_is_that_of_a_scan_of_the_circles(preset):
    robot, d, postures, _ = setting(preset, 20)
    number = 40_000
    curve = parallel_rods(d, number)
    psi = np.tile(np.linspace(-pi, pi, number, endpoint=False), len(curve.x) // number)
    signs = np.sign(np.sin(curve.q - psi[:, None])).astype(int)
    spacing = 2.0 * pi * d.l2eq / number
    for at in postures:
        away = np.hypot(curve.x - at.pose[0], curve.z - at.pose[1])
        assert measures.distance_to_parallel_rods(robot.mechanism, at.pose) == pytest.approx(
            away.min(initial=inf), abs=spacing
        )
        for mode in robot.mechanism.working_modes:
            of_mode = away[(signs == mode).all(axis=1)].min(initial=inf)
            stated = measures.distance_to_parallel_rods(robot.mechanism, at.pose, mode)
            assert stated == pytest.approx(of_mode, abs=spacing)


@every_preset
def test_joint_moves_below_the_type_2_bounds_keep_the_robot_assembled_in_its_mode(preset):
    robot, d, postures, rng = setting(preset, 20)
    for at in postures:
        bounds = measures.type2_joint_bounds(robot.mechanism, at)
        if bounds.sum == inf:
            assert preset == "irsbot2_strict"
            continue
        ways = rng.normal(size=(200, 2))
        ways[:4] = [(1, 1), (1, -1), (-1, 1), (-1, -1)]
        for bound, size in zip(bounds, (np.abs(ways).sum(1), np.hypot(*ways.T), np.abs(ways).max(1)), strict=True):
            for share in (0.5, 0.999):
                q = np.array(at.joints) + share * bound * ways / size[:, None]
                *_, apart = space.posture(d, q[:, 0], q[:, 1], at.assembly_mode)
                assert np.isfinite(apart).all()
                if abs(d.b0) <= d.l1:
                    assert apart.min() > 0.0
                if abs(d.b0) + d.l1 >= d.l2eq:
                    assert apart.max() < 2.0 * d.l2eq


@every_preset
def test_rod_forces_along_the_rods_in_space_add_up_to_the_force_of_their_leg(preset):
    robot, d, postures, rng = setting(preset)
    for at in postures:
        wrench = rng.uniform(-50.0, 50.0, 2)
        forces = robot.reactions(at.pose, at.joints, wrench)
        rods = measures.rod_forces(robot.mechanism, forces)
        total = np.zeros(3)
        for k, psi in enumerate(robot.mechanism.rod_angles(at)):
            leg = space.leg(d, k, at.joints[k], psi)
            total += rods[k] * leg.f.sum(axis=0)
        assert np.add(total, (wrench[0], 0.0, wrench[1])) == pytest.approx(np.zeros(3), abs=1e-9)


@every_preset
def test_leg_forces_are_read_back_from_the_efforts_that_they_cause(preset):
    robot, _, postures, rng = setting(preset, margin=1e-3)
    for at in postures:
        wrench = rng.uniform(-50.0, 50.0, 2)
        forces = robot.reactions(at.pose, at.joints, wrench)
        efforts = robot.efforts(at.pose, at.joints, wrench)
        floor = 0.1
        for k, found in enumerate(measures.leg_forces_from_efforts(at, efforts, floor)):
            if at.type1[k] > floor:
                assert found == pytest.approx(forces[k], rel=1e-9)
            else:
                assert np.isnan(found)
