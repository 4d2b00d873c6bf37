"""Branches of platforms on cranks, followed between neighbours; their certified bounds and boxes."""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
import pytest
from cranks import EXACT, HOME, ROBOTS, close, every_robot, layout, random_poses, rods
from hypothesis import given
from hypothesis import strategies as st

from irsbot_kinematics import Status, make_robot, statics
from irsbot_kinematics.mechanisms.branched_platform import _box_of
from irsbot_kinematics.numerics.arithmetic import ARRAYS, FLOATS

# --- following a branch ------------------------------------------------------------------------------------------


def walk(robot, rng, steps, size):
    """(followed posture, posture before) along a straight way in joint space from home, until it is lost."""
    m = robot.mechanism
    x = HOME[next(name for name in ROBOTS if ROBOTS[name] is robot)]
    q, _ = m.inverse(FLOATS, x, m.usual_working_mode)
    at = m.at(q, x, 1, (1.0, 1.0))
    way = rng.normal(size=len(q))
    way *= size / np.abs(way).max()
    for step in range(1, steps + 1):
        ahead = m.track(tuple(a + step * b for a, b in zip(q, way.tolist(), strict=True)), at)
        if ahead.status != Status.SOLVED:
            return
        yield ahead, at
        at = ahead


@every_robot
def test_a_followed_branch_is_continuous_closes_and_keeps_the_sign_of_its_determinant(name):
    robot, rng, lengths = ROBOTS[name], np.random.default_rng(9), []
    for _ in range(8):
        steps = 0
        for ahead, before in walk(robot, rng, 60, 0.04):
            steps += 1
            assert ahead.residual < 1e-12
            assert ahead.det * before.det > 0.0
            assert ahead.assembly_mode == before.assembly_mode
            x, way = np.array(before.pose), np.array(ahead.joints) - np.array(before.joints)
            for share in np.arange(1, 11) / 10:  # Newton steps along ten small ones arrive at the same pose
                x = close(robot, np.array(before.joints) + share * way, x)
            np.testing.assert_allclose(ahead.pose, x, atol=EXACT)
        lengths.append(steps)
        poses = robot.mechanism.assemblies([np.array([value]) for value in before.joints])
        candidates = np.array([column[0] for column in poses.pose]).T[poses.valid[0]]
        away = (
            (candidates - np.array(before.pose))[:, :-1],
            np.angle(np.exp(1j * (candidates[:, -1] - before.pose[-1]))),
        )
        assert (np.abs(away[0]).max(axis=1) + np.abs(away[1])).min() < 1e-6
    assert max(lengths) > 30
    assert min(lengths) < 60, "some ways end at a singularity"


@every_robot
def test_a_step_does_not_depend_on_the_steps_before(name):
    """The box of the last step is kept; the same step of a robot that made none has the same bits."""
    robot, rng, solved = ROBOTS[name], np.random.default_rng(10), 0
    for at, _ in walk(robot, rng, 40, 0.01):
        way = rng.normal(size=len(at.joints)) * 10.0 ** rng.uniform(-4.0, -1.0)
        there = [tuple((np.array(at.joints) + sign * way).tolist()) for sign in (1.0, -1.0, 0.5)]
        found = [robot.mechanism.track(joints, at) for joints in there]
        fresh = [type(robot.mechanism)(robot.mechanism.geometry).track(joints, at) for joints in there]
        assert repr(found) == repr(fresh)
        solved += found[0].status == found[1].status == Status.SOLVED
    assert solved > 5


@given(st.lists(st.floats(-1e300, 1e300), min_size=1, max_size=4))
def test_the_box_of_a_step_holds_it_and_hardly_more(ahead):
    for way, most in zip(ahead, _box_of(ahead), strict=True):
        assert abs(way) <= most <= abs(way) * (1.0 + 1e-8) + 5e-324


def test_a_step_and_the_step_back_have_one_box():
    rng = np.random.default_rng(11)
    middle, half = rng.uniform(-3.0, 3.0, 1000), 10.0 ** rng.uniform(-5.0, 0.0, 1000)
    ahead, back = (middle + half) - middle, (middle - half) - middle
    assert (ahead != -back).any()
    assert _box_of(ahead.tolist()) == _box_of(back.tolist())


@every_robot
def test_a_branch_is_lost_only_where_it_ends(name):
    """Where `track` gives up, the way meets Type 2 within a step: followed in steps of 1/200 the margin vanishes."""
    robot, rng, ends = ROBOTS[name], np.random.default_rng(10), 0
    for _ in range(25):
        last = None
        for ahead, _ in walk(robot, rng, 150, 0.01):
            last = ahead
        if last is None or last.type2 > 0.3:
            continue
        way = np.array(last.joints) - np.array(HOME_JOINTS[name])
        way *= 0.01 / np.abs(way).max()
        at, smallest = last, last.type2
        for share in np.arange(1, 401) / 200:
            ahead = robot.mechanism.track(tuple((np.array(last.joints) + share * way).tolist()), at)
            if ahead.status != Status.SOLVED:
                break
            at, smallest = ahead, min(smallest, ahead.type2)
        if ahead.status != Status.SOLVED:
            ends += 1
            assert smallest < 0.1
    assert ends >= 3


HOME_JOINTS = {
    name: ROBOTS[name].mechanism.inverse(FLOATS, HOME[name], ROBOTS[name].mechanism.usual_working_mode)[0]
    for name in ROBOTS
}


@every_robot
def test_a_far_goal_is_reached_in_proved_steps_or_refused_and_never_guessed(name):
    robot, rng, statuses = ROBOTS[name], np.random.default_rng(11), []
    q, x = HOME_JOINTS[name], HOME[name]
    start = robot.mechanism.at(q, x, 1, (1.0, 1.0))
    for _ in range(40):
        goal = np.array(q) + rng.uniform(-1, 1, len(q)) * 10 ** rng.uniform(-2, 0.5)
        ahead = robot.mechanism.track(tuple(goal.tolist()), start)
        statuses.append(ahead.status)
        at, lost = start, False
        for share in np.arange(1, 201) / 200:  # the same way in small steps
            at = robot.mechanism.track(tuple((np.array(q) + share * (goal - q)).tolist()), at)
            if at.status != Status.SOLVED:
                lost = True
                break
        if ahead.status == Status.SOLVED:
            assert not lost
            np.testing.assert_allclose(ahead.pose, at.pose, atol=1e-9)
    assert {Status.SOLVED, Status.SINGULAR} <= set(statuses)
    assert robot.mechanism.track((float("nan"),) * len(q), start).status == Status.INVALID
    turned = robot.mechanism.track(tuple(value + 2 * pi for value in q), start)
    assert turned.joints == tuple(value + 2 * pi for value in q), "a crank that its encoder counts a turn farther"
    np.testing.assert_allclose(turned.pose, start.pose, atol=EXACT)
    nowhere = robot.mechanism.track(q, robot.mechanism.track((float("nan"),) * len(q), start))
    assert nowhere.status == Status.SOLVED, "without a neighbour the usual label is looked up"


@pytest.mark.parametrize("slack_share", [0.0, 1.0], ids=["exact machine", "machine within the slack"])
@every_robot
def test_no_margin_on_the_branch_is_below_the_guarantee(name, slack_share):
    """Joints anywhere in the box; crank ends off by up to the slack; followed from the posture in five steps."""
    robot, rng, promised = ROBOTS[name], np.random.default_rng(12), 0
    B = layout(robot)[1]
    for q, x, _ in random_poses(robot, rng, 30, best=0.1):
        at = robot.mechanism.at(tuple(q.tolist()), tuple(x.tolist()), 1, (0.0, 1.0))
        travel, slack = 10.0 ** rng.uniform(-4, -2, len(q)), slack_share * 10.0 ** rng.uniform(-5, -3)
        bound = robot.mechanism.certified_bounds(at, travel.tolist(), slack)
        if not bound.type2 > 0.0:
            continue
        promised += 1
        for _ in range(8):
            ahead = travel * np.sign(rng.uniform(-1, 1, len(q)))
            off = rng.normal(size=(len(q), 3)) * ([1, 1, 1] if len(q) == 4 else [1, 1, 0])
            off *= slack / np.linalg.norm(off, axis=1, keepdims=True)
            pose = x
            for share in (0.2, 0.4, 0.6, 0.8, 1.0):
                pose = close_wrong(robot, q + share * ahead, pose, share * off)
            d = rods(robot, q + ahead, pose) - off
            r = d / np.linalg.norm(d, axis=1, keepdims=True)
            crank = np.stack([np.cos(q + ahead), np.sin(q + ahead)], axis=1)
            normalised_levers = np.abs(crank[:, 0] * r[:, 1] - crank[:, 1] * r[:, 0])
            assert (normalised_levers >= np.array(bound.type1) - EXACT).all()
            turned = np.array(
                [[cos(pose[-1]) * u - sin(pose[-1]) * v, sin(pose[-1]) * u + cos(pose[-1]) * v] for u, v, _ in B]
            )
            moment = turned[:, 0] * r[:, 1] - turned[:, 1] * r[:, 0]
            rows = np.column_stack([r if len(q) == 4 else r[:, :2], moment])
            _, cosines = statics.pressure_cosines(FLOATS, rows.tolist(), turned.tolist())
            assert min(cosines) >= bound.type2 - EXACT
            if len(q) == 4:
                level = r[:, :2] / np.linalg.norm(r[:, :2], axis=1, keepdims=True)
                assert np.linalg.svd(level)[1][1] / np.sqrt(2) >= bound.constraint - EXACT
                assert (normalised_levers >= np.array(bound.limb) - EXACT).all()
    assert promised > 6
    for travel in ([float("nan")] * len(q), [float("inf")] * len(q), [6.3] * len(q)):
        nothing = robot.mechanism.certified_bounds(at, travel)
        assert (*nothing.type1, nothing.type2, *nothing.limb) == (0.0,) * (len(q) + 1 + len(nothing.limb))
        assert not nothing.constraint > 0.0


def close_wrong(robot, q, near, off):
    """Pose when crank end i is displaced by off[i]; Newton steps with complex-step gradients."""
    x, l2 = np.array(near, dtype=float), layout(robot)[3]
    for _ in range(6):
        f = np.sqrt(np.sum((rods(robot, q, x) - off) ** 2, axis=1)) - l2
        step = 1e-30
        J = np.array(
            [
                np.imag(np.sqrt(np.sum((rods(robot, q, x + 1j * step * e) - off) ** 2, axis=1))) / step
                for e in np.eye(len(q))
            ]
        ).T
        x = x - np.linalg.solve(J, f)
    return x


@every_robot
def test_the_guarantee_tends_to_the_margins_as_the_box_shrinks(name):
    robot, rng = ROBOTS[name], np.random.default_rng(13)
    for q, x, _ in random_poses(robot, rng, 30, best=0.05):
        at = robot.mechanism.at(tuple(q.tolist()), tuple(x.tolist()), 1, (0.0, 1.0))
        for travel, near in ((1e-5, 0.02), (1e-8, 1e-4)):
            bound = robot.mechanism.certified_bounds(at, [travel] * len(q))
            assert min(at.cos_pressure) - near <= bound.type2 <= min(at.cos_pressure) + 1e-12
            assert all(m - near <= b <= m + 1e-12 for m, b in zip(at.type1, bound.type1, strict=True))


@every_robot
def test_no_move_with_turn_within_the_clearance_meets_a_singularity(name):
    robot, rng, useful = ROBOTS[name], np.random.default_rng(14), 0
    m = robot.mechanism
    for q, x, mode in random_poses(robot, rng, 40):
        at = m.at(tuple(q.tolist()), tuple(x.tolist()), 1, (0.0, 1.0))
        clearance = m.clearance(at)
        useful += clearance > 1e-3
        for _ in range(10):
            turn = rng.uniform(-1, 1)
            way = rng.normal(size=len(q) - 1)
            way *= (1 - abs(turn)) / np.linalg.norm(way)
            moves = clearance * np.linspace(0, 1, 10)[:, None] * np.array([*way, turn / m.radius])
            poses = tuple((x + moves).T)
            joints, reach = m.inverse(ARRAYS, poses, mode)
            legs = m.legs(ARRAYS, joints, poses)
            assert np.min(reach) > -1e-12
            assert (statics.cofactors(legs.screws)[0] * at.det > 0.0).all()
            if legs.constraint is not None:
                assert (legs.constraint > 0.0).all()
    assert useful > 10


@pytest.mark.parametrize("name", ["rpr3", "rails2", "rails3", "rrr3_base", "ruu4"])
def test_a_leap_ends_where_many_short_steps_of_newton_end(name: str):
    """Where the first bounds prove nothing: on all of the way the determinant keeps its sign. A way that is not proved
    is refused."""
    mechanism, rng, leaps, refused = make_robot(name).mechanism, np.random.default_rng(5), 0, 0
    lower, upper = np.array([(max(j.lower, -3.0), min(j.upper, 3.0)) for j in mechanism.joints]).T
    for _ in range(3000):
        if leaps >= 12 and refused >= 3:
            break
        q = rng.uniform(lower, upper)
        at = mechanism.posture(tuple(q.tolist()), int(rng.choice(mechanism.assembly_modes)))
        if at.status != Status.SOLVED or not 0.02 < at.type2 < 0.5:
            continue
        ahead = 10.0 ** rng.uniform(-4.0, -0.7) * rng.uniform(-1.0, 1.0, len(q))
        if mechanism.box(at, mechanism.travel_of(at, np.abs(ahead).tolist(), 0.0))[0] < np.inf:
            continue
        found = mechanism._follow(tuple((q + ahead).tolist()), at)
        if found is None:
            refused += 1
            continue
        leaps += 1
        x = np.array(at.pose)
        for share in np.linspace(0.0, 1.0, 101)[1:]:
            for _ in range(4):
                legs = mechanism.legs(FLOATS, tuple(q + share * ahead), tuple(x))
                x = x - np.linalg.solve(np.array(legs.screws), np.array(legs.closure))
            assert np.linalg.det(np.array(legs.screws)) * at.det > 0.0
        assert np.abs(legs.closure).max() < 1e-12
        np.testing.assert_allclose(found.pose, x, rtol=0.0, atol=1e-9)
        assert found.residual <= 1e-9
    assert leaps >= 12
    assert refused >= 3
