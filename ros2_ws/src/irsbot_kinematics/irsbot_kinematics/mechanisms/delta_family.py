"""Linear Delta robots: certified bounds of the margins over a joint box, and the clearance.

Names as in `delta_kinematics`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import asin, nan, sin, sqrt
from operator import sub

from irsbot_kinematics import statics
from irsbot_kinematics.bounds.boxes import Rod, reached
from irsbot_kinematics.bounds.displacement import EXACT, Errors, displacement, least_cosine, level_after
from irsbot_kinematics.bounds.sizes import distances
from irsbot_kinematics.mechanism import CertifiedBounds, Posture
from irsbot_kinematics.mechanisms.delta_kinematics import DeltaGeometry, DeltaKinematics
from irsbot_kinematics.skeleton import Vector

CLEARANCE_BALL = 0.9
"""1: share of the smallest reach within which the clearance from Type 2 is searched."""


class DeltaFamily(DeltaKinematics):
    """What is proved of a linear Delta robot."""

    def __init__(self, geometry: DeltaGeometry) -> None:
        super().__init__(geometry)
        self._nothing = CertifiedBounds((0.0, 0.0, 0.0), 0.0, nan, (0.0, 0.0, 0.0)[: self.limb_count])

    def certified_bounds(self, at: Posture, travel: Sequence[float], slack_m: float = 0.0) -> CertifiedBounds:
        """The platform moves by at most `displacement`, with |column i of A^-1| = 1/cos alpha_i.

        The Type 1 sine of a leg depends on the distance of P from its rail alone. Rod i turns by at most
        asin((move + h_i)/L), h_i what its slide moves. cos alpha_i is the sine of the elevation of rod i over the plane
        of the other two, whose normal r_j x r_k has the size |det|/cos alpha_i and changes by no more than their turns.
        """
        L = self.rod
        size = abs(at.det)
        c1, c2, c3 = at.cos_pressure
        s1, s2, s3 = at.type1
        h1, h2, h3 = t1, t2, t3 = travel
        e1 = e2 = e3 = 0.0
        if slack_m:
            off1, off2, off3 = self.geometry_errors(at.joints, travel, slack_m)
            h1, h2, h3 = t1 + off1.ends, t2 + off2.ends, t3 + off3.ends
            e1, e2, e3 = off1.ends + off1.length, off2.ends + off2.length, off3.ends + off3.length
        if not (size > 0.0 and c1 > 0.0 and c2 > 0.0 and c3 > 0.0):  # rods in one plane, to rounding
            return self._nothing
        if not (t1 >= 0.0 and t2 >= 0.0 and t3 >= 0.0 and slack_m >= 0.0):
            return self._nothing
        move = displacement(
            (s1 * t1 + e1 + 0.5 * h1 * h1 / L) / c1
            + (s2 * t2 + e2 + 0.5 * h2 * h2 / L) / c2
            + (s3 * t3 + e3 + 0.5 * h3 * h3 / L) / c3,
            (h1 / c1 + h2 / c2 + h3 / c3) / L,
            0.5 * (1.0 / c1 + 1.0 / c2 + 1.0 / c3) / L,
        )
        if not move + max(h1, h2, h3) < L:
            return self._nothing
        turn1, turn2, turn3 = asin((move + h1) / L), asin((move + h2) / L), asin((move + h3) / L)
        share1, share2, share3 = (
            (turn2 + turn3) * c1 / size,
            (turn3 + turn1) * c2 / size,
            (turn1 + turn2) * c3 / size,
        )
        type2 = 0.0
        if max(share1, share2, share3) < 1.0:
            left = min(
                asin(c1) - turn1 - asin(share1), asin(c2) - turn2 - asin(share2), asin(c3) - turn3 - asin(share3)
            )
            type2 = sin(left) if left > 0.0 else 0.0
        if slack_m:
            _, columns = statics.cofactors(at.screws)
            ways = [[tuple([value / at.det for value in column])] * 3 for column in columns]
            type2 = max(type2, least_cosine(ways, [0.0, 0.0, 0.0], [turn1, turn2, turn3], 0.0))
        a1 = a2 = a3 = move
        if slack_m:
            a1, a2, a3 = [move + error for error in self.rail_errors(at, slack_m)]
        r1, r2, r3 = at.reach
        type1 = (  # near 0 a sine from lengths has half the digits of one from directions
            min(self._sine(r1 - a1, slack_m), s1),
            min(self._sine(r2 - a2, slack_m), s2),
            min(self._sine(r3 - a3, slack_m), s3),
        )
        return CertifiedBounds(type1, type2, nan, type1[: self.limb_count])

    def geometry_errors(self, joints: Sequence[float], travel: Sequence[float], slack_m: float) -> list[Errors]:
        """Effect on every leg of geometry errors of slack_m, while its slide is within `travel` of its joint."""
        return [Errors(self._off_rail(q, t, slack_m), slack_m, 0.0) for q, t in zip(joints, travel, strict=True)]

    def rail_errors(self, at: Posture, slack_m: float, slid: Sequence[float] = (0.0,) * 3) -> list[float]:
        """m: error of each rail at its point nearest to the platform point, and up to `slid` m from there."""
        return [
            self._off_rail(q - self.rod * sine, along, slack_m)
            for q, sine, along in zip(at.joints, at.normalised_levers, slid, strict=True)
        ]

    def _off_rail(self, q: float, travel: float, slack_m: float) -> float:
        """m: error of a point of a rail whose ends are off by sqrt(3) slack_m: no larger between the ends; beyond them
        in proportion to the distance from the middle."""
        lower, upper = self.geometry.limits
        beyond = (abs(2.0 * q - lower - upper) + 2.0 * travel) / (upper - lower)
        return sqrt(3.0) * slack_m * max(beyond, 1.0)

    def sharp_bounds(self, at: Posture, travel: Sequence[float], slack_m: float = 0.0) -> CertifiedBounds:
        """boxes.reached; the Type 1 sines from the distances of the platform point from the rails."""
        errors = self.geometry_errors(at.joints, travel, slack_m) if slack_m else (EXACT,) * 3
        rods = [
            Rod(self.rod, (h * ux, h * uy, h * uz), ends, 0.0, length)
            for h, (_, (ux, uy, uz)), (ends, length, _arm) in zip(travel, self.rails, errors, strict=True)
        ]
        met = reached(at, rods) if min(travel) >= 0.0 and slack_m >= 0.0 else None
        if met is None:
            return self._nothing
        off_rails: Sequence[float] = (0.0,) * 3
        if slack_m:
            slid = [sum([abs(_along(move, u)) for move in met.moves], 0.0) + met.aside for _, u in self.rails]
            off_rails = self.rail_errors(at, slack_m, slid)
        type1 = []
        for (o, u), off, sine in zip(self.rails, off_rails, at.type1, strict=True):
            moves = [_across(move, u) for move in met.moves]
            far = distances(_across(map(sub, at.pose, o), u), moves, met.aside + off)[1]
            type1.append(min(self._sine(self.rod - far, slack_m), sine))
        return CertifiedBounds(tuple(type1), met.type2, nan, tuple(type1[: self.limb_count]))

    def _sine(self, reach: float, shorter: float = 0.0) -> float:
        """Sine of a leg whose rail is L - reach away from the platform point, and whose rod is `shorter` than L; 0 out
        of reach."""
        rod, left = self.rod - shorter, reach - shorter
        return sqrt(left * (2.0 * rod - left)) / rod if left > 0.0 else 0.0

    def clearance(self, at: Posture) -> float:
        """Type 1 and limbs: exact, the smallest reach. Type 2: while P stays in a ball, rod i turns by at most
        |move|/(L sine_i) with its smallest sine_i in the ball, because its end runs on a sphere over the plane across
        the rail; the elevations of `certified_bounds` fall accordingly. Of two balls the better bound counts."""
        wide = CLEARANCE_BALL * max(min(at.reach), 0.0)
        bound = self._level_after(at, wide)
        if not bound < wide:
            return wide
        ball = 0.5 * (bound + wide)
        return max(bound, min(ball, self._level_after(at, ball)))

    def _level_after(self, at: Posture, ball: float) -> float:
        """m: motion of the platform inside the ball before a rod can lie in the plane of the others; 0 if unknown."""
        a, b, c = at.reach
        floor1, floor2, floor3 = self._sine(a - ball), self._sine(b - ball), self._sine(c - ball)
        size = abs(at.det) * self.rod
        if not (size > 0.0 and floor1 > 0.0 and floor2 > 0.0 and floor3 > 0.0):
            return 0.0
        a, b, c = 1.0 / floor1, 1.0 / floor2, 1.0 / floor3
        c1, c2, c3 = at.cos_pressure
        return min(
            level_after(c1, a / self.rod, (b + c) * c1 / size),
            level_after(c2, b / self.rod, (c + a) * c2 / size),
            level_after(c3, c / self.rod, (a + b) * c3 / size),
        )


def _across(way: Iterable[float], u: Vector) -> tuple[float, ...]:
    """The part of a vector that is normal to a unit vector."""
    x, y, z = way
    along = _along((x, y, z), u)
    return x - along * u[0], y - along * u[1], z - along * u[2]


def _along(way: Sequence[float], u: Vector) -> float:
    """The part of a vector along a unit vector."""
    return way[0] * u[0] + way[1] * u[1] + way[2] * u[2]
