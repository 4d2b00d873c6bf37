"""Bounds of motions, cosines and singular values from their statements, with matrices, roots and grids."""

from __future__ import annotations

from itertools import product
from math import asin, inf, nan, pi, sin

import numpy as np
import pytest
from cranks import ROBOTS, every_robot

from irsbot_kinematics.bounds.displacement import (
    EXACT,
    displacement,
    displacement_and_turn,
    least_cosine,
    level_after,
    lowered,
)
from irsbot_kinematics.bounds.sizes import _least_of_two, distances, least_singular

ROUNDING = 1e-12


def smallest_root(square: float, linear: float, start: float) -> float:
    """Of square c^2 + (linear - 1) c + start, where it is positive; else infinite."""
    roots = np.roots([square, linear - 1.0, start])
    return float(min(roots.real)) if np.isreal(roots).all() and min(roots.real) > 0.0 else inf


# --- motions -------------------------------------------------------------------------------------------------------


def test_a_box_is_no_larger_than_its_shape_allows() -> None:
    """(x, y) = c (x0, y0), neither less than a tenth of the other: the smallest c at which both right sides close."""
    rng, found = np.random.default_rng(51), 0
    for _ in range(400):
        start, turn, moves, turns, path = (10.0 ** rng.uniform(-3.5, 0.0, 5)).tolist()
        rod, radius = rng.uniform(0.1, 2.0, 2).tolist()
        x0, y0 = max(start, 0.1 * radius * turn), max(turn, 0.1 * start / radius)
        end, worst = x0 + radius * y0, max(moves / x0, turns / y0)
        c = smallest_root(
            worst * (0.5 * end**2 / rod + 0.5 * radius * y0**2),
            worst * path * end / rod,
            1.0,
        )
        x, y = displacement_and_turn(start, turn, moves, turns, path, rod, radius)
        assert (x, y) == pytest.approx((c * x0, c * y0), rel=1e-6)
        found += c < inf
    assert 100 < found < 400


def test_a_platform_whose_joints_stand_still_stands_still_and_no_other_one_does() -> None:
    ways = (1.0, 2.0, 0.0, 0.5, 0.1)
    assert displacement_and_turn(0.0, 0.0, *ways) == (0.0, 0.0)
    for start, turn in ((1e-3, 0.0), (0.0, 1e-3), (1.0, 0.0), (0.0, 1.0)):
        x, y = displacement_and_turn(start, turn, 0.1, 0.1, 0.0, 5.0, 1.0)
        assert x >= max(start, 0.1 * turn)
        assert y >= max(turn, 0.1 * start)
    tiny = displacement_and_turn(1e-310, 0.0, *ways)
    assert 1e-310 < tiny[0] < 1e-99, "so that squares and quotients of the box are numbers"


@pytest.mark.parametrize(
    ("start", "linear", "square", "expected"),
    [(0.0, 0.5, 3.0, 0.0), (0.2, 0.0, 0.0, 0.2), (0.3, 0.4, 0.0, 0.5), (0.25, 0.0, 1.0, 0.5)],
)
def test_displacements_with_a_root_that_can_be_seen(
    start: float, linear: float, square: float, expected: float
) -> None:
    assert displacement(start, linear, square) == pytest.approx(expected)
    assert displacement(start, 1.0, square) == inf
    assert displacement(0.26, 0.0, 1.0) == displacement(nan, 0.0, 1.0) == displacement(0.1, nan, 1.0) == inf


# --- elevations ----------------------------------------------------------------------------------------------------


def test_an_elevation_is_lowered_by_the_turn_and_by_the_angle_of_the_share() -> None:
    assert lowered(sin(0.7), 0.2) == pytest.approx(sin(0.5))
    assert lowered(sin(0.7), 0.2, sin(0.3)) == pytest.approx(sin(0.2))
    assert lowered(np.nextafter(1.0, 2.0), 0.5) == pytest.approx(sin(0.5 * pi - 0.5)), "rounding has lifted it over 1"
    for sine, turn, share in (
        (0.5, 0.6, 0.0),
        (0.5, 0.3, 0.4),
        (0.5, 0.0, 1.0),
        (0.5, 0.0, 1.5),
        (0.5, 0.0, 2.0),
        (0.0, 0.0, 0.0),
    ):
        assert lowered(sine, turn, share) == 0.0
    assert lowered(nan, 0.1, 0.1) == lowered(0.5, 0.1, nan) == 0.0


def test_an_elevation_is_level_where_chords_say_so_or_where_the_normal_has_changed_by_half() -> None:
    rng, halves = np.random.default_rng(52), 0
    for _ in range(200):
        elevation, turn, share = rng.uniform(0.01, 1.5), 10.0 ** rng.uniform(-2.0, 1.0), 10.0 ** rng.uniform(-2.0, 1.0)
        d = level_after(sin(elevation), turn, share)
        chord = d * turn + d * share * (asin(0.5) / 0.5)
        assert chord == pytest.approx(elevation) or d * share == pytest.approx(0.5)
        assert chord <= elevation + ROUNDING
        assert d * share <= 0.5 + ROUNDING
        assert elevation - d * turn - asin(d * share) >= -ROUNDING
        halves += chord < elevation - 1e-9
    assert 20 < halves < 180
    assert level_after(sin(0.6), 2.0, 0.0) == pytest.approx(0.3)
    assert level_after(np.nextafter(1.0, 2.0), 1.0, 0.0) == pytest.approx(0.5 * pi)


# --- cosines -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [3, 4])
def test_the_least_cosine_is_the_velocity_with_its_changes_along_and_across(n: int) -> None:
    """With G the bound of the relative change of the rows, (1 + F)^-1 changes a column by G + G^2 and what the powers
    from the third on add up to."""
    rng, positive, refused = np.random.default_rng(53), 0, 0
    for _ in range(150):
        V = rng.normal(size=(n, n, n - 1))  # V[j][i]: of place i when leg j yields
        turns, angles = rng.uniform(0.0, 3.0, n), 10.0 ** rng.uniform(-2.0, 0.3) * rng.uniform(size=n) / n
        arm = 0.05 * rng.uniform() / n
        squares = np.sum(V**2, axis=2).T - np.eye(n)
        G = angles[:, None] * np.sqrt(np.maximum(squares, 0.0)) + arm * turns + np.diag(0.5 * angles**2)
        norm = G.sum(axis=1).max()
        found = least_cosine([[tuple(v) for v in leg] for leg in V.tolist()], turns.tolist(), angles.tolist(), arm)
        if norm >= 1.0:
            assert found == 0.0
            refused += norm < 2.0
            continue
        change = G + G @ G + norm**2 / (1.0 - norm) * G.max(axis=0)
        sizes = []
        for i in range(n):
            size = np.linalg.norm(V[i, i])
            along = V[:, i] @ V[i, i] / size
            across = np.linalg.norm(V[:, i] - np.outer(along, V[i, i] / size), axis=1)
            own = np.hypot(size + change[:, i] @ np.abs(along), change[:, i] @ across)
            sizes.append(own + arm * (turns[i] + change[:, i] @ turns))
        assert found == pytest.approx(min(1.0 / max(sizes), 1.0), rel=1e-6)
        positive += 1
    assert positive > 20
    assert refused > 5, "no series diverges slowly"


@every_robot
def test_a_geometry_without_errors_has_no_effect_on_a_leg(name: str) -> None:
    assert ROBOTS[name].mechanism.geometry_errors(0.0) == EXACT


def test_no_cosine_is_larger_than_one() -> None:
    short = [[(0.5, 0.0) if i == j else (0.0, 0.1) for i in range(3)] for j in range(3)]
    assert least_cosine(short, [0.0] * 3, [0.0] * 3, 0.0) == 1.0


# --- sizes ---------------------------------------------------------------------------------------------------------


def test_the_least_value_of_a_bilinear_function_less_two_parabolas_is_that_of_a_grid() -> None:
    """At corners, on edges of either kind and inside; also where a parabola is missing."""
    rng, axis = np.random.default_rng(54), np.linspace(-1.0, 1.0, 161)
    x, y = np.meshgrid(axis, axis, indexing="ij")
    places = {"corner": 0, "edge of x": 0, "edge of y": 0, "inside": 0}
    for _ in range(300):
        corners, sizes = rng.uniform(0.0, 1.0, 4) * 10.0 ** rng.uniform(-1.0, 0.0, 4), 10.0 ** rng.uniform(-2.0, 0.5, 2)
        sizes *= rng.uniform(size=2) < 0.8
        a, b, c, d = corners
        weights = (1.0 - x) * (1.0 - y), (1.0 - x) * (1.0 + y), (1.0 + x) * (1.0 - y), (1.0 + x) * (1.0 + y)
        grid = 0.25 * sum(w * value for w, value in zip(weights, (a, b, c, d), strict=True))
        grid = grid - (1.0 - x * x) * sizes[0] - (1.0 - y * y) * sizes[1]
        least = _least_of_two(corners.tolist(), sizes.tolist())
        spacing = axis[1] - axis[0]
        assert least <= grid.min() + ROUNDING
        assert least >= grid.min() - 0.5 * spacing**2 * (sizes.sum() + 1.0)
        row, column = np.unravel_index(grid.argmin(), grid.shape)
        at_x, at_y = row in (0, 160), column in (0, 160)
        places["corner" if at_x and at_y else "edge of x" if at_x else "edge of y" if at_y else "inside"] += 1
    assert min(places.values()) > 10, places


@pytest.mark.parametrize("ways", [1, 2, 3, 4])
def test_a_second_singular_value_is_bounded_by_those_at_the_corners_less_the_squares_of_the_ways(ways: int) -> None:
    """Of two ways the least is looked for on the square; of others each square counts in full."""
    rng, positive, values = np.random.default_rng(55), 0, list(product((-1.0, 1.0), repeat=ways))
    for _ in range(60):
        M = rng.normal(size=(3, 2))
        Mj, rest = rng.normal(size=(ways, 3, 2)) * 10.0 ** rng.uniform(-2.0, -0.5), 0.1 * rng.uniform()
        at_corners = [np.linalg.svd(M + np.tensordot(s, Mj, 1), compute_uv=False)[1] ** 2 for s in values]
        squares = np.sum(Mj**2, axis=(1, 2))
        square = _least_of_two(at_corners, squares.tolist()) if ways == 2 else min(at_corners) - squares.sum()
        expected = max(np.sqrt(max(square, 0.0)) - rest, 0.0)
        assert least_singular(M.tolist(), Mj.tolist(), rest) == pytest.approx(expected, abs=1e-9)
        positive += expected > 0.0
    assert positive > 20


def test_a_matrix_that_vanishes_has_no_singular_value_and_one_of_unit_columns_has_its_own() -> None:
    assert least_singular([(0.0, 0.0)] * 3, [], 0.0) == 0.0
    assert least_singular([(0.0, 0.0)] * 3, [[(0.0, 0.0)] * 3], 0.0) == 0.0
    assert least_singular([(2.0, 0.0), (0.0, 0.5)], [], 0.0) == pytest.approx(0.5)
    assert least_singular([(2.0, 0.0), (0.0, 0.5)], [], 0.2) == pytest.approx(0.3)
    assert least_singular([(2.0, 0.0), (0.0, 0.5)], [], 0.7) == 0.0


@pytest.mark.parametrize("dims", [2, 3])
def test_distances_are_the_length_with_the_motions_along_and_across(dims: int) -> None:
    rng = np.random.default_rng(56)
    for _ in range(50):
        x, moves, rest = rng.normal(size=dims), 0.1 * rng.normal(size=(3, dims)), 0.1 * rng.uniform()
        size = np.linalg.norm(x)
        along = np.abs(moves @ x / size)
        across = np.linalg.norm(moves - np.outer(moves @ x / size, x / size), axis=1)
        expected = size - along.sum() - rest, np.hypot(size + along.sum(), across.sum()) + rest
        assert distances(x.tolist(), moves.tolist(), rest) == pytest.approx(expected)
