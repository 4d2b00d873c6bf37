"""Certified arithmetic: everything a quantity can be lies within what is said of it."""

from __future__ import annotations

import numpy as np
import pytest

from irsbot_kinematics.bounds.quadratics import Quadratic, terms

SAMPLES = 400


def random_quantities(rng, n, m, *shape):
    """Coefficients of very different sizes, some of them 0."""
    t = terms(n, m)
    p = rng.normal(size=(t.number, *shape)) * 10.0 ** rng.uniform(-2.0, 0.0, (t.number, *shape))
    return Quadratic(t, p * (rng.uniform(size=p.shape) < 0.7), rng.uniform(size=shape) * rng.integers(0, 2) * 0.1)


def points(rng, n, m):
    """Joints and other effects anywhere in their range, often at its ends."""
    inner = rng.uniform(-1.0, 1.0, (SAMPLES, n + m))
    ends = np.where(rng.uniform(size=inner.shape) < 0.7, np.sign(inner), inner)
    return ends[:, :n], ends[:, n:]


def monomials(s, x):
    """(K, N) written out."""
    n = s.shape[1]
    squares = [s[:, j] ** 2 for j in range(n)]
    mixed = [s[:, j] * s[:, k] for j in range(n) for k in range(j + 1, n)]
    return np.column_stack([np.ones(len(s)), s, *squares, *mixed, x])


def values(quantity, at, e):
    """(K, ..) with a share e (K, ..) of the rest."""
    return np.tensordot(at, quantity.p, 1) + e * quantity.rest


@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_products_sums_and_sizes_hold_for_all_joints_and_remainders(n):
    rng, used = np.random.default_rng(50), []
    for m in [0, n] * 30:
        a, b = random_quantities(rng, n, m, 2, 3), random_quantities(rng, n, m, 1, 3)
        at = monomials(*points(rng, n, m))
        e, f = np.sign(rng.normal(size=(SAMPLES, 2, 3))), np.sign(rng.normal(size=(SAMPLES, 1, 3)))
        x, y = values(a, at, e), values(b, at, f)
        product = a * b
        off = np.abs(x * y - values(product, at, 0.0 * e))
        assert (off <= product.rest + 1e-12).all()
        used.append((off.max(0) / (product.rest + 1e-12)).max())
        for exact, stated in (
            (x + y, a + b),
            (x - y, a - b),
            (x.sum(1), a.sum(0)),
            (-3.0 * x, a.times(np.array(-3.0))),
        ):
            assert (np.abs(exact - np.tensordot(at, stated.p, 1)) <= stated.rest + 1e-12).all()
            assert (np.abs(exact) <= stated.largest() + 1e-12).all()
        linear = np.tensordot(at[:, : 1 + n], a.p[: 1 + n], 1)
        assert (np.abs(x - linear) <= a.besides() + 1e-12).all()
    assert np.max(used) > 0.9


@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_nothing_is_below_the_least_value(n):
    """And it is met, where no joint has to weigh two squares against one another."""
    rng, over = np.random.default_rng(51), []
    for _ in range(60):
        x = random_quantities(rng, n, 2, 5)
        s, others = points(rng, n, 2)
        s[: SAMPLES // 2, 0] = np.linspace(-1.0, 1.0, SAMPLES // 2)
        least = x.least()
        met = values(x, monomials(s, np.sign(others)), -1.0 * np.ones((SAMPLES, 5))).min(0)
        assert (met >= least - 1e-12).all()
        over.append(np.median(met - least) / np.abs(x.p).sum(0).mean())
    assert np.median(over) < (0.02 if n < 3 else 0.1)


def test_the_least_value_of_a_parabola_is_inside():
    t = terms(1, 0)
    found = Quadratic(t, np.array([[1.0, 1.0, 1.0], [0.5, 3.0, 0.5], [1.0, 1.0, -1.0]]), np.zeros(3)).least()
    np.testing.assert_allclose(found, [1.0 - 0.0625, -1.0, -0.5])
