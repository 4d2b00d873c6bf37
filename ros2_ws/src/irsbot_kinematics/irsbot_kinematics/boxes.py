"""Certified bounds of margins over a box of joint positions, to second order, in plain floats.

The box is q = q0 + (s_1 h_1, .., s_n h_n) with every s_j in -1..1. Bounds of first order (`guarantees`) add up what
every joint can do to every direction. Here the first-order effect of each joint is known with its sign; only what is of
second order in the size of the box is added up.

Setting, as in `guarantees`. Rod i has the unit direction r_i and the length rod_i. To first order its near end moves by
s_i near_i and its length grows by s_i growth_i; the rest of both is at most aside_i and growth_aside_i. With d and t
displacement and turn of the platform and a_i the change of the rod as a vector, the rod's length says exactly

    row_i . (d, t) = s_i (r_i . near_i + growth_i) + rest_i,
    rest_i = r_i . aside_i + growth_aside_i + r_i . c_i t^2/2 - (|a_i|^2 - growth^2)/(2 rod_i)

up to |c_i| t^3/6, with the full growth of the rod in the last term, which is no more than |a_i|: that term
lies between -|a_i|^2/(2 rod_i) and 0. So every rest_i has a range, m_i its middle and h_i half of its width. The rows
give (d, t) = sum_j s_j (d_j, t_j) + (D, T) with |D| <= |A^-1 m| + sum V_i h_i, and T likewise with W_i. Along any
way from the posture to a point of the box the motion is continuous, so it cannot leave a box of (D, T) that these right
sides map into its inside.

Seen from the platform only the directions of the rods change: r_i(s) = r_i + sum_j s_j u_ij + e_i, the u_ij known and
e_i bounded. det A and the cross products v_i of the other rows are multilinear in the r_j. With |row_j| <= size,
Hadamard bounds every term of them that changes two rows or more, and every term with an e_j but the first-order one of
det A, which is at most |e_j| |v_j|; the terms of det A also follow from the minors of K, det(A + U) = det A det(I + K),
and the smaller bound counts. What remains is linear in s. cos alpha_i = |det A|/|v_i| >= c holds if
det - c |v_i| >= 0: a linear function less a convex one, which is smallest at a corner of the box.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, product
from math import asin, hypot, inf, prod, sqrt
from operator import add, mul
from typing import TYPE_CHECKING, NamedTuple

from irsbot_kinematics import statics

if TYPE_CHECKING:
    from irsbot_kinematics.mechanism import Floats, Posture

WIDER = 1.5
"""1: how many times wider than its guess the box of what is of second order is."""
BOXES = 4
"""Guesses; where none of them holds, the box of joints is so large that it is better cut."""
LEAST = 1e-100
"""m or rad: the box is not smaller, so that its inside is not empty."""


class Rod(NamedTuple):
    """What the joint of a rod does to it within the box, m."""

    length: float
    near: Floats  # of its near end, to first order, at the upper end of the joint's range
    aside: float  # how far the near end may be from there
    growth: float = 0.0  # of its length, to first order
    growth_aside: float = 0.0
    bend: float = 0.0  # the near end's rest along the rod is between 0 and minus this, but for
    uncertain: float | None = None  # this much; `aside` if left out


class Change(NamedTuple):
    """How the direction of a rod changes over the box."""

    ways: Sequence[Sequence[float]]  # per joint, to first order
    most: float  # largest size of their sum
    rest: float  # what may come on top of it


class Reached(NamedTuple):
    """What happens anywhere in the box."""

    type2: float  # lower bound of the Type 2 margin
    moves: Sequence[Floats]  # m per joint, of the platform point, to first order
    aside: float  # m by which the platform point may be elsewhere
    rods: Sequence[Change]  # of every rod's direction, seen from the base

    @property
    def turn(self) -> float:
        """rad that a rod turns at most."""
        chord = max([rod.most + rod.rest for rod in self.rods])
        return 2.0 * asin(0.5 * chord) if chord < 2.0 else inf


def reached(at: Posture, rods: Sequence[Rod], span: float = 0.0) -> Reached | None:
    """Bounds over the box of which `at` is the middle; None where nothing can be said, also for NaN.

    rods: one per leg, with near ends in the plane or in space as the screws. span: m, largest |c_i - c_j| of a platform
    that turns.
    """
    det, columns = statics.cofactors(at.screws)
    size, turning = abs(det), bool(at.arms)
    if not (size > 0.0 and all(rod.length > 0.0 for rod in rods)):
        return None
    dims = len(rods[0].near)
    drives = [(_dot(screw, rod.near) + rod.growth) / det for screw, rod in zip(at.screws, rods, strict=True)]
    moves = [tuple([drive * value for value in column[:dims]]) for drive, column in zip(drives, columns, strict=True)]
    turns = [drive * column[dims] for drive, column in zip(drives, columns, strict=True)] if turning else []
    arms = at.arms or ((0.0, 0.0),) * len(rods)
    ways = [_ways(i, moves, turns, arm, rod.near) for i, (arm, rod) in enumerate(zip(arms, rods, strict=True))]
    V = [hypot(*column[:dims]) / size for column in columns]
    W = [abs(column[dims]) / size for column in columns] if turning else [0.0] * len(rods)
    lengths, turn = [_largest(way) for way in ways], sum(map(abs, turns))
    radii = [hypot(*arm) for arm in arms]
    tilts = [arm[0] * screw[0] + arm[1] * screw[1] for arm, screw in zip(arms, at.screws, strict=True)]

    def mapped(D: float, T: float) -> tuple[float, float]:
        most = turn + T
        square = 0.5 * most * most
        x = y = 0.0
        middles = []
        for rod, radius, tilt, length, v, w in zip(rods, radii, tilts, lengths, V, W, strict=True):
            change = length + D + radius * T + square * radius + rod.aside
            low, high = -0.5 * change * change / rod.length - rod.growth_aside, rod.growth_aside
            # What has a known sign pulls or pushes at most as far as this, and at least not at all.
            for part in (square * tilt, -rod.bend):
                low, high = low + min(part, 0.0), high + max(part, 0.0)
            half = 0.5 * (high - low) + (rod.aside if rod.uncertain is None else rod.uncertain)
            half += radius * square * most / 3.0
            middles.append(0.5 * (high + low))
            x, y = x + v * half, y + w * half
        shift = statics.combined(det, columns, middles) if len(middles) > 2 else statics.twist(at.screws, middles)
        return x + hypot(*shift[:dims]), y + (abs(shift[dims]) if turning else 0.0)

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
    most = turn + T
    from_base, from_platform = [], []
    for i, (rod, screw, arm, way, length, radius) in enumerate(
        zip(rods, at.screws, arms, ways, lengths, radii, strict=True)
    ):
        off = D + radius * T + 0.5 * radius * most * most + rod.aside
        growth = abs(rod.growth) + rod.growth_aside
        if not growth < rod.length:
            return None
        r, per = screw[:dims], 1.0 / rod.length
        if rod.growth:
            way[i] = [a - rod.growth * b for a, b in zip(way[i], r, strict=True)]
        changes = [[per * a for a in one] for one in way]
        rest = (off + rod.growth_aside + (length + off + growth) * growth / (rod.length - growth)) * per
        seen = Change(changes, _largest(changes), rest)
        from_base.append(seen)
        if turning:
            rows = [_seen(change, angle, r, arm) for change, angle in zip(changes, turns, strict=True)]
            rest += T + 0.5 * most * most + most * (seen.most + rest)
            seen = Change(rows, _largest([row[:dims] for row in rows]), rest)
        from_platform.append(seen)
    return Reached(type2_over(at, from_platform, span), moves, D, from_base)


def type2_over(at: Posture, changes: Sequence[Change], span: float) -> float:
    """Lower bound of the smallest cos alpha_i, see the head of the file. changes: of rows, seen from the platform."""
    n, turning = len(changes), bool(at.arms)
    rods = sqrt(2.0) if turning else 1.0  # size of a row, its moment about a rod's far end counted in spans
    scale = span * rods**n if turning else 1.0
    det, columns = statics.cofactors(at.screws)
    centre = _ends(columns, at.arms)
    size = abs(det) / det if det else 0.0
    gain = [
        size * sum([_dot(column, change.ways[j]) for column, change in zip(columns, changes, strict=True)])
        for j in range(n)
    ]
    rest = [change.rest for change in changes]
    speeds = [hypot(*v) for v in centre]
    all_rows = [change.most + change.rest for change in changes]
    several = min(scale * _several(all_rows), abs(det) * _minors(columns, at.arms, changes, det))
    off = several + sum(map(mul, rest, speeds))
    value: float = abs(det) - off
    if not value - sum(map(abs, gain)) > 0.0:
        return 0.0
    if n == 2:  # unit rows: v_i is the other one
        return value - sum(map(abs, gain))
    slopes, least = _slopes(at, changes), 1.0
    for i, (v, speed) in enumerate(zip(centre, speeds, strict=True)):
        others = [k for k in range(n) if k != i]
        spread = scale / rods * (_several([all_rows[k] for k in others]) + sum([rest[k] for k in others]))
        if n > 3:  # differences of a cubic contain its cube
            spread += scale / rods * prod([changes[k].most for k in others])
        if not speed > 0.0:  # det is 0, but for rounding
            return 0.0
        along = [_dot(v, slope[i]) / speed for slope in slopes]
        shortest = speed - sum(map(abs, along))
        if not shortest > 0.0:
            return 0.0
        aside = sum(
            [
                hypot(*[b - a * c / speed for b, c in zip(slope[i], v, strict=True)])
                for a, slope in zip(along, slopes, strict=True)
            ]
        )
        # |v + s . slopes| <= speed + s . along + aside^2/(2 shortest)
        least = min(least, _least_quotient(value, gain, speed + spread + 0.5 * aside * aside / shortest, along))
    return least


def _least_quotient(above: float, gain: Sequence[float], below: float, along: Sequence[float]) -> float:
    """Smallest (above + s . gain)/(below + s . along), s_j in -1..1, both positive everywhere. From any value c of the
    quotient the corner where above - c below is smallest has a smaller one, unless c is the smallest."""
    least, here = inf, above / below
    while here < least:
        least = here
        signs = [-1.0 if g > least * a else 1.0 for g, a in zip(gain, along, strict=True)]
        here = (above + _dot(signs, gain)) / (below + _dot(signs, along))
    return least


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
                square += (u * y - v * x) ** 2
            columns.append((x, y))
        # the product of both eigenvalues, without cancellation, over the larger one
        larger = 0.5 * (a + c + hypot(a - c, 2.0 * b))
        values.append(square / larger if larger > 0.0 else 0.0)
    least = _least_of_two(values, sizes) if len(ways) == 2 else min(values) - sum(sizes)
    left = (sqrt(least) if least > 0.0 else 0.0) - rest
    return left if left > 0.0 else 0.0


def _least_of_two(values: Sequence[float], sizes: Sequence[float]) -> float:
    """Smallest value over the square -1..1 of the bilinear function with the given values at (-1, -1), (-1, 1),
    (1, -1), (1, 1) less sum (1 - s_j^2) sizes_j: at a corner, on an edge, or where both slopes vanish."""
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


def _ways(i: int, moves: Sequence[Floats], turns: Sequence[float], arm: Floats, near: Floats) -> list[list[float]]:
    """How a rod's far end moves against its near end with every joint, m."""
    ways = [list(move) for move in moves]
    for way, turn in zip(ways, turns, strict=False):
        way[0], way[1] = way[0] - turn * arm[1], way[1] + turn * arm[0]
    ways[i] = [a - b for a, b in zip(ways[i], near, strict=True)]
    return ways


def _seen(change: Sequence[float], turn: float, r: Floats, arm: Floats) -> Floats:
    """The change of a row, seen from a platform that turns."""
    x, y = change[0] + turn * r[1], change[1] - turn * r[0]
    return (x, y, *change[2:], arm[0] * y - arm[1] * x)


def _ends(columns: Sequence[Floats], arms: Sequence[Floats]) -> list[list[float]]:
    """The v_i: det A times the velocity of a rod's far end when its leg alone yields."""
    if not arms:
        return [list(column) for column in columns]
    return [[x - w * ay, y + w * ax, *z] for (x, y, *z, w), (ax, ay) in zip(columns, arms, strict=True)]


def _slopes(at: Posture, changes: Sequence[Change]) -> list[list[list[float]]]:
    """Per joint, how the v_i change to first order at the upper end of its range; of four rows half the difference
    between both ends."""
    rows, found = at.screws, []
    for j in range(len(rows)):
        ways = [change.ways[j] for change in changes]
        if len(rows) == 3:
            (a, b, c), (x, y, z) = rows, ways
            found.append(_ends((_crosses(y, c, b, z), _crosses(z, a, c, x), _crosses(x, b, a, y)), at.arms))
            continue
        ends = []
        for sign in (0.5, -0.5):
            there = [
                [a + 2.0 * sign * b for a, b in zip(row, way, strict=True)] for row, way in zip(rows, ways, strict=True)
            ]
            ends.append([[sign * value for value in v] for v in _ends(statics.cofactors(there)[1], at.arms)])
        found.append([list(map(add, *both)) for both in zip(*ends, strict=True)])
    return found


def _crosses(a: Sequence[float], b: Sequence[float], c: Sequence[float], d: Sequence[float]) -> Floats:
    """a x b + c x d."""
    (ax, ay, az), (bx, by, bz), (cx, cy, cz), (dx, dy, dz) = a, b, c, d
    return (
        ay * bz - az * by + cy * dz - cz * dy,
        az * bx - ax * bz + cz * dx - cx * dz,
        ax * by - ay * bx + cx * dy - cy * dx,
    )


def _minors(columns: Sequence[Floats], arms: Sequence[Floats], changes: Sequence[Change], det: float) -> float:
    """Bound of |det(I + K) - 1 - tr K| with K = U A^-1 and U what the rows change by: the principal minors of two rows
    or more. Those of two are bounded by the entries of K, larger ones by the sums of its rows."""
    K = []
    for i, change in enumerate(changes):
        ends = _ends(columns, [arms[i]] * len(columns) if arms else ())
        K.append(
            [
                (sum([abs(_dot(way, column)) for way in change.ways]) + change.rest * hypot(*end)) / abs(det)
                for column, end in zip(columns, ends, strict=True)
            ]
        )
    pairs = [K[i][i] * K[k][k] + K[i][k] * K[k][i] for i, k in combinations(range(len(K)), 2)]
    sums = [sum(row) for row in K]
    return sum(pairs) + _several(sums) - sum([a * b for a, b in combinations(sums, 2)])


def _several(most: Sequence[float]) -> float:
    """All products of two or more different numbers."""
    return float(prod([1.0 + m for m in most])) - 1.0 - sum(most)


def _largest(ways: Sequence[Sequence[float]]) -> float:
    """Largest size of a sum of vectors with any signs, or a little more."""
    square = sum([sum(map(mul, way, way)) for way in ways])
    return sqrt(square + 2.0 * sum([abs(sum(map(mul, a, b))) for a, b in combinations(ways, 2)]))


def _dot(row: Sequence[float], vector: Sequence[float]) -> float:
    return sum(map(mul, row, vector), 0.0)  # a row may have a moment besides
