"""Certified bounds of margins along a course of the joints, from the posture in its middle, in plain floats.

A course is q = q0 + s half + e with s in -1..1 and every |e_k| bounded: joints that go together, and may be a little
off. Bounds over the box of all q take the worst sign of every joint; here the signs are known, and what is lost is of
second order in the length of the course.

Setting, as in `guarantees`. Rod i has the unit direction r_i and the length rod_i. To first order in s its near end
moves by near_i and its length grows by growth_i; the rest of both is at most aside_i and growth_aside_i. With d and t
displacement and turn of the platform and a_i the change of the rod as a vector, the rod's length says exactly

    row_i . (d, t) = r_i . near_i s + growth_i s + rest_i,
    |rest_i| <= aside_i + growth_aside_i + |c_i| t^2/2 + |a_i|^2/(2 rod_i),

because the rod grows by no more than |a_i|: what is left of |a_i|^2 - (growth of the rod)^2 is between 0 and |a_i|^2.
The rows give (d, t) = s (d1, t1) + (D, T) with |D| <= sum V_i |rest_i|, |T| <= sum W_i |rest_i|. The motion is
continuous from the posture on, so it cannot leave a box of (D, T) that these right sides map into its inside.

Seen from the platform only the directions of the rods change: r_i(s) = r_i + s u_i + e_i, u_i known and e_i bounded.
cos alpha_i is |det A| over the size of a cross product v_i, both multilinear in the r_j. Without the e_j they are
polynomials in s, which lie above or below their chords between s = -1, 0 and 1 by no more than an eighth of their
second derivative; a quotient of two chords is smallest at an end. With sizes |row_j| <= size, Hadamard bounds all
derivatives and all that the e_j add; what one e_j alone adds to the determinant is at most |e_j| |v_j|.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from math import asin, hypot, inf, prod, sqrt
from operator import mul
from typing import TYPE_CHECKING, NamedTuple

from irsbot_kinematics import statics
from irsbot_kinematics.arithmetic import FLOATS

if TYPE_CHECKING:
    from irsbot_kinematics.mechanism import Floats, Posture

WIDER = 1.5
"""1: how many times wider than its guess the box of what is of second order is."""
BOXES = 4
"""Guesses; where none of them holds, the course is so long that it is better cut."""
LEAST = 1e-100
"""m or rad: the box is not smaller, so that its inside is not empty."""


class Rod(NamedTuple):
    """What the joints of a course do to one rod, m."""

    length: float
    near: Floats  # of its near end, to first order, at the end of the course
    aside: float  # how far the near end may be from there
    growth: float = 0.0  # of its length, to first order
    growth_aside: float = 0.0


class Swept(NamedTuple):
    """What happens anywhere on a course."""

    type2: float  # lower bound of the Type 2 margin
    move: Floats  # m, of the platform point, to first order, at the end of the course
    aside: float  # m by which the platform point may be elsewhere
    turns: Floats  # rad each rod turns at most


class _Change(NamedTuple):
    """How the direction of a rod changes, seen from the platform."""

    row: Floats  # of its screw, to first order
    most: float  # size of the change, to first order
    rest: float  # what may come on top of it


def swept(at: Posture, rods: Sequence[Rod], span: float = 0.0) -> Swept | None:
    """Bounds along the course of which `at` is the middle; None where nothing can be said, also for NaN.

    rods: one per leg, with near ends in the plane or in space as the screws. span: m, largest |c_i - c_j| of a platform
    that turns.
    """
    det, columns = statics.cofactors(at.screws)
    size, turning = abs(det), bool(at.arms)
    if not (size > 0.0 and all(rod.length > 0.0 for rod in rods)):
        return None
    drive = [_dot(screw, rod.near) + rod.growth for screw, rod in zip(at.screws, rods, strict=True)]
    dims = len(rods[0].near)
    twist = statics.twist(at.screws, drive)
    move, turn = twist[:dims], twist[dims] if turning else 0.0
    arms = at.arms if turning else ((0.0, 0.0),) * len(rods)
    ways = [_relative(move, turn, arm, rod.near) for arm, rod in zip(arms, rods, strict=True)]
    moves = [hypot(*column[:dims]) / size for column in columns]
    turns = [abs(column[dims]) / size for column in columns] if turning else [0.0] * len(rods)
    lengths = [hypot(*way) for way in ways]
    radii = [hypot(*arm) for arm in arms]

    def mapped(D: float, T: float) -> tuple[float, float]:
        most = abs(turn) + T
        x = y = 0.0
        for rod, radius, length, V, W in zip(rods, radii, lengths, moves, turns, strict=True):
            bend = 0.5 * radius * most * most
            change = length + D + radius * T + bend + rod.aside
            rest = rod.aside + rod.growth_aside + bend + 0.5 * change * change / rod.length
            x, y = x + V * rest, y + W * rest
        return x, y

    D, T, shortest = *mapped(0.0, 0.0), min([rod.length for rod in rods])
    for _ in range(BOXES):
        if not shortest > D:  # whatever holds in such a box says nothing
            return None
        box = WIDER * D + LEAST, WIDER * T + LEAST
        D, T = mapped(*box)
        if box[0] > D and box[1] > T:
            break
    else:
        return None
    D, T = mapped(D, T)  # what is inside stays inside
    most = abs(turn) + T
    changes, rod_turns = [], []
    for rod, screw, arm, way, length, radius in zip(rods, at.screws, arms, ways, lengths, radii, strict=True):
        off = D + radius * T + 0.5 * radius * most * most + rod.aside
        growth = abs(rod.growth) + rod.growth_aside
        if not growth < rod.length:
            return None
        r = screw[:dims]
        u = [(a - rod.growth * b) / rod.length for a, b in zip(way, r, strict=True)]
        rest = (off + rod.growth_aside + (length + off + growth) * growth / (rod.length - growth)) / rod.length
        chord = hypot(*u) + rest
        rod_turns.append(2.0 * asin(0.5 * chord) if chord < 2.0 else inf)
        if turning:
            u[0], u[1] = u[0] + turn * r[1], u[1] - turn * r[0]
            rest += T + 0.5 * most * most + most * chord
            changes.append(_Change((*u, arm[0] * u[1] - arm[1] * u[0]), hypot(*u), rest))
        else:
            changes.append(_Change(tuple(u), hypot(*u), rest))
    return Swept(_type2(at, changes, det, span), move, D, tuple(rod_turns))


def _type2(at: Posture, changes: Sequence[_Change], det: float, span: float) -> float:
    """Lower bound of the smallest cos alpha_i, see the head of the file."""
    n, turning = len(changes), bool(at.arms)
    rods = sqrt(2.0) if turning else 1.0  # size of a row, its moment about a rod's far end counted in spans
    scale = span * rods**n if turning else 1.0
    most, rest = [change.most for change in changes], [change.rest for change in changes]
    if not max(rest) < 1.0:
        return 0.0
    grown = prod([1.0 + u for u in most])
    pairs = sum([u * v for u, v in combinations(most, 2)])
    curved = 0.25 * grown * pairs  # an eighth of the second derivative, over scale
    speed_off = scale / rods * (curved + prod([1.0 + u + e for u, e in zip(most, rest, strict=True)]) - grown)
    looks = []
    for s in (-1.0, 0.0, 1.0):
        pairs_of_rows = zip(at.screws, changes, strict=True)
        rows = [[a + s * b for a, b in zip(row, change.row, strict=True)] for row, change in pairs_of_rows]
        value, speeds = statics.yielding(FLOATS, rows, at.arms)
        looks.append((value if det > 0.0 else -value, speeds))
    fastest = [max(speeds) for speeds in zip(*[speeds for _, speeds in looks], strict=True)]
    several = prod([1.0 + e for e in rest]) - 1.0 - sum(rest)  # more than one of the e_j at a time
    det_off = scale * (curved + grown * several)
    det_off += sum([e * (v + scale / rods * curved) for e, v in zip(rest, fastest, strict=True)])
    least = inf
    for value, speeds in looks:
        if not value > det_off:
            return 0.0
        widest = 1.0 if n == 2 else max(speeds) + speed_off  # two unit rows: v_i is the other one
        least = min(least, (value - det_off) / widest)
    return least


def _relative(move: Sequence[float], turn: float, arm: Sequence[float], near: Sequence[float]) -> list[float]:
    """How a rod's far end moves against its near end, m."""
    way = [a - b for a, b in zip(move, near, strict=True)]
    way[0], way[1] = way[0] - turn * arm[1], way[1] + turn * arm[0]
    return way


def _dot(row: Sequence[float], vector: Sequence[float]) -> float:
    return sum(map(mul, row, vector), 0.0)  # a row may have a moment besides
