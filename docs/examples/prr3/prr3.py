"""A planar 3-PRR: three carriages on rails, three rods, a platform that moves and turns in the plane.

Rods 1 and 2 hold the platform point P, rod 3 holds it at B, at distance b from P in the direction phi. So P is where
two circles about the carriages meet, and B where two more do: the direct kinematics is closed form.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, inf, pi, sin, sqrt
from typing import ClassVar

from irsbot_kinematics.own_mechanism import (
    EXACT,
    Arithmetic,
    Coordinate,
    Errors,
    Floats,
    InvalidGeometry,
    Legs,
    N,
    Posture,
    Rod,
    Signs,
    Travel,
    TurningPlatform,
)

TINY = 1e-150  # m: keeps a quotient defined where two centres coincide; the clearances then say so


@dataclass(frozen=True)
class Prr3Geometry:
    """Lengths in metres, angles in radians. Rail i starts at o_i, where q_i = 0, and runs in the direction a_i."""

    o1: tuple[float, float]
    o2: tuple[float, float]
    o3: tuple[float, float]
    a1: float
    a2: float
    a3: float
    l1: float
    l2: float
    l3: float
    b: float
    travel: tuple[float, float]  # open range of every carriage

    def __post_init__(self) -> None:
        for name in ("l1", "l2", "l3", "b"):
            if not getattr(self, name) > 0.0:
                raise InvalidGeometry(f"{name} > 0 is broken: {name} = {getattr(self, name)}")


class Prr3(TurningPlatform):
    """Joints: carriages q_i. Task: x, y of P and the turn phi of the platform.

    Working mode: signs of q_i - (B_i - o_i).u_i, the carriage ahead of or behind its rod's end. Assembly mode: its sign
    is the side of C_1C_2 on which P lies; 1 and 2 tell the sides of PC_3 on which B lies.
    """

    kind: ClassVar[str] = "prr3"
    geometry: Prr3Geometry

    def __init__(self, geometry: Prr3Geometry) -> None:
        g = self.geometry = geometry
        self.origins = (g.o1, g.o2, g.o3)
        self.ways = tuple((cos(a), sin(a)) for a in (g.a1, g.a2, g.a3))
        self.rods = (g.l1, g.l2, g.l3)
        self.radius = self.diameter = self.length_m = g.b
        self.joints = tuple(Coordinate(f"carriage_{i}", "m", *g.travel) for i in (1, 2, 3))
        self.task = (
            Coordinate("x", "m", -inf, inf),
            Coordinate("y", "m", -inf, inf),
            Coordinate("phi", "rad", -inf, inf),
        )
        self.working_modes = tuple((i, j, k) for i in (1, -1) for j in (1, -1) for k in (1, -1))
        self.assembly_modes = (1, -1, 2, -2)
        self.usual_working_mode, self.usual_assembly_mode = (1, 1, 1), 1

    # --- equations, floats or arrays: no `if` on values, functions from k ---------------------------------------

    def inverse(self, k: Arithmetic[N], pose: Sequence[N], mode: Signs) -> tuple[tuple[N, ...], tuple[N, ...]]:
        """q = (B - o).u + w sqrt(l^2 - h^2), h the distance of B from the rail; reach l - h."""
        x, y, phi = pose
        b, (c, s) = self.geometry.b, k.cos_sin(phi)
        ends = ((x, y), (x, y), (x + b * c, y + b * s))
        joints, reach = [], []
        for (bx, by), (ox, oy), (ux, uy), l, w in zip(ends, self.origins, self.ways, self.rods, mode, strict=True):
            dx, dy = bx - ox, by - oy
            h = k.abs(ux * dy - uy * dx)
            joints.append(dx * ux + dy * uy + w * k.safe_sqrt((l - h) * (l + h)))
            reach.append(l - h)
        return tuple(joints), tuple(reach)

    def direct(self, k: Arithmetic[N], joints: Sequence[N], assembly: int) -> tuple[tuple[N, ...], tuple[N, N]]:
        """Gaps: [0] by how much the circles overlap, [1] the smaller distance of their centres."""
        l1, l2, l3 = self.rods
        b = self.geometry.b
        c1, c2, c3 = self._carriages(joints)
        (x, y), slack, apart = _meet(k, c1, l1, c2, l2, 1 if assembly > 0 else -1)
        (bx, by), slack_b, apart_b = _meet(k, (x, y), b, c3, l3, 1 if abs(assembly) == 1 else -1)
        return (x, y, k.atan2(by - y, bx - x)), (k.minimum(slack, slack_b), k.minimum(apart, apart_b))

    def _carriages(self, joints: Sequence[N]) -> list[tuple[N, N]]:
        rails = zip(joints, self.origins, self.ways, strict=True)
        return [(ox + q * ux, oy + q * uy) for q, (ox, oy), (ux, uy) in rails]

    def legs(self, k: Arithmetic[N], joints: Sequence[N], pose: Sequence[N]) -> Legs[N]:
        """Rows (r, PB x r), r along the rod; lever and sine -r.u, because the rod's length grows by r.(v - qdot u)."""
        x, y, phi = pose
        b, (c, s) = self.geometry.b, k.cos_sin(phi)
        zero = 0.0 * x
        attachments = ((zero, zero), (zero, zero), (b * c, b * s))
        screws, normalised_levers, reach, closure = [], [], [], []
        for (ax, ay), (cx, cy), (ux, uy), l in zip(
            attachments, self._carriages(joints), self.ways, self.rods, strict=True
        ):
            rx, ry = x + ax - cx, y + ay - cy
            size = k.hypot(rx, ry)
            rx, ry = rx / size, ry / size
            screws.append((rx, ry, ax * ry - ay * rx))
            normalised_levers.append(-(rx * ux + ry * uy))
            reach.append(l - l * k.abs(ux * ry - uy * rx))
            closure.append(size - l)
        legs = Legs(tuple(screws), tuple(normalised_levers), tuple(normalised_levers), tuple(reach), tuple(closure))
        legs.attachments = attachments
        return legs

    # --- one sample ------------------------------------------------------------------------------------------------

    def bias(self, at: Posture, joint_rates: Sequence[float], pose_rates: Sequence[float]) -> Floats:
        """Second derivative of |C_iB_i| without accelerations: what moves across the rod, and the arm's pull."""
        vx, vy, w = pose_rates
        found = []
        for rate, (rx, ry, _), (ax, ay), (ux, uy), l in zip(
            joint_rates, at.screws, at.attachments, self.ways, self.rods, strict=True
        ):
            across = rx * (vy + w * ax - rate * uy) - ry * (vx - w * ay - rate * ux)
            found.append(across * across / l - w * w * (ax * rx + ay * ry))
        return tuple(found)

    def travel_of(self, at: Posture, travel: Sequence[float], slack_m: float) -> Travel:
        """A carriage that moves by t moves by |lever| t along its rod."""
        ends, length, _ = self.geometry_errors(slack_m) if slack_m else EXACT
        drives = [abs(lever) * t + ends + length for lever, t in zip(at.levers, travel, strict=True)]
        return Travel(drives, max(travel) + ends, min(self.rods))

    def geometry_errors(self, slack_m: float) -> Errors:
        """Both coordinates of the rail while the carriage is between its ends, and of the rod on the platform."""
        place = sqrt(2.0) * slack_m
        return Errors(2.0 * place, slack_m, place)

    def rods_of(self, at: Posture, travel: Sequence[float], slack_m: float) -> list[Rod]:
        """The carriages take the near ends along the rails."""
        joints = zip(self.rods, self.ways, travel, strict=True)
        ends, length, _ = self.geometry_errors(slack_m) if slack_m else EXACT
        return [Rod(l, (h * ux, h * uy), ends, 0.0, length) for l, (ux, uy), h in joints]

    def sine_floors(self, at: Posture, travel: Sequence[float], turn_rad: float, slack_m: float = 0.0) -> Floats:
        """The sine is that of the rod's angle with the normal of its rail. The rod turns by at most turn_rad, and a
        rail whose ends are off is turned as well."""
        lower, upper = self.geometry.travel
        tilt = 2.0 * sqrt(2.0) * slack_m / (upper - lower)  # a chord; pi/2 of it is at least its angle
        return tuple([_less(sine, turn_rad + 0.5 * pi * tilt) for sine in at.type1])

    def turn_rate(self, at: Posture) -> tuple[float, float]:
        """l sin of the angle between rod and rail is the distance of B from the rail: rate 1/(l sine) in a ball of half
        the reach, with the smallest sine there."""
        ball = 0.5 * min(at.reach)
        farthest = [(l - reach + ball) / l for l, reach in zip(self.rods, at.reach, strict=True)]
        if not (ball > 0.0 and max(farthest) < 1.0):
            return 0.0, inf
        return ball, max([1.0 / (l * sqrt(1.0 - f * f)) for l, f in zip(self.rods, farthest, strict=True)])


def _meet(
    k: Arithmetic[N], a: tuple[N, N], ra: float, b: tuple[N, N], rb: float, side: int
) -> tuple[tuple[N, N], N, N]:
    """Where circles about a and b meet, on one side of ab; by how much they overlap; the distance of the centres."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    d = k.hypot(dx, dy)
    ux, uy = dx / (d + TINY), dy / (d + TINY)
    along = 0.5 * ((ra - rb) * (ra + rb) / (d + TINY) + d)
    across = side * k.safe_sqrt((ra - along) * (ra + along))
    overlap = k.minimum(ra + rb - d, d - abs(ra - rb)) if ra != rb else ra + rb - d
    return (a[0] + along * ux - across * uy, a[1] + along * uy + across * ux), overlap, d


def _less(sine: float, turn_rad: float) -> float:
    """Smallest |sin| after a turn: |sin(angle - turn)| >= sine cos(turn) - sqrt(1 - sine^2) sin(turn)."""
    if not turn_rad < 1.0:
        return 0.0
    return max(sine * cos(turn_rad) - sqrt(max(1.0 - sine * sine, 0.0)) * sin(turn_rad), 0.0)
