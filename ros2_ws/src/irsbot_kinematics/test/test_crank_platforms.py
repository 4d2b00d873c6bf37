"""Platforms on cranks, the base-actuated 3-RRR and the 4-RUU: every assembly, and branches followed between neighbours.

Loop closures and derivatives are written here once more, from the drawings.
"""

from __future__ import annotations

from math import cos, hypot, pi, sin

import numpy as np
import pytest

from irsbot_kinematics import Robot, Status, limbs, make_robot, statics
from irsbot_kinematics.mechanisms.rrr3_base import Rrr3Base, Rrr3BaseGeometry
from irsbot_kinematics.mechanisms.ruu4 import Ruu4, Ruu4Geometry
from irsbot_kinematics.numerics.arithmetic import ARRAYS, FLOATS
from irsbot_kinematics.numerics.assembly_roots import SAMPLED_TURNS, planar_closing, trigonometric_roots

TRIANGLES = Rrr3BaseGeometry(  # nothing about it is symmetric
    a1=(-0.31, -0.16),
    a2=(0.29, -0.2),
    a3=(0.04, 0.33),
    b1=(-0.1, -0.03),
    b2=(0.08, -0.06),
    b3=(0.01, 0.11),
    l1=0.35,
    l2=0.42,
)
EQUAL = Rrr3BaseGeometry(
    **{f"a{i}": (0.35 * cos(t), 0.35 * sin(t)) for i, t in enumerate((7 * pi / 6, 11 * pi / 6, pi / 2), 1)},
    **{f"b{i}": (0.1 * cos(t), 0.1 * sin(t)) for i, t in enumerate((7 * pi / 6, 11 * pi / 6, pi / 2), 1)},
    l1=0.4,
    l2=0.4,
)
ROBOTS = {
    "general triangles": Robot(Rrr3Base(TRIANGLES)),
    "equilateral": Robot(Rrr3Base(EQUAL)),
    "4-RUU": Robot(Ruu4(Ruu4Geometry(0.35, 0.1, 0.3, 0.6))),
}
HOME = {"general triangles": (0.02, 0.01, 0.6), "equilateral": (0.03, 0.02, 0.9), "4-RUU": (0.03, 0.02, -0.42, 0.1)}
every_robot = pytest.mark.parametrize("name", ROBOTS)
EXACT = 1e-9
"""m or rad, away from singularities."""


def layout(robot):
    """Base points, platform points (n, 3) and both lengths."""
    g = robot.mechanism.geometry
    if isinstance(g, Ruu4Geometry):
        ways = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]], dtype=float)
        return g.rb * ways, g.rp * ways, g.l1, g.l2
    A, B = (np.array([[*getattr(g, f"{letter}{i}"), 0.0] for i in (1, 2, 3)]) for letter in "ab")
    return A, B, g.l1, g.l2


def rods(robot, q, x):
    """C_iB_i (n, 3); complex numbers pass."""
    A, B, l1, _ = layout(robot)
    position = np.array([x[0], x[1], x[2] if len(x) == 4 else 0.0 * x[0]])
    c, s = np.cos(x[-1]), np.sin(x[-1])
    turned = np.stack([c * B[:, 0] - s * B[:, 1], s * B[:, 0] + c * B[:, 1], B[:, 2] + 0.0 * c], axis=1)
    cranks = np.stack([np.cos(q), np.sin(q), 0.0 * np.asarray(q)], axis=1)
    return position + turned - A - l1 * cranks


def closure(robot, q, x):
    return np.sqrt(np.sum(rods(robot, q, x) ** 2, axis=1)) - layout(robot)[3]


def gradients(robot, q, x):
    step = 1e-30
    n = len(q)
    by_x = [np.imag(closure(robot, q, np.array(x) + 1j * step * np.eye(n)[i])) / step for i in range(n)]
    by_q = [np.imag(closure(robot, np.array(q) + 1j * step * np.eye(n)[i], np.array(x))) / step for i in range(n)]
    return np.array(by_x).T, np.array(by_q).T


def close(robot, q, near):
    x = np.array(near, dtype=float)
    for _ in range(30):
        error = closure(robot, q, x)
        if np.abs(error).max() < 1e-15:
            break
        x = x - np.linalg.solve(gradients(robot, q, x)[0], error)
    assert np.abs(error).max() < 1e-13
    return x


def random_poses(robot, rng, number, best=0.02):
    """(q, x, mode) of reachable poses with all margins above `best`."""
    m, found = robot.mechanism, []
    while len(found) < number:
        x = (
            *rng.uniform(-0.15, 0.15, 2),
            *([-rng.uniform(0.2, 0.5)] if len(m.task) == 4 else []),
            rng.uniform(-pi, pi),
        )
        mode = m.working_modes[rng.integers(len(m.working_modes))]
        q, reach = m.inverse(FLOATS, x, mode)
        if min(reach) > 1e-3:
            at = m.at(q, x, 1, (0.0, 1.0))
            if min(at.type1) > best and min(at.cos_pressure) > best:
                found.append((np.array(q), np.array(x), mode))
    return found


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
        labels = [label for label in robot.mechanism.assembly_modes if robot.mechanism.posture(q, label).status == 0]
        dets = {label: robot.mechanism.posture(q, label).det for label in labels}
        assert all(np.sign(label) == np.sign(det) for label, det in dets.items())
        assert sum(np.sign(label) for label in labels) == 0, "as many poses of either sign: none was missed"
        for pose in robot.direct_all(q):
            assert np.abs(closure(robot, q, pose)).max() < EXACT


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
    for q, x, _ in random_poses(robot, rng, 60, best=0.1):
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
    assert promised > 12
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


# --- the limbs of the 4-RUU ----------------------------------------------------------------------------------------


def test_the_wrenches_of_a_ruu_leg_do_no_work_on_the_joints_that_they_should_not_feel():
    """The force along the rod on the four passive joints, the couple about its horizontal direction on all five."""
    robot, rng = ROBOTS["4-RUU"], np.random.default_rng(15)
    A, _, l1, _ = layout(robot)
    for q, x, _ in random_poses(robot, rng, 10):
        for foot, angle, rod in zip(A, q, rods(robot, q, x), strict=True):
            b = foot + l1 * np.array([cos(angle), sin(angle), 0.0])
            m = np.cross((0, 0, 1), rod)
            twists = limbs.ruu_twists(foot, b, b + rod, (0, 0, 1), m)
            force = np.concatenate([rod, np.cross(b, rod)])
            couple = np.concatenate([np.zeros(3), [rod[0], rod[1], 0.0]])
            power = [twist[3:] @ force[:3] + twist[:3] @ force[3:] for twist in twists]
            np.testing.assert_allclose(power[1:], 0.0, atol=1e-12)
            assert abs(power[0]) > 1e-4
            np.testing.assert_allclose(twists[:, :3] @ couple[3:], 0.0, atol=1e-12)


def test_limb_margins_are_those_of_the_factors():
    robot, rng = ROBOTS["4-RUU"], np.random.default_rng(16)
    for q, x, _ in random_poses(robot, rng, 20):
        at = robot.mechanism.at(tuple(q), tuple(x), 1, (0.0, 1.0))
        for angle, rod, margin in zip(q, rods(robot, q, x), at.limb, strict=True):
            bc = (rod / np.linalg.norm(rod)).tolist()
            factors = limbs.ruu_factors(FLOATS, (cos(angle), sin(angle), 0.0), bc, (0.0, 0.0, 1.0))
            assert margin == pytest.approx(min(factors), abs=1e-12)


def test_the_constraint_margin_is_the_second_singular_value_of_the_couples():
    robot, rng = ROBOTS["4-RUU"], np.random.default_rng(17)
    for q, x, _ in random_poses(robot, rng, 20):
        level = rods(robot, q, x)[:, :2]
        level = level / np.linalg.norm(level, axis=1, keepdims=True)
        at = robot.mechanism.at(tuple(q), tuple(x), 1, (0.0, 1.0))
        assert at.constraint == pytest.approx(np.linalg.svd(level)[1][1] / np.sqrt(2), abs=1e-12)
    four = [(0.6, 0.8), (-0.6, -0.8), (0.6, 0.8), (0.6, 0.8)]
    assert robot.mechanism.constraint_margin(FLOATS, four) == 0.0
    assert robot.mechanism.constraint_margin(FLOATS, [(1.0, 0.0), (0.0, 1.0)] * 2) == 1.0


def test_symmetric_cranks_of_equal_sign_leave_the_4_ruu_free_to_screw():
    """phi and z change together while no crank moves: every turn closes, and no pose is given."""
    robot = ROBOTS["4-RUU"]
    q = robot.inverse((0.0, 0.0, -0.4, 0.0), (1, 1, 1, 1))
    for turn in (0.0, 0.1, 0.2):
        size = hypot(*rods(robot, q, (0.0, 0.0, 0.0, turn))[0])
        x = (0.0, 0.0, -np.sqrt(0.6**2 - size**2), turn)
        assert np.abs(closure(robot, q, x)).max() < 1e-12
    assert {robot.mechanism.posture(tuple(q), label).status for label in robot.mechanism.assembly_modes} == {
        Status.SINGULAR
    }


def test_the_second_box_of_a_step_holds_the_one_solution_where_the_first_proves_nothing():
    """Newton's method from all over the box comes to one pose; steps that neither box proves are refused."""
    mechanism, rng, longer = make_robot("rpr3").mechanism, np.random.default_rng(5), 0
    while longer < 20:
        q = rng.uniform(0.05, 0.4, 3)
        at = mechanism.posture(tuple(q), int(rng.choice(mechanism.assembly_modes)))
        if at.status != Status.SOLVED or at.type2 < 0.05:
            continue
        step = 10.0 ** rng.uniform(-5.0, -2.5) * rng.uniform(-1.0, 1.0, 3)
        asked = mechanism.travel_of(at, np.abs(step).tolist(), 0.0)
        det, columns = statics.cofactors(at.screws)
        held = mechanism._held(at, asked, det, columns)
        if held is None or mechanism.box(at, asked)[0] < np.inf:
            continue
        longer += 1
        ends, turn = held
        middle, sizes = np.array(at.pose), np.array([min(most for *_, most in ends)] * 2 + [turn])
        found = []
        for _ in range(8):
            x = middle + 0.5 * sizes * rng.uniform(-1.0, 1.0, 3)
            for _ in range(40):
                legs = mechanism.legs(FLOATS, tuple(q + step), tuple(x))
                x = x - np.linalg.solve(np.array(legs.screws), np.array(legs.closure))
            found.append(x)
            dx, dy, t = x - middle
            assert abs(t) <= turn * (1.0 + 1e-9)
            for cx, cy, most in ends:
                assert hypot(dx - t * cy, dy + t * cx) <= most * (1.0 + 1e-9)
            assert np.sign(mechanism.at(tuple(q + step), tuple(x), 1, (0.0, 1.0)).det) == np.sign(at.det)
        np.testing.assert_allclose(found, [found[0]] * 8, atol=1e-10)
        followed = mechanism.track(tuple(q + step), at)
        np.testing.assert_allclose(followed.pose, found[0], atol=1e-9)
