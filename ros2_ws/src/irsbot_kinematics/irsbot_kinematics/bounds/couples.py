"""Constraints of a platform that turns about z only, over a box of joint positions: a bound of second order.

The couples of the legs that hinder the two other turns are across the horizontal parts h_i of the rods. They are
dependent where the directions of these parts are parallel: the second singular value of the matrix of these directions
vanishes there. If h changes by w across it, its direction changes by w/|h| to first order, and what w^2 adds is at most
(|w|/|h|)^2/sqrt 3 over (1 - |w|/|h|)^2, because the second derivatives of the unit vector along a vector are at most
2/sqrt 3 over its size squared.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

from irsbot_kinematics.bounds.box_code import codes_for
from irsbot_kinematics.bounds.quadratics import Quadratic, besides, effects, norm
from irsbot_kinematics.bounds.sizes import largest_sum, least_singular


def least_over(rods: Sequence[Sequence[Quadratic]]) -> float:
    """Lower bound of the second singular value, 1; 0 if nothing is proved.

    rods: m, as vectors, seen from the base: `boxes.Reached.rods`. Machine code answers where there is some.
    """
    n = len(rods)
    code = codes_for(n, len(rods[0]), effects(n, rods[0][0])).get("couples")
    found = code and code(numbers_of(rods))
    return found[0] if found else by_equations(rods)


def by_equations(rods: Sequence[Sequence[Quadratic]]) -> float:
    """The same without machine code, which is made from this."""
    n, room = len(rods), 0.0
    columns: list[tuple[float, float]] = []
    ways: list[list[tuple[float, float]]] = [[] for _ in rods]
    for a, b, *_ in rods:
        level = norm(a[0], b[0])
        if not level > 0.0:
            return 0.0
        x, y = a[0] / level, b[0] / level
        columns.append((x, y))
        for joint in range(n):
            across = (x * b[1 + joint] - y * a[1 + joint]) / level
            ways[joint].append((-y * across, x * across))
        rest = norm(besides(n, a), besides(n, b)) / level
        share = largest_sum([(a[1 + joint], b[1 + joint]) for joint in range(n)]) / level + rest
        if not share < 1.0:
            return 0.0
        more = rest + share * share / (sqrt(3.0) * (1.0 - share) * (1.0 - share))
        room += more * more
    return least_singular(columns, ways, sqrt(room))


def numbers_of(rods: Sequence[Sequence[Quadratic]]) -> list[float]:
    """What machine code takes."""
    found: list[float] = []
    for rod in rods:
        found += rod[0]
        found += rod[1]
    return found
