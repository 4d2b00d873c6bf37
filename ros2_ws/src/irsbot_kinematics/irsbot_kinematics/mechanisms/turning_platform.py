"""Platforms that move and turn about z, held by rods: the common part of the 3-RRR and the 4-RUU.

Leg i holds the platform point P at arm c_i by a rod with unit direction r_i. Row i of A is (r_i, (c_i x r_i).z): the
force along the rod and its moment about z at P, in metres. The task is the position of P and the turn of the platform.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from math import asin, hypot, inf, nan, sqrt
from typing import NamedTuple

from irsbot_kinematics import statics
from irsbot_kinematics.bounds.boxes import Reached, Rod, reached
from irsbot_kinematics.bounds.displacement import Errors, displacement_and_turn, least_cosine, level_after, lowered
from irsbot_kinematics.mechanism import CertifiedBounds, Floats, Mechanism, Posture

_ROWS = {n: (n - 1) * sqrt(2.0) ** (n - 1) for n in (3, 4)}
"""1: n - 1 rows of at most sqrt(2) change the cross product of n - 1 rows by at most this times their turn."""


class Travel(NamedTuple):
    """Demand on the rods for a travel of the joints, see `bounds.displacement`, m."""

    drives: Sequence[float]
    path: float
    """Largest end displacement of a rod."""
    rod: float
    """The shortest rod."""


def column_sizes(screws: Sequence[Floats]) -> Floats:
    """Per column of adj(A) the size of its force part, then per column of its moment part: |det| V_i, |det| W_i."""
    _, columns = statics.cofactors(screws)
    return (*[hypot(*column[:-1]) for column in columns], *[abs(column[-1]) for column in columns])


def _velocities(column: Floats, det: float, attachments: Sequence[Floats]) -> list[Floats]:
    """Velocities, 1, of the places at which the legs hold the platform, from a column of adj(A)."""
    vx, vy, w = column[0], column[1], column[-1]
    if len(column) == 3:
        return [((vx - w * ay) / det, (vy + w * ax) / det) for ax, ay in attachments]
    return [((vx - w * ay) / det, (vy + w * ax) / det, column[2] / det) for ax, ay in attachments]


class TurningPlatform(Mechanism):
    """Certified bounds for mechanisms whose platform turns."""

    radius: float
    """m: largest |c_i|."""
    diameter: float
    """m: largest |c_i - c_j|."""
    has_constraint: bool = False

    @abstractmethod
    def travel_of(self, at: Posture, travel: Sequence[float], slack_m: float) -> Travel:
        """Demand on the rods of joints that move by at most `travel`."""

    @abstractmethod
    def geometry_errors(self, slack_m: float) -> Errors:
        """Effect on a leg of geometry errors of slack_m (`Mechanism.certified_bounds`)."""

    @abstractmethod
    def sine_floors(self, at: Posture, travel: Sequence[float], turn_rad: float, slack_m: float = 0.0) -> Floats:
        """Lower bounds of the Type 1 sines while no rod turns by more than turn_rad."""

    @abstractmethod
    def turn_rate(self, at: Posture) -> tuple[float, float]:
        """A radius, m, and the largest turn of a rod, rad/m, while no rod end moves farther than that radius."""

    @abstractmethod
    def rods_of(self, at: Posture, travel: Sequence[float], slack_m: float) -> list[Rod]:
        """Motion of the rods while joints move by at most `travel`: the first order, and a bound of the remainder."""

    def sines_over(self, at: Posture, travel: Sequence[float], met: Reached, slack_m: float) -> Floats:
        """Lower bounds of the Type 1 sines for a given motion of the rods."""
        return self.sine_floors(at, travel, met.turn, slack_m)

    def constraint_over(self, at: Posture, met: Reached) -> float:
        """Lower bound of the constraint margin for a given motion of the rods; NaN: there is none."""
        return self.constraint_floor(at, met.turn) if self.has_constraint else nan

    def limb_floors(self, at: Posture, travel: Sequence[float], slack_m: float, type1: Floats) -> Floats:
        """Lower bounds of the limb margins for lower bounds type1 of the Type 1 sines: the same, for limbs that have a
        margin of their own."""
        return type1[: self.limb_count]

    def constraint_floor(self, at: Posture, turn_rad: float) -> float:
        """Lower bound of the constraint margin while no rod turns by more than turn_rad; NaN: there is none."""
        return nan

    def certified_bounds(self, at: Posture, travel: Sequence[float], slack_m: float = 0.0) -> CertifiedBounds:
        """The platform moves and turns by at most (d, t) of `displacement_and_turn`, a rod end by
        d + radius t, and a rod turns by at most asin((d + radius t + path)/rod), by t more seen from the platform.

        There cos alpha_i is the sine of the elevation of rod i over the line or plane across the velocity of its end
        when leg i yields. That velocity times det is the force part of the cross product of the other rows taken at
        c_i; with moments over `diameter` a row is no longer than sqrt(2) and changes by no more than sqrt(2) times its
        turn. All rods may turn alike, so the smallest cosine stays the smallest.
        """
        if slack_m:
            return self._bounds_of_inexact(at, travel, slack_m)
        n, size = len(at.levers), abs(at.det)
        asked = self.travel_of(at, travel, 0.0)
        d, t = self.box(at, asked)
        end = d + self.radius * t
        share = (end + asked.path) / asked.rod if asked.rod > 0.0 else inf
        if not (share < 1.0 and min(travel) >= 0.0):
            return self._nothing(n)
        rod_turn = asin(share)
        seen = rod_turn + t
        cosine = min(at.cos_pressure)
        type2 = lowered(cosine, seen, self._share(n, cosine, size, seen))
        type1 = self.sine_floors(at, travel, rod_turn)
        limb = self.limb_floors(at, travel, 0.0, type1)
        return CertifiedBounds(type1, type2, self.constraint_floor(at, rod_turn), limb)

    def _bounds_of_inexact(self, at: Posture, travel: Sequence[float], slack_m: float) -> CertifiedBounds:
        """The same for a geometry that is off, with what every leg does to every rod: in the box, rod end i moves by at
        most the sum of b_j times its velocity when leg j alone yields, and the platform turns accordingly."""
        n = len(at.levers)
        asked = self.travel_of(at, travel, slack_m)
        d, t = self.box(at, asked)
        if not (d + t < inf and min(travel) >= 0.0 and slack_m >= 0.0):
            return self._nothing(n)
        det, columns = statics.cofactors(at.screws)
        velocities = [_velocities(column, det, at.attachments) for column in columns]
        turns = [abs(column[-1] / det) for column in columns]
        bend = 0.5 * self.radius * t * t
        end = d + self.radius * t
        most = end + asked.path
        drives = [drive + 0.5 * most * most / asked.rod + bend for drive in asked.drives]
        turned = 0.0
        for turn, drive in zip(turns, drives, strict=True):
            turned += turn * drive
        t = min(t, turned)
        angles = []
        for i in range(n):
            moved = bend
            for alone, drive in zip(velocities, drives, strict=True):
                square, end_velocity = 0.0, alone[i]
                for x in end_velocity:
                    square += x * x
                moved += sqrt(square) * drive
            share = (min(moved, end) + asked.path) / asked.rod
            if not share < 1.0:
                return self._nothing(n)
            angles.append(asin(share))
        seen = [angle + t for angle in angles]
        type2 = least_cosine(velocities, turns, seen, self.geometry_errors(slack_m).arm)
        rod_turn = max(angles)
        type1 = self.sine_floors(at, travel, rod_turn, slack_m)
        limb = self.limb_floors(at, travel, slack_m, type1)
        return CertifiedBounds(type1, type2, self.constraint_floor(at, rod_turn), limb)

    def sharp_bounds(self, at: Posture, travel: Sequence[float], slack_m: float = 0.0) -> CertifiedBounds:
        """boxes.reached; the Type 1 sines and the constraint from what it says of the rods."""
        arm = self.geometry_errors(slack_m).arm if slack_m else 0.0
        met = reached(at, self.rods_of(at, travel, slack_m), arm) if min(travel) >= 0.0 and slack_m >= 0.0 else None
        if met is None:
            return self._nothing(len(at.levers))
        type1 = self.sines_over(at, travel, met, slack_m)
        return CertifiedBounds(
            type1, met.type2, self.constraint_over(at, met), self.limb_floors(at, travel, slack_m, type1)
        )

    def box(self, at: Posture, asked: Travel) -> tuple[float, float]:
        """(m, rad): largest motion and turn of the platform; infinite if there is no bound."""
        n, size = len(at.levers), abs(at.det)
        drives, path, rod = asked
        if not (size > 0.0 and rod > 0.0):
            return inf, inf
        sizes = at.parts or column_sizes(at.screws)
        x = y = move = turn = 0.0
        for moves, turns, drive in zip(sizes[:n], sizes[n : 2 * n], drives, strict=True):
            move, turn, x, y = move + moves, turn + turns, x + moves * drive, y + turns * drive
        move, turn, x, y = move / size, turn / size, x / size, y / size
        bend = 0.5 * path * path / rod
        return displacement_and_turn(x + move * bend, y + turn * bend, move, turn, path, rod, self.radius)

    def _share(self, n: int, cosine: float, size: float, turn: float) -> float:
        """Change over size of the velocity across which the elevation is taken, when all rods turn by `turn`."""
        return self.diameter * _ROWS[n] * turn * cosine / size

    def _nothing(self, n: int) -> CertifiedBounds:
        return CertifiedBounds((0.0,) * n, 0.0, 0.0 if self.has_constraint else nan, (0.0,) * self.limb_count)

    def clearance(self, at: Posture) -> float:
        """For translations d and turns t with |d| + radius |t| below the clearance, so that no rod end moves farther.

        Type 1: exact, the smallest reach. Type 2: elevations of the rods fall at bounded rates in a ball."""
        n = len(at.levers)
        ball, rate = self.turn_rate(at)
        size = abs(at.det)
        if not (ball > 0.0 and size > 0.0):
            return 0.0
        seen, cosine = rate + 1.0 / self.radius, min(at.cos_pressure)
        return min(ball, level_after(cosine, seen, self._share(n, cosine, size, seen)))
