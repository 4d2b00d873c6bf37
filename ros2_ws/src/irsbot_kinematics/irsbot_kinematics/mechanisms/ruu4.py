"""4-RUU: three translations and a turn about z. Source: limbs of [S3], section 5; the wrenches and margins are ours.

Leg i: a crank on an upright axis at A_i, a universal joint at its end C_i, a rod, a universal joint at the platform's
B_i.
The second axis of both universal joints is horizontal and normal to the rod, the first is parallel to z. The leg then
holds the platform by a force along its rod (actuation) and by a couple about the horizontal direction of its rod
(constraint); two couples that are not parallel keep the platform level.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import asin, cos, hypot, sin, sqrt
from typing import ClassVar

import numpy as np

from irsbot_kinematics.bounds import couples
from irsbot_kinematics.bounds.boxes import Reached
from irsbot_kinematics.mechanism import Floats, Legs, Posture
from irsbot_kinematics.mechanisms.branched_platform import BY_A_LOOP, TINY
from irsbot_kinematics.mechanisms.crank_platform import CrankPlatform
from irsbot_kinematics.mechanisms.geometry_checks import require, require_finite
from irsbot_kinematics.numerics.arithmetic import Arithmetic, Array, N
from irsbot_kinematics.numerics.assembly_roots import planar_position
from irsbot_kinematics.skeleton import Cut, Rod, Skeleton, X, Z, turned


@dataclass(frozen=True)
class Ruu4Geometry:
    """Lengths in metres."""

    rb: float
    """Distance of the crank axes from the middle of the base, at 0, 90, 180 and 270 deg."""
    rp: float
    """Distance of the platform's joints from its middle, at the same angles."""
    l1: float
    """Cranks."""
    l2: float
    """Rods."""

    def __post_init__(self) -> None:
        require_finite(self)
        for name in ("rb", "rp", "l1", "l2"):
            require(f"{name} > 0", getattr(self, name) > 0.0, getattr(self, name), 0.0)
        apart = abs(self.rb - self.rp)
        require("|rb - rp| <= l1 + l2 (assembly)", apart <= self.l1 + self.l2, apart, self.l1 + self.l2)


class Ruu4(CrankPlatform):
    """Joints: crank angles. Task: x, y, z of the platform's middle and its turn phi about z.

    With equal signs of all cranks symmetric postures are singular: the platform can screw up or down. In the usual
    working mode neighbours two by two have equal signs, which keeps Type 2 and the constraint margin away from 0.
    """

    kind: ClassVar[str] = "ruu4"
    geometry: Ruu4Geometry
    cuspidal = BY_A_LOOP
    has_constraint = True
    limb_count = 4

    def __init__(self, geometry: Ruu4Geometry) -> None:
        g = self.geometry = geometry
        ways = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))
        super().__init__([(g.rb * x, g.rb * y) for x, y in ways], [(g.rp * x, g.rp * y) for x, y in ways], g.l1, g.l2)
        signs = (1, -1)
        self.working_modes = tuple((a, b, c, d) for a in signs for b in signs for c in signs for d in signs)
        self.assembly_modes = tuple(sign * rank for rank in range(1, 7) for sign in signs)
        self.usual_working_mode = (1, 1, -1, -1)
        self.usual_assembly_mode = 1

    def legs(self, k: Arithmetic[N], joints: Sequence[N], pose: Sequence[N]) -> Legs[N]:
        """Rows (r_i, (PB_i x r_i).z) with r_i along the rod; sine = f1 = (u_AC x r).z, lever l1 f1.

        Limb margin min(|f1|, |f2|) of limbs.ruu_factors: |f1|, because f2 is the length of r's horizontal part.
        """
        x, y, z, phi = pose
        l1, l2 = self.crank, self.rod
        c, s = k.cos_sin(phi)
        screws, normalised_levers, reach, closure, attachments, level = [], [], [], [], [], []
        for (fx, fy), (bx, by), q in zip(self.feet, self.corners, joints, strict=True):
            ax, ay = c * bx - s * by, s * bx + c * by
            X, Y = x + ax - fx, y + ay - fy
            ux, uy = k.cos_sin(q)
            rx, ry = X - l1 * ux, Y - l1 * uy
            across = k.hypot(rx, ry)
            size = k.hypot(across, z) + TINY
            level.append((rx / (across + TINY), ry / (across + TINY)))
            rx, ry = rx / size, ry / size
            r = k.hypot(X, Y)
            screws.append((rx, ry, z / size, ax * ry - ay * rx))
            normalised_levers.append(uy * rx - ux * ry)
            reach.append(k.minimum(l2 - k.hypot(r - l1, z), k.hypot(r + l1, z) - l2))
            closure.append(size - l2)
            attachments.append((ax, ay))
        levers = tuple([l1 * sine for sine in normalised_levers])
        legs = Legs(tuple(screws), levers, tuple(normalised_levers), tuple(reach), tuple(closure))
        legs.constraint = self.constraint_margin(k, level)
        legs.limb = tuple([k.abs(sine) for sine in normalised_levers])
        legs.attachments = tuple(attachments)
        return legs

    def constraint_margin(self, k: Arithmetic[N], level: Sequence[tuple[N, N]]) -> N:
        """Second singular value of the unit couples' directions over its largest, sqrt 2: 0 iff all are parallel.

        sigma_1^2 sigma_2^2 is the sum of their squared cross products, sigma_1^2 + sigma_2^2 = 4; sigma_1^2 - sigma_2^2
        from the matrix itself, because from these two it would have half the digits where it is small.
        """
        (ax, ay), (bx, by), (cx, cy), (dx, dy) = level
        ab, ac, ad = ax * by - ay * bx, ax * cy - ay * cx, ax * dy - ay * dx
        bc, bd, cd = bx * cy - by * cx, bx * dy - by * dx, cx * dy - cy * dx
        product = ab * ab + ac * ac + ad * ad + bc * bc + bd * bd + cd * cd
        half = 0.5 * (ax * ax + bx * bx + cx * cx + dx * dx - ay * ay - by * by - cy * cy - dy * dy)
        return k.safe_sqrt(0.5 * product / (2.0 + k.hypot(half, ax * ay + bx * by + cx * cy + dx * dy)))

    def closing(self, joints: Sequence[Array], cosine: Array, sine: Array) -> Array:
        """Determinant of the three lines that the differences of the legs' equations leave for P, over size^4."""
        (x1, y1), *others = self.ends(joints, cosine, sine)
        (a1, a2, a3), (b1, b2, b3), (c1, c2, c3) = [
            (x - x1, y - y1, 0.5 * (x1 * x1 + y1 * y1 - x * x - y * y)) for x, y in others
        ]
        det: Array = a1 * (b2 * c3 - b3 * c2) - a2 * (b1 * c3 - b3 * c1) + a3 * (b1 * c2 - b2 * c1)
        return det / self.size_m**4

    def candidates(self, joints: Sequence[Array], turn: Array) -> tuple[Array, ...]:
        """x, y of the intersection of the two lines with the largest angle between them; z above and below."""
        first, *others = self.ends(joints, np.cos(turn), np.sin(turn))
        best, x, y = np.zeros_like(turn), np.zeros_like(turn), np.zeros_like(turn)
        for left_out in range(3):
            pair = [end for i, end in enumerate(others) if i != left_out]
            (px, py), D = planar_position([first, *pair], (self.rod,) * 3)
            better = np.abs(D) > np.abs(best)
            best, x, y = np.where(better, D, best), np.where(better, px, x), np.where(better, py, y)
        x, y = x / best, y / best
        height = np.sqrt(np.maximum(self.rod**2 - (x + first[0]) ** 2 - (y + first[1]) ** 2, 0.0))
        return np.tile(x, (1, 2)), np.tile(y, (1, 2)), np.concatenate([height, -height], axis=1), np.tile(turn, (1, 2))

    def constraint_floor(self, at: Posture, turn_rad: float) -> float:
        """The direction of a rod's horizontal part h changes by at most asin(turn/h), and a singular value by no more
        than the matrix does in the Frobenius norm."""
        changes = 0.0
        for rx, ry, *_ in at.screws:
            share = turn_rad / (hypot(rx, ry) + TINY)
            if not share < 1.0:
                return 0.0
            changes += asin(share) ** 2
        return max(at.constraint - sqrt(0.5 * changes), 0.0)

    def constraint_over(self, at: Posture, met: Reached) -> float:
        """The margin is the second singular value of the directions of the rods' horizontal parts, over sqrt 2."""
        return couples.least_over(met.rods) / sqrt(2.0)

    def clearance(self, at: Posture) -> float:
        """Constraints, besides: the horizontal part of a rod is at least its sine, and both are bounded in the ball of
        `turn_rate`; there the couples turn by at most rate/sine, and the margin falls by at most sqrt 2 times that."""
        _, rate = self.turn_rate(at)
        sine = 1.0 / (rate * self.rod - 1.0)
        return min(super().clearance(at), at.constraint * sine / (sqrt(2.0) * rate))

    def skeleton(self) -> Skeleton:
        """The first rod carries the platform; at 0 cranks and rods point to +x."""
        links = []
        for arm, rod in zip(self.attachments(), self._rods, strict=True):
            links += [arm, *rod.links()]
        links += self._rods[0].carry(self.platform_corners)
        pairs = list(zip(self._rods, self.platform_corners, strict=True))
        cuts = tuple(Cut(rod.name, rod.end, corner) for rod, corner in pairs[1:])
        return Skeleton(tuple(links), tuple(joint.name for joint in self.joints), cuts, self._passive)

    @property
    def _rods(self) -> list[Rod]:
        at = (self.crank, 0.0, 0.0)
        return [Rod(f"rod_{leg}", f"arm_{leg}", at, Z, X, self.rod) for leg in range(1, 5)]

    def _passive(self, joints: Floats, pose: Floats) -> dict[str, float]:
        angles: dict[str, float] = {}
        rows = self.at(joints, pose, 0, (0.0, 0.0)).screws
        for rod, q, row in zip(self._rods, joints, rows, strict=True):
            angles.update(rod.near(turned(-q, row[:3])))
        return {**angles, **self._rods[0].far(turned(-joints[0], rows[0][:3]), pose[3] - joints[0])}

    def bias(self, at: Posture, joint_rates: Sequence[float], pose_rates: Sequence[float]) -> Floats:
        """Second derivative of |C_iB_i|: the platform's, the crank's and the rod's centripetal parts."""
        vx, vy, vz, w = pose_rates
        c = []
        for q, rate, (rx, ry, rz, _), (ax, ay) in zip(at.joints, joint_rates, at.screws, at.attachments, strict=True):
            sx, sy = vx - w * ay + self.crank * rate * sin(q), vy + w * ax - self.crank * rate * cos(q)
            along = rx * sx + ry * sy + rz * vz
            centripetal = self.crank * rate * rate * (cos(q) * rx + sin(q) * ry) - w * w * (ax * rx + ay * ry)
            c.append(centripetal + (sx * sx + sy * sy + vz * vz - along * along) / self.rod)
        return tuple(c)
