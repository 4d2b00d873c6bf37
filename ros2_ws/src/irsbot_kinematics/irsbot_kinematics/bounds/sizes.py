"""Bounds of sizes over a box, s_j in -1..1: of a singular value of a matrix, of the length of a vector."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, product
from math import hypot, sqrt
from operator import mul
from typing import TYPE_CHECKING

from irsbot_kinematics.bounds.quadratics import norm

if TYPE_CHECKING:
    from irsbot_kinematics.mechanism import Floats

LEAST = 1e-300
"""A square that is not 0 in effect: a larger divisor only lowers a bound."""


def least_singular(matrix: Sequence[Floats], ways: Sequence[Sequence[Floats]], rest: float) -> float:
    """Lower bound of the second singular value of M(s) = M + sum_j s_j M_j + R, s_j in -1..1, |R| <= rest (Frobenius).

    matrix: columns of M, two numbers each; ways: those of every M_j. With P(s) multilinear in s and equal to
    M(s) M(s)^T at the corners, M M^T = P - sum (1 - s_j^2) M_j M_j^T, and the smaller eigenvalue is concave.
    """
    values, sizes = [], [sum([x * x + y * y for x, y in way]) for way in ways]
    for corner in product((-1.0, 1.0), repeat=len(ways)):
        a = b = c = square = 0.0
        columns: list[tuple[float, float]] = []
        for k, (x, y) in enumerate(matrix):
            for s, way in zip(corner, ways, strict=True):
                x, y = x + s * way[k][0], y + s * way[k][1]
            a, b, c = a + x * x, b + x * y, c + y * y
            for u, v in columns:
                part = u * y - v * x
                square += part * part
            columns.append((x, y))
        # the product of both eigenvalues, without cancellation, over the larger one
        larger = 0.5 * (a + c + norm(a - c, 2.0 * b))
        values.append(square / max(larger, LEAST))
    least = _least_of_two(values, sizes) if len(ways) == 2 else min(values) - sum(sizes)
    if not least > 0.0:
        return 0.0
    left = sqrt(least) - rest
    return left if left > 0.0 else 0.0


def _least_of_two(values: Sequence[float], sizes: Sequence[float]) -> float:
    """Smallest value over the square -1..1 of the bilinear function with the given values at (-1, -1), (-1, 1), (1,
    -1), (1, 1) minus sum (1 - s_j^2) sizes_j: at a corner, on an edge, or where both slopes vanish."""
    a, b, c, d = values
    m, p, q, r = 0.25 * (a + b + c + d), 0.25 * (c + d - a - b), 0.25 * (b + d - a - c), 0.25 * (a + d - b - c)
    e, f = sizes
    points = [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)]
    for edge in (-1.0, 1.0):
        if f > 0.0 and abs(q + r * edge) < 2.0 * f:
            points.append((edge, -0.5 * (q + r * edge) / f))
        if e > 0.0 and abs(p + r * edge) < 2.0 * e:
            points.append((-0.5 * (p + r * edge) / e, edge))
    det = 4.0 * e * f - r * r
    if det > 0.0:
        x, y = (q * r - 2.0 * p * f) / det, (p * r - 2.0 * q * e) / det
        if abs(x) < 1.0 and abs(y) < 1.0:
            points.append((x, y))
    return min([m + p * x + q * y + r * x * y - (1.0 - x * x) * e - (1.0 - y * y) * f for x, y in points])


def largest_sum(ways: Sequence[Sequence[float]]) -> float:
    """Upper bound of the size of a sum of vectors with any signs."""
    square = sum([sum(map(mul, way, way)) for way in ways])
    return sqrt(square + 2.0 * sum([abs(sum(map(mul, a, b))) for a, b in combinations(ways, 2)]))


def distances(x: Sequence[float], moves: Sequence[Sequence[float]], rest: float) -> tuple[float, float]:
    """Bounds of |x + sum_j s_j move_j + e|, s_j in -1..1, |e| <= rest: smallest and largest."""
    size = hypot(*x)
    if not size > 0.0:
        return 0.0, sum([hypot(*move) for move in moves]) + rest
    along = [_dot(x, move) / size for move in moves]
    aside = sum(
        [hypot(*[b - a * c / size for b, c in zip(move, x, strict=True)]) for a, move in zip(along, moves, strict=True)]
    )
    reach = sum(map(abs, along))
    return size - reach - rest, hypot(size + reach, aside) + rest


def _dot(row: Sequence[float], vector: Sequence[float]) -> float:
    return sum(map(mul, row, vector), 0.0)  # a row may also have a moment
