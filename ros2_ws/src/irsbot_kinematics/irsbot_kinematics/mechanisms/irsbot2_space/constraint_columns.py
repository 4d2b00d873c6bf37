"""`Irsbot2.constraint_over` for many postures at once, in columns (N,): the same equations."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi, sqrt
from typing import NamedTuple

import numpy as np

from irsbot_kinematics.bounds.columns import least_singular_many
from irsbot_kinematics.numerics.arithmetic import Array

ROOT2 = sqrt(2.0)


class Normal(NamedTuple):
    """The unit normal of a rod over a range of its directions, as `_normal_over` of `irsbot2` has it.

    small: smallest square of the normal before it is made a unit; where that is not positive the rest means nothing.
    """

    small: Array
    least: Array
    rate: Array
    bend: Array


def constraint_over(
    numbers: tuple[float, float, float, float, float, float],
    screws: Sequence[Sequence[Array]],
    turns: tuple[tuple[Array, Array], tuple[Array, Array]],
    error: Array,
) -> Array:
    """Lower bounds of the constraint margin while rod k turns by s_1 turns[k][0] + s_2 turns[k][1], s_j in -1..1, and
    by `error` on top, rad. numbers: those of the geometry."""
    s, c, l2, D, reach, offset = numbers
    (c1, m1), (c2, m2) = screws
    (u1, u2), (v1, v2) = turns
    turn1, turn2 = np.abs(u1) + np.abs(u2), np.abs(v1) + np.abs(v2)
    proved, square, room = np.ones(len(error), bool), np.zeros_like(error), np.zeros_like(error)
    normals = []
    for cosine, down, side, turn in ((c1, m1, D, turn1), (c2, m2, -D, turn2)):
        normal = _normal_over(l2, side, c, *_cosines(cosine, down, turn + error))
        x, z = c * (l2 * cosine + side), l2 * down
        size = np.hypot(x, z)
        proved &= (normal.small * normal.small > 0.0) & (size > 0.0)
        square += normal.least * normal.least
        x, z = x / size, z / size
        slope = c * (l2 + side * cosine) * l2 / (size * size)
        normals.append((c * x, z, -c * z * slope, x * slope))
        off = 0.5 * normal.bend * turn * turn + normal.rate * error
        room += 2.0 * off * off
    off = reach * ((0.5 * turn1 * turn1 + error) + (0.5 * turn2 * turn2 + error))
    (ux, uz, dux, duz), (vx, vz, dvx, dvz) = normals
    base = ((ROOT2 * ux, ROOT2 * uz), (ROOT2 * vx, ROOT2 * vz), (reach * (m2 - m1), reach * (c1 - c2) - offset))
    ways = [
        (
            (ROOT2 * dux * a, ROOT2 * duz * a),
            (ROOT2 * dvx * b, ROOT2 * dvz * b),
            (reach * (c2 * b - c1 * a), reach * (m2 * b - m1 * a)),
        )
        for a, b in ((u1, v1), (u2, v2))
    ]
    sigma_y, sigma_xz = s * np.sqrt(2.0 * square), least_singular_many(base, ways, np.sqrt(room + off * off))
    return np.where(proved, np.minimum(sigma_y, sigma_xz), 0.0)


def _cosines(cosine: Array, down: Array, turn: Array) -> tuple[Array, Array]:
    """Smallest and largest cosine of directions (cos, -sin) that turn by at most `turn`."""
    angle = np.arctan2(np.abs(down), cosine)  # 0..pi
    return np.cos(np.minimum(angle + turn, pi)), np.cos(np.maximum(angle - turn, 0.0))


def _normal_over(l2: float, D: float, c: float, low: Array, high: Array) -> Normal:
    p, r, t = l2 * l2 * (c * c - 1.0), 2.0 * c * c * l2 * D, c * c * D * D + l2 * l2
    squares = [(p * X + r) * X + t for X in (low, high)]
    small = np.minimum(*squares)
    ends = [low, high]
    if D != 0.0 and abs(l2) < abs(D):
        ends.append(np.clip(-l2 / D, low, high))  # stationary there, if that is within the range
        squares.append((p * ends[2] + r) * ends[2] + t)
    least = np.minimum.reduce([c * np.abs(l2 * X + D) / np.sqrt(below) for X, below in zip(ends, squares, strict=True)])
    least = np.where((low <= -D / l2) & (-D / l2 <= high), 0.0, least)
    rate = c * l2 * np.maximum(np.abs(l2 + D * low), np.abs(l2 + D * high)) / small
    most = np.maximum.reduce([np.abs((-D * p * X - 2.0 * p * l2) * X + D * t - l2 * r) for X in ends])
    flat = np.where((low <= 0.0) & (high >= 0.0), 0.0, np.minimum(low * low, high * high))
    slope = c * l2 * most * np.sqrt(np.maximum(1.0 - flat, 0.0)) / (small * small)
    return Normal(small, least, rate, np.hypot(rate * rate, slope))
