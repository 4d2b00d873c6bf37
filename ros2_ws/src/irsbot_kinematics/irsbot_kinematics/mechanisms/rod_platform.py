"""Planar platforms on three rods of fixed length whose near ends the joints move: cranks, carriages, or both.

Leg i: the joint moves the near end C_i(q_i) with constant |C_i'| and |C_i''|; a rod of length l_i leads from there to
the point of the platform at b_i. What remains to be written is `near_end`, `inverse` and `direct`.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from math import cos, dist, hypot, inf, pi, sin, sqrt

from irsbot_kinematics.bounds.boxes import Rod
from irsbot_kinematics.bounds.displacement import EXACT, Errors
from irsbot_kinematics.mechanism import Coordinate, Floats, Legs, Posture
from irsbot_kinematics.mechanisms.turning_platform import Travel, TurningPlatform
from irsbot_kinematics.numerics.arithmetic import FLOATS, Arithmetic, N

Point = tuple[float, float]
Pair = tuple[N, N]

_TINY = 1e-150
"""m: keeps a quotient defined if a rod has length 0; the closure then shows it."""


class RodPlatform(TurningPlatform):
    """Joints as the subclass says. Task: x, y of the platform point P, turn phi of the platform.

    rods: m, lengths. corners: (x, y) m, where the rods hold the platform, seen from P at phi = 0.
    speeds: |C_i'|, m/rad of a crank (its length), 1 of a carriage. bends: |C_i''|, m/rad2 of a crank (its length), 0 of
    a carriage. The subclass sets `joints` and all modes.
    """

    def __init__(self, rods: Floats, corners: tuple[Point, ...], speeds: Floats, bends: Floats) -> None:
        self.rods, self.corners, self.speeds, self.bends = rods, corners, speeds, bends
        self.radius = max([hypot(*corner) for corner in corners])
        self.diameter = max([dist(a, b) for a in corners for b in corners])
        self.length_m = self.radius
        self.task = (
            Coordinate("x", "m", -inf, inf),
            Coordinate("y", "m", -inf, inf),
            Coordinate("phi", "rad", -inf, inf),
        )

    @abstractmethod
    def near_end(self, k: Arithmetic[N], leg: int, joint: N) -> tuple[Pair[N], Pair[N], Pair[N]]:
        """C_i, C_i' and C_i'' of leg 0, 1 or 2: (x, y) each."""

    def legs(self, k: Arithmetic[N], joints: Sequence[N], pose: Sequence[N]) -> Legs[N]:
        """Rows (r, PB x r), r along the rod; lever -r.C', because the rod's length grows by r.(v - C' qdot)."""
        x, y, phi = pose
        c, s = k.cos_sin(phi)
        screws, levers, normalised_levers, closure, attachments = [], [], [], [], []
        for leg, (joint, (bx, by)) in enumerate(zip(joints, self.corners, strict=True)):
            (px, py), (ux, uy), _ = self.near_end(k, leg, joint)
            ax, ay = c * bx - s * by, s * bx + c * by
            rx, ry = x + ax - px, y + ay - py
            size = k.hypot(rx, ry) + _TINY
            rx, ry = rx / size, ry / size
            lever = -(rx * ux + ry * uy)
            screws.append((rx, ry, ax * ry - ay * rx))
            levers.append(lever)
            normalised_levers.append(lever / self.speeds[leg])
            closure.append(size - self.rods[leg])
            attachments.append((ax, ay))
        _, reach = self.inverse(k, pose, self.usual_working_mode)
        legs = Legs(tuple(screws), tuple(levers), tuple(normalised_levers), reach, tuple(closure))
        legs.attachments = tuple(attachments)
        return legs

    def bias(self, at: Posture, joint_rates: Sequence[float], pose_rates: Sequence[float]) -> Floats:
        """Second derivative of |C_iB_i| without accelerations: relative motion across the rod, and the acceleration of
        both ends."""
        vx, vy, w = pose_rates
        found = []
        for leg, (rate, (rx, ry, _), (ax, ay)) in enumerate(zip(joint_rates, at.screws, at.attachments, strict=True)):
            _, (ux, uy), (kx, ky) = self.near_end(FLOATS, leg, at.joints[leg])
            across = rx * (vy + w * ax - rate * uy) - ry * (vx - w * ay - rate * ux)
            pull = w * w * (ax * rx + ay * ry) + rate * rate * (kx * rx + ky * ry)
            found.append(across * across / self.rods[leg] - pull)
        return tuple(found)

    def travel_of(self, at: Posture, travel: Sequence[float], slack_m: float) -> Travel:
        """A near end moves by at most |lever| t along its rod, and by |C''| t^2/2 on top of it."""
        ends, length, _ = self.geometry_errors(slack_m) if slack_m else EXACT
        drives = [
            abs(lever) * t + 0.5 * bend * t * t + ends + length
            for lever, bend, t in zip(at.levers, self.bends, travel, strict=True)
        ]
        path = max([speed * t for speed, t in zip(self.speeds, travel, strict=True)])
        return Travel(drives, path + ends, min(self.rods) - length)

    def geometry_errors(self, slack_m: float) -> Errors:
        """Both coordinates at the base and on the platform, and the length of a crank."""
        place = sqrt(2.0) * slack_m
        return Errors(2.0 * place + slack_m, slack_m, place)

    def rods_of(self, at: Posture, travel: Sequence[float], slack_m: float) -> list[Rod]:
        """The near ends to first order, and C'' in addition."""
        ends, length, _ = self.geometry_errors(slack_m) if slack_m else EXACT
        found = []
        for leg, h in enumerate(travel):
            _, (ux, uy), _ = self.near_end(FLOATS, leg, at.joints[leg])
            aside = 0.5 * self.bends[leg] * h * h + ends
            found.append(Rod(self.rods[leg], (h * ux, h * uy), aside, 0.0, length))
        return found

    def sine_floors(self, at: Posture, travel: Sequence[float], turn_rad: float, slack_m: float = 0.0) -> Floats:
        """The sine is that of the rod's angle with the normal of C'. The rod turns by at most turn_rad, C' by
        |C''|/|C'| t, and a rail whose ends are off is turned as well."""
        found = []
        for sine, speed, bend, axis, t in zip(at.type1, self.speeds, self.bends, self.joints, travel, strict=True):
            tilt = 0.0 if axis.is_angle else 2.0 * sqrt(2.0) * slack_m / (axis.upper - axis.lower)
            turn = turn_rad + bend / speed * t + 0.5 * pi * tilt
            found.append(_less(sine, turn))
        return tuple(found)

    def turn_rate(self, at: Posture) -> tuple[float, float]:
        """A rod end that moves turns its rod by at most 1/(l s) and C' by |C''|/(|C'|^2 s), s the sine. So s^2 falls by
        at most twice the sum of both without s, and is above half of what it was up to the ball."""
        falls = [1.0 / l + bend / speed**2 for l, bend, speed in zip(self.rods, self.bends, self.speeds, strict=True)]
        ball = min([0.25 * sine * sine / fall for sine, fall in zip(at.type1, falls, strict=True)])
        if not ball > 0.0:
            return 0.0, inf
        return ball, max([sqrt(2.0) / (l * sine) for l, sine in zip(self.rods, at.type1, strict=True)])


def _less(sine: float, turn_rad: float) -> float:
    """Smallest |sin| after a turn: |sin(angle - turn)| >= sine cos(turn) - sqrt(1 - sine^2) sin(turn)."""
    if not turn_rad < 0.5 * pi:
        return 0.0
    return max(sine * cos(turn_rad) - sqrt(max(1.0 - sine * sine, 0.0)) * sin(turn_rad), 0.0)
