"""Certified bounds and clearance of linear Delta robots, derived once more with matrices; errors of rails."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

import irsbot_kinematics as irs
from irsbot_kinematics import Status
from irsbot_kinematics.bounds.boxes import Rod, reached
from irsbot_kinematics.bounds.displacement import least_cosine
from irsbot_kinematics.mechanism import Posture
from irsbot_kinematics.mechanisms.delta_family import DeltaFamily
from irsbot_kinematics.mechanisms.linear_delta import LinearDelta, LinearDeltaGeometry
from irsbot_kinematics.numerics.arithmetic import FLOATS

Array = NDArray[np.float64]
ROUNDING = 1e-9
NO_RAIL = LinearDeltaGeometry(1.0, (0.0, 1.0), *[(1.0, 0.0, 0.0)] * 6)


def some_machine(rng: np.random.Generator) -> DeltaFamily:
    """Rails anywhere in front of the platform, with a range that does not begin at 0, rods that are not 1 m long."""
    rod, lower = rng.uniform(0.4, 2.5), rng.uniform(-0.5, 0.5)
    along = np.linalg.qr(rng.normal(size=(3, 3)))[0] + 0.3 * rng.normal(size=(3, 3))
    origins = rng.uniform(-0.3, 0.3, (3, 3)) * rod
    vectors = {f"u{i}": tuple(u.tolist()) for i, u in enumerate(along, 1)}
    vectors |= {f"o{i}": tuple(o.tolist()) for i, o in enumerate(origins, 1)}
    return LinearDelta(replace(NO_RAIL, L=rod, limits=(lower, lower + rng.uniform(0.5, 1.5) * rod), **vectors))


def some_posture(mechanism: DeltaFamily, rng: np.random.Generator, beyond: float = 0.2) -> Posture:
    """Also with slides a little beyond their ranges."""
    lower, upper = mechanism.geometry.limits
    while True:
        q = rng.uniform(lower - beyond * (upper - lower), upper + beyond * (upper - lower), 3)
        at = mechanism.posture(tuple(q.tolist()), int(rng.choice((-1, 1))))
        if at.status == Status.SOLVED and min(*at.type1, at.type2) > 0.05:
            return at


def sines_at(mechanism: DeltaFamily, at: Posture, rod: float, farther: Array) -> Array:
    """Sines of rods of a length whose rails are farther away from the platform point than in the posture."""
    origins, ways = (np.array([rail[k] for rail in mechanism.rails]) for k in (0, 1))
    distance = np.linalg.norm(np.cross(np.array(at.pose) - origins, ways), axis=1)
    return np.sqrt(np.maximum(1.0 - ((distance + farther) / rod) ** 2, 0.0))


def rail_error(mechanism: DeltaFamily, q: Array, travel: Array, slack: float) -> Array:
    """Errors of its two ends, of every coordinate up to the slack, mixed as the slide's place divides the rail."""
    lower, upper = mechanism.geometry.limits
    shares = (np.array([q - travel, q, q + travel]) - lower) / (upper - lower)
    return np.max(np.abs(shares) + np.abs(1.0 - shares), axis=0) * slack * np.sqrt(3.0)


def elevations_left(at: Posture, turns: Array) -> Array:
    """rad: of each rod over the plane of the others, after all have turned."""
    rods, left = np.array(at.screws), np.zeros(3)
    for i, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
        normal = np.cross(rods[j], rods[k])
        size = np.linalg.norm(normal)
        tilt = (turns[j] + turns[k]) / size
        left[i] = np.arcsin(abs(rods[i] @ normal) / size) - turns[i] - np.arcsin(tilt) if tilt < 1.0 else -1.0
    return left


@pytest.mark.parametrize("slack_share", [0.0, 1e-5, 1e-3])
def test_the_guarantee_is_the_smallest_motion_that_closes_with_the_turns_of_the_rods(slack_share: float) -> None:
    """Displacement from the polynomial's roots, elevations from cross products, sines from distances."""
    rng, promised, nothing, elevated = np.random.default_rng(21), 0, 0, 0
    while min(promised, nothing) < 60:
        mechanism = some_machine(rng)
        at, L = some_posture(mechanism, rng), mechanism.rod
        slack, travel = slack_share * L, L * 10.0 ** rng.uniform(-4.0, -0.7) * rng.uniform(0.0, 1.0, 3)
        bound = mechanism.certified_bounds(at, travel.tolist(), slack)
        q = np.array(at.joints)
        ends = rail_error(mechanism, q, travel, slack) if slack else np.zeros(3)
        inverse = np.linalg.inv(np.array(at.screws))
        speeds, path = np.linalg.norm(inverse, axis=0), travel + ends
        # sum of speeds (sine travel + ends + length error + (d + path)^2/(2 L)) = d
        start = speeds @ (np.array(at.type1) * travel + ends + slack + path**2 / (2.0 * L))
        roots = np.roots([speeds.sum() / (2.0 * L), speeds @ path / L - 1.0, start])
        if np.iscomplex(roots).any() or min(roots) < 0.0:
            nothing += 1
            assert (*bound.type1, bound.type2) == (0.0,) * 4
            continue
        move = min(roots)
        turns = np.arcsin((move + path) / L)
        type2 = np.sin(max(min(elevations_left(at, turns)), 0.0))
        elevated += type2 > 0.0
        if slack:
            ways = [[tuple(column)] * 3 for column in inverse.T.tolist()]
            type2 = max(type2, least_cosine(ways, [0.0] * 3, turns.tolist(), 0.0))
        assert bound.type2 == pytest.approx(type2, abs=ROUNDING)
        foot = q - L * np.array(at.normalised_levers)
        farther = move + (rail_error(mechanism, foot, np.zeros(3), slack) if slack else 0.0)
        expected = np.minimum(sines_at(mechanism, at, L - slack, farther), at.type1)
        assert bound.type1 == pytest.approx(expected, abs=1e-7)
        promised += bound.type2 > 0.0
    assert elevated > 40


def test_the_clearance_is_the_better_one_of_two_balls() -> None:
    """Nine tenths of the smallest reach, and the mean of that and of what is proved within it: the elevations fall by
    the turns, whose arc sines are replaced by chords up to half a normal's size."""
    rng, by_type1, by_type2 = np.random.default_rng(22), 0, 0
    while min(by_type1, by_type2) < 40:
        mechanism = some_machine(rng)
        at = some_posture(mechanism, rng)
        rods, L = np.array(at.screws), mechanism.rod
        crosses = np.cross(np.roll(rods, -1, axis=0), np.roll(rods, -2, axis=0))
        normals = np.linalg.norm(crosses, axis=1)
        elevations = np.arcsin(np.minimum(np.abs(np.sum(rods * crosses, axis=1)) / normals, 1.0))

        def level(ball: float, mechanism=mechanism, at=at, L=L, normals=normals, elevations=elevations) -> float:
            rates = 1.0 / (L * sines_at(mechanism, at, L, np.full(3, ball)))
            tilts = (rates.sum() - rates) / normals
            return float(min(*(elevations / (rates + np.pi / 3.0 * tilts)), *(0.5 / tilts)))

        wide = 0.9 * min(at.reach)
        found = level(wide)
        by_type1 += found >= wide
        by_type2 += found < wide
        middle = 0.5 * (found + wide)
        expected = wide if found >= wide else max(found, min(middle, level(middle)))
        assert mechanism.clearance(at) == pytest.approx(expected, rel=ROUNDING)


def test_the_sines_of_the_second_order_count_the_errors_of_rails_where_the_platform_can_be_next_to_them() -> None:
    """The foot of the platform point on a rail slides as far as the motion of the point along it, at any corner of the
    box, and the rail is off there; the point itself goes away from the rail at most by the length and width of its
    motion across."""
    rng, beyond = np.random.default_rng(23), 0
    for _ in range(60):
        mechanism = some_machine(rng)
        at, L = some_posture(mechanism, rng, 1.0), mechanism.rod
        slack, travel = 1e-3 * L * at.type2, L * at.type2 * 10.0 ** rng.uniform(-3.0, -1.0) * rng.uniform(0.0, 1.0, 3)
        q, ways = np.array(at.joints), np.array([u for _, u in mechanism.rails])
        ends = rail_error(mechanism, q, travel, slack)
        near = [tuple(way) for way in (travel[:, None] * ways).tolist()]
        met = reached(at, [Rod(L, way, end, 0.0, slack) for way, end in zip(near, ends.tolist(), strict=True)])
        bound = mechanism.sharp_bounds(at, travel.tolist(), slack)
        if met is None or not met.type2 > 0.0:
            continue
        assert bound.type2 == pytest.approx(met.type2, abs=ROUNDING)
        moves, corners = np.array(met.moves), np.array(list(product((-1.0, 1.0), repeat=3)))
        foot = q - L * np.array(at.normalised_levers)
        slid = np.abs(corners @ moves @ ways.T).max(axis=0) + met.aside
        lower, upper = mechanism.geometry.limits
        beyond += np.count_nonzero(np.abs(2.0 * foot - lower - upper) > upper - lower)
        off = rail_error(mechanism, foot, slid, slack)
        for i, (origin, way) in enumerate(mechanism.rails):
            project = np.eye(3) - np.outer(way, way)
            place, across = project @ (np.array(at.pose) - origin), moves @ project
            size = np.linalg.norm(place)
            along = across @ place / size
            width = np.linalg.norm(across - np.outer(along, place / size), axis=1).sum()
            farthest = np.hypot(size + np.abs(along).sum(), width) + met.aside + off[i]
            sine = np.sqrt(max(1.0 - (farthest / (L - slack)) ** 2, 0.0))
            assert bound.type1[i] == pytest.approx(min(sine, at.type1[i]), abs=1e-8)
    assert beyond > 20, "no rail is used beyond its ends"


def test_rods_in_one_plane_and_a_rod_across_its_rail_leave_no_clearance() -> None:
    mechanism = irs.make_robot("triaglide").mechanism
    flat, reach = mechanism.inverse(FLOATS, (0.1, 2.0, 0.0), (1, 1, -1))
    assert min(reach) > 0.1
    at = mechanism.at(flat, (0.1, 2.0, 0.0), 1, (1.0, 1.0))
    assert at.det == 0.0
    assert mechanism.clearance(at) == 0.0
    assert mechanism.certified_bounds(at, (1e-6,) * 3).type2 == 0.0
    regular = mechanism.at(mechanism.inverse(FLOATS, (0.1, 2.0, 0.5), (1, 1, -1))[0], (0.1, 2.0, 0.5), 1, (1.0, 1.0))
    assert mechanism.clearance(regular) > 0.01
    for leg in range(3):
        edge = tuple(0.0 if i == leg else value for i, value in enumerate(regular.reach))
        assert mechanism.clearance(regular._replace(reach=edge)) == 0.0


@pytest.mark.parametrize("name", ["orthoglide", "linear_delta"])
def test_an_error_that_is_no_error_leaves_nothing_of_either_bound(name: str) -> None:
    mechanism = irs.make_robot(name).mechanism
    at = some_posture(mechanism, np.random.default_rng(24))
    travels = [[1e-4 * (-1.0) ** (k == leg) for k in range(3)] for leg in range(3)]
    asked = [(travel, slack) for travel in travels for slack in (0.0, 1e-5)]
    asked += [([1e-4] * 3, -1e-5), ([1e-4] * 3, float("nan")), ([0.0] * 3, -1e-5)]
    for travel, slack in asked:
        for bound in (mechanism.certified_bounds(at, travel, slack), mechanism.sharp_bounds(at, travel, slack)):
            assert (*bound.type1, bound.type2, *bound.limb) == (0.0,) * (4 + len(bound.limb))
            assert np.isnan(bound.constraint)
            assert len(bound.limb) == mechanism.limb_count
