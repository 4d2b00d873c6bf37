"""Kinematics of two cranks and two rods in the x-z plane: the five-bar, and the loop to which the IRSBot-2 is
equivalent.

Frame: x right, z up; a planar angle t means the direction u(t) = (cos t, -sin t), a positive rotation about +y, so
that sin q > 0 points down. Leg I starts at (-half_base, -drop), leg II at (+half_base, -drop). Elbow C_k, rod
direction r_k = u(psi_k) from C_k to the platform point P.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from math import cos, inf, nan, sin, sqrt

from irsbot_kinematics.mechanism import (
    Coordinate,
    Cuspidal,
    Floats,
    Legs,
    Locus,
    Mechanism,
    Posture,
    Signs,
    Status,
    sign_of,
)
from irsbot_kinematics.mechanisms.planar_loop import Loop, loci
from irsbot_kinematics.numerics.arithmetic import FLOATS, Arithmetic, N
from irsbot_kinematics.numerics.tolerances import CLOSURE_TOL_M, COINCIDENT_TOL_M, FARTHEST

SOLVED = Status.SOLVED


class PlanarKinematics(Mechanism):
    """Kinematics, Type 1 and Type 2 measures of the planar loop."""

    loop: Loop
    cuspidal = Cuspidal(
        "no", "two assembly modes, mirror images with opposite signs of det A at the same joints: the sign is a label"
    )

    def __init__(self, loop: Loop, joint_names: tuple[str, str] = ("joint_1", "joint_2")) -> None:
        self.loop = loop
        self.joints = tuple(Coordinate(name, "rad", -inf, inf) for name in joint_names)
        self.task = (Coordinate("x", "m", -inf, inf), Coordinate("z", "m", -inf, inf))
        self.length_m = loop.rod
        self.working_modes = ((1, -1), (-1, 1), (1, 1), (-1, -1))
        self.assembly_modes = (-1, 1)
        self.usual_working_mode = (1, -1)
        self.usual_assembly_mode = -1
        self._annulus = abs(loop.crank - loop.rod), loop.crank + loop.rod

    @abstractmethod
    def constraint_parts(self, k: Arithmetic[N], c1: N, mz1: N, c2: N, mz2: N) -> tuple[N, ...]:
        """Two numbers whose minimum is the constraint margin, from (cos psi, -sin psi) of both rods. Empty where the
        legs constrain nothing but the plane."""

    # --- equations, floats or arrays -------------------------------------------------------------------------

    def inverse(self, k: Arithmetic[N], pose: Sequence[N], mode: Signs) -> tuple[tuple[N, N], tuple[N, N]]:
        """IRSBot-2 sheet section 3: area by Heron's factors, angles by atan2, no acos and no division."""
        q1, reach1 = self._crank(k, pose[0] + self.loop.half_base, pose[1] + self.loop.drop, mode[0])
        q2, reach2 = self._crank(k, pose[0] - self.loop.half_base, pose[1] + self.loop.drop, mode[1])
        return (q1, q2), (reach1, reach2)

    def _crank(self, k: Arithmetic[N], X: N, Z: N, w: int) -> tuple[N, N]:
        l1, l2 = self.loop.crank, self.loop.rod
        r = k.hypot(X, Z)
        area = k.safe_sqrt((l1 + l2 + r) * (l1 + l2 - r) * (r + l1 - l2) * (r - l1 + l2))
        # Beyond the boundary area is 0; the numerator's sign then folds or stretches the crank towards the pose.
        q = k.atan2(-Z, X) + w * k.atan2(area, r * r + (l1 - l2) * (l1 + l2))
        return k.wrap(q), k.minimum(l1 + l2 - r, r - abs(l1 - l2))

    def direct(self, k: Arithmetic[N], joints: Sequence[N], assembly: int) -> tuple[tuple[N, N], tuple[N, N]]:
        """IRSBot-2 sheet section 4. Gaps: [0] 2 rod - d (rods in line), [1] d (elbows coincide)."""
        b0, e, l1, l2 = self.loop
        q1, q2 = joints
        (cos1, sin1), (cos2, sin2) = k.cos_sin(q1), k.cos_sin(q2)
        c1x, c1z, c2x, c2z = l1 * cos1 - b0, -e - l1 * sin1, l1 * cos2 + b0, -e - l1 * sin2
        vx, vz = c2x - c1x, c2z - c1z
        d = k.hypot(vx, vz)
        half = 0.5 * d
        height = assembly * k.safe_sqrt((l2 - half) * (l2 + half))
        per_d = height / k.maximum(d, 0.0 * d + COINCIDENT_TOL_M)
        return (0.5 * (c1x + c2x) - per_d * vz, 0.5 * (c1z + c2z) + per_d * vx), (2.0 * l2 - d, d)

    def legs(self, k: Arithmetic[N], joints: Sequence[N], pose: Sequence[N]) -> Legs[N]:
        """IRSBot-2 sheet sections 5 and 6: rows r_k, levers l1 sin(q_k - psi_k)."""
        b0, e, l1, l2 = self.loop
        x, z = pose
        screws, normalised_levers, reach, closure = [], [], [], []
        far: list[N] = []
        for q, foot in zip(joints, (-b0, b0), strict=True):
            cq, sq = k.cos_sin(q)
            X, Z = x - foot, z + e
            rx, rz = X - l1 * cq, Z + l1 * sq
            error = k.hypot(rx, rz) - l2
            rx, rz = rx / l2, rz / l2  # (cos psi, -sin psi)
            screws.append((rx, rz))
            normalised_levers.append(sq * rx + cq * rz)  # sin(q - psi)
            r = k.hypot(X, Z)
            far.append(r)
            reach.append(k.minimum(l1 + l2 - r, r - abs(l1 - l2)))
            closure.append(error)
        levers = tuple([l1 * s for s in normalised_levers])
        constrained: tuple[N, ...] = self.constraint_parts(k, *screws[0], *screws[1])
        constraint = k.minimum(constrained[0], constrained[1]) if constrained else None
        parts = constrained + tuple(far)
        return Legs(
            tuple(screws), levers, tuple(normalised_levers), tuple(reach), tuple(closure), constraint, (), parts
        )

    def posture(self, joints: Sequence[float], assembly: int) -> Posture:
        """The equations of `direct` and `legs` in one function for one sample: three times as fast."""
        q1, q2 = joints
        if not abs(q1) + abs(q2) <= FARTHEST:
            return super().posture(joints, assembly)
        b0, e, l1, l2 = self.loop
        k1, s1, k2, s2 = cos(q1), sin(q1), cos(q2), sin(q2)
        c1x, c1z, c2x, c2z = l1 * k1 - b0, -e - l1 * s1, l1 * k2 + b0, -e - l1 * s2
        vx, vz = c2x - c1x, c2z - c1z
        d = sqrt(vx * vx + vz * vz)
        slack = 2.0 * l2 - d
        if not (slack > 0.0 and d > COINCIDENT_TOL_M):
            return super().posture(joints, assembly)
        half = 0.5 * d
        height = assembly * sqrt((l2 - half) * (l2 + half)) / d
        x, z = 0.5 * (c1x + c2x) - height * vz, 0.5 * (c1z + c2z) + height * vx
        r1x, r1z, r2x, r2z = x - c1x, z - c1z, x - c2x, z - c2z
        off1, off2 = abs(sqrt(r1x * r1x + r1z * r1z) - l2), abs(sqrt(r2x * r2x + r2z * r2z) - l2)
        if not (off1 <= CLOSURE_TOL_M and off2 <= CLOSURE_TOL_M):
            return super().posture(joints, assembly)
        r1x, r1z, r2x, r2z = r1x / l2, r1z / l2, r2x / l2, r2z / l2
        sine1, sine2 = s1 * r1x + k1 * r1z, s2 * r2x + k2 * r2z
        down, left, right = (z + e) * (z + e), x + b0, x - b0
        far1, far2 = sqrt(left * left + down), sqrt(right * right + down)
        inner, outer = self._annulus
        out1, out2, in1, in2 = outer - far1, outer - far2, far1 - inner, far2 - inner
        det = r1x * r2z - r1z * r2x
        cosine = abs(det)
        if cosine > 1.0:
            cosine = 1.0
        constrained = self.constraint_parts(FLOATS, r1x, r1z, r2x, r2z)
        return Posture(
            SOLVED,
            (q1, q2),
            (x, z),
            (sign_of(sine1), sign_of(sine2)),
            assembly,
            ((r1x, r1z), (r2x, r2z)),
            (l1 * sine1, l1 * sine2),
            (sine1, sine2),
            (out1 if out1 < in1 else in1, out2 if out2 < in2 else in2),
            (slack, d),
            (cosine, cosine),
            det,
            FLOATS.minimum(constrained[0], constrained[1]) if constrained else nan,
            (),
            off1 if off1 > off2 else off2,
            (),
            (*constrained, far1, far2),
        )

    def loci(self, mode: Signs) -> tuple[Locus, ...]:
        return loci(self.loop, mode)

    def workspace_ranges(self) -> tuple[tuple[float, float], tuple[float, float]]:
        far = self.loop.crank + self.loop.rod
        side = far - abs(self.loop.half_base)
        return (-side, side), (-far - self.loop.drop, far - self.loop.drop)

    def symmetric_extent(self) -> tuple[float, float]:
        far = self.loop.crank + self.loop.rod
        return far, -far - abs(self.loop.drop)

    def rod_angles(self, at: Posture) -> Floats:
        """psi_k, rad: direction of each rod from its elbow to the platform point."""
        return tuple([FLOATS.atan2(-rz, rx) for rx, rz in at.screws])

    def bias(self, at: Posture, joint_rates: Sequence[float], pose_rates: Sequence[float]) -> Floats:
        """IRSBot-2 sheet section 5: c_k = l1 qdot^2 cos(q - psi) + l2 psidot^2."""
        l1, l2 = self.loop.crank, self.loop.rod
        c = []
        for q, rate, (rx, rz) in zip(at.joints, joint_rates, at.screws, strict=True):
            cq, sq = cos(q), sin(q)
            turn = rz * (pose_rates[0] + l1 * rate * sq) - rx * (pose_rates[1] + l1 * rate * cq)
            c.append(l1 * rate * rate * (cq * rx - sq * rz) + turn * turn / l2)
        return tuple(c)
