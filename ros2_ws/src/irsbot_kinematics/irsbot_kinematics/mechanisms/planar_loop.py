"""The planar loop of two cranks and two rods: its lengths, and its singular curves."""

from __future__ import annotations

from math import acos, cos, hypot, pi, sin, tau
from typing import NamedTuple

import numpy as np

from irsbot_kinematics.mechanism import Locus, Signs
from irsbot_kinematics.numerics.arithmetic import FLOATS, Array

LOCUS_POINTS = 720
"""Points per turn along a locus: half a degree."""


Arc = tuple[float, float, float, float]
"""Centre x, z (m); start angle, length (rad) of an arc with the radius of the rods."""


class Loop(NamedTuple):
    """Lengths of the planar loop, m. half_base may be negative; drop is the distance of the motors below z = 0."""

    half_base: float
    drop: float
    crank: float
    rod: float


def loci(loop: Loop, mode: Signs) -> tuple[Locus, ...]:
    """Type 1 boundary and Type 2 curves of one working mode, from their equations (IRSBot-2 sheet section 6)."""
    b0, drop, l1, l2 = loop
    t = np.linspace(0.0, tau, LOCUS_POINTS + 1)
    found = []
    for foot in (-b0, b0):
        for radius in (l1 + l2, abs(l1 - l2)):
            circle = np.column_stack((foot + radius * np.cos(t), -drop - radius * np.sin(t)))
            other = np.hypot(circle[:, 0] + foot, circle[:, 1] + drop)
            inside = (other <= l1 + l2) & (other >= abs(l1 - l2))
            found.append(Locus("type1", np.where(inside[:, np.newaxis], circle, np.nan)))
    for cx, cz, start, length in coincident_arcs(loop, mode):
        along = start + length * np.linspace(0.0, 1.0, LOCUS_POINTS + 1)
        found.append(Locus("type2", np.column_stack((cx + l2 * np.cos(along), cz - l2 * np.sin(along)))))
    return (*found, *(_in_line(loop, mode, side, t) for side in (1.0, -1.0)))


def _in_line(loop: Loop, mode: Signs, side: float, t: Array) -> Locus:
    """Rods in line (psi_I = psi_II + pi): P = (0, -drop) + side sqrt(l1^2 - |v|^2) perp(v)/|v|, v = b0 x - l2 u(t)."""
    b0, drop, l1, l2 = loop
    vx, vz = b0 - l2 * np.cos(t), l2 * np.sin(t)
    size = np.hypot(vx, vz)
    with np.errstate(invalid="ignore", divide="ignore"):
        scale = side * np.sqrt(l1 * l1 - size * size) / size
        px, pz = -scale * vz, scale * vx
        # The cranks point from the motors to the elbows, which lie at P -+ l2 u(t).
        attachments = ((px + vx, pz + vz), (px - vx, pz - vz))
        normalised_levers = [-(ax * np.sin(t) + az * np.cos(t)) for ax, az in attachments]
        belongs = (normalised_levers[0] * mode[0] > 0.0) & (-normalised_levers[1] * mode[1] > 0.0)
    points = np.column_stack((px, pz - drop))
    return Locus("type2", np.where(belongs[:, np.newaxis], points, np.nan))


def coincident_elbows(loop: Loop) -> list[tuple[float, float]]:
    """Joint positions at which both elbows coincide (psi_I = psi_II), sheet section 6: none, or two isolated points,
    which are equal if the cranks just reach each other."""
    b0, l1 = loop.half_base, loop.crank
    if not 0.0 < abs(b0) <= l1:
        return []
    g = acos(abs(b0) / l1)
    return [(g, pi - g), (-g, g - pi)] if b0 > 0.0 else [(pi - g, g), (g - pi, -g)]


def coincident_arcs(loop: Loop, mode: Signs) -> list[Arc]:
    """Arcs of platform points with psi_I = psi_II in one working mode: |sin(q_k - psi)| keeps its sign between
    psi = q_k and q_k + pi, so each circle is cut at four angles."""
    arcs = []
    for q1, q2 in coincident_elbows(loop):
        cx, cz = -loop.half_base + loop.crank * cos(q1), -loop.drop - loop.crank * sin(q1)
        cuts = sorted({angle % tau for angle in (q1, q1 + pi, q2, q2 + pi)})
        for start, end in zip(cuts, [*cuts[1:], cuts[0] + tau], strict=True):
            middle = 0.5 * (start + end)
            if sin(q1 - middle) * mode[0] > 0.0 and sin(q2 - middle) * mode[1] > 0.0:
                arcs.append((cx, cz, start, end - start))
    return arcs


def arc_distance(dx: float, dz: float, radius: float, start: float, length: float) -> float:
    """Distance from a point to an arc; the point is relative to the centre."""
    after = (FLOATS.atan2(-dz, dx) - start) % tau
    if after <= length:
        return abs(hypot(dx, dz) - radius)
    return min(hypot(dx - radius * cos(end), dz + radius * sin(end)) for end in (start, start + length))
