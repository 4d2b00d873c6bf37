"""Planar 3-RRR with actuated base joints and triangles of any shape: the usual build of the robot of [S2].

The position of the platform is eliminated as for the 3-RPR of [S4], Listing 8, with the crank ends as base points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, cos, hypot, nan, sin
from typing import ClassVar

import numpy as np

from irsbot_kinematics.mechanism import Floats, Legs, Posture, Status, sign_of
from irsbot_kinematics.mechanisms.branched_platform import BY_A_LOOP, TINY, Point
from irsbot_kinematics.mechanisms.crank_platform import CrankPlatform
from irsbot_kinematics.mechanisms.geometry_checks import require, require_finite, require_size
from irsbot_kinematics.numerics.arithmetic import FLOATS, Arithmetic, Array, N
from irsbot_kinematics.numerics.assembly_roots import planar_closing, planar_meetings
from irsbot_kinematics.skeleton import Cut, Link, Skeleton, Z, planar_end


@dataclass(frozen=True)
class Rrr3BaseGeometry:
    """Lengths in metres, points (x, y) in metres."""

    a1: Point
    """Base joints."""
    a2: Point
    a3: Point
    b1: Point
    """Platform joints relative to the platform point."""
    b2: Point
    b3: Point
    l1: float
    """Cranks."""
    l2: float
    """Rods."""

    def __post_init__(self) -> None:
        require_finite(self)
        require_size(self, 2, "a1", "a2", "a3", "b1", "b2", "b3")
        for name in ("l1", "l2"):
            require(f"{name} > 0", getattr(self, name) > 0.0, getattr(self, name), 0.0)
        spread = max(hypot(*self.b1), hypot(*self.b2), hypot(*self.b3))
        require("max |b| > 0", spread > 0.0, spread, 0.0)


class Rrr3Base(CrankPlatform):
    """Joints: crank angles. Task: x, y of the platform point, turn phi of the platform."""

    kind: ClassVar[str] = "rrr3_base"
    geometry: Rrr3BaseGeometry
    cuspidal = BY_A_LOOP

    def __init__(self, geometry: Rrr3BaseGeometry) -> None:
        g = self.geometry = geometry
        super().__init__((g.a1, g.a2, g.a3), (g.b1, g.b2, g.b3), g.l1, g.l2)
        self.working_modes = tuple((a, b, c) for a in (1, -1) for b in (1, -1) for c in (1, -1))
        self.assembly_modes = (1, -1, 2, -2, 3, -3)
        self.usual_working_mode = (1, 1, 1)
        self.usual_assembly_mode = 1

    def legs(self, k: Arithmetic[N], joints: Sequence[N], pose: Sequence[N]) -> Legs[N]:
        """Rows (r_i, PB_i x r_i) with r_i along the rod; levers l1 sin(q_i - psi_i), psi_i the direction of the rod."""
        x, y, phi = pose
        l1, l2 = self.crank, self.rod
        c, s = k.cos_sin(phi)
        screws, normalised_levers, reach, closure, attachments = [], [], [], [], []
        for (fx, fy), (bx, by), q in zip(self.feet, self.corners, joints, strict=True):
            ax, ay = c * bx - s * by, s * bx + c * by
            X, Y = x + ax - fx, y + ay - fy
            ux, uy = k.cos_sin(q)
            rx, ry = X - l1 * ux, Y - l1 * uy
            size = k.hypot(rx, ry) + TINY
            rx, ry = rx / size, ry / size
            r = k.hypot(X, Y)
            screws.append((rx, ry, ax * ry - ay * rx))
            normalised_levers.append(uy * rx - ux * ry)
            reach.append(k.minimum(l1 + l2 - r, r - abs(l1 - l2)))
            closure.append(size - l2)
            attachments.append((ax, ay))
        legs = Legs(
            tuple(screws),
            tuple([l1 * sine for sine in normalised_levers]),
            tuple(normalised_levers),
            tuple(reach),
            tuple(closure),
        )
        legs.attachments = tuple(attachments)
        return legs

    def at(self, joints: Floats, pose: Floats, assembly: int, gaps: tuple[float, float]) -> Posture:
        """The posture of CrankPlatform, with the equations of `legs` in one function for one sample: twice as fast."""
        x, y, phi = pose
        q1, q2, q3 = joints
        l1, l2 = self.crank, self.rod
        (f1x, f1y), (f2x, f2y), (f3x, f3y) = self.feet
        (b1x, b1y), (b2x, b2y), (b3x, b3y) = self.corners
        c, s = cos(phi), sin(phi)
        a1x, a1y, a2x, a2y = c * b1x - s * b1y, s * b1x + c * b1y, c * b2x - s * b2y, s * b2x + c * b2y
        a3x, a3y = c * b3x - s * b3y, s * b3x + c * b3y
        X1, Y1, X2, Y2, X3, Y3 = (
            x + a1x - f1x,
            y + a1y - f1y,
            x + a2x - f2x,
            y + a2y - f2y,
            x + a3x - f3x,
            y + a3y - f3y,
        )
        u1x, u1y, u2x, u2y, u3x, u3y = cos(q1), sin(q1), cos(q2), sin(q2), cos(q3), sin(q3)
        d1x, d1y, d2x, d2y = X1 - l1 * u1x, Y1 - l1 * u1y, X2 - l1 * u2x, Y2 - l1 * u2y
        d3x, d3y = X3 - l1 * u3x, Y3 - l1 * u3y
        rod1, rod2, rod3 = hypot(d1x, d1y) + TINY, hypot(d2x, d2y) + TINY, hypot(d3x, d3y) + TINY
        r1x, r1y, r2x, r2y, r3x, r3y = d1x / rod1, d1y / rod1, d2x / rod2, d2y / rod2, d3x / rod3, d3y / rod3
        m1, m2, m3 = a1x * r1y - a1y * r1x, a2x * r2y - a2y * r2x, a3x * r3y - a3y * r3x
        v1x, v1y, w1 = r2y * m3 - m2 * r3y, m2 * r3x - r2x * m3, r2x * r3y - r2y * r3x
        v2x, v2y, w2 = r3y * m1 - m3 * r1y, m3 * r1x - r3x * m1, r3x * r1y - r3y * r1x
        v3x, v3y, w3 = r1y * m2 - m1 * r2y, m1 * r2x - r1x * m2, r1x * r2y - r1y * r2x
        det = r1x * v1x + r1y * v1y + m1 * w1
        size = abs(det)
        s1, s2, s3 = u1y * r1x - u1x * r1y, u2y * r2x - u2x * r2y, u3y * r3x - u3x * r3y
        off1, off2, off3 = rod1 - l2, rod2 - l2, rod3 - l2
        far1, far2, far3, outer, inner = hypot(X1, Y1), hypot(X2, Y2), hypot(X3, Y3), l1 + l2, abs(l1 - l2)
        return Posture(
            Status.SOLVED,
            joints,
            pose,
            (sign_of(s1), sign_of(s2), sign_of(s3)),
            assembly,
            ((r1x, r1y, m1), (r2x, r2y, m2), (r3x, r3y, m3)),
            (l1 * s1, l1 * s2, l1 * s3),
            (s1, s2, s3),
            (min(outer - far1, far1 - inner), min(outer - far2, far2 - inner), min(outer - far3, far3 - inner)),
            (size, gaps[1]),
            (
                FLOATS.ratio(size, hypot(v1x - w1 * a1y, v1y + w1 * a1x)),
                FLOATS.ratio(size, hypot(v2x - w2 * a2y, v2y + w2 * a2x)),
                FLOATS.ratio(size, hypot(v3x - w3 * a3y, v3y + w3 * a3x)),
            ),
            det,
            nan,
            (),
            max(abs(off1), abs(off2), abs(off3)),
            ((a1x, a1y), (a2x, a2y), (a3x, a3y)),
            (hypot(v1x, v1y), hypot(v2x, v2y), hypot(v3x, v3y), abs(w1), abs(w2), abs(w3), off1, off2, off3),
        )

    def closing(self, joints: Sequence[Array], cosine: Array, sine: Array) -> Array:
        """planar_closing with the crank ends as base points, over size^6."""
        closing: Array = planar_closing(self.ends(joints, cosine, sine), (self.rod,) * 3) / self.size_m**6
        return closing

    def candidates(self, joints: Sequence[Array], turn: Array) -> tuple[Array, ...]:
        """planar_meetings with the crank ends as base points."""
        return planar_meetings(self.ends(joints, np.cos(turn), np.sin(turn)), (self.rod,) * 3, turn)

    def skeleton(self) -> Skeleton:
        """Leg 1 carries the platform; at 0 cranks and rods point to +x."""
        links, end = [], (self.rod, 0.0, 0.0)
        for leg, arm in enumerate(self.attachments(), 1):
            links.append(arm)
            links.append(Link(f"rod_{leg}", f"elbow_{leg}", arm.name, (self.crank, 0.0, 0.0), Z, shape=(end,)))
        links += planar_end("rod_1", self.rod, Z, self.platform_corners)
        cuts = tuple(Cut(f"rod_{leg}", end, self.platform_corners[leg - 1]) for leg in (2, 3))
        return Skeleton(tuple(links), tuple(joint.name for joint in self.joints), cuts, self._passive)

    def _passive(self, joints: Floats, pose: Floats) -> dict[str, float]:
        ways = [atan2(ry, rx) for rx, ry, _ in self.at(joints, pose, 0, (0.0, 0.0)).screws]
        angles = {f"elbow_{leg}": way - q for leg, (way, q) in enumerate(zip(ways, joints, strict=True), 1)}
        return {**angles, "wrist_1": pose[2] - ways[0]}

    def bias(self, at: Posture, joint_rates: Sequence[float], pose_rates: Sequence[float]) -> Floats:
        """Second derivative of |C_iB_i|: the platform's, the crank's and the rod's centripetal parts."""
        vx, vy, w = pose_rates
        c = []
        for q, rate, (rx, ry, _), (ax, ay) in zip(at.joints, joint_rates, at.screws, at.attachments, strict=True):
            swing_x = vx - w * ay + self.crank * rate * sin(q)
            swing_y = vy + w * ax - self.crank * rate * cos(q)
            across = rx * swing_y - ry * swing_x
            centripetal = self.crank * rate * rate * (cos(q) * rx + sin(q) * ry) - w * w * (ax * rx + ay * ry)
            c.append(centripetal + across * across / self.rod)
        return tuple(c)
