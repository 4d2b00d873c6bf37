"""Bounds along courses of rods of any place and motion: what the mechanisms hand to `swept`, and more."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from rod_machines import Array, Machine, closed, rows, units

from irsbot_kinematics.courses import Rod, swept
from irsbot_kinematics.courses import _Change as Change
from irsbot_kinematics.courses import _type2 as least_cosine

ROUNDING = 1e-10
"""m or 1: the machines are closed with rounding of their own."""
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


# --- directions that change in any way, as no rods do: where they bend most against the chords ---


def cross_products(machine, r):
    """Determinants (N,) of rods along r (N, n, m), and the v_i (N, n, m): what r_i is multiplied with in them."""
    m = machine.r.shape[1]
    A = rows(machine, r, machine.arms)
    det = np.linalg.det(A)
    columns = np.swapaxes(np.linalg.inv(A), -1, -2) * det[..., None, None]
    v = columns[..., :m].copy()
    if machine.turns:
        v[..., :2] += columns[..., m:] * np.stack([-machine.arms[:, 1], machine.arms[:, 0]], axis=1)
    return det, v


CORNERS = np.array([0.0, 2.0, 4.0]) * np.pi / 3.0


def random_change(rng, n, m, still):
    """Rods, what their directions change to first order, and what may come on top."""
    while True:
        right = n == m and rng.uniform() < 0.5
        r = np.linalg.qr(rng.normal(size=(m, m)))[0] if right else units(rng.normal(size=(n, m)))
        arms = units(rng.normal(size=(n, 2))) * 10.0 ** (rng.uniform(-1.0, 2.0) + rng.uniform(-0.3, 0.3, (n, 1)))
        if n == 3 > m and rng.uniform() < 0.5:  # arms as far apart as they can, rods across them
            x, y = np.cos(CORNERS), np.sin(CORNERS)
            arms, r = np.stack([x, y], axis=1) * np.hypot(*arms[0]), np.stack([-y, x], axis=1)
        machine = Machine(r, arms * (n > m), np.ones(n))
        if np.linalg.det(rows(machine, r, arms)) > 0.05 * (machine.span or 1.0):
            break
    size = 10.0 ** rng.uniform(-2.5, -0.5)
    mixed = rng.normal(size=(n, n)) * (rng.uniform(size=(n, n)) < 0.4) @ r
    u = size * (mixed if rng.uniform() < 0.5 else rng.normal(size=(n, m)))
    return machine, u, (0.0 if still else size * 10.0 ** rng.uniform(-2.0, 0.0)) * rng.uniform(size=n)


def changed(machine, u, rest):
    """What the bound is made of."""
    ways = rows(machine, u, machine.arms).tolist()
    changes = [Change(tuple(way), float(np.linalg.norm(v)), e) for way, v, e in zip(ways, u, rest, strict=True)]
    return machine.posture, changes, float(np.linalg.det(rows(machine, machine.r, machine.arms))), machine.span


@pytest.mark.parametrize("still", [True, False], ids=["to first order", "with more on top"])
@pytest.mark.parametrize("platform", PLATFORMS)
def test_directions_that_change_as_badly_as_they_can_stay_above_the_bound(platform, still):
    """On top comes what lowers the determinant most, found row by row. Two rods: their determinant is the cosine."""
    rng, (n, m) = np.random.default_rng(39), PLATFORMS[platform]
    promised, used = 0, 0.0
    for _ in range(300):
        machine, u, rest = random_change(rng, n, m, still)
        bound = least_cosine(*changed(machine, u, rest))
        if not bound > 0.0:
            continue
        promised += 1
        r = machine.r + np.linspace(-1.0, 1.0, 41)[:, None, None] * u
        e = np.zeros_like(r)
        for j in [*range(n)] * 3:
            e[:, j] = -rest[j] * units(cross_products(machine, r + e)[1][:, j])
        cosines = [
            det if n == 2 else det / np.linalg.norm(v, axis=2).max(axis=1)
            for det, v in (cross_products(machine, r + e), cross_products(machine, machine.r[None]))
        ]
        assert (cosines[0] >= bound - ROUNDING).all()
        used = max(used, (cosines[1][0] - cosines[0].min()) / (cosines[1][0] - bound + 1e-12))
    assert promised > 150
    assert used > 0.8, "no determinant falls as far as is allowed for"


@pytest.mark.parametrize("size", [1.0, 30.0, 1000.0])
def test_the_chords_miss_no_more_on_large_platforms(size):
    """Directions, arms and changes for which a search found a cosine that falls far below its chords."""
    r = units(np.array([[-0.646, 0.763], [0.965, -0.261], [0.96, 0.28]]))
    machine = Machine(r, size * np.array([[-0.127, 0.333], [0.209, -0.353], [0.987, -0.159]]), np.ones(3))
    u = np.array([[-0.048, 0.015], [-0.013, -0.048], [-0.005, 0.028]])
    along = machine.r + np.linspace(-1.0, 1.0, 41)[:, None, None] * u
    det, v = cross_products(machine, along)
    cosines = np.abs(det) / np.linalg.norm(v, axis=2).max(axis=1)
    bound = least_cosine(*changed(machine, u, np.zeros(3)))
    assert 0.0 < bound <= cosines.min() < min(cosines[0], cosines[20], cosines[-1]) - 1e-3
