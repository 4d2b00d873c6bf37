"""`least_singular` of `boxes` for many matrices at once, in columns (N,)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from irsbot_kinematics.numerics.arithmetic import Array

Column = tuple[Array, Array]
"""Two numbers of a column of each matrix."""

CORNERS = ((-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0))
"""Of the square of s."""


def least_singular_many(matrix: Sequence[Column], ways: Sequence[Sequence[Column]], rest: Array) -> Array:
    """Lower bound of the second singular value of M(s) = M + s_1 M_1 + s_2 M_2 + R, s_j in -1..1, |R| <= rest.

    matrix: columns of M; ways: those of M_1 and of M_2; as `boxes.least_singular`.
    """
    first, second = (np.sum([x * x + y * y for x, y in way], axis=0) for way in ways)
    values = []
    for s, t in CORNERS:
        columns = [
            (x + s * ax + t * bx, y + s * ay + t * by) for (x, y), (ax, ay), (bx, by) in zip(matrix, *ways, strict=True)
        ]
        a, b, c = (sum([column[i] * column[j] for column in columns]) for i, j in ((0, 0), (0, 1), (1, 1)))
        square = sum([(u * y - v * x) ** 2 for (u, v), (x, y) in combinations(columns, 2)])
        larger = 0.5 * (a + c + np.hypot(a - c, 2.0 * b))
        values.append(np.divide(square, larger, out=np.zeros_like(larger), where=larger > 0.0))
    least = _least_of_two(values, first, second)
    left: Array = np.maximum(np.sqrt(np.maximum(least, 0.0)) - rest, 0.0)
    return left


def _least_of_two(values: Sequence[Array], e: Array, f: Array) -> Array:
    """Smallest value over the square -1..1 of the bilinear function with these values at its corners minus
    (1 - x^2) e + (1 - y^2) f: at a corner, on an edge, or where both slopes vanish."""
    a, b, c, d = values
    m, p, q, r = 0.25 * (a + b + c + d), 0.25 * (c + d - a - b), 0.25 * (b + d - a - c), 0.25 * (a + d - b - c)

    def value(x: Array | float, y: Array | float) -> Array:
        found: Array = m + p * x + q * y + r * x * y - (1.0 - x * x) * e - (1.0 - y * y) * f
        return found

    least = np.minimum.reduce([value(x, y) for x, y in CORNERS])
    for edge in (-1.0, 1.0):
        least = np.minimum(least, value(edge, _inside(-0.5 * (q + r * edge) / f)))
        least = np.minimum(least, value(_inside(-0.5 * (p + r * edge) / e), edge))
    det = 4.0 * e * f - r * r
    x, y = (q * r - 2.0 * p * f) / det, (p * r - 2.0 * q * e) / det
    inner = (det > 0.0) & (np.abs(x) < 1.0) & (np.abs(y) < 1.0)
    found: Array = np.minimum(least, value(np.where(inner, x, 1.0), np.where(inner, y, 1.0)))
    return found


def _inside(place: Array) -> Array:
    """A place on an edge; one that is not on it is a corner."""
    inside: Array = np.where(np.abs(place) < 1.0, place, 1.0)
    return inside
