"""Certified bounds of the motion of a platform and of the decrease of its margins, from one posture, in plain floats.

Setting. Leg i holds the platform point at arm c_i through a rod of length rod_i with unit direction r_i. The near end
of the rod moves by at most path_i; `drive_i` bounds its elongation demand along r_i. With d the displacement of the
platform point, t the turn of the platform and radius >= |c_i|, the change of rod i is a = d + (R' - R) c_i - near end,
and |(R' - R) c_i - t perp(c_i)| <= radius t^2/2, so from the rod's length

    row_i . (d, t) = b_i,   |b_i| <= drive_i + (|d| + radius |t| + path_i)^2/(2 rod_i) + radius t^2/2

(exact, not linearised), and |d| <= sum V_i |b_i|, |t| <= sum W_i |b_i| with (V_i, W_i) the sizes of column i of A^-1.
Along any motion that starts at the posture (d, t) is continuous, so it cannot leave a box (x, y) whose image under
these right sides is the box or less. With (x, y) = c (x0, y0), (x0, y0) the right sides without their terms in d and t,
that is 1 + linear c + square c^2 <= c; the smallest such c is taken. If the joints may move too far, there is no such c
and no bound.

Angles add up: if a direction turns by at most v and a plane's normal by at most w, the elevation of the direction over
the plane falls by at most v + w; a vector changed by a share u < 1 of its size turns by at most asin(u).
"""

from __future__ import annotations

from math import asin, hypot, inf, pi, sin, sqrt
from typing import NamedTuple

BALANCE = 0.1
"""1: least ratio of translation and turn of a box (turns times the radius): otherwise a motion that begins as a pure
turn about the platform point would have a box of width 0."""
LEAST_M = 1e-100
"""m: least size of boxes. A larger box is also a bound, and the squares and shares of this size are still numbers."""
HALF = 0.5
"""1: share of its size up to which `level_after` follows the change of a normal."""
CHORD = pi / 3.0
"""asin(u) <= CHORD u for 0 <= u <= HALF, because asin is convex there and asin(1/2) = pi/6."""


class Errors(NamedTuple):
    """Effect on one leg of the geometry errors of `Mechanism.certified_bounds`, m.

    A rod with errors at both ends is equivalent to a rod with the sum of the errors at its near end: a + R' e - near
    end, see above. The error of the attachment also has an effect on the moment of the rod.
    """

    ends: float
    """Relative error of the ends of its rod, in any direction, at the positions of the joints."""
    length: float
    """Error of the length of its rod."""
    arm: float
    """Error of its attachment, seen along the axis about which the platform turns."""


EXACT = Errors(0.0, 0.0, 0.0)
"""A geometry without errors."""


def displacement(start: float, linear: float, square: float) -> float:
    """Smallest d with start + linear d + square d^2 <= d, m; infinite if there is none, also for NaN."""
    slope = 1.0 - linear
    delta = slope * slope - 4.0 * square * start
    return 2.0 * start / (slope + sqrt(delta)) if slope > 0.0 and delta >= 0.0 else inf


def displacement_and_turn(
    x0: float, y0: float, moves: float, turns: float, path: float, rod: float, radius: float
) -> tuple[float, float]:
    """(m, rad) largest displacement and turn of a platform; infinite if there is no bound, also for NaN.

    x0, y0: sum of V_i and of W_i times drive_i + path_i^2/(2 rod_i), m and rad; moves, turns: sums of V_i and W_i;
    path: the largest path_i, rod: the smallest rod, m.
    """
    if x0 == 0.0 and y0 == 0.0:
        return 0.0, 0.0
    x0 = max(x0, LEAST_M)
    x0, y0 = max(x0, BALANCE * radius * y0), max(y0, BALANCE * x0 / radius)
    reach = x0 + radius * y0
    worst = max(moves / x0, turns / y0)
    square = 0.5 * (reach * reach / rod + radius * y0 * y0)
    c = displacement(1.0, worst * path * reach / rod, worst * square)
    return c * x0, c * y0


def least_cosine(
    velocities: list[list[tuple[float, ...]]], turns: list[float], angles: list[float], arm: float
) -> float:
    """Smallest cos alpha while rod j turns by at most angles[j], seen from the platform, and every place at which a leg
    holds the platform is off by at most `arm`; 0 where that proves nothing.

    velocities[j][i]: of the place of leg i when leg j alone yields by one unit, and turns[j], rad/m, of the platform.
    1/cos alpha_i is the size of velocities[i][i]. With rows A + E these are the columns of A^-1 (1 + F)^-1, F = E A^-1.
    A rod's change is across it but for half the square of its angle, and r_j . velocities[k][j] is 1 for k = j, else 0;
    so |F_jk| is at most G_jk below, and (1 + F)^-1 differs from 1 in column i by at most the sum of G^m, m > 0.
    """
    n = len(turns)
    G, norm = [], 0.0
    for j in range(n):
        angle, row, total = angles[j], [], 0.0
        for k in range(n):
            square = -1.0 if j == k else 0.0
            for x in velocities[k][j]:
                square += x * x
            entry = angle * sqrt(max(square, 0.0)) + arm * turns[k]
            if j == k:
                entry += 0.5 * angle * angle
            row.append(entry)
            total += entry
        if not total < 1.0:
            return 0.0
        G.append(row)
        norm = max(norm, total)
    largest = 0.0
    for i in range(n):
        own, square, most = velocities[i][i], 0.0, 0.0
        for x in own:
            square += x * x
        size = sqrt(square)
        if not size > 0.0:
            return 0.0
        for row in G:
            most = max(most, row[i])
        rest = norm * norm / (1.0 - norm) * most
        along, across, turn = size, 0.0, turns[i]
        for j in range(n):
            row, other = G[j], velocities[j][i]
            change, part, square = row[i] + rest, 0.0, 0.0
            for k in range(n):
                change += row[k] * G[k][i]
            for d in range(len(own)):
                part += other[d] * own[d]
                square += other[d] * other[d]
            part = abs(part) / size
            along += change * part
            across += change * sqrt(max(square - part * part, 0.0))
            turn += change * turns[j]
        bound = hypot(along, across) + arm * turn
        if not bound < inf:
            return 0.0
        largest = max(largest, bound)
    return min(1.0 / largest, 1.0)


def lowered(sine: float, turn: float, share: float = 0.0) -> float:
    """Smallest |sin| of an elevation after its direction turned by `turn` rad and the vector along its plane's normal
    changed by `share` of its size: sin(asin(sine) - turn - asin(share)), 0 where that proves nothing."""
    if not (share < 1.0 and sine > 0.0):
        return 0.0
    left = asin(min(sine, 1.0)) - turn - asin(share)
    return sin(left) if left > 0.0 else 0.0


def level_after(sine: float, turn: float, share: float) -> float:
    """Largest d up to which an elevation that `lowered` by d turn and d share has not reached 0.

    turn: positive. share: 0 if the normal cannot turn, or if the sine is 0.
    """
    steps = asin(min(sine, 1.0)) / (turn + CHORD * share)
    return min(steps, HALF / share) if share > 0.0 else steps
