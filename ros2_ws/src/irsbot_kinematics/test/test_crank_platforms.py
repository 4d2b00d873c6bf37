"""Platforms on cranks, the base-actuated 3-RRR and the 4-RUU: every assembly, Jacobians, forces and pressure angles.

Loop closures and derivatives are written once more in the oracles, from the drawings.
"""

from __future__ import annotations

from itertools import product
from math import cos, pi, sin

import numpy as np
import pytest
from cranks import EXACT, ROBOTS, close, closure, every_robot, gradients, layout, random_poses
from postures import solutions

from irsbot_kinematics import Status, make_robot
from irsbot_kinematics.numerics.arithmetic import FLOATS
from irsbot_kinematics.numerics.assembly_roots import SAMPLED_TURNS, planar_closing, trigonometric_roots


def test_the_3_rpr_of_listing_8_has_its_six_poses():
    """[S4]: d1 = 17.04, d2 = 16.54, d3 = 20.84, A2x = 15.91, A3y = 10, rho = (14.98, 15.38, 12)."""
    d1, d2, d3 = 17.04, 16.54, 20.84
    beta = np.arccos((d1**2 + d3**2 - d2**2) / (2 * d1 * d3))
    corners = [(0.0, 0.0), (d1, 0.0), (d3 * cos(beta), d3 * sin(beta))]
    feet = [(0.0, 0.0), (15.91, 0.0), (0.0, 10.0)]

    def closing(turn):
        c, s = np.cos(turn), np.sin(turn)
        ends = [(c * x - s * y - u, s * x + c * y - v) for (x, y), (u, v) in zip(corners, feet, strict=True)]
        return planar_closing(ends, (14.98, 15.38, 12.0))

    turns, unreal = trigonometric_roots(closing(SAMPLED_TURNS)[None])
    printed = (-0.9869742378, -0.0473313694, 0.245309531, 0.5856727833, 1.00203854, 2.132904365)
    np.testing.assert_allclose(np.sort(turns[0]), printed, rtol=0, atol=6e-10)  # ten digits
    assert unreal.max() < 1e-12
    spectrum = np.abs(np.fft.fft(closing(np.arange(32) * pi / 16)))
    assert spectrum[4:17].max() < 1e-12 * spectrum.max(), "the closing polynomial is of degree 3"


@every_robot
def test_every_inverse_solution_closes_in_its_mode_and_its_pose_is_among_the_direct_ones_once(name):
    robot, rng = ROBOTS[name], np.random.default_rng(1)
    for q, x, mode in random_poses(robot, rng, 25):
        assert np.abs(closure(robot, q, x)).max() < 1e-12
        at = robot.mechanism.at(tuple(q), tuple(x), 1, (0.0, 1.0))
        assert at.working_mode == mode
        found = [pose for pose in robot.direct_all(q) if np.abs(pose - x).max() < 1e-7]
        assert len(found) == 1
        there = solutions(robot, tuple(q))
        assert all(np.sign(at.assembly_mode) == np.sign(at.det) for at in there)
        assert sum(np.sign(at.assembly_mode) for at in there) == 0, "as many poses of either sign: none was missed"
        for pose in robot.direct_all(q):
            assert np.abs(closure(robot, q, pose)).max() < EXACT


@every_robot
def test_an_elevation_falls_at_most_by_the_turns_of_rod_and_crank(name):
    """The slope of a sine is at most 1: its certified floor is no lower than the sine less the turns, and no higher
    than the sine of the elevation that is left."""
    robot, rng = ROBOTS[name], np.random.default_rng(13)
    for q, x, _mode in random_poses(robot, rng, 10):
        at, travel = robot.mechanism.at(tuple(q), tuple(x), 1, (0.0, 1.0)), rng.uniform(0.0, 0.02, len(q))
        sines, turn = np.array(at.type1), rng.uniform(0.0, 0.02)
        floors = np.array(robot.mechanism.sine_floors(at, travel.tolist(), turn))
        left = np.arcsin(sines) - turn - travel
        assert (floors >= np.maximum(sines - turn - travel, 0.0)).all()
        np.testing.assert_allclose(floors, np.sin(np.maximum(left, 0.0)), rtol=0, atol=1e-12)


def turns_by_scan(robot, q, steps=40_000):
    """Turns at which the legs can meet, from sign changes of the equation left when the position is eliminated, with
    numpy's own solvers."""
    A, B, l1, l2 = layout(robot)
    C = A[:, :2] + l1 * np.stack([np.cos(q), np.sin(q)], axis=1)
    phi = np.linspace(-pi, pi, steps)
    R = np.array([[np.cos(phi), -np.sin(phi)], [np.sin(phi), np.cos(phi)]]).transpose(2, 0, 1)
    k = np.einsum("tij,nj->tni", R, B[:, :2]) - C
    D = k[:, 1:] - k[:, :1]
    h = 0.5 * (np.sum(k[:, :1] ** 2, 2) - np.sum(k[:, 1:] ** 2, 2))
    if len(q) == 4:
        residual = np.linalg.det(np.concatenate([D, h[..., None]], axis=2))
    else:
        p = np.linalg.solve(D, h[..., None])[..., 0]
        residual = (np.sum((p + k[:, 0]) ** 2, 1) - l2**2) * np.linalg.det(D) ** 2
    crossing = np.flatnonzero(np.diff(np.sign(residual)) != 0)
    found = []
    for i in crossing:
        if len(q) == 4:
            p = np.linalg.lstsq(D[i], h[i], rcond=None)[0]
            if np.sum((p + k[i, 0]) ** 2) > l2**2:
                continue
        found.append(phi[i])
    return np.array(found)


@every_robot
def test_no_pose_is_missed_and_none_is_invented(name):
    robot, rng, counts = ROBOTS[name], np.random.default_rng(2), []
    n = len(robot.mechanism.joints)
    for _ in range(60):
        q = rng.uniform(-pi, pi, n)
        poses = robot.mechanism.assemblies([np.array([value]) for value in q])
        turns = np.unique(np.round(poses.pose[-1][poses.valid], 9))
        if np.abs(poses.det[poses.valid]).min(initial=1.0) < 1e-3:
            continue  # next to a double root, which a scan cannot see
        np.testing.assert_allclose(turns, turns_by_scan(robot, q), atol=1e-3)
        counts.append(len(turns))
    assert len(set(counts)) >= 2


def test_a_candidate_that_polishing_leads_to_another_pose_is_not_counted_as_one():
    """A 3-RPR next to a double root. The signs of det A over all poses add up to nothing, by continuity."""
    mechanism = make_robot("rpr3").mechanism
    poses = mechanism.assemblies(np.array([[0.2004730448536717], [0.3136544973006788], [0.3089184205670864]]))
    signs = np.sign(poses.det[poses.valid])
    assert len(signs) == 4
    assert signs.sum() == 0.0


@every_robot
def test_the_error_of_a_rods_end_is_that_of_the_worst_machine(name):
    """Both places and the crank's length are off, each number by the slack or against it."""
    mechanism, slack = ROBOTS[name].mechanism, 1e-4
    dim = 3 if name == "4-RUU" else 2
    worst = 0.0
    for angle in np.linspace(0.0, 2.0 * pi, 721):
        crank = np.array([cos(angle), sin(angle), 0.0][:dim])
        for foot, corner in product(product((-1.0, 1.0), repeat=dim), repeat=2):
            for longer in (-1.0, 1.0):
                worst = max(worst, float(np.linalg.norm(np.array(foot) - np.array(corner) + longer * crank)))
    ends, _, _ = mechanism.geometry_errors(slack)
    assert ends == pytest.approx(worst * slack, rel=1e-9)


def test_two_poses_that_share_a_turn_are_both_found():
    """The crank ends are seen from the platform joints in parallel directions: the lines that give P are one."""
    robot, found = ROBOTS["equilateral"], 0
    x = robot.direct((0.0, 0.0, 0.0), 1)
    for q in robot.inverse_all(x):
        at = robot.mechanism.at(tuple(q), tuple(x), 1, (0.0, 1.0))
        if at.type2 > 0.01:
            away = np.array(robot.direct_all(q)) - x
            assert np.count_nonzero(np.abs(away).max(axis=1) < EXACT) == 1
            found += np.count_nonzero((np.abs(away[:, 2]) < EXACT) & (np.abs(away[:, :2]).max(axis=1) > 0.01))
    assert found, "no turn is shared: the fixture proves nothing"


@every_robot
def test_jacobians_are_the_gradients_of_the_closure(name):
    robot, rng = ROBOTS[name], np.random.default_rng(3)
    for q, x, _ in random_poses(robot, rng, 30):
        A, B = robot.jacobians(x, q)
        by_x, by_q = gradients(robot, q, x)
        np.testing.assert_allclose(A, by_x, atol=1e-12)
        np.testing.assert_allclose(B, by_q, atol=1e-12)


@every_robot
def test_velocity_and_acceleration_are_the_differences_of_poses_along_a_motion(name):
    robot, rng, h = ROBOTS[name], np.random.default_rng(4), 2e-4
    for q, x, _ in random_poses(robot, rng, 10, best=0.2):
        rates, accelerations = rng.uniform(-1, 1, (2, len(q)))
        a, b, c, d, e = (close(robot, q + rates * t + accelerations * t * t / 2, x) for t in h * np.arange(-2, 3))
        np.testing.assert_allclose(
            robot.velocity(x, q, rates), (a - 8 * b + 8 * d - e) / (12 * h), atol=1e-6, rtol=1e-5
        )
        expected = (-a + 16 * b - 30 * c + 16 * d - e) / (12 * h * h)
        scale = 1 + np.abs(expected).max()
        np.testing.assert_allclose(robot.acceleration(x, q, rates, accelerations), expected, atol=1e-4 * scale)


@every_robot
def test_leg_forces_balance_the_load_and_motors_do_its_work(name):
    robot, rng = ROBOTS[name], np.random.default_rng(5)
    for q, x, _ in random_poses(robot, rng, 20):
        wrench, rates = rng.normal(size=(2, len(q)))
        by_x, by_q = gradients(robot, q, x)
        forces = robot.reactions(x, q, wrench)
        np.testing.assert_allclose(by_x.T @ forces, -wrench, atol=1e-9)
        twist = np.linalg.solve(by_x, -by_q @ rates)
        work = robot.efforts(x, q, wrench) @ rates + wrench @ twist
        assert abs(work) < 1e-9 * (1 + np.linalg.norm(twist))


@every_robot
def test_the_largest_leg_force_is_the_largest_over_all_loads(name):
    robot, rng = ROBOTS[name], np.random.default_rng(6)
    n = len(robot.mechanism.joints)
    ways = rng.normal(size=(40_000, n - 1))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    wrenches = np.concatenate([np.insert(70.0 * ways, n - 1, sign * 4.0, axis=1) for sign in (-1, 1)])
    for q, x, _ in random_poses(robot, rng, 5):
        tried = np.abs(np.linalg.solve(gradients(robot, q, x)[0].T, wrenches.T)).max(axis=1)
        stated = robot.reaction_max(x, q, 70.0, 4.0)
        assert (tried <= stated * (1 + 1e-9)).all()
        assert (tried >= stated * 0.995).all()


def held_velocities(robot, q, x):
    """Per leg the velocity (n, 3) of B_i when that leg yields by one unit."""
    B = layout(robot)[1]
    turned = np.array([[cos(x[-1]) * u - sin(x[-1]) * v, sin(x[-1]) * u + cos(x[-1]) * v] for u, v, _ in B])
    twists = np.linalg.inv(gradients(robot, q, x)[0]).T
    z = twists[:, 2] if len(x) == 4 else np.zeros(len(q))
    return np.stack(
        [twists[:, 0] - twists[:, -1] * turned[:, 1], twists[:, 1] + twists[:, -1] * turned[:, 0], z], axis=1
    )


@every_robot
def test_pressure_angles_lie_between_the_leg_forces_and_the_velocities_of_their_points(name):
    robot, rng = ROBOTS[name], np.random.default_rng(7)
    for q, x, _ in random_poses(robot, rng, 20):
        at = robot.mechanism.at(tuple(q), tuple(x), 1, (0.0, 1.0))
        np.testing.assert_allclose(
            at.cos_pressure, 1 / np.linalg.norm(held_velocities(robot, q, x), axis=1), atol=1e-12
        )


@every_robot
def test_one_sample_and_many_say_the_same(name):
    robot, rng = ROBOTS[name], np.random.default_rng(8)
    m = robot.mechanism
    Q = np.array([q for q, _, _ in random_poses(robot, rng, 12)])
    for label in m.assembly_modes[:4]:
        evs = robot.evaluate_many(Q, label)
        for i, q in enumerate(Q.tolist()):
            at = m.posture(tuple(q), label)
            assert evs.status[i] == at.status
            if at.status == Status.SOLVED and at.type2 > 1e-3:
                np.testing.assert_allclose(evs.pose[i], at.pose, atol=EXACT)
                np.testing.assert_allclose(evs.type1_margin[i], at.type1, atol=EXACT)
                np.testing.assert_allclose(evs.limb_margin[i], at.limb, atol=EXACT)
                np.testing.assert_allclose(
                    [evs.type2_margin[i], evs.constraint_margin[i]], [at.type2, at.constraint], atol=EXACT
                )
                shared = m.legs(FLOATS, tuple(q), at.pose)
                for field in ("screws", "levers", "normalised_levers", "reach", "attachments"):
                    np.testing.assert_allclose(getattr(at, field), getattr(shared, field), atol=1e-12)
