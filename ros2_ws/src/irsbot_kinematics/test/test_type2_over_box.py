"""Lower bound of the Type 2 margin from rods as vectors: attachments that are off, each on its own."""

from __future__ import annotations

from itertools import product
from math import cos, hypot, pi, sin

import numpy as np
import pytest

from irsbot_kinematics.bounds.quadratics import numbers
from irsbot_kinematics.bounds.type2_over_box import _in_space, type2_over

DIRECTIONS = [(cos(k * pi / 4), sin(k * pi / 4)) for k in range(8)]
ROUNDING = 1e-12


def constant(value: float) -> list[float]:
    """A quantity in three joints that no joint changes."""
    return [float(value)] + [0.0] * (numbers(3, 0) - 1)


def least_cosine_of(rods: np.ndarray, attachments: np.ndarray) -> float:
    """Smallest cosine between a rod and the velocity of its place when it alone yields, from the twists."""
    units = rods / np.linalg.norm(rods, axis=1, keepdims=True)
    moments = attachments[:, 0] * units[:, 1] - attachments[:, 1] * units[:, 0]
    found = []
    for leg, twist in enumerate(np.linalg.inv(np.column_stack([units, moments])).T):
        x, y = attachments[leg]
        velocity = np.array([twist[0] - twist[2] * y, twist[1] + twist[2] * x])
        found.append(abs(velocity @ units[leg]) / hypot(*velocity))
    return min(found)


@pytest.mark.parametrize("share", [1e-3, 1e-2])
def test_attachments_that_are_off_count_with_their_moments(share: float):
    """Nothing else is off, so all that the margin loses is the effect of the arms; most of what is allowed is met."""
    rng, met = np.random.default_rng(4), []
    while len(met) < 40:
        attachments, rods = rng.uniform(-0.1, 0.1, (3, 2)), rng.uniform(-0.4, 0.4, (3, 2))
        exact, arm = least_cosine_of(rods, attachments), 0.1 * share
        if exact < 0.2:
            continue
        vectors = [[constant(x) for x in rod] for rod in rods]
        lengths = np.linalg.norm(rods, axis=1)
        of = (vectors, [constant(length) for length in lengths], attachments.tolist())
        assert type2_over(*of, 0.0, lengths.tolist()) == pytest.approx(exact, abs=ROUNDING)
        floor = type2_over(*of, arm, lengths.tolist())
        if not floor > 0.0:
            continue
        least = min(least_cosine_of(rods, attachments + arm * np.array(away)) for away in product(DIRECTIONS, repeat=3))
        assert floor <= least + ROUNDING
        met.append((exact - least) / (exact - floor))
    assert max(met) > 0.5, "what is met is far from what is allowed: the attack does not bite"


def least_cosine_in(rods: np.ndarray, attachments: np.ndarray | None) -> np.ndarray:
    """The same of (N, n, m) rods in the plane or in space, from twists; attachments: of platforms that turn."""
    units = rods / np.linalg.norm(rods, axis=2, keepdims=True)
    rows = units
    if attachments is not None:
        moments = attachments[:, 0] * units[..., 1] - attachments[:, 1] * units[..., 0]
        rows = np.concatenate([units, moments[..., None]], axis=2)
    twists = np.swapaxes(np.linalg.inv(rows), 1, 2)
    velocities = twists[..., : rods.shape[2]].copy()
    if attachments is not None:
        velocities[..., 0] -= twists[..., -1] * attachments[:, 1]
        velocities[..., 1] += twists[..., -1] * attachments[:, 0]
    return (1.0 / np.linalg.norm(velocities, axis=2)).min(axis=1)


PLATFORMS = [(2, 2), (3, 3), (3, 2), (4, 3)]
"""Number of rods, dimensions."""


def box_of_rods(
    rng: np.random.Generator, n: int, m: int, size: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Rods in the middle (n, m), their motions (joints, n, m), and where they hold a platform that turns."""
    while True:
        rods, attachments = rng.normal(size=(n, m)), rng.uniform(-1.0, 1.0, (n, 2)) if n > m else None
        if least_cosine_in(rods[None], attachments)[0] > 0.2:
            return rods, size * rng.normal(size=(n, n, m)), attachments


def bound_of(rods: np.ndarray, moves: np.ndarray, attachments: np.ndarray | None) -> float:
    """Of rods that keep their lengths: they are given as quantities that hold their largest change."""
    n, m = rods.shape
    nothing = [0.0] * (numbers(n, 0) - 1 - n)
    vectors = [[[float(rods[i, k]), *moves[:, i, k].tolist(), *nothing] for k in range(m)] for i in range(n)]
    corners = rods + np.tensordot(np.array(list(product((-1.0, 1.0), repeat=n))), moves, 1)
    longest = np.nan_to_num(np.linalg.norm(corners, axis=2).max(axis=0), nan=2.0, posinf=2.0).tolist()
    lengths = [[length, *[0.0] * n, *nothing] for length in longest]
    return type2_over(vectors, lengths, () if attachments is None else attachments.tolist(), 0.0, longest)


@pytest.mark.parametrize(("n", "m"), PLATFORMS)
def test_rods_that_do_not_move_have_the_margin_of_their_twists(n: int, m: int) -> None:
    rng = np.random.default_rng(6)
    for _ in range(30):
        rods, moves, attachments = box_of_rods(rng, n, m, 0.0)
        exact = least_cosine_in(rods[None], attachments)[0]
        assert bound_of(rods, moves, attachments) == pytest.approx(exact, abs=ROUNDING)


@pytest.mark.parametrize(("n", "m"), PLATFORMS)
def test_no_rods_of_a_box_have_a_smaller_margin_and_singular_ones_have_no_bound(n: int, m: int) -> None:
    """Lengths are at their largest in space, where they count: so much less is promised, and no more than that."""
    rng, promised, refused = np.random.default_rng(7), 0, 0
    s = np.concatenate([np.array(list(product((-1.0, 1.0), repeat=n))), rng.uniform(-1.0, 1.0, (200, n))])
    for _ in range(120):
        size = 10.0 ** rng.uniform(-4.0, 0.3)
        rods, moves, attachments = box_of_rods(rng, n, m, size)
        there = rods + np.tensordot(s, moves, 1)
        bound, met = bound_of(rods, moves, attachments), least_cosine_in(there, attachments)
        longest = np.linalg.norm(there, axis=2)
        assert bound <= met.min() + ROUNDING
        if size < 1e-3:
            lost = (longest / longest.max(axis=0)).min() if m == 3 else 1.0
            assert bound >= met.min() * lost - 50.0 * size**2
            promised += 1
        refused += bound == 0.0
    assert min(promised, refused) > 15


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
@pytest.mark.parametrize(("n", "m"), PLATFORMS)
def test_a_number_that_is_not_finite_leaves_no_bound(n: int, m: int, wrong: float) -> None:
    rods, moves, attachments = box_of_rods(np.random.default_rng(8), n, m, 1e-3)
    for leg in range(n):
        unknown = moves.copy()
        unknown[0, leg, 0] = wrong
        with np.errstate(invalid="ignore"):
            assert bound_of(rods, unknown, attachments) == 0.0


def test_a_normal_that_may_vanish_has_no_bound_even_if_its_product_with_the_rod_does_not() -> None:
    """rod = x, and v = (1, 0, 3 + 4 s) turns by more than a right angle from its middle: cos alpha >= 1/sqrt 50."""
    zero = [0.0] * numbers(1, 0)
    rod = [[1.0, *zero[1:]], zero, zero]
    v = [[1.0, *zero[1:]], zero, [3.0, 4.0, *zero[2:]]]
    assert 0.0 <= _in_space(1, rod, v, [1.0, *zero[1:]]) <= 1.0 / np.sqrt(50.0)
