"""Turning platforms on cranks: leg i is a crank on the base at A_i and a rod from its end C_i to the platform at B_i.

Planar with three legs or in space with four; cranks and platform turn about z. All assemblies and their branches:
`branched_platform`.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, hypot, inf, sin, sqrt

from irsbot_kinematics.bounds.boxes import Reached, Rod
from irsbot_kinematics.bounds.cranks import Crank, levers_over
from irsbot_kinematics.bounds.displacement import EXACT, Errors, lowered
from irsbot_kinematics.mechanism import Coordinate, Floats, Posture, Signs
from irsbot_kinematics.mechanisms.branched_platform import BranchedPlatform, Point
from irsbot_kinematics.mechanisms.turning_platform import Travel
from irsbot_kinematics.numerics.arithmetic import Arithmetic, N
from irsbot_kinematics.skeleton import BASE, Link, Z


class CrankPlatform(BranchedPlatform):
    """Kinematics of cranks and rods; the legs themselves are in the subclasses."""

    feet: tuple[Point, ...]
    """A_i, m."""
    crank: float
    rod: float

    def __init__(self, feet: Sequence[Point], corners: Sequence[Point], crank: float, rod: float) -> None:
        self.feet, self.crank, self.rod = tuple(feet), crank, rod
        joints = [Coordinate(f"crank_{i + 1}", "rad", -inf, inf) for i in range(len(self.feet))]
        size = max(hypot(*foot) for foot in feet) + crank + rod + max(hypot(*corner) for corner in corners)
        super().__init__(corners, joints, size)

    # --- description -----------------------------------------------------------------------------------------------

    def attachments(self) -> list[Link]:
        """The cranks as links."""
        return [
            Link(f"arm_{leg}", joint.name, BASE, (x, y, 0.0), Z, shape=((self.crank, 0.0, 0.0),))
            for leg, (joint, (x, y)) in enumerate(zip(self.joints, self.feet, strict=True), 1)
        ]

    # --- cranks ----------------------------------------------------------------------------------------------------

    def inverse(self, k: Arithmetic[N], pose: Sequence[N], mode: Signs) -> tuple[tuple[N, ...], tuple[N, ...]]:
        """q = azimuth of A_iB_i + w atan2(area, ...): the circle of C_i about A_i against the sphere about B_i.

        The circle's farthest and nearest points are far and near away: 16 area^2 = (far^2 - rod^2)(rod^2 - near^2).
        """
        x, y, phi = pose[0], pose[1], pose[-1]
        z = pose[2] if len(pose) == 4 else 0.0 * x
        (c, s), joints, reach = k.cos_sin(phi), [], []
        for (fx, fy), (bx, by), w in zip(self.feet, self.corners, mode, strict=True):
            X, Y = x + c * bx - s * by - fx, y + s * bx + c * by - fy
            r = k.hypot(X, Y)
            near, far = k.hypot(r - self.crank, z), k.hypot(r + self.crank, z)
            area = k.safe_sqrt((far - self.rod) * (far + self.rod) * (self.rod - near) * (self.rod + near))
            along = r * r + z * z + (self.crank - self.rod) * (self.crank + self.rod)
            joints.append(k.wrap(k.atan2(Y, X) + w * k.atan2(area, along)))
            reach.append(k.minimum(self.rod - near, far - self.rod))
        return tuple(joints), tuple(reach)

    def rods(self, k: Arithmetic[N], joints: Sequence[N]) -> Sequence[tuple[N, N, float]]:
        found = []
        for (fx, fy), q in zip(self.feet, joints, strict=True):
            ux, uy = k.cos_sin(q)
            found.append((fx + self.crank * ux, fy + self.crank * uy, self.rod))
        return found

    # --- guarantees, one sample --------------------------------------------------------------------------------

    def travel_of(self, at: Posture, travel: Sequence[float], slack_m: float) -> Travel:
        """C_i moves by at most crank travel_i; along the rod by |B_ii| travel_i + crank travel_i^2/2."""
        half = 0.5 * self.crank
        ends, length, _ = self.geometry_errors(slack_m) if slack_m else EXACT
        off = ends + length
        drives = [(abs(lever) + half * t) * t + off for lever, t in zip(at.levers, travel, strict=True)]
        return Travel(drives, self.crank * max(travel) + ends, self.rod)

    def geometry_errors(self, slack_m: float) -> Errors:
        """Level, the places of both joints and the crank's length, which moves its end along the crank; along z both
        places, where there is a z."""
        place = sqrt(2.0) * slack_m
        level = 2.0 * place + slack_m
        return Errors(hypot(level, 2.0 * slack_m) if len(self.feet) == 4 else level, slack_m, place)

    def rods_of(self, at: Posture, travel: Sequence[float], slack_m: float) -> list[Rod]:
        """The near ends run on the circles of the cranks."""
        l1, level, rods = self.crank, (0.0,) * (len(at.pose) - 3), []
        ends, length, _ = self.geometry_errors(slack_m) if slack_m else EXACT
        for q, h in zip(at.joints, travel, strict=True):
            x, y = l1 * h * cos(q), l1 * h * sin(q)
            near, curve = (-y, x, *level), (-0.5 * h * x, -0.5 * h * y, *level)
            third = (h * h * y / 6.0, -h * h * x / 6.0, *level)
            rods.append(Rod(self.rod, near, l1 * h * h * h * h / 24.0 + ends, 0.0, length, curve, 0.0, third))
        return rods

    def sines_over(self, at: Posture, travel: Sequence[float], met: Reached, slack_m: float) -> Floats:
        """The sine is the cross product of the directions of crank and rod, seen from above."""
        cranks = [
            Crank(cos(q), sin(q), h, -1.0 if sine < 0.0 else 1.0)
            for q, h, sine in zip(at.joints, travel, at.normalised_levers, strict=True)
        ]
        levers = levers_over(met.rods, cranks)
        return tuple([x / longest if x > 0.0 else 0.0 for x, longest in zip(levers, met.longest, strict=True)])

    def sine_floors(self, at: Posture, travel: Sequence[float], turn_rad: float, slack_m: float = 0.0) -> Floats:
        """The sine is |elevation| of the rod over the upright plane through its crank: both turn by bounded angles."""
        return tuple([lowered(sine, turn_rad + t, 0.0) for sine, t in zip(at.type1, travel, strict=True)])

    def turn_rate(self, at: Posture) -> tuple[float, float]:
        """A rod end that moves by v drags the crank's end by at most v/sine: the rod turns by at most
        (1 + 1/sine) v/rod. sine^2 = (far^2 - rod^2)(rod^2 - near^2)/(2 crank rod)^2; far, near change by at most v."""
        ball = 0.5 * min(at.reach)
        if not ball > 0.0:
            return 0.0, inf
        l1, l2 = self.crank, self.rod
        z = at.pose[2] if len(at.pose) == 4 else 0.0
        least = inf
        for (ax, ay), (fx, fy) in zip(at.attachments, self.feet, strict=True):
            r = hypot(at.pose[0] + ax - fx, at.pose[1] + ay - fy)
            near, far = hypot(r - l1, z) + ball, hypot(r + l1, z) - ball
            least = min(least, (far - l2) * (far + l2) * (l2 - near) * (l2 + near))
        return (ball, (1.0 + 2.0 * l1 * l2 / sqrt(least)) / l2) if least > 0.0 else (0.0, inf)
