"""Step 3 of `boxes`: lower bound of the Type 2 margin over a box, from the rods as vectors."""

from __future__ import annotations

from collections.abc import Sequence
from math import copysign, inf

from irsbot_kinematics.bounds.quadratics import (
    Quadratic,
    combined,
    corner_values,
    dot,
    largest,
    least,
    minus,
    multiplied,
    norm,
    plus,
    scaled,
)

Vector = Sequence[Quadratic]
Place = Sequence[float]


def type2_over(
    rods: Sequence[Vector], lengths: Sequence[Quadratic], attachments: Sequence[Place], arm: float, longest: Place
) -> float:
    """Lower bound of the smallest cos alpha_i, 0..1; 0 if nothing is proved.

    rods: as vectors, seen from the platform. lengths: their lengths, m. attachments: (x, y), m, where they hold a
    platform that turns, else none. arm: m, error of these. longest: m, upper bounds of the lengths.
    """
    n, found = len(rods), inf
    for leg, rod in enumerate(rods):
        others = [k for k in range(n) if k != leg]
        rows = [list(rods[k]) for k in others]
        if attachments:  # moments about the place where the leg holds the platform
            for row, k in zip(rows, others, strict=True):
                x, y = attachments[k][0] - attachments[leg][0], attachments[k][1] - attachments[leg][1]
                moment = combined((x, -y), (row[1], row[0]))
                moment[-1] += 2.0 * arm * longest[k]
                row.append(moment)
        v = _crossed(n, len(rod), rows)
        cosine = _in_plane(n, rod, v) if len(rod) == 2 else _in_space(n, rod, v, lengths[leg])
        if not cosine > 0.0:
            return 0.0
        found = min(found, cosine)
    return found


def _in_plane(n: int, rod: Vector, v: Vector) -> float:
    """tan alpha = |X|/D with D = rod . v and X = rod x v. If D s - X c and D s + X c are at least -m and D is at least
    d, m >= 0 and d > 0, then |X| d c <= D (d s + m)."""
    det = dot(n, rod, v)
    det = scaled(det, copysign(1.0, det[0]))
    cross = minus(multiplied(n, rod[0], v[1]), multiplied(n, rod[1], v[0]))
    d, tangent = least(n, det), 0.0
    dets, crosses = corner_values(n, det), corner_values(n, cross)
    if not min(d, min(dets)) > 0.0:  # d comes first: it is NaN if a number is not finite, and then min is NaN
        return 0.0
    for k in range(len(dets)):
        tangent = max(tangent, abs(crosses[k] / dets[k]))
    c = 1.0 / norm(1.0, tangent)
    s, shortest = tangent * c, d * c
    low, high = least(n, combined((s, -c), (det, cross))), least(n, combined((s, c), (det, cross)))
    if not (low > -inf and high > -inf and shortest > 0.0):
        return 0.0
    m = max(-min(low, high), 0.0)
    return 1.0 / norm(1.0, (d * s + m) / shortest)


def _in_space(n: int, rod: Vector, v: Vector, length: Quadratic) -> float:
    """cos alpha = D/(|v| length) with D = rod . v. If D - q |v| length is at least -m and D at least d, m >= 0 and
    d > 0, then D (d + m) >= q d |v| length. |v| <= along + aside^2/(2 along), along and across its middle."""
    det = dot(n, rod, v)
    det = scaled(det, copysign(1.0, det[0]))
    d, size = least(n, det), norm(v[0][0], v[1][0], v[2][0])
    if not (d > 0.0 and size > 0.0):
        return 0.0
    way = v[0][0] / size, v[1][0] / size, v[2][0] / size
    along = combined(way, v)
    shortest = 2.0 * along[0] - largest(along)
    if not shortest > 0.0:
        return 0.0
    across = [minus(v[k], scaled(along, way[k])) for k in range(3)]
    reach = plus(along, scaled(dot(n, across, across), 0.5 / shortest))
    below = multiplied(n, reach, length)
    dets, belows, q = corner_values(n, det), corner_values(n, below), inf
    if not min(belows) > 0.0:
        return 0.0
    for k in range(len(dets)):
        q = min(q, dets[k] / belows[k])
    left = least(n, minus(det, scaled(below, q)))
    if not (q > 0.0 and left > -inf):
        return 0.0
    return q * d / (d + max(-left, 0.0))


def _crossed(n: int, dims: int, rows: Sequence[Vector]) -> list[Quadratic]:
    """The first dims entries of what the determinants of any row and these n - 1 are the products with."""
    if n == 2:
        return [rows[0][1], scaled(rows[0][0], -1.0)]
    if n == 3:
        a, b = rows
        return [_minor(n, a, b, (k + 1) % 3, (k + 2) % 3) for k in range(dims)]
    a, b, c = rows
    minors = [[_minor(n, b, c, i, k) if i < k else [] for k in range(4)] for i in range(4)]
    return [
        minus(
            plus(multiplied(n, a[1], minors[2][3]), multiplied(n, a[3], minors[1][2])),
            multiplied(n, a[2], minors[1][3]),
        ),
        minus(
            multiplied(n, a[2], minors[0][3]),
            plus(multiplied(n, a[0], minors[2][3]), multiplied(n, a[3], minors[0][2])),
        ),
        minus(
            plus(multiplied(n, a[0], minors[1][3]), multiplied(n, a[3], minors[0][1])),
            multiplied(n, a[1], minors[0][3]),
        ),
    ]


def _minor(n: int, a: Vector, b: Vector, i: int, k: int) -> Quadratic:
    """Of columns i and k."""
    return minus(multiplied(n, a[i], b[k]), multiplied(n, a[k], b[i]))
