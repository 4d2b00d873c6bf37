"""Planar platforms on slides: leg i is a strut of actuated length or a rod on a carriage that runs along a rail.

A strut joins the base at o_i to the platform at B_i, |o_iB_i| = q_i. A carriage is at C_i = o_i + q_i u_i, and a rod of
length L_i joins it to B_i. Source: [S4], section 2.4 and Listing 8. All assemblies and their branches:
`branched_platform`.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import asin, atan2, hypot, inf, sqrt
from typing import Any, NamedTuple

import numpy as np

from irsbot_kinematics.bounds.boxes import Reached, Rod
from irsbot_kinematics.bounds.displacement import CHORD, Errors, lowered
from irsbot_kinematics.bounds.quadratics import besides
from irsbot_kinematics.mechanism import CertifiedBounds, Coordinate, Floats, Legs, Posture, Signs
from irsbot_kinematics.mechanisms.branched_platform import TINY, BranchedPlatform, Point
from irsbot_kinematics.mechanisms.geometry_checks import require, require_finite, require_size
from irsbot_kinematics.mechanisms.turning_platform import Travel
from irsbot_kinematics.numerics.arithmetic import ARRAYS, FLOATS, Arithmetic, Array, N
from irsbot_kinematics.numerics.assembly_roots import planar_closing, planar_meetings
from irsbot_kinematics.skeleton import BASE, HERE, Cut, Link, Skeleton, Vector, X, Z, planar_end

FAR = 1e5
"""1: slides farther away than this, over the size of the robot, leave no digits for the platform."""


class Rail(NamedTuple):
    """A straight rail and the rod of its carriage."""

    way: Point
    """Unit vector along which the carriage moves."""
    rod: float
    """m."""


class SlidingPlatform(BranchedPlatform):
    """Joints: lengths of struts and carriages, m. Task: x, y of the platform point P, turn phi of the platform.

    Working mode: the sign of B_ii; of a carriage whether it is ahead of its rod's end (+1) or behind it, of a strut
    always -1. A strut has no Type 1 singularity; without length it could swing freely and would push in no direction:
    its limb margin is its length over the longest one.
    """

    def __init__(
        self, feet: Sequence[Point], rails: Sequence[Rail | None], corners: Sequence[Point], limits: Sequence[Point]
    ) -> None:
        """feet: o_i, m; rails: one per leg, None for a strut; corners: B_i seen from P, m; limits: open range of each
        joint, m."""
        self.feet, self.rails = tuple(feet), tuple(rails)
        self.limb_count = sum(rail is None for rail in rails)
        names = ["strut" if rail is None else "slide" for rail in rails]
        joints = [Coordinate(f"{n}_{i}", "m", *ends) for i, (n, ends) in enumerate(zip(names, limits, strict=True), 1)]
        slides, rods = [abs(end) for ends in limits for end in ends], [rail.rod for rail in rails if rail]
        places = max(hypot(*foot) for foot in feet) + max(hypot(*corner) for corner in corners)
        super().__init__(corners, joints, places + max(slides) + max(rods, default=0.0))
        signs = [(-1,) if rail is None else (1, -1) for rail in rails]
        self.working_modes = tuple((a, b, c) for a in signs[0] for b in signs[1] for c in signs[2])
        self.assembly_modes = (1, -1, 2, -2, 3, -3)
        self.usual_working_mode = self.working_modes[0]
        self.usual_assembly_mode = 1

    # --- equations, floats or arrays ---------------------------------------------------------------------------------

    def inverse(self, k: Arithmetic[N], pose: Sequence[N], mode: Signs) -> tuple[tuple[N, ...], tuple[N, ...]]:
        """Strut: its length; reach: to the nearer end of its stroke. Carriage: q = (B - o).u + w sqrt(L^2 - h^2), h the
        distance of B from the rail; reach L - h."""
        x, y, phi = pose
        (c, s), joints, reach = k.cos_sin(phi), [], []
        legs = zip(self.feet, self.corners, self.rails, self.joints, mode, strict=True)
        for (ox, oy), (bx, by), rail, joint, w in legs:
            X, Y = x + c * bx - s * by - ox, y + s * bx + c * by - oy
            if rail is None:
                length, zero = k.hypot(X, Y), 0.0 * X
                joints.append(k.minimum(k.maximum(length, joint.lower + zero), joint.upper + zero))
                reach.append(k.minimum(length - joint.lower, joint.upper - length))
            else:
                (ux, uy), rod = rail
                h = k.abs(ux * Y - uy * X)
                joints.append(X * ux + Y * uy + w * k.safe_sqrt((rod - h) * (rod + h)))
                reach.append(rod - h)
        return tuple(joints), tuple(reach)

    def rods(self, k: Arithmetic[N], joints: Sequence[N]) -> Sequence[tuple[N, N, N]]:
        return [
            (ox + 0.0 * q, oy + 0.0 * q, q)
            if rail is None
            else (ox + q * rail.way[0], oy + q * rail.way[1], rail.rod + 0.0 * q)
            for (ox, oy), rail, q in zip(self.feet, self.rails, joints, strict=True)
        ]

    def legs(self, k: Arithmetic[N], joints: Sequence[N], pose: Sequence[N]) -> Legs[N]:
        """Rows (r_i, PB_i x r_i) with r_i along strut or rod; levers and sines -1 or -r_i.u_i."""
        x, y, phi = pose
        c, s = k.cos_sin(phi)
        screws, normalised_levers, reach, closure, attachments, limb = [], [], [], [], [], []
        for (cx, cy, length), (bx, by), rail, joint in zip(
            self.rods(k, joints), self.corners, self.rails, self.joints, strict=True
        ):
            ax, ay = c * bx - s * by, s * bx + c * by
            rx, ry = x + ax - cx, y + ay - cy
            size = k.hypot(rx, ry) + TINY
            rx, ry = rx / size, ry / size
            screws.append((rx, ry, ax * ry - ay * rx))
            closure.append(size - length)
            attachments.append((ax, ay))
            if rail is None:
                normalised_levers.append(0.0 * size - 1.0)
                reach.append(k.minimum(size - joint.lower, joint.upper - size))
                limb.append(k.minimum(size / joint.upper, 1.0 + 0.0 * size))
            else:
                ux, uy = rail.way
                normalised_levers.append(-(rx * ux + ry * uy))
                reach.append(rail.rod - rail.rod * k.abs(ux * ry - uy * rx))
        legs = Legs(tuple(screws), tuple(normalised_levers), tuple(normalised_levers), tuple(reach), tuple(closure))
        legs.attachments, legs.limb = tuple(attachments), tuple(limb)
        return legs

    def closing(self, joints: Sequence[Array], cosine: Array, sine: Array) -> Array:
        """planar_closing over size^6; 0 if the joints are so far away that no digits are left."""
        lengths = [length for *_, length in self.rods(ARRAYS, joints)]
        closing: Array = planar_closing(self.ends(joints, cosine, sine), lengths) / self.size_m**6
        farthest = np.max([np.abs(q) for q in joints], axis=0)
        return np.where(farthest < FAR * self.size_m, closing, 0.0)

    def candidates(self, joints: Sequence[Array], turn: Array) -> tuple[Array, ...]:
        """planar_meetings."""
        lengths = [length for *_, length in self.rods(ARRAYS, joints)]
        return planar_meetings(self.ends(joints, np.cos(turn), np.sin(turn)), lengths, turn)

    def bias(self, at: Posture, joint_rates: Sequence[float], pose_rates: Sequence[float]) -> Floats:
        """Second derivative of |C_iB_i|: relative motion across the rod, and the acceleration of the attachment."""
        vx, vy, w = pose_rates
        found = []
        for (*_, length), rail, rate, (rx, ry, _), (ax, ay) in zip(
            self.rods(FLOATS, at.joints), self.rails, joint_rates, at.screws, at.attachments, strict=True
        ):
            ux, uy = rail.way if rail else (0.0, 0.0)
            across = rx * (vy + w * ax - rate * uy) - ry * (vx - w * ay - rate * ux)
            found.append(across * across / (length + TINY) - w * w * (ax * rx + ay * ry))
        return tuple(found)

    # --- description -------------------------------------------------------------------------------------------------

    def skeleton(self) -> Skeleton:
        """Leg 1 carries the platform; at 0 struts and rods point to +x."""
        links: list[Link] = []
        ends: list[tuple[str, float]] = []
        for leg, ((x, y), rail, joint) in enumerate(zip(self.feet, self.rails, self.joints, strict=True), 1):
            foot = (x, y, 0.0)
            if rail is None:
                links.append(Link(f"pivot_{leg}", f"turn_{leg}", BASE, foot, Z))
                piston = (-0.5 * joint.upper, 0.0, 0.0)
                links.append(Link(f"leg_{leg}", joint.name, f"pivot_{leg}", HERE, X, slides=True, shape=(piston,)))
            else:
                links.append(Link(f"carriage_{leg}", joint.name, BASE, foot, (*rail.way, 0.0), slides=True))
                end = (rail.rod, 0.0, 0.0)
                links.append(Link(f"leg_{leg}", f"turn_{leg}", f"carriage_{leg}", HERE, Z, shape=(end,)))
            ends.append((f"leg_{leg}", 0.0 if rail is None else rail.rod))
        links += planar_end(*ends[0], Z, self.platform_corners)
        corners = self.platform_corners[1:]
        cuts = tuple(Cut(name, (way, 0.0, 0.0), b) for (name, way), b in zip(ends[1:], corners, strict=True))
        rails: list[tuple[Vector, Vector]] = []
        for (x, y), rail, joint in zip(self.feet, self.rails, self.joints, strict=True):
            if rail is not None:
                (ux, uy), low, high = rail.way, joint.lower, joint.upper
                rails.append(((x + low * ux, y + low * uy, 0.0), (x + high * ux, y + high * uy, 0.0)))
        return Skeleton(tuple(links), tuple(joint.name for joint in self.joints), cuts, self._passive, tuple(rails))

    def _passive(self, joints: Floats, pose: Floats) -> dict[str, float]:
        ways = [atan2(ry, rx) for rx, ry, _ in self.at(joints, pose, 0, (0.0, 0.0)).screws]
        return {**{f"turn_{leg}": way for leg, way in enumerate(ways, 1)}, "wrist_1": pose[2] - ways[0]}

    # --- guarantees, one sample --------------------------------------------------------------------------------------

    def certified_bounds(self, at: Posture, travel: Sequence[float], slack_m: float = 0.0) -> CertifiedBounds:
        """Legs of so different lengths that the bound in which every leg has its own effect on every other is taken for
        an exact machine, too."""
        return self._bounds_of_inexact(at, travel, slack_m)

    def _lengths(self, at: Posture) -> list[float]:
        """Lengths of struts and rods, m."""
        return [rod[2] for rod in self.rods(FLOATS, at.joints)]

    def travel_of(self, at: Posture, travel: Sequence[float], slack_m: float) -> Travel:
        """A carriage that moves by t moves by |B_ii| t along its rod. A strut that is longer by D pushes by
        D + D^2/(2 length)."""
        drives, path, lengths = [], 0.0, self._lengths(at)
        errors = self._errors(at, travel, slack_m)
        for rail, lever, length, t, (ends, longer) in zip(self.rails, at.levers, lengths, travel, errors, strict=True):
            if rail is None:
                D = t + longer
                drives.append(D + 0.5 * D * D / length + ends if length > 0.0 else inf)
                path = max(path, ends)
            else:
                drives.append(abs(lever) * t + longer + ends)
                path = max(path, t + ends)
        return Travel(drives, path, min(lengths))

    def geometry_errors(self, slack_m: float) -> Errors:
        """Errors of the places of a strut's joints, and of its length."""
        place = sqrt(2.0) * slack_m
        return Errors(2.0 * place, slack_m, place)

    def _errors(self, at: Posture, travel: Sequence[float], slack_m: float) -> list[tuple[float, float]]:
        """Per leg, m: relative error of the ends of its rod, and error of its length. A rail is off at the carriage,
        instead of the joint on the base."""
        if not slack_m:
            return [(0.0, 0.0)] * 3
        ends, length, place = self.geometry_errors(slack_m)
        legs = zip(self.rails, self.joints, at.joints, travel, strict=True)
        return [
            (ends if rail is None else place + _rail_errors(joint, q, t, place)[0], length)
            for rail, joint, q, t in legs
        ]

    def rods_of(self, at: Posture, travel: Sequence[float], slack_m: float) -> list[Rod]:
        """Struts grow, carriages take the near ends along the rails."""
        rods = []
        errors = self._errors(at, travel, slack_m)
        for rail, length, h, (ends, longer) in zip(self.rails, self._lengths(at), travel, errors, strict=True):
            if rail is None:
                rods.append(Rod(length, (0.0, 0.0), ends, h, longer))
            else:
                rods.append(Rod(length, (h * rail.way[0], h * rail.way[1]), ends, 0.0, longer))
        return rods

    def sine_floors(self, at: Posture, travel: Sequence[float], turn_rad: float, slack_m: float = 0.0) -> Floats:
        """Of a carriage the sine of the rod's angle with the normal of its rail, which may turn as well. Of a strut 1,
        whatever happens."""
        floors = []
        for rail, joint, sine in zip(self.rails, self.joints, at.type1, strict=True):
            turned = _rail_errors(joint, joint.lower, 0.0, sqrt(2.0) * slack_m)[1] if slack_m else 0.0
            floors.append(1.0 if rail is None else lowered(sine, turn_rad + turned))
        return tuple(floors)

    def sines_over(self, at: Posture, travel: Sequence[float], met: Reached, slack_m: float) -> Floats:
        """The sine of a carriage is linear in its rod as a vector, over the rod's length; rails that are off turn."""
        n, floors = len(travel), []
        legs = zip(self.rails, self.joints, at.type1, met.rods, self._lengths(at), met.longest, strict=True)
        for rail, joint, sine, (x, y, *_), length, longest in legs:
            if rail is None:
                floors.append(1.0)
                continue
            ux, uy = rail.way
            along = sine * length - abs(ux) * besides(n, x) - abs(uy) * besides(n, y)
            for k in range(1, 1 + n):
                along -= abs(ux * x[k] + uy * y[k])
            least = along / longest if along > 0.0 else 0.0
            if slack_m:
                least = lowered(least, _rail_errors(joint, joint.lower, 0.0, sqrt(2.0) * slack_m)[1])
            floors.append(least)
        return tuple(floors)

    def limb_floors(self, at: Posture, travel: Sequence[float], slack_m: float, type1: Floats) -> Floats:
        """A strut is shorter by at most its travel and its error."""
        return tuple(
            [
                min(max(q - t - slack_m, 0.0) / joint.upper, 1.0)
                for rail, joint, q, t in zip(self.rails, self.joints, at.joints, travel, strict=True)
                if rail is None
            ]
        )

    def turn_rate(self, at: Posture) -> tuple[float, float]:
        """In a ball of half the reach. A strut that keeps half its length turns by at most asin(move/length); a rod's
        angle with its rail has the sine h/L, h the distance of B from the rail."""
        ball = 0.5 * min(at.reach)
        if not ball > 0.0:
            return 0.0, inf
        rates = []
        for rail, reach, length in zip(self.rails, at.reach, self._lengths(at), strict=True):
            if rail is None:
                rates.append(CHORD / length)
            else:
                h = rail.rod - reach + ball
                rates.append(1.0 / sqrt((rail.rod - h) * (rail.rod + h)))
        return ball, max(rates)


def _rail_errors(joint: Coordinate, q: float, travel: float, place_m: float) -> tuple[float, float]:
    """(m, rad) by which a rail is off within `travel` of q, and turned, if both its ends are off by at most place_m.

    Carriages count from the middle. With e = place/range the rail turns by at most asin(2 e k), k = 1/(1 - 2 e). Across
    the rail a place is off by at most place b k, b its distance from the middle over that of the ends or, between them,
    1; along the rail by place more than what the turn takes, range/2 b (1 - cos) <= 2 place b e k^2.
    """
    size = joint.upper - joint.lower
    e = place_m / size
    if not e < 0.25:
        return inf, inf
    b = max((abs(2.0 * q - joint.lower - joint.upper) + 2.0 * travel) / size, 1.0)
    k = 1.0 / (1.0 - 2.0 * e)
    return place_m * hypot(1.0 + 2.0 * b * e * k * k, b * k), asin(2.0 * e * k)


def unit(vector: Point) -> Point:
    """A vector of size 1, for a direction of any size."""
    size = hypot(*vector)
    return vector[0] / size, vector[1] / size


def require_places(geometry: Any, *names: str) -> None:
    """Raise InvalidGeometry unless the named fields are two numbers, and platform points b_i are not all at P."""
    require_finite(geometry)
    require_size(geometry, 2, *names)
    spread = max(hypot(*getattr(geometry, name)) for name in names if name.startswith("b"))
    require("max |b| > 0", spread > 0.0, spread, 0.0)


def require_range(limits: Point, name: str, strut: bool) -> None:
    """Raise InvalidGeometry unless limits are a range, and that of a strut is not negative."""
    require(f"{name}[0] < {name}[1]", limits[0] < limits[1], *limits)
    if strut:
        require(f"{name}[0] >= 0", limits[0] >= 0.0, limits[0], 0.0)


def require_rails(geometry: Any, *names: str) -> None:
    """Raise InvalidGeometry unless the named directions have a size."""
    for name in names:
        size = hypot(*getattr(geometry, name))
        require(f"|{name}| > 0", size > 0.0, size, 0.0)
