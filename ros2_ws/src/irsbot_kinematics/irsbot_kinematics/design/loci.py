"""Type 2 loci that a design meets, by working mode and by side of the line through the motors."""

from __future__ import annotations

from dataclasses import dataclass
from math import tau

import numpy as np

from irsbot_kinematics.mechanism import Signs
from irsbot_kinematics.mechanisms.irsbot2_space.geometry import Irsbot2Geometry
from irsbot_kinematics.mechanisms.planar_loop import Loop, coincident_elbows
from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_kinematics.numerics.tolerances import COINCIDENT_TOL_M, SIGN_DEAD_BAND

_SAMPLES = 7200
"""Points per turn of each locus: parts shorter than 0.05 deg may be missed. Whether a locus exists at all is decided
by the closed inequalities of `proximal`, not here."""


@dataclass(frozen=True)
class LocusPart:
    """The part of one Type 2 locus that belongs to one working mode and one side."""

    opposite: bool
    """psi_I = psi_II + pi; else psi_I = psi_II."""
    working_mode: Signs
    below: bool
    """z + e < 0."""
    z_low: float
    """m, of the platform point."""
    z_high: float


def type_2_parts(g: Irsbot2Geometry) -> tuple[LocusPart, ...]:
    """All parts of both loci, one per branch, working mode and side; empty if Type 2 is out of reach."""
    parts: list[LocusPart] = []
    t = np.arange(_SAMPLES) * (tau / _SAMPLES)
    for q_1, q_2 in coincident_elbows(Loop(g.b0, g.e, g.l1, g.l2eq)):
        height = -g.l1 * np.sin(q_1) - g.l2eq * np.sin(t)
        parts += _parts(g, False, np.sin(q_1 - t), np.sin(q_2 - t), height)
    vx, vz = g.b0 - g.l2eq * np.cos(t), g.l2eq * np.sin(t)
    size = np.hypot(vx, vz)
    closes = (size <= g.l1) & (size > COINCIDENT_TOL_M)
    vx, vz, size, psi = vx[closes], vz[closes], size[closes], t[closes]
    for side in (1.0, -1.0):  # P = (0, -e) + side sqrt(l1^2 - |v|^2) perp(v)/|v|, arms P +- v
        scale = side * np.sqrt(g.l1**2 - size**2) / size
        px, pz = -scale * vz, scale * vx
        normalised_levers = [_sine(ax, az, psi) / g.l1 for ax, az in ((px + vx, pz + vz), (px - vx, pz - vz))]
        parts += _parts(g, True, normalised_levers[0], -normalised_levers[1], pz)
    return tuple(parts)


def _sine(ax: Array, az: Array, psi: Array) -> Array:
    """sin(q - psi) times the length of the arm (ax, az) = l1 u(q)."""
    sine: Array = -az * np.cos(psi) - ax * np.sin(psi)
    return sine


def _parts(g: Irsbot2Geometry, opposite: bool, sine_1: Array, sine_2: Array, height: Array) -> list[LocusPart]:
    found = []
    for mode in ((1, -1), (-1, 1), (1, 1), (-1, -1)):
        belongs = (mode[0] * sine_1 > SIGN_DEAD_BAND) & (mode[1] * sine_2 > SIGN_DEAD_BAND)
        for below in (True, False):
            z = height[belongs & ((height < 0.0) if below else (height > 0.0))] - g.e
            if z.size:
                found.append(LocusPart(opposite, mode, below, float(z.min()), float(z.max())))
    return found
