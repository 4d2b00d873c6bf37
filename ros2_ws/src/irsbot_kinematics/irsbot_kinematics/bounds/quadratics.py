"""Polynomials of second degree with a remainder: certified arithmetic over a box of joints.

A quantity over a box of n joints, s_j in -1..1, is written as

    c + sum_j l_j s_j + sum_{j<=k} q_jk s_j s_k + sum_i z_i x_i + e,    |x_i| <= 1,  |e| <= rest

with x_i any other effect of known direction and bounded size. It is the list of its numbers: c, l_j, q_jj, then q_jk
with j < k in the order (0, 1), (0, 2), (1, 2), (0, 3), .., z_i, and rest, which is not negative. Sums and products of
such quantities are again such quantities; other terms of a product go into its remainder, so the result is still a
bound. A number that is not finite makes `least` NaN.

Loops over floats, because these quantities have about 15 numbers: less than a call of an array library costs.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, nan, sqrt
from operator import mul

Quadratic = list[float]


def numbers(n: int, m: int) -> int:
    """How many numbers a quantity in n joints and m other effects has."""
    return polynomial(n) + m + 1


def polynomial(n: int) -> int:
    """How many numbers come before those of the other effects."""
    return 1 + n + n * (n + 1) // 2


def effects(n: int, a: Quadratic) -> int:
    """How many other effects a quantity in n joints has."""
    return len(a) - polynomial(n) - 1


def plus(a: Quadratic, b: Quadratic) -> Quadratic:
    """The sum."""
    return [a[i] + b[i] for i in range(len(a))]


def minus(a: Quadratic, b: Quadratic) -> Quadratic:
    """The difference."""
    found = [a[i] - b[i] for i in range(len(a))]
    found[-1] = a[-1] + b[-1]
    return found


def scaled(a: Quadratic, factor: float) -> Quadratic:
    """The product with a number."""
    found = [factor * x for x in a]
    found[-1] = abs(factor) * a[-1]
    return found


def combined(factors: Sequence[float], quantities: Sequence[Quadratic]) -> Quadratic:
    """The sum of quantities times numbers."""
    found = scaled(quantities[0], factors[0])
    for i in range(1, len(factors)):
        factor, a = factors[i], quantities[i]
        rest = found[-1] + abs(factor) * a[-1]
        for k in range(len(a)):
            found[k] += factor * a[k]
        found[-1] = rest
    return found


def multiplied(n: int, a: Quadratic, b: Quadratic) -> Quadratic:
    """The product of quantities in n joints."""
    a0, b0 = a[0], b[0]
    first = others = more = besides = 0.0  # sizes of the terms of a, then of b: first degree, what comes after it
    for j in range(1, n + 1):
        first += abs(a[j])
        others += abs(b[j])
    for k in range(n + 1, len(a)):
        more += abs(a[k])
        besides += abs(b[k])
    found = [a0 * b[k] + b0 * a[k] for k in range(len(a))]
    found[0] = a0 * b0
    place = 1 + n
    for j in range(1, n + 1):
        found[place] += a[j] * b[j]
        place += 1
    for k in range(2, n + 1):
        for j in range(1, k):
            found[place] += a[j] * b[k] + a[k] * b[j]
            place += 1
    found[-1] = first * besides + more * (others + besides) + abs(a0) * b[-1] + abs(b0) * a[-1]
    return found


def dot(n: int, a: Sequence[Quadratic], b: Sequence[Quadratic]) -> Quadratic:
    """The product of two vectors of quantities in n joints."""
    found = multiplied(n, a[0], b[0])
    for k in range(1, len(a)):
        found = plus(found, multiplied(n, a[k], b[k]))
    return found


def largest(a: Quadratic) -> float:
    """Bound of the size."""
    size = 0.0
    for x in a:
        size += abs(x)
    return size


def besides(n: int, a: Quadratic) -> float:
    """Bound of all terms except the constant and those of first degree in the n joints."""
    size = 0.0
    for k in range(n + 1, len(a)):
        size += abs(a[k])
    return size


def aside(n: int, a: Quadratic) -> float:
    """Bound of the other effects and the rest."""
    size = 0.0
    for k in range(polynomial(n), len(a)):
        size += abs(a[k])
    return size


def monomials(s: Sequence[float]) -> list[float]:
    """At a point of the box, in the order of the numbers of a quantity: with them, `value_at` has its polynomial."""
    found = [1.0, *s, *[x * x for x in s]]
    for k in range(1, len(s)):
        found += [x * s[k] for x in s[:k]]
    return found


def value_at(a: Quadratic, terms: Sequence[float]) -> float:
    """Its polynomial where the `monomials` are these."""
    return sum(map(mul, terms, a), 0.0)


def norm(*parts: float) -> float:
    """Size of a vector. Not `math.hypot`: the last bit of that depends on the version of Python."""
    square = 0.0
    for x in parts:
        square += x * x
    return sqrt(square)


def corner_values(n: int, a: Quadratic) -> list[float]:
    """(2^n) values at the corners without effects and rest: s_j is 1 where the number of a corner has the bit 2^j."""
    middle = a[0]
    for k in range(1 + n, 1 + 2 * n):
        middle += a[k]
    values, place = [middle], 1 + 2 * n
    for k in range(n):
        slopes = [a[1 + k]]
        for _ in range(k):
            slopes = _spread(slopes, a[place])
            place += 1
        values = _doubled(values, slopes)
    return values


def least(n: int, a: Quadratic) -> float:
    """Lower bound; NaN if a number is not finite.

    Where a square has a negative coefficient the least value is at an end, and the square is 1 there; q s^2 with q > 0
    is at least q (2 a s - a^2) for any a. What is left is linear in every joint, so it is least at a corner, where that
    made it less by q (1 - a s)^2.
    """
    if not largest(a) < inf:
        return nan
    values = corner_values(n, a)
    lowest, corner = values[0], 0
    for k in range(1, len(values)):
        if values[k] < lowest:
            lowest, corner = values[k], k
    bends, less = [0.0], 0.0
    for j in range(n):
        convex, side = max(a[1 + n + j], 0.0), 1 << j
        rise = values[corner ^ side] - lowest
        share = rise / (4.0 * convex) if rise < 4.0 * convex else 1.0
        bend = 2.0 * convex * (share if corner & side else -share)
        bends = _spread(bends, bend)
        less += convex * (1.0 + share * share)
    found = values[0] + bends[0]
    for k in range(1, len(values)):
        found = min(found, values[k] + bends[k])
    found -= less
    for k in range(polynomial(n), len(a)):
        found -= abs(a[k])
    return found


def _doubled(values: list[float], slopes: list[float]) -> list[float]:
    """Values at the corners of one joint more, in which these are the slopes."""
    return [values[k] - slopes[k] for k in range(len(values))] + [values[k] + slopes[k] for k in range(len(values))]


def _spread(values: list[float], slope: float) -> list[float]:
    """The same, with one slope at all corners."""
    return [value - slope for value in values] + [value + slope for value in values]
