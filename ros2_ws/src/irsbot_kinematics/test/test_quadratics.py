"""Certified arithmetic: everything a quantity can be lies within what is said of it."""

from __future__ import annotations

import numpy as np
import pytest

from irsbot_kinematics.bounds import boxes
from irsbot_kinematics.bounds.quadratics import (
    aside,
    besides,
    combined,
    corner_values,
    dot,
    largest,
    least,
    minus,
    monomials,
    multiplied,
    norm,
    numbers,
    plus,
    polynomial,
    scaled,
    value_at,
)

SAMPLES = 400


def random_quantity(rng, n, m):
    """Coefficients of very different sizes, some of them 0."""
    a = rng.normal(size=numbers(n, m)) * 10.0 ** rng.uniform(-2.0, 0.0, numbers(n, m))
    a *= rng.uniform(size=len(a)) < 0.7
    a[-1] = rng.uniform() * rng.integers(0, 2) * 0.1
    return a.tolist()


def points(rng, n, m):
    """Joints and other effects anywhere in their range, often at its ends."""
    inner = rng.uniform(-1.0, 1.0, (SAMPLES, n + m))
    ends = np.where(rng.uniform(size=inner.shape) < 0.7, np.sign(inner), inner)
    return ends[:, :n], ends[:, n:]


def written_out(s, x):
    """(K, N) written out."""
    n = s.shape[1]
    squares = [s[:, j] ** 2 for j in range(n)]
    mixed = [s[:, j] * s[:, k] for k in range(n) for j in range(k)]
    return np.column_stack([np.ones(len(s)), s, *squares, *mixed, x])


def values(a, at, e=0.0):
    """(K,) with a share e (K,) of the rest."""
    return at @ a[:-1] + e * a[-1]


@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_products_sums_and_sizes_hold_for_all_joints_and_remainders(n):
    rng, used = np.random.default_rng(50), []
    for m in [0, n] * 150:
        a, b, c, d = (random_quantity(rng, n, m) for _ in range(4))
        at = written_out(*points(rng, n, m))
        x, y, z, w = (values(q, at, np.sign(rng.normal(size=SAMPLES))) for q in (a, b, c, d))
        factors = rng.normal(size=3).tolist()
        for exact, stated in (
            (x * y, multiplied(n, a, b)),
            (x * y + z * w, dot(n, [a, c], [b, d])),
            (x + y, plus(a, b)),
            (x - y, minus(a, b)),
            (-3.0 * x, scaled(a, -3.0)),
            (np.array(factors) @ [x, y, z], combined(factors, [a, b, c])),
        ):
            off = np.abs(exact - values(stated, at))
            assert (off <= stated[-1] + 1e-12).all()
            used.append((off / (stated[-1] + 1e-12)).max())
        assert (np.abs(x) <= largest(a) + 1e-12).all()
        linear = at[:, : 1 + n] @ a[: 1 + n]
        assert (np.abs(x - linear) <= besides(n, a) + 1e-12).all()
    assert np.max(used) > 0.9


@pytest.mark.parametrize("n", [1, 2, 3, 4])
@pytest.mark.parametrize("m", [0, 3])
def test_remainders_are_met_where_everything_is_at_its_end_and_adds_up(n, m):
    """Of quantities without a negative number all terms that are left out of a product are positive there."""
    a, b, c, d = np.random.default_rng(53).uniform(0.1, 1.0, (4, numbers(n, m))).tolist()
    for stated, exact in (
        (multiplied(n, a, b), sum(a) * sum(b)),
        (dot(n, [a, c], [b, d]), sum(a) * sum(b) + sum(c) * sum(d)),
        (plus(a, b), sum(a) + sum(b)),
        (scaled(a, 3.0), 3.0 * sum(a)),
        (combined((0.5, 2.0), [a, b]), 0.5 * sum(a) + 2.0 * sum(b)),
    ):
        assert largest(stated) == pytest.approx(exact, rel=1e-12)
    assert besides(n, a) == pytest.approx(sum(a) - a[0] - sum(a[1 : 1 + n]), rel=1e-12)
    assert minus(a, b)[-1] == a[-1] + b[-1]
    assert scaled(a, -3.0)[-1] == 3.0 * a[-1]
    assert combined((-0.5, -2.0), [a, b])[-1] == pytest.approx(0.5 * a[-1] + 2.0 * b[-1])


@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_values_at_the_corners_are_those_of_the_polynomial(n):
    a = random_quantity(np.random.default_rng(52), n, n)
    corners = np.array([[1.0 if corner >> j & 1 else -1.0 for j in range(n)] for corner in range(2**n)])
    exact = written_out(corners, np.zeros((2**n, n))) @ a[:-1]
    np.testing.assert_allclose(corner_values(n, a), exact, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_nothing_is_below_the_least_value(n):
    """And it is met, where no joint has to weigh two squares against one another."""
    rng, over = np.random.default_rng(51), []
    for _ in range(300):
        a = random_quantity(rng, n, 2)
        s, others = points(rng, n, 2)
        s[: SAMPLES // 2, 0] = np.linspace(-1.0, 1.0, SAMPLES // 2)
        worst = -np.sign(a[polynomial(n) : -1]) * np.abs(np.sign(others))
        met = values(a, written_out(s, np.where(rng.uniform(size=worst.shape) < 0.9, worst, others)), -1.0).min()
        assert met >= least(n, a) - 1e-12
        over.append((met - least(n, a)) / max(np.abs(a).sum(), 1e-12))
    assert np.median(over) < (0.02 if n < 3 else 0.1)


def test_the_least_value_of_a_parabola_is_inside():
    found = [least(1, [1.0, slope, square, 0.0]) for slope, square in ((0.5, 1.0), (3.0, 1.0), (0.5, -1.0))]
    np.testing.assert_allclose(found, [1.0 - 0.0625, -1.0, -0.5])


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf])
def test_a_number_that_is_not_finite_has_no_least_value(wrong):
    for place in range(numbers(2, 1)):
        a = [1.0] * numbers(2, 1)
        a[place] = wrong
        assert np.isnan(least(2, a))


@pytest.mark.parametrize(("n", "m"), [(3, 3), (4, 4)])
def test_the_cosine_and_the_sine_of_a_turn_hold_for_all_joints_and_remainders(n, m):
    rng = np.random.default_rng(53)
    platform = object.__new__(boxes._Platform)  # these two numbers are all that it reads of a platform
    platform.n, platform.m = n, m
    used = []
    for size in rng.uniform(0.01, 0.5, 300):
        turn = [0.0, *random_quantity(rng, n, m)[1:]]
        turn = scaled(turn, size / largest(turn))
        at = written_out(*points(rng, n, m))
        exact = values(turn, at, np.sign(rng.normal(size=SAMPLES)))
        for function, stated in zip((np.cos, np.sin), platform._turned(turn), strict=True):
            off = np.abs(function(exact) - values(stated, at))
            assert (off <= stated[-1] + 1e-15).all()
            used.append(off.max() / (stated[-1] + 1e-15))
    assert np.max(used) > 0.5


@pytest.mark.parametrize(("n", "m"), [(2, 2), (3, 3), (4, 4)])
def test_a_quantity_at_a_point_is_its_polynomial_and_what_is_aside(n, m):
    rng = np.random.default_rng(11)
    for _ in range(10):
        a = random_quantity(rng, n, m)
        s, x = points(rng, n, m)
        there = np.array([value_at(a, monomials(point)) for point in s.tolist()])
        np.testing.assert_allclose(there, written_out(s, 0.0 * x) @ a[:-1], atol=1e-14)
        assert aside(n, a) == pytest.approx(np.abs(a[polynomial(n) :]).sum(), abs=1e-15)
        off = np.abs(written_out(s, x) @ a[:-1] + a[-1] - there)
        assert (off <= aside(n, a) + 1e-14).all()


def test_the_norm_is_the_size_of_a_vector():
    rng = np.random.default_rng(12)
    for size in (1, 2, 3, 4):
        v = rng.normal(size=size)
        assert norm(*v.tolist()) == pytest.approx(np.linalg.norm(v), rel=1e-15)
    assert norm() == 0.0
    assert norm(1e-200, -1e-200) == 0.0  # its square is none
