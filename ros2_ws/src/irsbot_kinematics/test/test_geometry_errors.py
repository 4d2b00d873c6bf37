"""Bounds with a slack hold on machines of which every length and place is off, each on its own."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from postures import NAMES, ROBOTS
from wrong_geometry import attacks, columns, kappa_of_wrong_legs, margins, random_machine, random_travel, some_posture

import irsbot_kinematics as irs

ROUNDING = 1e-9
"""1: machines are closed with rounding of their own."""
POSTURES = 15


def machines(name: str, rng: np.random.Generator) -> list[irs.Robot]:
    """The shipped robot, and machines of its kind and other lengths."""
    return [ROBOTS[name]] + [random_machine(ROBOTS[name].mechanism.kind, rng) for _ in range(5)]


@pytest.mark.parametrize("name", NAMES)
def test_no_margin_of_a_machine_that_is_off_in_everything_is_below_the_guarantee(name):
    rng, promised, lost = np.random.default_rng(61), 0, 0.0
    for number in range(3 * POSTURES):
        if number % POSTURES == 0:
            robots = machines(name, rng)
        robot = robots[0] if number % 2 else robots[1 + number // 2 % 5]
        at = some_posture(robot, rng)
        if at is None:
            continue
        slack = robot.mechanism.length_m * 10.0 ** rng.uniform(-6.0, -2.3)
        travel = rng.integers(0, 2) * random_travel(robot, at, rng)  # of half of them nothing but the geometry is off
        bound = robot.mechanism.certified_bounds(at, travel.tolist(), slack)
        if not bound.type2 > 0.0:
            continue
        promised += 1
        met = columns(margins(robot, at, *attacks(robot, at, travel, slack, rng)))
        floors = columns(bound)[0]
        assert (met >= floors - ROUNDING).all(), (robot.mechanism.geometry, at.joints, travel, slack)
        lost = max(lost, float(((columns(at)[0] - met.min(axis=0)) / (columns(at)[0] - floors + 1e-15)).max()))
    assert promised > 15
    assert lost > 0.25, "what is met is far from what is allowed: the attack does not bite"


def test_kappa_falls_at_fixed_directions_of_the_rods_by_no_more_than_its_bound():
    rng, nearest = np.random.default_rng(64), 0.0
    for number in range(60):
        robot = ROBOTS["irsbot2_beta45"] if number % 2 else random_machine("irsbot2", rng)
        at = some_posture(robot, rng)
        if at is None:
            continue
        slack = robot.mechanism.geometry.a2 * 10.0 ** rng.uniform(-5.0, -1.0)
        psi = np.array([np.arctan2(-z, x) for x, z in at.screws])
        step = 1e-7 * np.concatenate([np.zeros((1, 20)), np.eye(20)])
        there = kappa_of_wrong_legs(robot, np.tile(psi, (21, 1)), step.reshape(-1, 2, 10))
        worst = -np.sign(there[1:] - there[0])
        wrong = slack * np.concatenate([worst[None], np.sign(rng.normal(size=(30, 20)))])
        met = kappa_of_wrong_legs(robot, np.tile(psi, (31, 1)), wrong.reshape(-1, 2, 10))
        floor = min(robot.mechanism.parts_left(at, 0.0, slack)[:2])
        assert met.min() >= floor - ROUNDING
        if floor > 0.0:
            nearest = max(nearest, (at.constraint - met.min()) / (at.constraint - floor))
    assert nearest > 0.2, "what is met is far from what is allowed"


def test_the_error_of_an_elbow_is_that_of_the_worst_machine():
    """The crank points wherever its error adds to that of the leg's foot."""
    s = 1e-4
    signs = np.array(list(product((-s, s), repeat=7)))
    five_bar = np.hypot(signs[:, 0], signs[:, 1]).max() + s
    assert ROBOTS["five_bar"].mechanism.geometry_errors(s).ends == pytest.approx(five_bar, rel=1e-9)
    mechanism = ROBOTS["irsbot2"].mechanism
    g = mechanism.geometry
    motor_x, wrist_x, motor_z, wrist_z, drop, longer, across = signs.T
    inwards = (g.a1 + longer) * np.sin(g.beta + across / g.a1) - g.a1 * np.sin(g.beta)
    foot = np.hypot(motor_x - wrist_x + inwards, motor_z - wrist_z - drop)
    assert mechanism.geometry_errors(s).ends == pytest.approx(foot.max() + s, rel=1e-9)


def test_five_bar_with_every_length_off_the_worst_way():
    """Cranks shorter, rods longer, motors nearer by 0.2 mm: cos alpha by the law of cosines lies above the bound."""
    robot, s = irs.make_robot("five_bar"), 2e-4
    other = irs.make_robot("five_bar", l1=0.375 - s, l2=0.825 + s, b=0.1375 - s)
    below = 0
    for joints in np.random.default_rng(3).uniform(-np.pi, np.pi, (400, 2)):
        for assembly in (1, -1):
            at = robot.mechanism.posture(tuple(joints.tolist()), assembly)
            if at.status == irs.Status.SOLVED and at.type2 > 0.1:
                bound = robot.mechanism.certified_bounds(at, (0.0, 0.0), s)
                there = other.mechanism.posture(tuple(joints.tolist()), assembly)
                assert there.type2 >= bound.type2 - ROUNDING
                assert min(np.subtract(there.type1, bound.type1)) >= -ROUNDING
                below += there.type2 < at.type2
    assert below > 100


@pytest.mark.parametrize("name", NAMES)
def test_a_slack_that_tends_to_nothing_costs_nothing_and_one_that_is_no_number_leaves_nothing(name):
    robot, rng, tried = ROBOTS[name], np.random.default_rng(62), 0
    for _ in range(40):
        at = some_posture(robot, rng)
        if at is None or min(*at.type1, at.type2, *at.limb) < 0.2 or at.constraint < 0.02:
            continue
        tried += 1
        n = len(at.joints)
        exact, nearly = (robot.mechanism.certified_bounds(at, (1e-9,) * n, slack) for slack in (0.0, 1e-12))
        np.testing.assert_allclose(columns(nearly), columns(exact), atol=1e-6)
        for bad in (float("nan"), float("inf"), 10.0 * robot.mechanism.length_m):
            bound = robot.mechanism.certified_bounds(at, (0.0,) * n, bad)
            assert bound.type2 == 0.0
            assert not any(value > 0.0 for value in (*bound.type1, bound.constraint))
    assert tried > 3
