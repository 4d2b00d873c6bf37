"""Bounds of second order over boxes of joints: never broken, usually better than `certified_bounds`, and how loose."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
import wrong_geometry
import wrong_machines
from postures import NAMES, ROBOTS, joint_range, near, random_joints, solutions
from rod_machines import closed, units

import irsbot_kinematics as irs
from irsbot_kinematics.bounds.boxes import reached
from irsbot_kinematics.mechanism import Mechanism
from irsbot_kinematics.mechanisms.delta_kinematics import DeltaGeometry
from irsbot_kinematics.mechanisms.orthoglide import Orthoglide
from irsbot_kinematics.mechanisms.sliding_platform import SlidingPlatform

ROUNDING = 1e-10
"""A bound is exact to rounding where the box is a point; samples are computed with rounding of their own."""
every_robot = pytest.mark.parametrize("name", NAMES)


def random_postures(robot, rng, number):
    """Postures of all assembly modes in turn, at random joints."""
    joints = random_joints(robot, rng, 6 * number).tolist()
    there = ((k, solutions(robot, tuple(q))) for k, q in enumerate(joints))
    found = [at[k % len(at)] for (k, at), _ in zip((one for one in there if one[1]), range(number), strict=False)]
    assert len(found) > number // 2, "hardly any posture is assembled: the fixture proves nothing"
    return found


def random_travel(robot, rng, longest=0.1):
    """Of all joints, often of one alone; from tiny to large."""
    lower, upper = joint_range(robot)
    travel = (upper - lower) * longest * 10.0 ** rng.uniform(-4.0, 0.0) * rng.uniform(size=len(lower))
    if rng.uniform() < 0.3:
        travel *= np.arange(len(travel)) == rng.integers(len(travel))
    return travel


def in_box(rng, n, number):
    """(N, n) shares of the box: corners, points of faces, inner points."""
    inner = rng.uniform(-1.0, 1.0, (number, n))
    return np.where(rng.uniform(size=inner.shape) < 0.6, np.sign(inner), inner)


def corners(n):
    return np.array(list(product((-1.0, 1.0), repeat=n)))


def numbers(bound):
    return np.array([*bound.type1, bound.type2, bound.constraint, *bound.limb])


def margins(met):
    return np.column_stack([met.type1_margin, met.type2_margin, met.constraint_margin, met.limb_margin])


def steepest(robot, at, travel):
    """(margins, n) the corners where each margin falls fastest, from differences."""
    step = 1e-3 * travel * np.eye(len(travel))
    slopes = margins(near(robot, at, np.array(at.joints) + step)) - numbers(at)
    return -np.sign(np.nan_to_num(slopes.T))


@every_robot
def test_no_margin_in_a_box_is_below_its_bound_and_the_branch_is_kept(name):
    robot, rng = ROBOTS[name], np.random.default_rng(30)
    number, points = (120, 24) if robot.mechanism.label_is_invariant else (60, 8)
    promised, nearest = 0, np.inf
    for at in random_postures(robot, rng, number):
        travel = random_travel(robot, rng)
        bound = robot.mechanism.sharp_bounds(at, travel.tolist())
        assert 0.0 <= bound.type2 <= at.type2 + ROUNDING
        if not bound.type2 > 0.0:
            continue
        promised += 1
        s = np.concatenate([in_box(rng, len(travel), points), steepest(robot, at, travel)])
        met = near(robot, at, np.array(at.joints) + s * travel)
        assert (met.status == irs.Status.SOLVED).all(), (at.joints, travel)
        lost = numbers(bound) - margins(met)
        assert not (lost > ROUNDING).any(), (at.joints, travel)
        nearest = min(nearest, np.min(met.type2_margin - bound.type2))
        kept = (np.array(bound.type1) <= 0.0) | (met.working_mode == np.array(at.working_mode))
        assert kept.all(), "a working mode changes only through a Type 1 margin of 0"
    assert promised > number // 4, "hardly anything is promised"
    assert nearest < 1e-5


def test_planar_loops_of_any_proportions_stay_above_their_bounds():
    """Cranks much longer than the rods, too, whose ends swing across the line between them."""
    rng, s, promised, used = np.random.default_rng(44), np.array(list(product((-1.0, 0.0, 1.0), repeat=2))), 0, []
    for _ in range(400):
        l1, l2, b = (10.0 ** rng.uniform([-0.5, -1.5, -1.5], [0.5, 0.0, 0.5])).tolist()
        robot = irs.make_robot("five_bar", l1=l1, l2=l2, b=min(b, 0.9 * (l1 + l2)))
        for q in rng.uniform(-np.pi, np.pi, (60, 2)).tolist():
            at = robot.mechanism.posture(tuple(q), -1)
            if at.status == irs.Status.SOLVED and at.type2 > 0.02:
                break
        else:
            continue
        travel = 0.1 * at.type2 * min(1.0, l2 / l1) * 10.0 ** rng.uniform(-2.0, 0.5) * rng.uniform(size=2)
        bound = robot.mechanism.sharp_bounds(at, travel.tolist())
        if bound.type2 > 0.0:
            promised += 1
            met = near(robot, at, np.array(at.joints) + s * travel)
            assert not (margins(met) < numbers(bound) - ROUNDING).any(), (robot.mechanism.geometry, q, travel)
            used.append((at.type2 - met.type2_margin.min()) / (at.type2 - bound.type2))
    assert promised > 150
    assert np.median(used) > 0.9, "the samples are far from the bound"


@pytest.mark.parametrize("name", [name for name in NAMES if ROBOTS[name].mechanism.kind == "irsbot2"])
def test_the_constraint_bound_holds_where_the_margin_is_small_and_falls_fast(name):
    """One joint moves alone, or both, so that one rod turns alone or both alike or against each other."""
    robot, rng, used = ROBOTS[name], np.random.default_rng(37), []
    postures = [at for at in random_postures(robot, rng, 3000) if min(*at.type1, at.type2) > 0.1]
    s = np.array(list(product(np.linspace(-1.0, 1.0, 9), repeat=2)))
    for at in sorted(postures, key=lambda at: at.constraint)[:120]:
        turns = rng.choice([(1.0, 0.0), (0.0, 1.0), (1.0, -1.0), (1.0, 1.0)]) * 10.0 ** rng.uniform(-4.0, -1.0)
        travel = np.abs(joints_that_turn(robot, at, turns))
        if rng.uniform() < 0.3:
            travel[rng.integers(2)] = 0.0
        bound = robot.mechanism.sharp_bounds(at, travel.tolist())
        if bound.type2 > 0.0 and bound.constraint > 0.0:
            met = near(robot, at, np.array(at.joints) + s * travel)
            assert (met.constraint_margin >= bound.constraint - ROUNDING).all()
            used.append((at.constraint - met.constraint_margin.min()) / (at.constraint - bound.constraint))
    assert len(used) > 30
    assert np.quantile(used, 0.75) > (0.5 if name == "irsbot2_strict" else 0.9), (
        "margins do not fall as fast as is allowed for"
    )


def joints_that_turn(robot, at, turns):
    """Joint steps that turn both rods by given angles to first order, from differences of the direct kinematics."""
    step, slopes = 1e-6, []
    for k in range(2):
        q = np.array(at.joints)
        psi = []
        for sign in (-1.0, 1.0):
            q[k] = at.joints[k] + sign * step
            psi.append(
                [np.arctan2(-z, x) for x, z in robot.mechanism.posture(tuple(q.tolist()), at.assembly_mode).screws]
            )
        slopes.append(np.angle(np.exp(1j * np.subtract(psi[1], psi[0]))) / (2.0 * step))
    return np.linalg.solve(np.array(slopes).T, turns)


@pytest.mark.parametrize("name", [name for name in NAMES if hasattr(ROBOTS[name].mechanism, "rods_of")])
def test_near_ends_and_lengths_of_rods_stay_within_the_bounds_of_a_box(name):
    """And they use it."""
    robot, rng, used = ROBOTS[name], np.random.default_rng(38), 0.0
    straight = isinstance(robot.mechanism, SlidingPlatform)  # nothing is allowed for, so that nothing is used
    for at in random_postures(robot, rng, 60):
        travel = random_travel(robot, rng, 0.03)
        s = in_box(rng, len(travel), 40)
        how, machine = wrong_machines.driven(robot, at, s * travel), wrong_machines.rods(robot, at)
        rods = robot.mechanism.rods_of(at, travel.tolist(), 0.0)
        met = reached(machine.posture, rods)
        bound = robot.mechanism.sharp_bounds(at, travel.tolist())
        assert bound.type2 == pytest.approx(met.type2 if met else 0.0, abs=1e-12)
        for i, rod in enumerate(rods):
            x, none = s[:, i, None], (0.0,) * len(rod.near)
            ways = x * rod.near + x**2 * np.array(rod.curve or none) + x**3 * np.array(rod.third or none)
            off = np.linalg.norm(how.shift[:, i] - ways, axis=1)
            grown = x * rod.growth + x**2 * rod.growth_curve + x**3 * rod.growth_third
            longer = np.abs(how.longer[:, i] - grown[:, 0])
            assert (off <= rod.aside + 1e-14).all()
            assert not straight or rod.aside == rod.growth_aside == 0.0
            assert (longer <= rod.growth_aside + 1e-14).all()
            assert 0.0 <= rod.length - machine.length[i] + 1e-12 < 1e-9
            if rod.aside + rod.growth_aside > 1e-9:
                used = max(used, (off + longer).max() / (rod.aside + rod.growth_aside))
    if robot.mechanism.joints[0].is_angle:
        assert used > 0.9, "more is allowed for than happens"


# --- machines that are wrong ---


@every_robot
def test_bounds_with_slack_hold_on_machines_whose_legs_are_that_wrong(name):
    """A leg that is too long or misplaced has the near end of its rod off by at most the slack, in any direction."""
    robot, rng = ROBOTS[name], np.random.default_rng(31)
    number, points = (60, 32) if robot.mechanism.label_is_invariant else (40, 32)
    promised, used = 0, 0.0
    for at in random_postures(robot, rng, number):
        travel = random_travel(robot, rng)
        machine = wrong_machines.rods(robot, at)
        slack = machine.length.min() * 10.0 ** rng.uniform(-5.0, -2.0) * min(1.0, 2.0 * at.type2)
        bound = robot.mechanism.sharp_bounds(at, travel.tolist(), slack)
        if not bound.type2 > 0.0:
            continue
        promised += 1
        how = wrong_machines.driven(robot, at, in_box(rng, len(travel), points) * travel)
        wrong = rng.normal(size=how.shift.shape)
        wrong[::2] = machine.r * rng.normal(size=(points // 2, len(machine.r), 1))  # rods too long or too short
        met = closed(machine, how.shift + slack * units(wrong), how.longer)
        type1, constraint, limb = wrong_machines.margins(robot, how, met.r)
        assert (met.type2 >= bound.type2 - ROUNDING).all()
        assert (type1 >= np.array(bound.type1) - ROUNDING).all()
        assert (limb >= np.array(bound.limb) - ROUNDING).all()
        assert constraint is None or (constraint >= bound.constraint - ROUNDING).all()
        used = max(used, (at.type2 - met.type2.min()) / (at.type2 - bound.type2))
    assert promised > number // 4, "hardly anything is promised"
    assert used > 0.05, "the machines are far from the bound: the fixture does not bite"


@every_robot
def test_bounds_with_slack_hold_on_machines_with_errors_of_every_length_and_place(name):
    """Among the machines are those whose errors and joints lower a margin fastest."""
    rng, promised, used = np.random.default_rng(40), 0, 0.0
    for k in range(40):
        robot = ROBOTS[name] if k % 2 else wrong_geometry.random_machine(ROBOTS[name].mechanism.kind, rng)
        at = wrong_geometry.some_posture(robot, rng)
        if at is None:
            continue
        slack = robot.mechanism.length_m * 10.0 ** rng.uniform(-6.0, -2.3)
        travel = rng.integers(0, 2) * wrong_geometry.random_travel(robot, at, rng)
        bound = robot.mechanism.sharp_bounds(at, travel.tolist(), slack)
        if bound.type2 > 0.0:
            promised += 1
            met = wrong_geometry.margins(robot, at, *wrong_geometry.attacks(robot, at, travel, slack, rng))
            stated, now = wrong_geometry.columns(bound)[0], wrong_geometry.columns(at)[0]
            found = wrong_geometry.columns(met)
            assert (found >= stated - ROUNDING).all()
            used = max(used, np.max((now - found.min(axis=0)) / (now - stated + 1e-9)))
    assert promised > 12, "hardly anything is promised"
    assert used > 0.3, "the machines are far from the bound: the fixture does not bite"


# --- what is lost ---


@every_robot
def test_the_pessimism_of_a_box_is_of_second_or_third_order(name):
    """Of half the box a quarter of it is left, of platforms on rods an eighth; bounds of first order leave a half."""
    robot, rng = ROBOTS[name], np.random.default_rng(33)
    lower, upper = joint_range(robot)
    s, ratios = corners(len(lower)), []
    for at in random_postures(robot, rng, 120 if robot.mechanism.label_is_invariant else 30):
        travel = 3e-3 * (upper - lower) * at.type2 * rng.uniform(size=len(lower))
        lost = [
            near(robot, at, np.array(at.joints) + share * travel * s).type2_margin.min()
            - robot.mechanism.sharp_bounds(at, (share * travel).tolist()).type2
            for share in (1.0, 0.5)
        ]
        if lost[0] < 0.1 and lost[1] > 1e-9:
            ratios.append(lost[0] / lost[1])
    assert len(ratios) > 15
    assert np.median(ratios) > (3.4 if len(lower) == 2 else 6.8)


@every_robot
def test_the_second_order_is_usually_better_than_the_first(name):
    robot, rng = ROBOTS[name], np.random.default_rng(34)
    gains, saved = [], []
    for at in random_postures(robot, rng, 80):
        travel = random_travel(robot, rng, 0.03).tolist()
        sharp, usual = (
            numbers(robot.mechanism.sharp_bounds(at, travel)),
            numbers(robot.mechanism.certified_bounds(at, travel)),
        )
        k = len(travel)
        if max(sharp[k], usual[k]) > 0.0:
            gains.append(sharp - usual)
            saved.append(gains[-1][k] / (at.type2 - usual[k]))
    assert len(gains) > 40
    kept = np.array(gains)[:, ~np.isnan(gains[0])]
    assert (np.median(kept, axis=0) >= -1e-12).all()
    assert np.median(saved) > 0.2, "of what the first order loses of Type 2"


# --- what is no box ---


@every_robot
def test_nothing_is_promised_for_boxes_that_are_unknown_or_of_a_whole_turn(name):
    robot, rng = ROBOTS[name], np.random.default_rng(35)
    lower, upper = joint_range(robot)
    n = len(lower)
    usual = [1e-3] * n
    asked = [((upper - lower).tolist(), 0.0)]
    for wrong in (np.nan, np.inf, -1e-3, 1e200):
        asked += [([wrong] * n, 0.0), ([*usual[1:], wrong], 0.0), ([wrong, *usual[1:]], 0.0)]
        if not wrong < 0.0:
            asked.append((usual, wrong))
    for at in random_postures(robot, rng, 12):
        for travel, slack in asked:
            bound = robot.mechanism.sharp_bounds(at, travel, slack)
            assert bound.type2 == 0.0, (travel, slack)
            assert min(bound.type1) == 0.0
            assert not bound.constraint > 0.0
            assert not bound.limb or min(bound.limb) == 0.0


@every_robot
def test_a_box_that_is_smaller_than_any_motion_loses_nothing(name):
    robot, rng = ROBOTS[name], np.random.default_rng(36)
    n = len(robot.mechanism.joints)
    for at in random_postures(robot, rng, 20):
        if min(at.type2, *at.type1) > 0.1:
            for length in (0.0, 5e-324, 2.6e-162, 1e-17):
                for travel in ([length] * n, [length] + [0.0] * (n - 1)):
                    bound = robot.mechanism.sharp_bounds(at, travel)
                    np.testing.assert_allclose(numbers(bound), numbers(at), atol=1e-9, err_msg=str(travel))


def test_a_mechanism_that_knows_no_better_has_its_usual_bound():
    class Plain(Orthoglide):
        sharp_bounds = Mechanism.sharp_bounds

    plain = Plain(DeltaGeometry(2.0, (0.0, 4.0)))
    at = plain.posture((1.4, 1.5, 1.7), -1)
    travel, slack = (0.025, 0.025, 0.001), 1e-4
    usual = plain.certified_bounds(at, travel, slack)
    assert plain.sharp_bounds(at, travel, slack) == usual
    assert 0.0 < usual.type2 != Orthoglide.sharp_bounds(plain, at, travel, slack).type2
