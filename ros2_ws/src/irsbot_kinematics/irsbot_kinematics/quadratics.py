"""Polynomials of second degree with a rest: certified arithmetic over a box, vectorised.

A quantity over a box of joints, s_j in -1..1, is written as

    c + sum_j l_j s_j + sum_{j<=k} q_jk s_j s_k + sum_i z_i x_i + e,    |x_i| <= 1,  |e| <= rest

with x_i whatever else has an effect of known direction and bounded size. Sums and products of such quantities are again
such quantities; what a product has besides these terms goes into its rest, so nothing is lost from a bound.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import combinations_with_replacement, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Terms:
    """The coefficients of quadratics in n joints and m other effects: 1, s_j, s_j s_k with j <= k, x_i."""

    def __init__(self, n: int, m: int) -> None:
        pairs = list(combinations_with_replacement(range(n), 2))
        self.n, self.polynomial, self.number = n, 1 + n + len(pairs), 1 + n + len(pairs) + m
        self.joints, self.pairs = slice(1, 1 + n), slice(1 + n, self.polynomial)
        self.effects = slice(self.polynomial, self.number)
        self.squares = np.array([1 + n + pairs.index((j, j)) for j in range(n)])
        self.sizes = np.zeros((self.number, 2))
        """(N, 2) which coefficients belong to the first degree in the joints, and to all the rest but the constant."""
        self.sizes[self.joints, 0] = self.sizes[1 + n :, 1] = 1.0
        self.fold = np.zeros((n * n, len(pairs)))
        """(n n, pairs) where the products of two joints belong."""
        for column, (j, k) in enumerate(pairs):
            self.fold[[j * n + k, k * n + j], column] = 1.0
        self.corners = np.array(list(product((-1.0, 1.0), repeat=n)))
        self.flipped = np.arange(2**n)[:, None] ^ (1 << np.arange(n)[::-1])
        """(2^n, n) the corner on the other side of every joint."""
        self.monomials = np.array([[1.0, *s, *[s[j] * s[k] for j, k in pairs]] for s in self.corners.tolist()]).T.copy()
        """(polynomial, 2^n) values at the corners."""


@lru_cache
def terms(n: int, m: int) -> Terms:
    """The terms are found once."""
    return Terms(n, m)


def multiplied(t: Terms, p: Array, q: Array) -> Array:
    """Coefficients of products, as far as there are terms for them."""
    both = p[..., :1] * q
    both += q[..., :1] * p
    both[..., 0] *= 0.5
    squares = p[..., t.joints, None] * q[..., None, t.joints]
    both[..., t.pairs] += (squares.reshape(-1, len(t.fold)) @ t.fold).reshape(*both.shape[:-1], -1)
    product: Array = both
    return product


class Quadratic:
    """An array of such quantities."""

    __slots__ = ("p", "rest", "terms")

    def __init__(self, terms: Terms, p: Array, rest: Array) -> None:
        """p: (.., N) coefficients. rest: (..) bounds, not negative."""
        self.terms, self.p, self.rest = terms, p, rest

    def __getitem__(self, which: Any) -> Quadratic:
        return Quadratic(self.terms, self.p[which], self.rest[which])

    def __add__(self, other: Quadratic) -> Quadratic:
        return Quadratic(self.terms, self.p + other.p, self.rest + other.rest)

    def __sub__(self, other: Quadratic) -> Quadratic:
        return Quadratic(self.terms, self.p - other.p, self.rest + other.rest)

    def __mul__(self, other: Quadratic) -> Quadratic:
        t, p, q = self.terms, self.p, other.p
        (x, more), (y, others) = self._sizes(), other._sizes()
        rest = x * others + more * (y + others)
        rest += abs(p[..., 0]) * other.rest + abs(q[..., 0]) * self.rest
        return Quadratic(t, multiplied(t, p, q), rest)

    def _sizes(self) -> tuple[Array, Array]:
        """Bounds of what is of first order in the joints, and of all else but the constant."""
        p = self.p
        sizes = (abs(p).reshape(-1, p.shape[-1]) @ self.terms.sizes).reshape(*p.shape[:-1], 2)
        return sizes[..., 0], sizes[..., 1] + self.rest

    def sum(self, axis: int) -> Quadratic:
        """axis: counted from the first."""
        return Quadratic(self.terms, self.p.sum(axis), self.rest.sum(axis))

    def times(self, factors: Array) -> Quadratic:
        """Multiplied by numbers (..)."""
        return Quadratic(self.terms, factors[..., None] * self.p, abs(factors) * self.rest)

    def largest(self) -> Array:
        """(..) bound of the size."""
        size: Array = abs(self.p).sum(-1) + self.rest
        return size

    def least(self) -> Array:
        """(M,) lower bound of M quantities. Where a square has a negative coefficient the least value is at an end, and
        the square is 1 there; q s^2 with q > 0 is at least q (2 a s - a^2) for any a. What is left is linear in every
        joint, so it is least at a corner, where that made it less by q (1 - a s)^2."""
        t = self.terms
        values = self.p[:, : t.polynomial] @ t.monomials
        rows, corner = np.arange(len(values)), values.argmin(1)
        convex = np.maximum(self.p[:, t.squares], 0.0)
        rises = values[rows[:, None], t.flipped[corner]] - values[rows, corner][:, None]
        a = t.corners[corner] * np.minimum(rises / (4.0 * convex + TINY), 1.0)
        values -= (convex * (1.0 + a * a)).sum(1)[:, None] - 2.0 * (convex * a) @ t.corners.T
        least: Array = values.min(1) - abs(self.p[:, t.effects]).sum(1) - self.rest
        return least


TINY = 1e-300
"""Keeps a quotient defined where a coefficient is 0."""


def joined(*parts: Quadratic) -> Quadratic:
    """One after the other."""
    return Quadratic(
        parts[0].terms, np.concatenate([x.p for x in parts]), np.concatenate([x.rest for x in parts])
    )
