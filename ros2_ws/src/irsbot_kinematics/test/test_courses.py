"""Bounds along courses of the joints: never broken, of second order, better than those of a box."""

from __future__ import annotations

import numpy as np
import pytest
import wrong_machines
from postures import NAMES, ROBOTS, joint_range, near, random_joints
from rod_machines import closed, units

import irsbot_kinematics as irs
from irsbot_kinematics.courses import swept
from irsbot_kinematics.mechanism import Mechanism
from irsbot_kinematics.mechanisms.delta_family import DeltaGeometry
from irsbot_kinematics.mechanisms.orthoglide import Orthoglide
from irsbot_kinematics.mechanisms.planar_pair import _span as distances

ROUNDING = 1e-10
"""A bound is exact to rounding where the course is a point; samples are computed with rounding of their own."""
BESIDE = (0.0, 0.1, 1.0, 3.0)
"""Shares of the course by which a joint may be off it."""
every_robot = pytest.mark.parametrize("name", NAMES)


def random_postures(robot, rng, number):
    """Postures of all assembly modes in turn, at random joints."""
    modes = robot.mechanism.assembly_modes
    joints = random_joints(robot, rng, 3 * number * len(modes)).tolist()
    asked = (robot.mechanism.posture(tuple(q), modes[k % len(modes)]) for k, q in enumerate(joints))
    found = [at for at, _ in zip((at for at in asked if at.status == irs.Status.SOLVED), range(number), strict=False)]
    assert len(found) > number // 2, "hardly any posture is assembled: the fixture proves nothing"
    return found


def random_course(robot, rng, beside, longest=0.1):
    """(half, beside): any direction, often along one joint; from tiny to long."""
    lower, upper = joint_range(robot)
    half = (upper - lower) * longest * 10.0 ** rng.uniform(-4.0, 0.0) * rng.uniform(-1.0, 1.0, len(lower))
    if rng.uniform() < 0.3:
        half *= np.arange(len(half)) == rng.integers(len(half))
    return half, beside * np.abs(half).max() * rng.uniform(size=len(half))


def on_course(rng, half, beside, number):
    """Joints of a course less those of its middle (N, n), and s: ends, points between, and both with joints at or
    within what they may be beside."""
    s = np.linspace(-1.0, 1.0, number)
    ends = rng.uniform(size=number) < 0.4
    s[ends] = np.sign(s[ends])
    off = rng.uniform(-1.0, 1.0, (number, len(half)))
    off = np.where(rng.uniform(size=off.shape) < 0.5, np.sign(off), off)
    return s[:, None] * half + off * beside, s


def numbers(bound):
    return np.array([*bound.type1, bound.type2, bound.constraint, *bound.limb])


@every_robot
def test_no_margin_on_a_course_is_below_its_bound_and_the_branch_is_kept(name):
    robot, rng = ROBOTS[name], np.random.default_rng(30)
    holds = robot.mechanism.labels_hold
    number, points, promised, nearest = (240, 24, 0, np.inf) if holds else (100, 12, 0, np.inf)
    for k, at in enumerate(random_postures(robot, rng, number)):
        half, beside = random_course(robot, rng, BESIDE[k % 4])
        bound = robot.mechanism.guarantee_along(at, half.tolist(), beside.tolist())
        assert 0.0 <= bound.type2 <= at.type2 + ROUNDING
        if not bound.type2 > 0.0:
            continue
        promised += 1
        met = near(robot, at, np.array(at.joints) + on_course(rng, half, beside, points)[0])
        assert (met.status == irs.Status.SOLVED).all(), (at.joints, half, beside)
        assert (met.type1_margin >= np.array(bound.type1) - ROUNDING).all()
        assert (met.type2_margin >= bound.type2 - ROUNDING).all()
        nearest = min(nearest, np.min(met.type2_margin - bound.type2))
        if np.isfinite(bound.constraint):
            assert (met.constraint_margin >= bound.constraint - ROUNDING).all()
        assert (met.limb_margin >= np.array(bound.limb) - ROUNDING).all()
        kept = (np.array(bound.type1) <= 0.0) | (met.working_mode == np.array(at.working_mode))
        assert kept.all(), "a working mode changes only through a Type 1 margin of 0"
    assert promised > number // 4, "hardly anything is promised"
    assert nearest < 1e-5


@pytest.mark.parametrize("name", [name for name in NAMES if ROBOTS[name].mechanism.kind == "irsbot2"])
def test_the_constraint_bound_holds_where_the_margin_is_small_and_falls_fast(name):
    """One rod turns alone, or both alike or against each other."""
    robot, rng, used = ROBOTS[name], np.random.default_rng(37), 0.0
    postures = [at for at in random_postures(robot, rng, 3000) if min(*at.type1, at.type2) > 0.1]
    for at in sorted(postures, key=lambda at: at.constraint)[:120]:
        turns = rng.choice([(1.0, 0.0), (0.0, 1.0), (1.0, -1.0), (1.0, 1.0)]) * 10.0 ** rng.uniform(-4.0, -1.0)
        half = joints_that_turn(robot, at, turns)
        bound = robot.mechanism.guarantee_along(at, half.tolist(), (0.0, 0.0))
        if bound.type2 > 0.0 and bound.constraint > 0.0:
            met = near(robot, at, np.array(at.joints) + np.linspace(-1.0, 1.0, 41)[:, None] * half)
            assert (met.constraint_margin >= bound.constraint - ROUNDING).all()
            used = max(used, (at.constraint - met.constraint_margin.min()) / (at.constraint - bound.constraint))
    assert used > (0.8 if name == "irsbot2" else 0.2), "no margin falls as fast as is allowed for"


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
def test_near_ends_and_lengths_of_rods_stay_within_what_a_course_says_of_them(name):
    """And they use it: where joints may be beside the course, and where only the bend of their way is left."""
    robot, rng, used = ROBOTS[name], np.random.default_rng(38), {0.0: 0.0, 1.0: 0.0}
    for k, at in enumerate(random_postures(robot, rng, 60)):
        beside = float(k % 2)
        half, off = random_course(robot, rng, beside, 0.03)
        ahead, s = on_course(rng, half, off, 40)
        how, machine = wrong_machines.driven(robot, at, ahead), wrong_machines.rods(robot, at)
        rods = robot.mechanism.rods_of(at, half.tolist(), off.tolist(), 0.0)
        bound = robot.mechanism.guarantee_along(at, half.tolist(), off.tolist())
        met = swept(machine.posture, rods, machine.span)
        assert bound.type2 == pytest.approx(met.type2 if met else 0.0, abs=1e-12)
        for i, rod in enumerate(rods):
            astray = np.linalg.norm(how.shift[:, i] - s[:, None] * rod.near, axis=1)
            longer = np.abs(how.longer[:, i] - s * rod.growth)
            assert (astray <= rod.aside + 1e-14).all()
            assert (longer <= rod.growth_aside + 1e-14).all()
            assert 0.0 <= rod.length - machine.length[i] + 1e-12 < 1e-9
            said = rod.aside + rod.growth_aside
            if said > 1e-6:
                used[beside] = max(used[beside], (astray + longer).max() / said)
    assert min(used.values()) > 0.9, "more is allowed for than happens"


# --- machines that are wrong ---


@every_robot
def test_bounds_with_slack_hold_on_machines_whose_legs_are_that_wrong(name):
    """A leg that is too long or misplaced has the near end of its rod off by at most the slack, in any direction."""
    robot, rng = ROBOTS[name], np.random.default_rng(31)
    number, points = (120, 32) if robot.mechanism.labels_hold else (80, 32)
    promised, used = 0, 0.0
    for k, at in enumerate(random_postures(robot, rng, number)):
        half, beside = random_course(robot, rng, BESIDE[k % 4])
        machine = wrong_machines.rods(robot, at)
        slack = machine.length.min() * 10.0 ** rng.uniform(-5.0, -2.0) * min(1.0, 2.0 * at.type2)
        bound = robot.mechanism.guarantee_along(at, half.tolist(), beside.tolist(), slack)
        if not bound.type2 > 0.0:
            continue
        promised += 1
        how = wrong_machines.driven(robot, at, on_course(rng, half, beside, points)[0])
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


# --- what is lost ---


def lowest(robot, at, half, points=41):
    """Smallest Type 2 margin on a course, sampled densely."""
    s = np.linspace(-1.0, 1.0, points)[:, None]
    return near(robot, at, np.array(at.joints) + s * half).type2_margin.min()


@every_robot
def test_what_a_course_loses_is_of_second_order(name):
    """Of half the course a quarter of the loss is left; a box would leave a half."""
    robot, rng = ROBOTS[name], np.random.default_rng(33)
    lower, upper = joint_range(robot)
    still, ratios = [0.0] * len(lower), []
    for at in random_postures(robot, rng, 120 if robot.mechanism.labels_hold else 30):
        half = 3e-3 * (upper - lower) * at.type2 * rng.uniform(-1.0, 1.0, len(lower))
        lost = [
            lowest(robot, at, share * half) - robot.mechanism.guarantee_along(at, (share * half).tolist(), still).type2
            for share in (1.0, 0.5)
        ]
        if lost[0] < 0.1 and lost[1] > 1e-9:
            ratios.append(lost[0] / lost[1])
    assert len(ratios) > 15
    assert np.median(ratios) > 3.0


@every_robot
@pytest.mark.parametrize("beside", BESIDE[:2])
def test_a_course_is_usually_bounded_better_than_the_box_around_it(name, beside):
    robot, rng = ROBOTS[name], np.random.default_rng(34)
    gains, saved = [], []
    for at in random_postures(robot, rng, 80):
        half, off = random_course(robot, rng, beside, 0.03)
        along = numbers(robot.mechanism.guarantee_along(at, half.tolist(), off.tolist()))
        box = numbers(robot.mechanism.guarantee(at, (np.abs(half) + off).tolist()))
        if max(box[len(half)], along[len(half)]) > 0.0:
            gains.append(along - box)
            saved.append(gains[-1][len(half)] / (at.type2 - box[len(half)]))
    assert len(gains) > 40
    kept = np.array(gains)[:, ~np.isnan(gains[0])]
    assert (np.median(kept, axis=0) >= -1e-12).all()
    assert np.median(saved) > 0.3, "of what the box loses of Type 2"


# --- what is no course ---


@every_robot
@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf, 1e200, -1e200, "a turn"])
def test_nothing_is_promised_for_courses_that_are_unknown_or_of_a_whole_turn(name, wrong):
    robot, rng = ROBOTS[name], np.random.default_rng(35)
    lower, upper = joint_range(robot)
    n = len(lower)
    usual = [1e-3] * n
    for at in random_postures(robot, rng, 12):
        far = upper - lower if wrong == "a turn" else np.full(n, wrong)
        far = (far * (-1.0) ** np.arange(n)).tolist()  # slides on parallel rails may go far together
        asked = [(far, [0.0] * n, 0.0), (far, usual, 0.0), (usual, [abs(value) for value in far], 0.0)]
        if wrong != "a turn":
            asked += [
                (usual, usual, abs(wrong)),
                ([*usual[1:], wrong], usual, 0.0),
                (usual, [abs(wrong), *usual[1:]], 0.0),
            ]
        for half, beside, slack in asked:
            bound = robot.mechanism.guarantee_along(at, half, beside, slack)
            assert bound.type2 == 0.0, (half, beside, slack)
            assert min(bound.type1) == 0.0
            assert not bound.constraint > 0.0
            assert not bound.limb or min(bound.limb) == 0.0


@every_robot
@pytest.mark.parametrize("length", [0.0, 5e-324, 2.6e-162, 1e-60, 1e-17])
def test_a_course_that_is_shorter_than_any_motion_loses_nothing(name, length):
    robot, rng = ROBOTS[name], np.random.default_rng(36)
    n = len(robot.mechanism.joints)
    for at in random_postures(robot, rng, 30):
        if min(at.type2, *at.type1) > 0.1:
            for half, beside in ((length, 0.0), (0.0, length), (length, length)):
                bound = robot.mechanism.guarantee_along(at, [half] * n, [beside] * n)
                found = numbers(irs.Guarantee(at.type1, at.type2, at.constraint, at.limb))
                np.testing.assert_allclose(numbers(bound), found, atol=1e-9)


@pytest.mark.parametrize("length", [2.5e-162, 3.5e-162, 1e-160, 1e-9, 1.0])
def test_the_distance_from_a_way_is_that_of_its_nearest_point_however_short_it_is(length):
    assert distances(0.3, 0.0, 0.0, length, 0.0) == pytest.approx((0.3, np.hypot(0.3, length)), rel=1e-12)


def test_a_mechanism_that_knows_no_better_has_the_bound_of_the_box_around_a_course():
    class Plain(Orthoglide):
        guarantee_along = Mechanism.guarantee_along

    plain = Plain(DeltaGeometry(2.0, (0.0, 4.0)))
    at = plain.posture((1.4, 1.5, 1.7), -1)
    half, beside, slack = (0.02, -0.025, 0.0), (0.005, 0.0, 0.001), 1e-4
    box = plain.guarantee(at, (0.025, 0.025, 0.001), slack)
    assert plain.guarantee_along(at, half, beside, slack) == box
    assert 0.0 < box.type2 != Orthoglide.guarantee_along(plain, at, half, beside, slack).type2
