"""Certified arithmetic of third degree: everything a quantity can be lies within what is said of it."""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np
import pytest

from irsbot_kinematics.bounds import cubics
from irsbot_kinematics.bounds.quadratics import largest, polynomial, scaled

SAMPLES = 400
every_number = pytest.mark.parametrize("n", [1, 2, 3, 4])


def random_cubic(rng, n):
    """Numbers of very different sizes, some of them 0."""
    a = np.array(cubics.cubic(n, [0.0] * polynomial(n)))
    a = rng.normal(size=len(a)) * 10.0 ** rng.uniform(-2.0, 0.0, len(a)) * (rng.uniform(size=len(a)) < 0.7)
    a[-1] = rng.uniform() * rng.integers(0, 2) * 0.1
    return a.tolist()


def points(rng, n):
    """(N, n) anywhere in the box, often at its ends."""
    inner = rng.uniform(-1.0, 1.0, (SAMPLES, n))
    return np.where(rng.uniform(size=inner.shape) < 0.7, np.sign(inner), inner)


def values(a, s, e):
    """(N,) written out, with a share e (N,) of the rest."""
    n = s.shape[1]
    pairs = [(j, j) for j in range(n)] + [(j, k) for k in range(n) for j in range(k)]
    terms = [(), *[(j,) for j in range(n)], *pairs, *combinations_with_replacement(range(n), 3)]
    return sum(x * np.prod(s[:, list(joints)], axis=1) for x, joints in zip(a, terms, strict=False)) + e * a[-1]


@every_number
def test_products_and_squares_hold_for_all_joints_and_remainders(n):
    rng, used = np.random.default_rng(60), []
    for _ in range(300):
        a, b, s = random_cubic(rng, n), random_cubic(rng, n), points(rng, n)
        x, y = (values(q, s, np.sign(rng.normal(size=SAMPLES))) for q in (a, b))
        for exact, stated in ((x * y, cubics.multiplied(n, a, b)), (x * x, cubics.squared(n, a))):
            off = np.abs(exact - values(stated, s, 0.0))
            assert (off <= stated[-1] + 1e-12).all()
            used.append((off / (stated[-1] + 1e-12)).max())
    assert np.max(used) > 0.9


@every_number
def test_remainders_are_met_where_everything_is_at_its_end_and_adds_up(n):
    """Of quantities without a negative number all terms that are left out of a product are positive there."""
    a, b = np.random.default_rng(61).uniform(0.1, 1.0, (2, len(cubics.cubic(n, [0.0] * polynomial(n))))).tolist()
    assert largest(cubics.multiplied(n, a, b)) == pytest.approx(sum(a) * sum(b), rel=1e-12)
    assert largest(cubics.squared(n, a)) == pytest.approx(sum(a) ** 2, rel=1e-12)


@every_number
def test_a_square_is_a_product_and_terms_are_where_they_are_said(n):
    rng = np.random.default_rng(62)
    a = random_cubic(rng, n)
    np.testing.assert_allclose(cubics.squared(n, a), cubics.multiplied(n, a, a), rtol=1e-12, atol=1e-15)
    quadratic = rng.normal(size=polynomial(n) + 3).tolist()
    third = cubics.cubic(n, quadratic, 0.5)
    assert third[: polynomial(n)] == quadratic[: polynomial(n)]
    assert third[-1] == 0.5
    assert not any(third[place] for place in cubics.third_degree(n))
    for joint in range(n):
        alone = cubics.cubic(n, [0.0] * polynomial(n))
        alone[cubics.cube(n, joint)] = 1.0
        s = points(rng, n)
        np.testing.assert_allclose(values(alone, s, 0.0), s[:, joint] ** 3, rtol=1e-14)


@every_number
def test_the_cosine_and_the_sine_of_a_turn_hold_for_all_joints_and_remainders(n):
    rng, used = np.random.default_rng(63), []
    for size in rng.uniform(0.01, 0.7, 300):
        turn = [0.0, *random_cubic(rng, n)[1:]]
        turn = scaled(turn, size / max(largest(turn), 1e-12))
        s = points(rng, n)
        exact = values(turn, s, np.sign(rng.normal(size=SAMPLES)))
        for function, stated in zip((np.cos, np.sin), cubics.cosine_and_sine(n, turn), strict=True):
            off = np.abs(function(exact) - values(stated, s, 0.0))
            assert (off <= stated[-1] + 1e-15).all()
            used.append((off / (stated[-1] + 1e-15)).max())
    assert np.max(used) > 0.5
