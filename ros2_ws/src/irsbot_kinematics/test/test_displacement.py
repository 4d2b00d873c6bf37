"""Certified bounds: what `certified_bounds` and `clearance` promise is never broken, and they promise something."""

from __future__ import annotations

import irsbot2_3d as space
import numpy as np
import pytest
from irsbot2_3d import Design
from postures import NAMES, ROBOTS, apart, joint_range, near, random_joints

import irsbot_kinematics as irs
from irsbot_kinematics.bounds.displacement import least_cosine

ROUNDING = 1e-10
"""A bound is exact to rounding where the box is a point; samples are computed with rounding of their own."""
POSTURES, IN_BOX = 30, 40

every_robot = pytest.mark.parametrize("name", NAMES)


def random_postures(robot, rng, number):
    """(assembly mode, posture) pairs, all assembly modes in turn."""
    found = []
    for assembly in robot.mechanism.assembly_modes:
        for q in random_joints(robot, rng, number).tolist():
            at = robot.mechanism.posture(tuple(q), assembly)
            if at.status == irs.Status.SOLVED:
                found.append((assembly, at))
    assert len(found) > number // 4, "hardly any posture is assembled: the fixture proves nothing"
    return found


def in_box(rng, at, travel, number):
    """Joint positions in the box: its corners, points of its faces and inner points."""
    n = len(travel)
    inner = rng.uniform(-1.0, 1.0, (number, n))
    corners = np.sign(rng.uniform(-1.0, 1.0, (number, n)))
    share = np.where(rng.uniform(size=(number, n)) < 0.5, corners, inner)
    return np.array(at.joints) + share * travel


@every_robot
def test_no_margin_in_a_box_of_joints_is_below_the_guarantee_and_the_branch_is_kept(name):
    robot, rng = ROBOTS[name], np.random.default_rng(20)
    lower, upper = joint_range(robot)
    promised = 0
    for assembly, at in random_postures(robot, rng, POSTURES):
        travel = (upper - lower) * 10.0 ** rng.uniform(-5.0, -1.0) * rng.uniform(0.0, 1.0, len(lower))
        bound = robot.mechanism.certified_bounds(at, travel.tolist())
        assert 0.0 <= bound.type2 <= at.type2 + ROUNDING
        assert all(0.0 <= b <= m + ROUNDING for b, m in zip(bound.type1, at.type1, strict=True))
        if not bound.type2 > 0.0:
            continue
        promised += 1
        met = near(robot, at, in_box(rng, at, travel, IN_BOX))
        assert (met.status == irs.Status.SOLVED).all(), (assembly, at.joints)
        assert (met.type1_margin >= np.array(bound.type1) - ROUNDING).all()
        assert (met.type2_margin >= bound.type2 - ROUNDING).all()
        constraint = -np.inf if np.isnan(bound.constraint) else bound.constraint
        assert (np.nan_to_num(met.constraint_margin, nan=np.inf) >= constraint - ROUNDING).all()
        assert (met.limb_margin >= np.array(bound.limb) - ROUNDING).all()
        kept = (np.array(bound.type1) <= 0.0) | (met.working_mode == np.array(at.working_mode))
        assert kept.all(), "a working mode changes only through a Type 1 margin of 0"
    assert promised > POSTURES // 4, "hardly anything is promised"


@every_robot
def test_the_guarantee_tends_to_the_margins_as_the_box_shrinks(name):
    robot, rng = ROBOTS[name], np.random.default_rng(21)
    lower, upper = joint_range(robot)
    moment = robot.mechanism.length_m if robot.mechanism.task[-1].is_angle else 1.0
    regular = [
        at
        for _, at in random_postures(robot, rng, 120)
        if min(at.type1) > 0.05
        and at.type2 > 0.05
        and abs(at.det) > 0.04 * moment  # the bound starts from 1/det, which the cosines alone do not limit
        and not at.constraint < 0.01
        and not min(at.limb, default=1.0) < 0.01
    ]
    assert len(regular) > 12
    for at in regular:
        worst = []
        for share in (1e-4, 1e-6, 1e-8):
            bound = robot.mechanism.certified_bounds(at, (share * (upper - lower)).tolist())
            margins = np.array([*at.type1, at.type2, *([] if np.isnan(at.constraint) else [at.constraint]), *at.limb])
            floors = [
                *bound.type1,
                bound.type2,
                *([] if np.isnan(bound.constraint) else [bound.constraint]),
                *bound.limb,
            ]
            assert len(floors) == len(margins)
            worst.append(np.max(margins - floors))
        assert worst[1] < 0.01
        assert worst[2] < 1e-4


@every_robot
def test_nothing_is_promised_over_a_whole_turn_or_for_an_unknown_travel(name):
    robot, rng = ROBOTS[name], np.random.default_rng(22)
    lower, upper = joint_range(robot)
    for _, at in random_postures(robot, rng, 20):
        for travel in ((upper - lower).tolist(), [np.nan] * len(lower), [np.inf] * len(lower)):
            bound = robot.mechanism.certified_bounds(at, travel)
            assert (*bound.type1, bound.type2) == (0.0,) * (len(bound.type1) + 1)
            assert not bound.constraint > 0.0
            assert not any(margin > 0.0 for margin in bound.limb)


def test_a_leg_that_can_be_folded_to_nothing_has_no_type_1_guarantee_where_the_move_takes_it_there():
    """Crank and rod of equal length: P near a motor axis is near Type 1, on whichever side of the axis."""
    robot, asked = irs.make_robot("five_bar", l1=0.4, l2=0.4, b=0.2), 0
    for away in (0.01, 0.02, 0.04):
        q = robot.inverse((-0.2 + away, 0.0), (1, -1))
        at = next(at for at in (robot.mechanism.posture(tuple(q), a) for a in (-1, 1)) if abs(at.pose[1]) < 1e-9)
        for travel in (0.5 * away, 2.0 * away, 5.0 * away):
            bound = robot.mechanism.certified_bounds(at, (travel, travel))
            if bound.type2 > 0.0 and 2.0 * 0.4 * travel > away:  # the joints' box holds postures at the axis
                asked += 1
                assert bound.type1[0] == 0.0
    assert asked > 3


@pytest.mark.parametrize("name", [name for name in NAMES if ROBOTS[name].mechanism.kind == "irsbot2"])
def test_the_guarantee_with_slack_holds_on_machines_whose_legs_are_that_wrong(name):
    """A leg that is too long or misplaced has its elbow off by at most the slack; both legs at once, any direction."""
    robot, rng = ROBOTS[name], np.random.default_rng(23)
    g = robot.mechanism.geometry
    d = Design(g.l1, g.l2eq, g.b, g.p, g.a1, g.a2, g.beta, g.e)
    number, promised, nearest = 80, 0, np.inf
    for assembly, at in random_postures(robot, rng, 120):
        slack = g.l2eq * 10.0 ** rng.uniform(-4.0, -1.5)
        travel = 10.0 ** rng.uniform(-4.0, -1.0) * rng.uniform(0.0, 1.0, 2)
        bound = robot.mechanism.certified_bounds(at, travel.tolist(), slack)
        if not bound.type2 > 0.0:
            continue
        promised += 1
        q = in_box(rng, at, travel, number)
        wrong = slack * np.exp(2j * np.pi * rng.uniform(size=(number, 2)))
        line = complex(at.screws[0][0] - at.screws[1][0], at.screws[0][1] - at.screws[1][1])  # C_1C_2 over l2eq
        worst = np.sign(rng.uniform(-1.0, 1.0, (number // 2, 1))) * [-1.0, 1.0]
        wrong[: number // 2] = slack * line / abs(line) * worst  # both elbows pulled apart, or pushed together
        psi1, psi2 = bent(d, q, wrong, assembly)
        type2 = np.abs(np.sin(psi1 - psi2))
        assert (type2 >= bound.type2 - ROUNDING).all()
        nearest = min(nearest, np.min(type2 - bound.type2))
        for k, psi in enumerate((psi1, psi2)):
            assert (np.abs(np.sin(q[:, k] - psi)) >= bound.type1[k] - ROUNDING).all()
        assert (space.kappa(d, psi1, psi2) >= bound.constraint - ROUNDING).all()
    assert promised > 60
    assert nearest < 1e-3, "the machines are far from the bound: the fixture does not bite"


def bent(d, q, wrong, assembly):
    """psi_1, psi_2 of legs whose elbows C_k are displaced by complex numbers `wrong`."""
    C = [
        -sign * d.b0 + d.l1 * np.cos(q[:, k]) + 1j * (-d.e - d.l1 * np.sin(q[:, k])) + wrong[:, k]
        for k, sign in enumerate(space.SIGMA)
    ]
    across = C[1] - C[0]
    rod = d.l2eq * across / np.abs(across) * np.exp(1j * assembly * np.arccos(np.abs(across) / (2.0 * d.l2eq)))
    return -np.angle(rod), -np.angle(C[0] + rod - C[1])


MOVES, ALONG = 16, 8


@every_robot
def test_no_straight_move_shorter_than_the_clearance_meets_a_singularity(name):
    """The inverse kinematics stays solvable, and the direct one gives the pose back in the same assembly mode: no
    margin has changed its sign on the way. The move is a translation; the platform keeps its orientation."""
    robot, rng = ROBOTS[name], np.random.default_rng(24)
    turns = robot.mechanism.task[-1].is_angle
    useful = 0
    for _, at in random_postures(robot, rng, POSTURES):
        if 0 in at.working_mode:
            continue
        clearance = robot.mechanism.clearance(at)
        assert clearance >= 0.0
        useful += clearance > 0.01 * min(at.reach)
        way = rng.normal(size=(MOVES, len(at.pose) - turns))
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        if turns:
            way = np.insert(way, way.shape[1], 0.0, axis=1)
        share = np.linspace(0.0, 1.0 - 1e-6, ALONG)
        poses = (np.array(at.pose) + clearance * way[:, None, :] * share[None, :, None]).reshape(-1, len(at.pose))
        q, status, _ = robot.inverse_many(poses, at.working_mode)
        assert (status == irs.Status.SOLVED).all()
        evs = near(robot, at, q)
        assert (evs.type1_margin > 0.0).all()
        near_type2 = evs.type2_margin < 1e-6  # there the direct kinematics is worth half its digits
        assert (apart(robot, evs.pose, poses)[~near_type2] < 1e-7).all()
        assert not (evs.constraint_margin <= 0.0).any()
    assert useful > POSTURES / 4


def test_clearance_of_the_worked_example_is_the_exact_distance_to_the_boundary():
    """W1: Type 1 at .352478386 = l1 + l2eq - |A_II P|; Type 2 of this mode is 1.2293 away."""
    robot = ROBOTS["irsbot2"]
    at = robot.posture(robot.inverse((0.3, -0.75)))
    assert robot.mechanism.clearance(at) == pytest.approx(0.352478386, abs=1e-9)


@every_robot
@pytest.mark.parametrize("travel", [5e-324, 1e-323, 1e-310, 1e-200, 1e-60])
def test_a_box_that_is_smaller_than_any_motion_loses_nothing(name, travel):
    robot = ROBOTS[name]
    for _assembly, at in random_postures(robot, np.random.default_rng(8), 12):
        if min(min(at.type1), at.type2) < 0.1:
            continue
        found = robot.mechanism.certified_bounds(at, (travel,) * len(at.joints))
        assert found.type2 == pytest.approx(at.type2, abs=1e-9)
        assert found.type1 == pytest.approx(at.type1, abs=1e-9)


def whole(n: int, seed: int) -> tuple[list[list[tuple[float, ...]]], list[float]]:
    """Velocities and turns of a rigid planar platform on n rods, by numpy alone."""
    rng = np.random.default_rng(seed)
    rods, arms = rng.uniform(0.0, 2.0 * np.pi, n), rng.uniform(-0.2, 0.2, (n, 2))
    rows = np.array(
        [[np.cos(a), np.sin(a), x * np.sin(a) - y * np.cos(a)] for a, (x, y) in zip(rods, arms, strict=True)]
    )
    twists = np.linalg.inv(rows).T
    velocities = [[(t[0] - t[2] * y, t[1] + t[2] * x) for x, y in arms.tolist()] for t in twists.tolist()]
    return velocities, np.abs(twists[:, 2]).tolist()


def test_the_least_cosine_of_rods_that_keep_their_directions_is_the_smallest_cosine():
    for seed in range(20):
        velocities, turns = whole(3, seed)
        cosines = [1.0 / np.hypot(*velocities[i][i]) for i in range(3)]
        assert least_cosine(velocities, turns, [0.0] * 3, 0.0) == pytest.approx(min(cosines), rel=1e-12)


@pytest.mark.parametrize("norm", [0.1, 0.5, 0.9])
def test_the_least_cosine_counts_the_whole_series(norm):
    """Errors of places alone, and legs that turn the platform alike: all rows of G are equal, and its powers add up to
    G/(1 - norm)."""
    velocities = np.random.default_rng(12).uniform(-1.0, 1.0, (3, 3, 2))
    turn = 0.8
    arm = norm / (3 * turn)
    change = arm * turn / (1.0 - norm)
    largest = []
    for i in range(3):
        own = velocities[i, i] / np.linalg.norm(velocities[i, i])
        along = np.linalg.norm(velocities[i, i]) + change * np.abs(velocities[:, i] @ own).sum()
        across = change * np.abs(velocities[:, i] @ (-own[1], own[0])).sum()
        largest.append(np.hypot(along, across) + arm * turn * (1.0 + 3 * change))
    found = least_cosine([[tuple(v) for v in leg] for leg in velocities.tolist()], [turn] * 3, [0.0] * 3, arm)
    assert found == pytest.approx(1.0 / max(largest), rel=1e-12)


def test_the_least_cosine_with_a_number_missing_proves_nothing():
    velocities, turns = whole(3, 1)
    assert least_cosine(velocities, turns, [1e-3] * 3, 1e-6) > 0.0
    for j, i in np.ndindex(3, 3):
        broken = [list(row) for row in velocities]
        broken[j][i] = (np.nan, 0.0)
        assert least_cosine(broken, turns, [1e-3] * 3, 1e-6) == 0.0
    for i in range(3):
        still = [list(row) for row in velocities]
        still[i][i] = (0.0, 0.0)  # of no posture: a rod that yields moves its own place
        assert least_cosine(still, turns, [1e-3] * 3, 1e-6) == 0.0
    assert least_cosine(velocities, turns, [np.nan, 0.0, 0.0], 0.0) == 0.0
    assert least_cosine(velocities, [0.0, np.nan, 0.0], [0.0] * 3, 0.0) == 0.0
