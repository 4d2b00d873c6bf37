"""Platforms on cranks: reaches, drives, candidates and bounds of the constraint, derived once more."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from math import cos, hypot, pi, sin
from types import SimpleNamespace

import numpy as np
import pytest
from cranks import HOME, ROBOTS, TRIANGLES, every_robot, layout, random_poses, rods

import irsbot_kinematics as irs
from irsbot_kinematics import Robot
from irsbot_kinematics.bounds.cranks import _direction
from irsbot_kinematics.bounds.quadratics import numbers
from irsbot_kinematics.mechanism import Posture
from irsbot_kinematics.mechanisms.rrr3_base import Rrr3Base, Rrr3BaseGeometry
from irsbot_kinematics.mechanisms.ruu4 import Ruu4, Ruu4Geometry
from irsbot_kinematics.mechanisms.turning_platform import TurningPlatform
from irsbot_kinematics.numerics.arithmetic import FLOATS

ROUNDING = 1e-10
UNEQUAL = {
    "long cranks": Robot(Rrr3Base(replace(TRIANGLES, l1=0.5, l2=0.22))),
    "long rods": Robot(Rrr3Base(replace(TRIANGLES, l1=0.22, l2=0.5))),
    "4-RUU, long cranks": Robot(Ruu4(Ruu4Geometry(0.35, 0.1, 0.5, 0.4))),
    "4-RUU, long rods": Robot(Ruu4(Ruu4Geometry(0.1, 0.35, 0.3, 0.6))),
}
RUU4 = ROBOTS["4-RUU"].mechanism


def posture(robot: Robot, q: np.ndarray, x: np.ndarray) -> Posture:
    return robot.mechanism.at(tuple(q.tolist()), tuple(x.tolist()), 1, (0.0, 1.0))


@pytest.mark.parametrize("name", UNEQUAL)
def test_the_reach_is_what_is_left_of_the_nearest_and_farthest_point_of_the_cranks_circle(name: str) -> None:
    robot, rng, inner = UNEQUAL[name], np.random.default_rng(31), 0
    _, _, l1, l2 = layout(robot)
    circle = np.linspace(-pi, pi, 2001)
    points = l1 * np.stack([np.cos(circle), np.sin(circle), 0.0 * circle], axis=1)
    for q, x, mode in random_poses(robot, rng, 60):
        crank = l1 * np.stack([np.cos(q), np.sin(q), 0.0 * q], axis=1)
        place = rods(robot, q, x) + crank  # A_iB_i
        apart = np.linalg.norm(place[:, None] - points, axis=2)
        left = np.minimum(l2 - apart.min(axis=1), apart.max(axis=1) - l2)
        inner += np.count_nonzero(l2 - apart.min(axis=1) > apart.max(axis=1) - l2)
        for reach in (posture(robot, q, x).reach, robot.mechanism.legs(FLOATS, tuple(q), tuple(x)).reach):
            np.testing.assert_allclose(reach, left, atol=1e-3)  # of a polygon with 2000 corners
        if name.startswith("4"):
            assert robot.mechanism.inverse(FLOATS, tuple(x), mode)[1] == pytest.approx(left, abs=1e-3)
    assert inner > 3 or "cranks" in name, "no leg is nearer to where it is folded: the fixture proves nothing"


@pytest.mark.parametrize("number", [1, 2, 3])
@pytest.mark.parametrize("lengths", [(0.22, 0.5), (0.5, 0.22)])
def test_a_folded_leg_has_no_reach_left(number: int, lengths: tuple[float, float]) -> None:
    """Crank and rod lie on one another: the place on the platform is |l1 - l2| away from the leg's foot."""
    l1, l2 = lengths
    mechanism = Rrr3Base(replace(TRIANGLES, l1=l1, l2=l2))
    for turn, angle, more in product((0.3, -1.2), (0.5, 2.5), (0.0, 0.01)):
        foot, corner = mechanism.feet[number - 1], mechanism.corners[number - 1]
        size = abs(l1 - l2) + more
        x = foot[0] + size * cos(angle) - cos(turn) * corner[0] + sin(turn) * corner[1]
        y = foot[1] + size * sin(angle) - sin(turn) * corner[0] - cos(turn) * corner[1]
        q = (angle, angle, angle)
        for reach in (
            mechanism.at(q, (x, y, turn), 1, (0.0, 1.0)).reach,
            mechanism.legs(FLOATS, q, (x, y, turn)).reach,
        ):
            assert reach[number - 1] == pytest.approx(more, abs=ROUNDING)


@every_robot
def test_a_platform_on_the_axis_of_the_base_is_reached(name: str) -> None:
    robot = ROBOTS[name]
    x = np.array(HOME[name]) * ([0.0, 0.0] + [1.0] * (len(HOME[name]) - 2))
    solutions = robot.inverse_all(x)
    assert len(solutions) == 2 ** len(robot.mechanism.joints)
    for q in solutions:
        assert np.linalg.norm(rods(robot, q, x), axis=1) == pytest.approx(robot.mechanism.rod, abs=ROUNDING)


def test_no_place_of_the_platform_is_farther_away_than_the_size_of_the_robot() -> None:
    """The leg with the farthest foot is stretched, or the place that is held farthest from the platform point is."""
    for far in (1, 2, 3):
        geometry = replace(TRIANGLES, **{f"a{far}": (2.0, 1.0), f"b{far}": (0.5, -0.3)})
        size = Rrr3Base(geometry).size_m
        assert size == pytest.approx(hypot(2.0, 1.0) + geometry.l1 + geometry.l2 + hypot(0.5, 0.3))


@every_robot
def test_the_drive_of_a_crank_is_the_farthest_that_its_end_comes_along_the_rod(name: str) -> None:
    """By the lever, and by what a circle leaves its tangent."""
    robot, rng = ROBOTS[name], np.random.default_rng(32)
    l1 = robot.mechanism.crank
    for q, x, _ in random_poses(robot, rng, 20, 0.0):
        at, travel = posture(robot, q, x), 10.0 ** rng.uniform(-3.0, -0.3, len(q))
        ways = np.array(at.screws)[:, :2]
        turns = q + np.linspace(-1.0, 1.0, 201)[:, None] * travel
        moved = l1 * (np.stack([np.cos(turns), np.sin(turns)], axis=2) - np.stack([np.cos(q), np.sin(q)], axis=1))
        along = np.abs(np.sum(moved * ways, axis=2)).max(axis=0)
        asked = robot.mechanism.travel_of(at, travel.tolist(), 0.0)
        tangent, leaves = np.abs(at.levers) * travel, l1 * (1.0 - np.cos(travel))
        assert (np.array(asked.drives) >= along - ROUNDING).all()
        assert (np.array(asked.drives) <= tangent + leaves * (1.0 + travel**2 / 6.0) + ROUNDING).all()
        assert asked.path == pytest.approx(l1 * travel.max())
        assert asked.rod == robot.mechanism.rod


@every_robot
def test_the_candidates_at_the_turn_of_a_pose_hold_the_pose_before_they_are_polished(name: str) -> None:
    robot, rng = ROBOTS[name], np.random.default_rng(33)
    for q, x, _ in random_poses(robot, rng, 20):
        joints = [np.array([[value]]) for value in q]
        found = np.array([column[0] for column in robot.mechanism.candidates(joints, np.full((1, 1), x[-1]))]).T
        assert np.abs(found - x).max(axis=1).min() < 1e-7


@pytest.mark.parametrize("scale", [0.01, 100.0])
def test_the_closing_equation_has_no_unit(scale: float) -> None:
    """That of a machine of another size is the same, and it vanishes at the turn of a pose."""
    ruu4 = Ruu4Geometry(0.35, 0.1, 0.3, 0.6)
    triangles = {key: np.multiply(scale, value).tolist() for key, value in vars(TRIANGLES).items()}
    triangles = {key: tuple(value) if isinstance(value, list) else value for key, value in triangles.items()}
    pairs = {
        "4-RUU": (Ruu4(ruu4), Ruu4(Ruu4Geometry(*(scale * length for length in vars(ruu4).values())))),
        "general triangles": (Rrr3Base(TRIANGLES), Rrr3Base(Rrr3BaseGeometry(**triangles))),
    }
    turns = np.linspace(-3.0, 3.0, 13)
    for name, (here, there) in pairs.items():
        for q, x, _ in random_poses(ROBOTS[name], np.random.default_rng(34), 5):
            joints = [np.array([value]) for value in q]
            values = [m.closing(joints, np.cos(turns), np.sin(turns)) for m in (here, there)]
            np.testing.assert_allclose(values[1], values[0], rtol=1e-9, atol=1e-12)
            at_pose = here.closing(joints, np.cos(x[-1:]), np.sin(x[-1:]))
            assert np.abs(at_pose).max() < 1e-9 * np.abs(values[0]).max()


@every_robot
def test_a_rod_turns_per_motion_of_its_end_by_what_the_triangle_of_crank_and_rod_leaves(name: str) -> None:
    """Within half the smallest reach: (1 + 1/sine)/rod per metre."""
    robot, rng = ROBOTS[name], np.random.default_rng(38)
    _, _, l1, l2 = layout(robot)
    for q, x, _ in random_poses(robot, rng, 20, 0.05):
        at = posture(robot, q, x)
        ball = 0.5 * min(at.reach)
        X, Y, z = (rods(robot, q, x) + l1 * np.stack([np.cos(q), np.sin(q), 0.0 * q], axis=1)).T
        near, far = np.hypot(np.hypot(X, Y) - l1, z) + ball, np.hypot(np.hypot(X, Y) + l1, z) - ball
        sine = np.sqrt(min((far**2 - l2**2) * (l2**2 - near**2))) / (2.0 * l1 * l2)
        assert robot.mechanism.turn_rate(at) == pytest.approx((ball, (1.0 + 1.0 / sine) / l2))
        assert sine <= min(at.type1)
        for reach in (0.0, 100.0):  # no room, and a ball beyond everything
            nothing = at._replace(reach=(reach,) * len(q))
            assert robot.mechanism.turn_rate(nothing) == (0.0, np.inf)
            assert robot.mechanism.clearance(nothing) == 0.0


@pytest.mark.parametrize(("joint", "n", "effects"), [(0, 3, 0), (2, 3, 3), (3, 4, 4)])
def test_the_direction_of_a_crank_is_its_parabola_and_a_rest_of_third_order(joint: int, n: int, effects: int) -> None:
    s, used = np.linspace(-1.0, 1.0, 401), []
    for q, travel in product((0.0, 0.4, 1.5, 3.0, -2.0), (1e-3, 0.1, 0.5)):
        for value, slope in ((np.cos, -sin(q)), (np.sin, cos(q))):
            stated = _direction(joint, n, numbers(n, effects), float(value(q)), slope, travel)
            assert np.count_nonzero(stated) <= 4
            parabola = stated[0] + stated[1 + joint] * s + stated[1 + n + joint] * s * s
            off = np.abs(value(q + s * travel) - parabola).max()
            assert off <= stated[-1] * (1.0 + 1e-6)
            used.append(off / stated[-1])
    assert max(used) > 0.95


@pytest.mark.parametrize(("name", "ranks"), [("equilateral", 3), ("4-RUU", 6)])
def test_every_rank_of_either_sign_is_named_once(name: str, ranks: int) -> None:
    mechanism = ROBOTS[name].mechanism
    assert sorted(mechanism.assembly_modes) == sorted(sign * rank for rank in range(1, ranks + 1) for sign in (1, -1))
    assert len(set(mechanism.working_modes)) == len(mechanism.working_modes) == 2 ** len(mechanism.joints)


# --- the constraint of the 4-RUU -----------------------------------------------------------------------------------


def test_the_constraint_falls_by_the_turns_of_the_horizontal_parts_of_the_rods() -> None:
    """A rod whose horizontal part is h turns it by asin(turn/h); four couples that turn move the matrix by the root of
    the sum of squares. A rod that can become upright leaves nothing."""
    rng, upright = np.random.default_rng(35), 0
    for q, x, _ in random_poses(ROBOTS["4-RUU"], rng, 40):
        at = posture(ROBOTS["4-RUU"], q, x)
        level = np.linalg.norm(np.array(at.screws)[:, :2], axis=1)
        for turn in (0.0, 1e-3, 0.05, 0.3, 1.01 * min(level), 1.5 * min(level)):
            shares = turn / level
            left = at.constraint - np.linalg.norm(np.arcsin(np.minimum(shares, 1.0))) / np.sqrt(2.0)
            expected = max(left, 0.0) if max(shares) < 1.0 else 0.0
            assert RUU4.constraint_floor(at, turn) == pytest.approx(expected, abs=ROUNDING)
            upright += max(shares) > 1.0
    assert upright > 40


def rods_of(directions: np.ndarray, rests: np.ndarray, ways: float = 0.0) -> SimpleNamespace:
    """Rods (4, 2) as quantities over a box: rests (4, 2), and what the first joint adds to x of the last rod."""
    found = np.zeros((4, 2, numbers(4, 4)))
    found[..., 0], found[..., -1], found[3, 0, 1] = directions, rests, ways
    return SimpleNamespace(rods=(0.7 * found).tolist())


def test_a_rest_costs_of_the_constraint_what_its_first_two_orders_turn() -> None:
    """Of rods that change by a rest alone, the matrix moves by rest/h + (rest/h)^2/sqrt 3/(1 - rest/h)^2 each."""
    rng = np.random.default_rng(36)
    for q, x, _ in random_poses(ROBOTS["4-RUU"], rng, 20):
        at = posture(ROBOTS["4-RUU"], q, x)
        directions = np.array(at.screws)[:, :2]
        level = np.linalg.norm(directions, axis=1)
        for share in (0.0, 0.01, 0.1, 1.05, 1.5):
            shares = share * rng.uniform(0.5, 1.0, 4)
            shares[rng.integers(4)] = share
            angle = rng.uniform(0.0, 0.5 * pi, 4)
            met = rods_of(directions, np.stack([np.cos(angle), np.sin(angle)], axis=1) * (shares * level)[:, None])
            turned = shares + (shares / (1.0 - np.minimum(shares, 0.99))) ** 2 / np.sqrt(3.0)
            left = at.constraint - np.linalg.norm(turned) / np.sqrt(2.0)
            expected = max(left, 0.0) if share < 1.0 else 0.0
            assert RUU4.constraint_over(at, met) == pytest.approx(expected, abs=ROUNDING)


def test_a_rod_that_is_upright_or_can_become_so_leaves_nothing_of_the_constraint() -> None:
    """Of an upright rod any motion turns the couple to wherever it may."""
    across = np.array([(1.0, 0.0), (0.0, 1.0), (1.0, 0.0), (0.0, 1.0)])
    upright, still = across * [[1.0], [1.0], [1.0], [0.0]], np.zeros((4, 2))
    assert RUU4.constraint_over(SimpleNamespace(), rods_of(across, still)) == pytest.approx(1.0)
    for directions, most, rest in ((across, 0.0, 1.0), (across, 1.0, 0.0), (upright, 0.1, 0.0), (upright, 0.0, 0.1)):
        rests = still.copy()
        rests[3, 0] = rest
        assert RUU4.constraint_over(SimpleNamespace(), rods_of(directions, rests, most)) == 0.0
    screws = [(*row, 0.0, 0.0) for row in upright[:3].tolist()]
    upright_rod = SimpleNamespace(screws=[*screws, (0.0, 0.0, 1.0, 0.0)], constraint=0.5)
    assert RUU4.constraint_floor(upright_rod, 0.1) == 0.0


@pytest.mark.parametrize("share", [1.0, 0.01])
def test_the_clearance_ends_where_the_couples_could_be_parallel(share: float) -> None:
    """Within half the smallest reach a rod turns by (1 + 1/sine)/rod per metre, and the couple by 1/sine as much; the
    sines are those of the triangles of crank and rod. A small margin of the couples is the first to vanish."""
    robot, rng, by_couples, poses = ROBOTS["4-RUU"], np.random.default_rng(37), 0, 40
    _, _, l1, l2 = layout(robot)
    for q, x, _ in random_poses(robot, rng, poses, 0.05):
        at = posture(robot, q, x)
        at = at._replace(constraint=share * at.constraint)
        ball = 0.5 * min(at.reach)
        crank = l1 * np.stack([np.cos(q), np.sin(q), 0.0 * q], axis=1)
        X, Y, z = (rods(robot, q, x) + crank).T
        r = np.hypot(X, Y)
        near, far = np.hypot(r - l1, z) + ball, np.hypot(r + l1, z) - ball
        area = (far**2 - l2**2) * (l2**2 - near**2)
        sine = np.sqrt(min(area)) / (2.0 * l1 * l2)
        rate = (1.0 + 1.0 / sine) / l2
        assert robot.mechanism.turn_rate(at) == pytest.approx((ball, rate))
        couples = at.constraint / (np.sqrt(2.0) * rate / sine)
        others = TurningPlatform.clearance(robot.mechanism, at)
        assert robot.mechanism.clearance(at) == pytest.approx(min(others, couples), rel=1e-9)
        by_couples += couples < others
    assert share == 1.0 or by_couples > poses // 2


# --- lengths -------------------------------------------------------------------------------------------------------


def test_a_platform_joint_may_be_the_platform_point_but_not_all_of_them() -> None:
    assert Rrr3Base(replace(TRIANGLES, b2=(0.0, 0.0))).radius > 0.0
    with pytest.raises(irs.InvalidGeometry, match=r"> 0, got 0$"):
        replace(TRIANGLES, b1=(0.0, 0.0), b2=(0.0, 0.0), b3=(0.0, 0.0))
    for length in ("l1", "l2"):
        with pytest.raises(irs.InvalidGeometry, match=rf"{length} > 0, got 0$"):
            replace(TRIANGLES, **{length: 0.0})
    for name, point in (("a2", (0.1, 0.2, 0.3)), ("b3", (0.1,))):
        with pytest.raises(irs.InvalidGeometry, match=name):
            replace(TRIANGLES, **{name: point})


@pytest.mark.parametrize(("rb", "rp"), [(1.2, 0.2), (0.2, 1.2)])
def test_a_4_ruu_is_assembled_where_its_stretched_legs_bridge_the_difference(rb: float, rp: float) -> None:
    assert Ruu4Geometry(rb, rp, 0.6, 0.4).l1 == 0.6
    with pytest.raises(irs.InvalidGeometry, match=r"got 1 against 0\.9$"):
        Ruu4Geometry(rb, rp, 0.6, 0.3)
    for lengths in ((0.0, rp, 0.6, 0.6), (rb, -0.1, 0.6, 0.6), (rb, rp, 0.0, 1.2), (rb, rp, 1.2, 0.0)):
        with pytest.raises(irs.InvalidGeometry, match=f"> 0, got {min(lengths):g}$"):
            Ruu4Geometry(*lengths)
