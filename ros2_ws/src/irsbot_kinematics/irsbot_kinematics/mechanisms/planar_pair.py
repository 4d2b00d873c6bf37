"""Two cranks and two rods in the x-z plane: certified bounds of the margins over a joint box, and the clearance.

Frame and names as in `planar_kinematics`.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from math import acos, asin, atan2, cos, hypot, inf, nan, sin, sqrt

import numpy as np

from irsbot_kinematics.bounds.displacement import EXACT, Errors, lowered
from irsbot_kinematics.mechanism import CertifiedBounds, CertifiedColumns, Floats, Legs, Posture, Signs
from irsbot_kinematics.mechanisms import planar_columns
from irsbot_kinematics.mechanisms.planar_kinematics import PlanarKinematics
from irsbot_kinematics.mechanisms.planar_loop import Arc, Loop, coincident_arcs
from irsbot_kinematics.numerics.arithmetic import Array


class PlanarPair(PlanarKinematics):
    """What is proved of the planar loop."""

    def __init__(self, loop: Loop, joint_names: tuple[str, str] = ("joint_1", "joint_2")) -> None:
        super().__init__(loop, joint_names)
        self._arcs: dict[Signs, tuple[Floats, ...]] = {
            mode: tuple(map(self._bounded, coincident_arcs(loop, mode))) for mode in self.working_modes
        }
        self._opposite_possible = abs(loop.half_base) + loop.crank >= loop.rod
        l1, l2 = loop.crank, loop.rod
        self._squares = l1 * l1 + l2 * l2, 2.0 * l1 * l2

    @abstractmethod
    def constraint_bound(self, parts: Floats, turn_rad: float) -> float:
        """Lower bound of the constraint margin while the rods turn by at most turn_rad together; NaN if there is no
        constraint margin."""

    @abstractmethod
    def foot_error(self, slack_m: float) -> float:
        """m: error of A_k, the start of the crank in the loop, for geometry errors of slack_m."""

    def parts_left(self, at: Posture, turn_rad: float, slack_m: float) -> Floats:
        """`constraint_parts` of a machine with geometry errors, at rod directions at most turn_rad together from the
        posture's: at.parts minus the loss by the errors at fixed directions."""
        return at.parts

    def geometry_errors(self, slack_m: float) -> Errors:
        """Effect on a leg of geometry errors of slack_m: an error of the crank's length moves the elbow along the
        crank."""
        return Errors(self.foot_error(slack_m) + slack_m, slack_m, 0.0)

    def certified_bounds(self, at: Posture, travel: Sequence[float], slack_m: float = 0.0) -> CertifiedBounds:
        """Closed-form bounds. The elbow distance d changes by at most the elbows' paths; cos alpha depends on d alone
        and is unimodal; the platform moves by at most the elbows' paths over the smallest cos alpha met; each Type 1
        sine depends on |A_k P| alone and is unimodal; each rod turns by at most (platform + elbow path) / rod."""
        if slack_m:
            return self._bounds_of_inexact(at, travel, slack_m)
        _b0, _e, l1, l2 = self.loop
        h1, h2 = travel
        path = l1 * (h1 + h2)
        d, full, parts = at.gaps[1], 2.0 * l2, at.parts
        low, high = d - path, d + path
        if not (low > 0.0 and high < full and h1 >= 0.0 and h2 >= 0.0):
            return self._nothing(parts)
        low *= sqrt((full - low) * (full + low))
        high *= sqrt((full - high) * (full + high))
        type2 = (low if low < high else high) / (full * l2)
        apart = path / type2
        middle, span = self._squares
        far1, far2 = parts[-2:]
        type1 = (
            _sine_in(far1 - apart, far1 + apart, middle, span),
            _sine_in(far2 - apart, far2 + apart, middle, span),
        )
        constraint = self.constraint_bound(parts, (2.0 * apart + path) / l2)  # turn of both rods together
        return CertifiedBounds(_capped(type1, at.normalised_levers), type2, constraint, ())

    def certified_bounds_many(
        self, legs: Legs[Array], gaps: Sequence[Array], travel: Sequence[Array], slack_m: float = 0.0
    ) -> CertifiedColumns | None:
        """The equations of `certified_bounds`, of an exact geometry."""
        if slack_m:
            return None
        type1, type2, turn = planar_columns.first_order(self.loop, legs, gaps, travel)
        return CertifiedColumns(type1, type2, self.constraint_bound_many(legs.parts[:-2], turn), ())

    def sharp_bounds_many(
        self,
        joints: Sequence[Array],
        pose: Sequence[Array],
        legs: Legs[Array],
        gaps: Sequence[Array],
        travel: Sequence[Array],
        slack_m: float = 0.0,
    ) -> CertifiedColumns | None:
        """The equations of `sharp_bounds`, of an exact geometry."""
        if slack_m:
            return None
        proved, type1, type2, turns, error = planar_columns.second_order(self.loop, joints, pose, legs, gaps, travel)
        constraint = self.constraint_over_many(legs, turns, error)
        one, other, type2 = (np.where(proved, bound, 0.0) for bound in (*type1, type2))
        return CertifiedColumns(
            (one, other), type2, None if constraint is None else np.where(proved, constraint, 0.0), ()
        )

    def constraint_bound_many(self, parts: Sequence[Array], turn_rad: Array) -> Array | None:
        """`constraint_bound` of many postures; None if there is no constraint margin."""
        return None

    def constraint_over_many(
        self, legs: Legs[Array], turns: tuple[tuple[Array, Array], tuple[Array, Array]], error: Array
    ) -> Array | None:
        """`constraint_over` of many postures, with `error` as the rest of both rods; None if there is no constraint
        margin."""
        return None

    def _bounds_of_inexact(self, at: Posture, travel: Sequence[float], slack_m: float) -> CertifiedBounds:
        """The same for a geometry that is off. Its errors are further paths of the elbows; a rod that grows moves the
        platform as an elbow does that moves along it. A_k P is then seen from a displaced A_k, in a triangle of other
        sides. The triangle of elbows and platform, too, says how far a rod turns, and the better bound counts."""
        _b0, _e, l1, l2 = self.loop
        ends, length, _ = self.geometry_errors(slack_m)
        path = l1 * (travel[0] + travel[1]) + 2.0 * ends
        d, parts, short = at.gaps[1], at.parts, l2 - length
        low, high = d - path, d + path
        if not (slack_m >= 0.0 and min(travel) >= 0.0 and low > 2.0 * length and high < 2.0 * short):
            return self._nothing(parts)
        type2 = _least_sine(low, high, l2, length)
        move = (path + 2.0 * length) / type2
        turn = asin(path / d) + _opening(d, low, high, l2, length)  # of one rod
        both = min((2.0 * move + path) / short, 2.0 * turn)
        apart = move + self.foot_error(slack_m)
        type1, other = [
            max(self._sine_floor(r, apart, length), lowered(abs(sine), turn + t))
            for r, sine, t in zip(parts[-2:], at.normalised_levers, travel, strict=True)
        ]
        parts = self.parts_left(at, both, slack_m)
        sines = _capped((type1, other), at.normalised_levers)
        return CertifiedBounds(sines, type2, self.constraint_bound(parts, both), ())

    def _nothing(self, parts: Floats) -> CertifiedBounds:
        return CertifiedBounds((0.0, 0.0), 0.0, self.constraint_bound(parts, inf), ())

    def sharp_bounds(self, at: Posture, travel: Sequence[float], slack_m: float = 0.0) -> CertifiedBounds:
        """To second order, in closed form. Along v = C_2 - C_1 and across it, to first order the elbows move by x_j and
        y_j with joint j, by `rest` on top. Both rods turn with v, by y/d, and against each other, as cos gamma =
        d/(2 l2) asks; `error` bounds what is left of both turns. The platform point goes with elbow and rod of one leg,
        and the Type 1 sines follow from its distances from the feet.

        A leg whose geometry is off has its rod, and its crank, where one with exact lengths would have them if its
        elbow and foot were off by all its errors together."""
        b0, e, l1, l2 = self.loop
        (r1x, r1z), (r2x, r2z) = at.screws
        q1, q2 = at.joints
        h1, h2 = travel
        det, parts, d, full = at.det, at.parts, at.gaps[1], 2.0 * l2
        nothing = self._nothing(parts)
        if not (det != 0.0 and h1 >= 0.0 and h2 >= 0.0 and slack_m >= 0.0):
            return nothing
        n1x, n1z, n2x, n2z = -l1 * h1 * sin(q1), -l1 * h1 * cos(q1), -l1 * h2 * sin(q2), -l1 * h2 * cos(q2)
        ends, length, _ = self.geometry_errors(slack_m) if slack_m else EXACT
        wrong = ends + length
        rest1, rest2 = 0.5 * l1 * h1 * h1 + wrong, 0.5 * l1 * h2 * h2 + wrong
        rest = rest1 + rest2
        vx, vz = (r1x - r2x) / d * l2, (r1z - r2z) / d * l2
        along = abs(vx * n1x + vz * n1z) + abs(vx * n2x + vz * n2z) + rest
        aside = abs(vx * n1z - vz * n1x) + abs(vx * n2z - vz * n2x) + rest
        low = d - along
        if not low > 0.0:
            return nothing
        tilt = aside / low
        high = hypot(d + along, aside)
        if not high < full:
            return nothing
        farther = rest + 0.5 * aside * tilt  # of d, beyond first order
        most = along + 0.5 * aside * tilt  # change of d
        opening, widest = (full - d) * (full + d), (full - high) * (full + high)
        error = rest / d + tilt * along / d + tilt * tilt * tilt / 3.0
        error += farther / sqrt(opening) + 0.5 * most * most * high / (widest * sqrt(widest))
        type2 = min(low * sqrt((full - low) * (full + low)), high * sqrt(widest)) / (full * l2)
        drive1, drive2 = (r1x * n1x + r1z * n1z) / det, (r2x * n2x + r2z * n2z) / det
        d1x, d1z, d2x, d2z = drive1 * r2z, -drive1 * r2x, -drive2 * r1z, drive2 * r1x  # platform point, by joint
        # Turns of both rods by both joints, rad to first order; positive from x to z.
        t11, t12 = (r1x * (d1z - n1z) - r1z * (d1x - n1x)) / l2, (r1x * d2z - r1z * d2x) / l2
        t21, t22 = (r2x * d1z - r2z * d1x) / l2, (r2x * (d2z - n2z) - r2z * (d2x - n2x)) / l2
        turn1, turn2 = abs(t11) + abs(t12) + error, abs(t21) + abs(t22) + error
        off1, off2 = rest1 + l2 * (error + 0.5 * turn1 * turn1), rest2 + l2 * (error + 0.5 * turn2 * turn2)
        off = (off1 if off1 < off2 else off2) + wrong
        x, z = at.pose
        type1 = (
            self._sine_between(*_distances(x + b0, z + e, d1x, d1z, d2x, d2z, off)),
            self._sine_between(*_distances(x - b0, z + e, d1x, d1z, d2x, d2z, off)),
        )
        if len(parts) == 2:
            return CertifiedBounds(_capped(type1, at.normalised_levers), type2, nan, ())
        constraint = self.constraint_over(at, ((t11, t12), (t21, t22)), (error, error))
        if slack_m:
            left = self.parts_left(at, turn1 + turn2, slack_m)
            constraint = max(constraint - max(parts[0] - left[0], parts[1] - left[1]), 0.0)
        return CertifiedBounds(_capped(type1, at.normalised_levers), type2, constraint, ())

    def constraint_over(
        self, at: Posture, turns: tuple[tuple[float, float], tuple[float, float]], rests: tuple[float, float]
    ) -> float:
        """Lower bound of the constraint margin while rod k turns by s_1 turns[k][0] + s_2 turns[k][1], s_j in -1..1,
        and by rests[k] on top, rad."""
        turn = sum([abs(a) + abs(b) + rest for (a, b), rest in zip(turns, rests, strict=True)], 0.0)
        return self.constraint_bound(at.parts, turn)

    def _sine_floor(self, r: float, move: float, error: float = 0.0) -> float:
        """Smallest |sin(q - psi)| while |A P| stays within `move` of r, and crank and rod within `error` of theirs.

        |f| of f = (r^2 - a^2 - b^2)/(2 a b) is largest at a corner of a box of (r, a, b): f grows with r; in a and in b
        it is monotone, or concave with a maximum that is not positive, so that |f| is largest at an end.
        """
        near, far = r - move, r + move
        if not error:
            return self._sine_between(near, far)
        l1, l2, least = self.loop.crank, self.loop.rod, 1.0
        for a in (l1 - error, l1 + error):
            for b in (l2 - error, l2 + error):
                least = min(_sine_in(near, far, a * a + b * b, 2.0 * a * b), least)
        return least

    def _sine_between(self, near: float, far: float) -> float:
        """Smallest |sin(q - psi)| for |A P| in a range: S^2 = 1 - ((r^2 - l1^2 - l2^2)/(2 l1 l2))^2."""
        return _sine_in(near, far, *self._squares)

    def clearance(self, at: Posture) -> float:
        """Type 1: exact. Type 2 with parallel rods: exact distance to the locus arcs of this working mode. Type 2 with
        rods in line: what the rods still have to turn, over their speed while the platform stays within a ball."""
        reach1, reach2 = at.reach
        reach = nearest = max(reach1 if reach1 < reach2 else reach2, 0.0)
        x, z = at.pose
        rod = self.loop.rod
        for cx, cz, toward_x, toward_z, cosine, from_x, from_z, to_x, to_z in self._arcs.get(at.working_mode, ()):
            dx, dz = x - cx, z - cz
            r = sqrt(dx * dx + dz * dz)
            away = abs(r - rod)
            if away < nearest:  # the circle is near enough to ask for the arc
                if dx * toward_x + dz * toward_z >= r * cosine:
                    nearest = away
                else:
                    nearest = min(nearest, hypot(x - from_x, z - from_z), hypot(x - to_x, z - to_z))
        if self._opposite_possible:
            nearest = min(nearest, self._opposite_clearance(at, 0.5 * reach))
        return nearest

    def _bounded(self, arc: Arc) -> Floats:
        """Constants for the distance to an arc: centre, direction of its middle, cosine of half its length, both
        ends."""
        cx, cz, start, length = arc
        rod, middle, end = self.loop.rod, start + 0.5 * length, start + length
        ends = (cx + rod * cos(start), cz - rod * sin(start), cx + rod * cos(end), cz - rod * sin(end))
        return (cx, cz, cos(middle), -sin(middle), cos(0.5 * length), *ends)

    def _opposite_clearance(self, at: Posture, ball: float) -> float:
        if not ball > 0.0:
            return 0.0
        s1, s2 = self._sine_floor(at.parts[-2], ball), self._sine_floor(at.parts[-1], ball)
        if not (s1 > 0.0 and s2 > 0.0):
            return 0.0
        slack, d = at.gaps
        rod = self.loop.rod
        turn = 2.0 * atan2(sqrt(slack * (2.0 * rod + d)), d) if slack > 0.0 else 0.0
        return min(ball, rod * turn * s1 * s2 / (s1 + s2))  # rod |psi_k'| <= |P'| / |S_k|


def _distances(x: float, z: float, ax: float, az: float, bx: float, bz: float, rest: float) -> tuple[float, float]:
    """Bounds of the distance of (x, z) + s (ax, az) + t (bx, bz), s and t in -1..1, from the origin, with an error of
    `rest`: smallest and largest."""
    size = hypot(x, z)
    if not size > 0.0:
        return 0.0, inf
    x, z = x / size, z / size
    along = abs(x * ax + z * az) + abs(x * bx + z * bz)
    aside = abs(x * az - z * ax) + abs(x * bz - z * bx)
    return size - along - rest, hypot(size + along, aside) + rest


def _capped(floors: tuple[float, float], normalised_levers: Floats) -> Floats:
    """Near 0 a sine computed from lengths has half the digits of one computed from directions."""
    floor1, floor2 = floors
    sine1, sine2 = normalised_levers
    size1, size2 = abs(sine1), abs(sine2)
    return (floor1 if floor1 < size1 else size1, floor2 if floor2 < size2 else size2)


def _sine_in(near: float, far: float, middle: float, span: float) -> float:
    """Smallest sin of the angle between sides a, b of triangles whose third side is between near and far.

    middle: a^2 + b^2; span: 2 a b, m^2."""
    low, high = middle - near * near, far * far - middle
    worst = low if low > high else high
    return sqrt((span - worst) * (span + worst)) / span if near > 0.0 and worst < span else 0.0


def _least_sine(low: float, high: float, rod: float, error: float) -> float:
    """Smallest sin of the angle between rods a, b within `error` of `rod` whose near ends are low to high apart.

    cos = 1 - (d^2 - (a - b)^2)/(2 a b) is at most 1 - (low^2 - (2 error)^2)/(2 long^2) and, because a/b + b/a >= 2, at
    least 1 - high^2/(2 short^2).
    """
    long, short = rod + error, rod - error
    low = sqrt((low - 2.0 * error) * (low + 2.0 * error))
    return min(
        low * sqrt((2.0 * long - low) * (2.0 * long + low)) / (2.0 * long * long),
        high * sqrt((2.0 * short - high) * (2.0 * short + high)) / (2.0 * short * short),
    )


def _opening(d: float, low: float, high: float, rod: float, error: float) -> float:
    """By how much the angle between a rod and the line of the near ends can differ from acos(d/(2 rod)), rad, where the
    near ends are low to high apart and the rods a, b within `error` of `rod`: cos = d/(2 a) + (a^2 - b^2)/(2 a d)."""
    long, short = rod + error, rod - error
    other = 2.0 * rod * error / (short * low)
    now = acos(min(0.5 * d / rod, 1.0))
    return max(acos(max(0.5 * low / long - other, -1.0)) - now, now - acos(min(0.5 * high / short + other, 1.0)))
