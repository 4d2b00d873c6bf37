"""Bounds along courses of the joints: never broken, of second order, better than those of a box."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
import wrong_machines
from postures import NAMES, ROBOTS, joint_range, near, random_joints
from rod_machines import Array, Machine, closed

import irsbot_kinematics as irs
from irsbot_kinematics.courses import Rod, swept
from irsbot_kinematics.mechanism import Mechanism
from irsbot_kinematics.mechanisms.delta_family import DeltaGeometry
from irsbot_kinematics.mechanisms.orthoglide import Orthoglide

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


def units(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


# --- rods of any place and direction: what the mechanisms hand to `swept`, and more ---

PLATFORMS = {"two rods": (2, 2), "three in space": (3, 3), "turning": (3, 2), "turning in space": (4, 3)}
"""Number of rods, dimensions."""
WAYS = ("ends", "swings", "lengths", "ends aside", "lengths aside", "off alone", "all")


class Course(NamedTuple):
    """What happens to the rods of a machine, as `Rod` says it, of all of them."""

    machine: Machine
    near: Array
    aside: Array
    growth: Array
    growth_aside: Array

    def rods(self):
        lists = [value.tolist() for value in (self.machine.length, *self[1:])]
        return [Rod(length, tuple(near), *rest) for length, near, *rest in zip(*lists, strict=True)]

    def met(self, s, e, g):
        """s (N,) in -1..1; e (N, n, m) and g (N, n) of size 1 at most: shares of what may come on top."""
        shift = s[:, None, None] * self.near + self.aside[:, None] * e
        return closed(self.machine, shift, s[:, None] * self.growth + self.growth_aside * g)


def random_machine_course(rng, rods, dims, way):
    """Lengths, arms and motions of very different sizes."""
    while True:
        arms = rng.normal(size=(rods, 2)) * 10.0 ** rng.uniform(-1.0, 1.0) * (rods > dims)
        machine = Machine(units(rng.normal(size=(rods, dims))), arms, 10.0 ** rng.uniform(-1.0, 1.0, rods))
        if abs(np.linalg.det(np.array(machine.posture.screws))) > 1e-2:
            break
    size = 10.0 ** rng.uniform(-3.5, -0.7) * machine.length
    some = lambda *ways: (way in ways) * size * (rng.uniform(size=rods) < 0.7)  # noqa: E731
    near = rng.normal(size=(rods, dims)) * some("ends", "swings", "ends aside", "lengths aside", "all")[:, None]
    if way == "swings":
        near -= np.sum(near * machine.r, axis=1, keepdims=True) * machine.r
    aside = some("ends aside", "off alone", "all") * 10.0 ** rng.uniform(-2.0, 0.5)
    growth_aside = some("lengths aside", "all") * 10.0 ** rng.uniform(-2.0, 0.5)
    growth = rng.normal(size=rods) * some("lengths", "lengths aside", "all")
    return Course(machine, near, aside, growth, growth_aside)


def steepest(course, n, m):
    """Points (s, e, g) at both ends of a course, with everything off where it lowers the Type 2 margin fastest."""
    step, points = 0.05, []
    ways = np.concatenate([np.zeros((1, n * m + n)), np.eye(n * m + n)])
    for s in (-1.0, 1.0):
        there = course.met(np.full(len(ways), s), step * ways[:, : n * m].reshape(-1, n, m), step * ways[:, n * m :])
        slope = (there.type2[1:] - there.type2[0]) / step
        down = -slope[: n * m].reshape(n, m)
        down /= np.maximum(np.linalg.norm(down, axis=1, keepdims=True), 1e-12)
        points.append((s, down, -np.sign(slope[n * m :])))
    return [np.array(column) for column in zip(*points, strict=True)]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("platform", PLATFORMS)
def test_rods_of_any_place_and_motion_stay_within_what_is_said_of_a_course(platform, way):
    """Near ends and lengths anywhere within their bounds, and where they lower the Type 2 margin fastest."""
    rng, (n, m), others = np.random.default_rng(32), PLATFORMS[platform], 24
    promised, used = 0, np.zeros(3)
    for _ in range(80 if platform == "turning in space" else 50):
        course = random_machine_course(rng, n, m, way)
        machine = course.machine
        said = swept(machine.posture, course.rods(), machine.span)
        if said is None or not said.type2 > 0.0:
            continue
        promised += 1
        s, e, g = steepest(course, n, m)
        s = np.concatenate([s, np.linspace(-1.0, 1.0, others)])
        along = machine.r * np.sign(rng.uniform(-1.0, 1.0, (others // 2, n, 1)))
        e = np.concatenate([e, units(rng.normal(size=(others // 2, n, m))), along])
        g = np.concatenate([g, np.sign(rng.uniform(-1.0, 1.0, (others, n)))])
        found, start = course.met(s, e, g), course.met(0.0 * s[:1], 0.0 * e[:1], 0.0 * g[:1])
        off, turns = np.linalg.norm(found.move - s[:, None] * said.move, axis=1), found.rod_turns(machine)
        assert (off <= said.aside + ROUNDING).all()
        assert (turns <= np.array(said.turns) + 10.0 * ROUNDING).all()
        assert (found.type2 >= said.type2 - ROUNDING).all()
        loss = (start.type2 - found.type2) / (start.type2 - said.type2 + 1e-9)
        shares = off / (said.aside + 1e-9), turns / (np.array(said.turns) + 1e-9), loss
        used = np.maximum(used, [share.max() for share in shares])
    assert promised > 10, "hardly anything is promised"
    assert (used > [0.7, 0.9, 0.3]).all(), "what happens is far from what is said of displacement, turns, Type 2"


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


def test_a_mechanism_that_knows_no_better_has_the_bound_of_the_box_around_a_course():
    class Plain(Orthoglide):
        guarantee_along = Mechanism.guarantee_along

    plain = Plain(DeltaGeometry(2.0, (0.0, 4.0)))
    at = plain.posture((1.4, 1.5, 1.7), -1)
    half, beside, slack = (0.02, -0.025, 0.0), (0.005, 0.0, 0.001), 1e-4
    box = plain.guarantee(at, (0.025, 0.025, 0.001), slack)
    assert plain.guarantee_along(at, half, beside, slack) == box
    assert 0.0 < box.type2 != Orthoglide.guarantee_along(plain, at, half, beside, slack).type2
