"""Polynomials of second degree with a remainder: certified arithmetic over a box, vectorised.

A quantity over a box of joints, s_j in -1..1, is written as

    c + sum_j l_j s_j + sum_{j<=k} q_jk s_j s_k + sum_i z_i x_i + e,    |x_i| <= 1,  |e| <= rest

with x_i any other effect of known direction and bounded size. Sums and products of such quantities are again such
quantities; other terms of a product go into its remainder `rest`, so the result is still a bound.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import combinations, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
TINY = 1e-300
"""Keeps a quotient defined if a coefficient is 0."""


class Terms:
    """The coefficients of quantities in n joints and m other effects: 1, s_j, s_j^2, s_j s_k with j < k, x_i."""

    def __init__(self, n: int, m: int) -> None:
        pairs = [(j, j) for j in range(n)] + list(combinations(range(n), 2))
        self.joints, self.squares = slice(1, 1 + n), slice(1 + n, 1 + 2 * n)
        self.pairs = slice(1 + n, 1 + n + len(pairs))
        self.polynomial = slice(0, self.pairs.stop)
        self.effects = slice(self.pairs.stop, self.pairs.stop + m)
        self.number = self.effects.stop
        self.sizes = np.zeros((2, self.number))
        """(2, N) masks: terms of first degree in the joints, and all others except the constant."""
        self.sizes[0, self.joints] = self.sizes[1, 1 + n :] = 1.0
        self.fold = np.zeros((len(pairs), n * n))
        """(pairs, n n) index of the product of two joints."""
        for row, (j, k) in enumerate(pairs):
            self.fold[row, [j * n + k, k * n + j]] = 1.0
        corners = list(product((-1.0, 1.0), repeat=n))
        self.corners = np.array(corners).T.copy()
        """(n, 2^n)"""
        self.across = np.arange(2**n) ^ (1 << np.arange(n)[::-1])[:, None]
        """(n, 2^n) index of the corner on the opposite side of every joint."""
        self.monomials = np.array([[1.0, *s, *[s[j] * s[k] for j, k in pairs]] for s in corners])
        """(2^n, polynomial) values at the corners."""


@lru_cache
def terms(n: int, m: int) -> Terms:
    """The terms, computed once for each size."""
    return Terms(n, m)


def multiplied(t: Terms, p: Array, q: Array) -> Array:
    """Coefficients (N, ..) of products, as far as there are terms for them."""
    both: Array = p[0] * q
    both += q[0] * p
    both[0] *= 0.5
    squares = p[t.joints, None] * q[None, t.joints]
    both[t.pairs] += (t.fold @ squares.reshape(t.fold.shape[1], -1)).reshape(-1, *both.shape[1:])
    return both


class Quadratic:
    """An array of such quantities."""

    __slots__ = ("p", "rest", "terms")

    def __init__(self, terms: Terms, p: Array, rest: Array) -> None:
        """p: (N, ..) coefficients. rest: (..) bounds, not negative."""
        self.terms, self.p, self.rest = terms, p, rest

    def __getitem__(self, which: Any) -> Quadratic:
        """An element of the array, not of its coefficients."""
        index = which if isinstance(which, tuple) else (which,)
        coefficients = (slice(None), *index)
        return Quadratic(self.terms, self.p[coefficients], self.rest[index])

    def __add__(self, other: Quadratic) -> Quadratic:
        return Quadratic(self.terms, self.p + other.p, self.rest + other.rest)

    def __sub__(self, other: Quadratic) -> Quadratic:
        return Quadratic(self.terms, self.p - other.p, self.rest + other.rest)

    def __mul__(self, other: Quadratic) -> Quadratic:
        """Products of arrays that numpy broadcasts; both have all axes."""
        t, p, q = self.terms, self.p, other.p
        (x, more), (y, others) = self._sizes(), other._sizes()
        rest = x * others + more * (y + others)
        rest += abs(p[0]) * other.rest + abs(q[0]) * self.rest
        return Quadratic(t, multiplied(t, p, q), rest)

    def _sizes(self) -> tuple[Array, Array]:
        """Bounds of the terms of first degree in the joints, and of all others except the constant."""
        p = self.p
        first, more = (self.terms.sizes @ abs(p).reshape(len(p), -1)).reshape(2, *p.shape[1:])
        return first, more + self.rest

    def times(self, factors: Array) -> Quadratic:
        """The product with numbers (..)."""
        return Quadratic(self.terms, self.p * factors, self.rest * abs(factors))

    def sum(self, axis: int) -> Quadratic:
        """Along an axis of the array, counted from the first one."""
        return Quadratic(self.terms, self.p.sum(axis + 1), self.rest.sum(axis))

    def largest(self) -> Array:
        """(..) bound of the size."""
        size: Array = abs(self.p).sum(0) + self.rest
        return size

    def besides(self) -> Array:
        """(..) bound of all terms except the constant and the first degree in the joints."""
        return self._sizes()[1]

    def least(self) -> Array:
        """(M,) lower bound of M quantities. Where a square has a negative coefficient the least value is at an end, and
        the square is 1 there; q s^2 with q > 0 is at least q (2 a s - a^2) for any a. What is left is linear in every
        joint, so it is least at a corner, where that made it less by q (1 - a s)^2."""
        t, p = self.terms, self.p
        values = self.corner_values()
        corner, lowest = values.argmin(0), values.min(0)
        convex = np.maximum(p[t.squares], 0.0)
        rises = values[t.across[:, corner], np.arange(len(lowest))] - lowest
        a = t.corners[:, corner] * np.minimum(rises / (4.0 * convex + TINY), 1.0)
        bent = convex * a
        values += 2.0 * t.corners.T @ bent - (convex + bent * a).sum(0)
        least: Array = values.min(0) - abs(p[t.effects]).sum(0) - self.rest
        return least

    def corner_values(self) -> Array:
        """(2^n, M) of M polynomials, without effects and rests."""
        values: Array = self.terms.monomials @ self.p[self.terms.polynomial]
        return values
