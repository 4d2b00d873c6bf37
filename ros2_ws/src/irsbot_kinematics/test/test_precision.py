"""Floats against 40 digits, up to the singularities: errors grow as the conditioning says, and no faster."""

from __future__ import annotations

import many_digits as exact
import mpmath as mp
import numpy as np
import pytest

import irsbot_kinematics as irs

EPS = 2.0**-52
PRESETS = ["irsbot2", "irsbot2_beta45", "irsbot2_csc"]


@pytest.fixture(autouse=True)
def _forty_digits():
    with mp.workdps(40):
        yield


def error(found, expected):
    return max(abs(float(mp.mpf(f) - e)) for f, e in zip(found, expected, strict=True))


def angle_error(found, expected):
    return max(
        abs(float(mp.fmod(mp.mpf(f) - e + 3 * mp.pi, 2 * mp.pi) - mp.pi)) for f, e in zip(found, expected, strict=True)
    )


@pytest.mark.parametrize("preset", PRESETS)
def test_regular_postures_are_right_to_rounding(preset):
    robot, rng = irs.make_robot(preset), np.random.default_rng(7)
    g = robot.mechanism.geometry
    compared = 0
    while compared < 10:
        q, assembly = tuple(rng.uniform(-np.pi, np.pi, 2)), int(rng.choice((-1, 1)))
        at = robot.mechanism.posture(q, assembly)
        if at.status != irs.Status.SOLVED or at.type2 < 0.1 or min(at.type1) < 0.1:
            continue
        compared += 1
        x, z, psi1, psi2 = exact.direct(g, q, assembly)
        assert error(at.pose, (x, z)) < 20 * EPS
        assert error(at.normalised_levers, (mp.sin(q[0] - psi1), mp.sin(q[1] - psi2))) < 100 * EPS
        assert error([at.det], [mp.sin(psi1 - psi2)]) < 100 * EPS
        assert error([at.constraint], [exact.kappa(g, psi1, psi2)]) < 200 * EPS
        assert (
            angle_error(robot.inverse(at.pose, at.working_mode), exact.inverse(g, at.pose, at.working_mode)) < 100 * EPS
        )


@pytest.mark.parametrize("distance", [1e-2, 1e-4, 1e-6, 1e-8, 1e-10])
def test_near_rods_in_line_the_pose_loses_half_its_digits_and_no_more(distance):
    """gap_par -> 0: dP ~ sqrt(l2eq d(gap)), so a rounding of the joints moves the pose by eps l1/cos alpha."""
    robot = irs.make_robot("irsbot2_csc")
    g = robot.mechanism.geometry
    q1 = 1.9
    q2 = float(mp.findroot(lambda q2: slack(g, q1, q2) - distance, 0.2))
    at = robot.mechanism.posture((q1, q2), -1)
    assert at.gaps[0] == pytest.approx(distance, abs=10 * EPS)
    x, z, psi1, psi2 = exact.direct(g, (q1, q2), -1)
    cosine = float(abs(mp.sin(psi1 - psi2)))
    assert error(at.pose, (x, z)) < 4 * EPS / cosine
    assert error([at.type2], [cosine]) < 20 * EPS / cosine
    assert error([at.constraint], [exact.kappa(g, psi1, psi2)]) < 20 * EPS / cosine
    assert at.residual < 10 * EPS


def slack(g, q1, q2):
    """2 l2eq - |C_1C_2|."""
    b0, _, l1, l2 = exact.loop(g)
    return 2 * l2 - abs(2 * b0 + l1 * (mp.expj(-q2) - mp.expj(-mp.mpf(q1))))


@pytest.mark.parametrize("distance", [1e-2, 1e-4, 1e-6, 1e-8])
def test_near_coincident_elbows_the_pose_error_grows_as_one_over_the_gap(distance):
    robot = irs.make_robot("irsbot2_beta45")
    g = robot.mechanism.geometry
    b0, _, l1, l2 = (float(value) for value in exact.loop(g))
    inner = np.arccos(abs(b0) / l1)
    q = (np.pi - inner + distance / l1, inner)
    at = robot.mechanism.posture(q, -1)
    assert at.gaps[1] == pytest.approx(distance, rel=0.01)
    x, z, psi1, psi2 = exact.direct(g, q, -1)
    cosine = float(abs(mp.sin(psi1 - psi2)))
    assert error(at.pose, (x, z)) < 4 * EPS * l2 / distance
    assert error([at.type2], [cosine]) < 20 * EPS
    assert error([at.constraint], [exact.kappa(g, psi1, psi2)]) < 20 * EPS * l2 / distance


@pytest.mark.parametrize("distance", [1e-2, 1e-5, 1e-8, 1e-11])
def test_near_the_workspace_boundary_the_joints_lose_half_their_digits_and_no_more(distance):
    robot = irs.make_robot("irsbot2")
    g = robot.mechanism.geometry
    b0, _, l1, l2 = (float(value) for value in exact.loop(g))
    for reach, way in ((l1 + l2 - distance, 1.2), (l2 - l1 + distance, 2.1)):
        pose = (-b0 + reach * np.cos(way), -reach * np.sin(way))
        q, expected = robot.inverse(pose, (1, -1)), exact.inverse(g, pose, (1, -1))
        sine = max(abs(float(mp.sin(expected[0] - exact.direct(g, expected, -1)[2]))), np.sqrt(EPS))
        assert angle_error(q[:1], expected[:1]) < 20 * EPS / sine
        assert angle_error(q[1:], expected[1:]) < 100 * EPS


@pytest.mark.parametrize("offset", [0.0, 1e-12, 1e-9, 1e-6, 1e-3])
def test_the_constraint_margin_has_no_cancellation_near_its_zero(offset):
    """Case I of the paper, solved with 40 digits; kappa is linear in the distance, down to the rounding of psi."""
    g = irs.make_robot("irsbot2_csc").mechanism.geometry
    c2, s = mp.cos(mp.mpf(g.beta)) ** 2, mp.sin(mp.mpf(g.beta))
    l2, p, a1, a2 = (mp.mpf(value) for value in (g.l2eq, g.p, g.a1, g.a2))
    mu = a2 / (a1 - a2)
    A, B, C = -(l2**2) * s**2 * mu, l2 * c2 * (p - a2 * s), -p * (a1 - a2) * c2 * s + l2**2 * mu
    X = (-B + mp.sqrt(B * B - 4 * A * C)) / (2 * A)
    psi2 = float(mp.acos(X))
    psi1 = float(mp.acos(X) + mp.pi + offset)
    margin = irs.make_robot("irsbot2_csc").mechanism
    parts = margin.constraint_parts(irs.robot.FLOATS, np.cos(psi1), -np.sin(psi1), np.cos(psi2), -np.sin(psi2))
    expected = exact.kappa(g, mp.mpf(psi1), mp.mpf(psi2))
    assert error([min(parts)], [expected]) < 10 * EPS
    assert float(expected) < max(offset, 4 * EPS)
