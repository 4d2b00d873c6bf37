"""Polynomials of third degree with a remainder, for the pose of a platform over a box of joints.

As in `quadratics`, with the products of three joints and without other effects. A cubic is the list of its numbers:
those of a quadratic up to the products of two joints, then the factors of s_j s_k s_l with j <= k <= l in the order
(0, 0, 0), (0, 0, 1), .., and the remainder, which is not negative. `plus`, `minus`, `scaled`, `combined` and `largest`
of `quadratics` hold for cubics as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations_with_replacement

from irsbot_kinematics.bounds.quadratics import largest, minus, polynomial, scaled

Cubic = list[float]

MOST_JOINTS = 4


def _places(n: int) -> list[list[int]]:
    """Per product of two joints, in the order of a quadratic, the place of its product with each joint."""
    pairs = [(j, j) for j in range(n)] + [(j, k) for k in range(n) for j in range(k)]
    third = {joints: polynomial(n) + i for i, joints in enumerate(combinations_with_replacement(range(n), 3))}
    return [[third[_three(j, k, other)] for other in range(n)] for j, k in pairs]


def _three(*joints: int) -> tuple[int, int, int]:
    low, middle, high = sorted(joints)
    return low, middle, high


PLACES = [_places(n) for n in range(MOST_JOINTS + 1)]


def third_degree(n: int) -> range:
    """Places of the products of three joints."""
    return range(polynomial(n), polynomial(n) + n * (n + 1) * (n + 2) // 6)


def cube(n: int, joint: int) -> int:
    """Place of the factor of s_joint^3."""
    return PLACES[n][joint][joint]


def cubic(n: int, terms: Sequence[float], rest: float = 0.0) -> Cubic:
    """A cubic with the terms of a quadratic; its other numbers are ignored."""
    return [*terms[: polynomial(n)], *[0.0] * len(third_degree(n)), rest]


def _sizes(n: int, a: Cubic) -> tuple[float, float, float]:
    """Bounds of the sizes of its terms of first, second and third degree."""
    first = second = third = 0.0
    for k in range(1, 1 + n):
        first += abs(a[k])
    for k in range(1 + n, polynomial(n)):
        second += abs(a[k])
    for k in range(polynomial(n), len(a) - 1):
        third += abs(a[k])
    return first, second, third


def multiplied(n: int, a: Cubic, b: Cubic) -> Cubic:
    """The product of cubics in n joints."""
    a0, b0, second, end = a[0], b[0], 1 + n, len(a) - 1
    (a1, a2, a3), (b1, b2, b3) = _sizes(n, a), _sizes(n, b)
    found = [a0 * b[k] + b0 * a[k] for k in range(end + 1)]
    found[0] = a0 * b0
    place = second
    for j in range(1, second):
        found[place] += a[j] * b[j]
        place += 1
    for k in range(2, second):
        for j in range(1, k):
            found[place] += a[j] * b[k] + a[k] * b[j]
            place += 1
    place = second
    for places in PLACES[n]:
        x, y = a[place], b[place]
        for j in range(n):
            found[places[j]] += x * b[1 + j] + y * a[1 + j]
        place += 1
    more = a1 * b3 + a3 * b1 + (a2 + a3) * (b2 + b3)
    more += a[end] * (abs(b0) + b1 + b2 + b3 + b[end]) + b[end] * (abs(a0) + a1 + a2 + a3)
    found[end] = more
    return found


def squared(n: int, a: Cubic) -> Cubic:
    """The square of a cubic in n joints."""
    a0, second, end = a[0], 1 + n, len(a) - 1
    a1, a2, a3 = _sizes(n, a)
    twice = 2.0 * a0
    found = [twice * x for x in a]
    found[0] = a0 * a0
    place = second
    for j in range(1, second):
        found[place] += a[j] * a[j]
        place += 1
    for k in range(2, second):
        double = 2.0 * a[k]
        for j in range(1, k):
            found[place] += double * a[j]
            place += 1
    place = second
    for places in PLACES[n]:
        double = 2.0 * a[place]
        for j in range(n):
            found[places[j]] += double * a[1 + j]
        place += 1
    more = 2.0 * a1 * a3 + (a2 + a3) * (a2 + a3)
    found[end] = more + a[end] * (2.0 * (abs(a0) + a1 + a2 + a3) + a[end])
    return found


def cosine_and_sine(n: int, turn: Cubic) -> tuple[Cubic, Cubic]:
    """Of an angle, rad, that is 0 in the middle of the box."""
    square, most = squared(n, turn), largest(turn)
    cosine, sine = scaled(square, -0.5), minus(turn, scaled(multiplied(n, square, turn), 1.0 / 6.0))
    cosine[0] += 1.0
    cosine[-1] += most * most * most * most / 24.0
    sine[-1] += most * most * most * most * most / 120.0
    return cosine, sine
