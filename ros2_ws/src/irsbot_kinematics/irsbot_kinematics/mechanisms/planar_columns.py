"""Bounds of the margins of a planar pair over boxes around many postures: the equations of `planar_pair`, for an exact
geometry, in columns (N,). A row of which nothing can be said is False in `proved`, and its other numbers mean
nothing."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import NamedTuple

import numpy as np

from irsbot_kinematics.mechanism import Legs
from irsbot_kinematics.mechanisms.planar_loop import Loop
from irsbot_kinematics.numerics.arithmetic import Array


class FirstOrder(NamedTuple):
    """Bounds of first order.

    type1: (N,) of every leg.
    type2: of both.
    turn: rad, of both rods together.
    """

    type1: tuple[Array, ...]
    type2: Array
    turn: Array


class SecondOrder(NamedTuple):
    """Bounds of second order, and the turns of the rods.

    proved: (N,) True where the bounds hold.
    type1: of every leg.
    type2: of both.
    turns: rad, of every rod by every joint to first order; positive from x to z.
    error: rad, on top of the turn of either rod.
    """

    proved: Array
    type1: tuple[Array, ...]
    type2: Array
    turns: tuple[tuple[Array, Array], tuple[Array, Array]]
    error: Array


def first_order(loop: Loop, legs: Legs[Array], gaps: Sequence[Array], travel: Sequence[Array]) -> FirstOrder:
    """`PlanarPair.certified_bounds`; 0 where nothing can be said."""
    l1, l2 = loop.crank, loop.rod
    path, full = l1 * (travel[0] + travel[1]), 2.0 * l2
    low, high = gaps[1] - path, gaps[1] + path
    proved = (low > 0.0) & (high < full) & (travel[0] >= 0.0) & (travel[1] >= 0.0)
    low, high = np.where(proved, low, 0.0), np.where(proved, high, 0.0)
    low, high = low * np.sqrt((full - low) * (full + low)), high * np.sqrt((full - high) * (full + high))
    type2 = np.minimum(low, high) / (full * l2)
    apart = np.divide(path, type2, out=np.full_like(path, inf), where=type2 > 0.0)
    type1 = [
        np.minimum(_sine_between(loop, r - apart, r + apart), np.abs(sine))
        for r, sine in zip(legs.parts[-2:], legs.normalised_levers, strict=True)
    ]
    return FirstOrder(tuple(type1), type2, (2.0 * apart + path) / l2)


def second_order(
    loop: Loop,
    joints: Sequence[Array],
    pose: Sequence[Array],
    legs: Legs[Array],
    gaps: Sequence[Array],
    travel: Sequence[Array],
) -> SecondOrder:
    """`PlanarPair.sharp_bounds`; the comments there say what the numbers are."""
    b0, e, l1, l2 = loop
    (r1x, r1z), (r2x, r2z) = legs.screws
    q1, q2 = joints
    h1, h2 = travel
    d, full = gaps[1], 2.0 * l2
    det = r1x * r2z - r1z * r2x
    n1x, n1z, n2x, n2z = -l1 * h1 * np.sin(q1), -l1 * h1 * np.cos(q1), -l1 * h2 * np.sin(q2), -l1 * h2 * np.cos(q2)
    rest1, rest2 = 0.5 * l1 * h1 * h1, 0.5 * l1 * h2 * h2
    rest = rest1 + rest2
    vx, vz = (r1x - r2x) / d * l2, (r1z - r2z) / d * l2
    along = np.abs(vx * n1x + vz * n1z) + np.abs(vx * n2x + vz * n2z) + rest
    aside = np.abs(vx * n1z - vz * n1x) + np.abs(vx * n2z - vz * n2x) + rest
    low, high = d - along, np.hypot(d + along, aside)
    proved = (det != 0.0) & (h1 >= 0.0) & (h2 >= 0.0) & (low > 0.0) & (high < full)
    tilt = aside / low
    farther, most = rest + 0.5 * aside * tilt, along + 0.5 * aside * tilt
    opening, widest = (full - d) * (full + d), (full - high) * (full + high)
    root = np.sqrt(widest)
    error = rest / d + tilt * along / d + tilt * tilt * tilt / 3.0
    error += farther / np.sqrt(opening) + 0.5 * most * most * high / (widest * root)
    type2 = np.minimum(low * np.sqrt((full - low) * (full + low)), high * root) / (full * l2)
    drive1, drive2 = (r1x * n1x + r1z * n1z) / det, (r2x * n2x + r2z * n2z) / det
    d1x, d1z, d2x, d2z = drive1 * r2z, -drive1 * r2x, -drive2 * r1z, drive2 * r1x
    t11, t12 = (r1x * (d1z - n1z) - r1z * (d1x - n1x)) / l2, (r1x * d2z - r1z * d2x) / l2
    t21, t22 = (r2x * d1z - r2z * d1x) / l2, (r2x * (d2z - n2z) - r2z * (d2x - n2x)) / l2
    turn1, turn2 = np.abs(t11) + np.abs(t12) + error, np.abs(t21) + np.abs(t22) + error
    off1, off2 = rest1 + l2 * (error + 0.5 * turn1 * turn1), rest2 + l2 * (error + 0.5 * turn2 * turn2)
    off, way, type1 = np.minimum(off1, off2), ((d1x, d1z), (d2x, d2z)), []
    for foot, sine in zip((b0, -b0), legs.normalised_levers, strict=True):
        near, far = _distances(pose[0] + foot, pose[1] + e, *way, off)
        type1.append(np.minimum(_sine_between(loop, near, far), np.abs(sine)))
    return SecondOrder(proved, tuple(type1), type2, ((t11, t12), (t21, t22)), error)


def _distances(
    x: Array, z: Array, one: tuple[Array, Array], other: tuple[Array, Array], rest: Array
) -> tuple[Array, Array]:
    """Bounds of the distance of (x, z) + s one + t other, s and t in -1..1, from the origin, with an error of `rest`:
    smallest and largest; NaN from the origin itself."""
    size = np.hypot(x, z)
    x, z = x / size, z / size
    (ax, az), (bx, bz) = one, other
    along = np.abs(x * ax + z * az) + np.abs(x * bx + z * bz)
    aside = np.abs(x * az - z * ax) + np.abs(x * bz - z * bx)
    return size - along - rest, np.hypot(size + along, aside) + rest


def _sine_between(loop: Loop, near: Array, far: Array) -> Array:
    """Smallest |sin(q - psi)| for |A P| between near and far; 0 where crank and rod may be in line."""
    l1, l2 = loop.crank, loop.rod
    middle, span = l1 * l1 + l2 * l2, 2.0 * l1 * l2
    worst = np.maximum(middle - near * near, far * far - middle)
    worst = np.where((near > 0.0) & (worst < span), worst, span)
    sine: Array = np.sqrt((span - worst) * (span + worst)) / span
    return sine
