"""Two cranks and two rods in the x-z plane: the five-bar, and the loop to which the IRSBot-2 is equivalent.

Frame: x right, z up; a planar angle t means the direction u(t) = (cos t, -sin t), a positive rotation about +y, so
that sin q > 0 points down. Leg I starts at (-half_base, -drop), leg II at (+half_base, -drop). Elbow C_k, rod
direction r_k = u(psi_k) from C_k to the platform point P.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from math import acos, atan2, cos, hypot, inf, isfinite, nan, pi, sin, sqrt, tau
from typing import NamedTuple

from irsbot_kinematics.arithmetic import FLOATS, Arithmetic, N
from irsbot_kinematics.guarantees import displacement
from irsbot_kinematics.mechanism import (
    Coordinate,
    Cuspidal,
    Floats,
    Guarantee,
    Legs,
    Mechanism,
    Posture,
    Signs,
    Status,
    sign_of,
)
from irsbot_kinematics.tolerances import COINCIDENT_TOL_M

SOLVED = Status.SOLVED

Arc = tuple[float, float, float, float]
"""Centre x, z (m); start angle, length (rad) of an arc with the radius of the rods."""


class Loop(NamedTuple):
    """Lengths of the planar loop, m. half_base may be negative; drop is how far the cranks start below z = 0."""

    half_base: float
    drop: float
    crank: float
    rod: float


ASIN_BEND = 0.5 * pi - 1.0
"""1: asin(x) - x <= ASIN_BEND x^3 for 0 <= x <= 1, because (asin(x) - x)/x^3 grows up to there."""


class PlanarPair(Mechanism):
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
        self._arcs: dict[Signs, tuple[Floats, ...]] = {
            mode: tuple(map(self._bounded, coincident_arcs(loop, mode))) for mode in self.working_modes
        }
        self._opposite_possible = abs(loop.half_base) + loop.crank >= loop.rod
        l1, l2 = loop.crank, loop.rod
        self._annulus = abs(l1 - l2), l1 + l2
        self._squares = l1 * l1 + l2 * l2, 2.0 * l1 * l2

    @abstractmethod
    def constraint_parts(self, k: Arithmetic[N], c1: N, mz1: N, c2: N, mz2: N) -> tuple[N, ...]:
        """Numbers whose minimum is the constraint margin, from (cos psi, -sin psi) of both rods; empty where the legs
        constrain nothing but the plane."""

    @abstractmethod
    def constraint_guarantee(self, parts: Floats, turn_rad: float) -> float:
        """Lower bound of the constraint margin while the rods turn by at most turn_rad together; NaN: there is none."""

    # --- equations, floats or arrays -------------------------------------------------------------------------

    def inverse(self, k: Arithmetic[N], pose: Sequence[N], mode: Signs) -> tuple[tuple[N, N], tuple[N, N]]:
        """IRSBot-2 sheet section 3: area by Heron's factors, angles by atan2, no acos and no division."""
        q1, reach1 = self._crank(k, pose[0] + self.loop.half_base, pose[1] + self.loop.drop, mode[0])
        q2, reach2 = self._crank(k, pose[0] - self.loop.half_base, pose[1] + self.loop.drop, mode[1])
        return (q1, q2), (reach1, reach2)

    def _crank(self, k: Arithmetic[N], X: N, Z: N, w: int) -> tuple[N, N]:
        l1, l2 = self.loop.crank, self.loop.rod
        r = k.hypot(X, Z)
        area = k.root((l1 + l2 + r) * (l1 + l2 - r) * (r + l1 - l2) * (r - l1 + l2))
        # Beyond the boundary area is 0; the numerator's sign then folds or stretches the crank towards the pose.
        q = k.atan2(-Z, X) + w * k.atan2(area, r * r + (l1 - l2) * (l1 + l2))
        return k.wrap(q), k.least(l1 + l2 - r, r - abs(l1 - l2))

    def direct(self, k: Arithmetic[N], joints: Sequence[N], assembly: int) -> tuple[tuple[N, N], tuple[N, N]]:
        """IRSBot-2 sheet section 4. Gaps: [0] 2 rod - d (rods in line), [1] d (elbows coincide)."""
        b0, e, l1, l2 = self.loop
        q1, q2 = joints
        c1x, c1z = -b0 + l1 * k.cos(q1), -e - l1 * k.sin(q1)
        c2x, c2z = b0 + l1 * k.cos(q2), -e - l1 * k.sin(q2)
        vx, vz = c2x - c1x, c2z - c1z
        d = k.hypot(vx, vz)
        half = 0.5 * d
        height = assembly * k.root((l2 - half) * (l2 + half))
        per_d = height / k.most(d, 0.0 * d + COINCIDENT_TOL_M)
        return (0.5 * (c1x + c2x) - per_d * vz, 0.5 * (c1z + c2z) + per_d * vx), (2.0 * l2 - d, d)

    def legs(self, k: Arithmetic[N], joints: Sequence[N], pose: Sequence[N]) -> Legs[N]:
        """IRSBot-2 sheet sections 5 and 6: rows r_k, levers l1 sin(q_k - psi_k)."""
        b0, e, l1, l2 = self.loop
        x, z = pose
        screws, sines, reach, closure = [], [], [], []
        far: list[N] = []
        for q, foot in zip(joints, (-b0, b0), strict=True):
            cq, sq = k.cos(q), k.sin(q)
            X, Z = x - foot, z + e
            rx, rz = X - l1 * cq, Z + l1 * sq
            error = k.hypot(rx, rz) - l2
            rx, rz = rx / l2, rz / l2  # (cos psi, -sin psi)
            screws.append((rx, rz))
            sines.append(sq * rx + cq * rz)  # sin(q - psi)
            r = k.hypot(X, Z)
            far.append(r)
            reach.append(k.least(l1 + l2 - r, r - abs(l1 - l2)))
            closure.append(error)
        levers = tuple([l1 * s for s in sines])
        constrained: tuple[N, ...] = self.constraint_parts(k, *screws[0], *screws[1])
        constraint = k.least(*constrained) if constrained else None
        parts = constrained + tuple(far)
        return Legs(tuple(screws), levers, tuple(sines), tuple(reach), tuple(closure), constraint, (), parts)

    def posture(self, joints: Sequence[float], assembly: int) -> Posture:
        """The equations of `direct` and `legs` once more, in one piece for one sample: three times as fast."""
        q1, q2 = joints
        if not isfinite(q1 + q2):
            return super().posture(joints, assembly)
        b0, e, l1, l2 = self.loop
        k1, s1, k2, s2 = cos(q1), sin(q1), cos(q2), sin(q2)
        c1x, c1z, c2x, c2z = l1 * k1 - b0, -e - l1 * s1, l1 * k2 + b0, -e - l1 * s2
        vx, vz = c2x - c1x, c2z - c1z
        d = hypot(vx, vz)
        slack = 2.0 * l2 - d
        if not (slack > 0.0 and d > COINCIDENT_TOL_M):
            return super().posture(joints, assembly)
        half = 0.5 * d
        height = assembly * sqrt((l2 - half) * (l2 + half)) / d
        x, z = 0.5 * (c1x + c2x) - height * vz, 0.5 * (c1z + c2z) + height * vx
        r1x, r1z, r2x, r2z = x - c1x, z - c1z, x - c2x, z - c2z
        off1, off2 = abs(hypot(r1x, r1z) - l2), abs(hypot(r2x, r2z) - l2)
        r1x, r1z, r2x, r2z = r1x / l2, r1z / l2, r2x / l2, r2z / l2
        sine1, sine2 = s1 * r1x + k1 * r1z, s2 * r2x + k2 * r2z
        far1, far2 = hypot(x + b0, z + e), hypot(x - b0, z + e)
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
            FLOATS.least(*constrained) if constrained else nan,
            (),
            off1 if off1 > off2 else off2,
            (),
            (*constrained, far1, far2),
        )

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

    # --- guarantees, one sample --------------------------------------------------------------------------------

    def guarantee(self, at: Posture, travel: Sequence[float], slack_m: float = 0.0) -> Guarantee:
        """Closed-form bounds. The elbow distance d changes by at most the elbows' paths; cos alpha depends on d alone
        and is unimodal; the platform moves by at most the elbows' paths over the smallest cos alpha met; each Type 1
        sine depends on |A_k P| alone and is unimodal; each rod turns by at most (platform + elbow path) / rod.
        An error of a leg displaces its elbow by at most the slack; A_k P is then seen from a displaced A_k."""
        _b0, _e, l1, l2 = self.loop
        elbows = l1 * (travel[0] + travel[1])
        path = elbows + 2.0 * slack_m
        d, full, parts = at.gaps[1], 2.0 * l2, at.parts
        low, high = d - path, d + path
        if not (low > 0.0 and high < full):
            return Guarantee((0.0, 0.0), 0.0, self.constraint_guarantee(parts, inf), ())
        low *= sqrt((full - low) * (full + low))
        high *= sqrt((full - high) * (full + high))
        type2 = (low if low < high else high) / (full * l2)
        apart = path / type2 + slack_m
        return Guarantee(
            (self._sine_floor(parts[-2], apart), self._sine_floor(parts[-1], apart)),
            type2,
            self.constraint_guarantee(parts, (2.0 * apart + elbows) / l2),  # turn of both rods together
            (),
        )

    def guarantee_along(
        self, at: Posture, half: Sequence[float], beside: Sequence[float], slack_m: float = 0.0
    ) -> Guarantee:
        """As `courses` bounds a course, in closed form. To first order elbows and platform move along straight lines,
        on which distances are known exactly; `rest` bounds what else each of them does. The constraint is looked at
        for the rods' turns of first order: between two looks it lies above their mean less what half a turn and the
        rest take."""
        b0, e, l1, l2 = self.loop
        (r1x, r1z), (r2x, r2z) = at.screws
        q1, q2 = at.joints
        h1, h2 = half
        size, parts = abs(at.det), at.parts
        nothing = Guarantee((0.0, 0.0), 0.0, self.constraint_guarantee(parts, inf), ())
        if not size > 0.0:
            return nothing
        most1, most2 = abs(h1) + beside[0], abs(h2) + beside[1]
        n1x, n1z, n2x, n2z = -l1 * h1 * sin(q1), -l1 * h1 * cos(q1), -l1 * h2 * sin(q2), -l1 * h2 * cos(q2)
        rest1 = l1 * (0.5 * most1 * most1 + beside[0]) + slack_m
        rest2 = l1 * (0.5 * most2 * most2 + beside[1]) + slack_m
        drive1, drive2 = r1x * n1x + r1z * n1z, r2x * n2x + r2z * n2z
        dx, dz = (r2z * drive1 - r1z * drive2) / at.det, (r1x * drive2 - r2x * drive1) / at.det
        turn1, turn2 = (r1x * (dz - n1z) - r1z * (dx - n1x)) / l2, (r2x * (dz - n2z) - r2z * (dx - n2x)) / l2
        way1, way2 = l2 * abs(turn1) + rest1, l2 * abs(turn2) + rest2
        rest = displacement(
            (rest1 + rest2 + 0.5 * (way1 * way1 + way2 * way2) / l2) / size,
            (way1 + way2) / (l2 * size),
            1.0 / (l2 * size),
        )
        chord1, chord2, full = (way1 + rest) / l2, (way2 + rest) / l2, 2.0 * l2
        low, high = _span(l2 * (r1x - r2x), l2 * (r1z - r2z), n2x - n1x, n2z - n1z, rest1 + rest2)
        if not (chord1 < 1.0 and chord2 < 1.0 and low > 0.0 and high < full):
            return nothing
        type2 = min(low * sqrt((full - low) * (full + low)), high * sqrt((full - high) * (full + high))) / (full * l2)
        x, z = at.pose
        type1 = (
            self._sine_between(*_span(x + b0, z + e, dx, dz, rest + slack_m)),
            self._sine_between(*_span(x - b0, z + e, dx, dz, rest + slack_m)),
        )
        off = (2.0 * rest + rest1 + rest2) / l2 + ASIN_BEND * (chord1 * chord1 * chord1 + chord2 * chord2 * chord2)
        constraint = self._constraint_along(at, turn1, turn2, off) if len(parts) > 2 else nan
        return Guarantee(type1, type2, constraint, ())

    def _constraint_along(self, at: Posture, turn1: float, turn2: float, off: float) -> float:
        """Constraint while the rods turn by s turn_k, s in -1..1, and by `off` together on top."""
        (r1x, r1z), (r2x, r2z) = at.screws
        c1, c2, turn, least = cos(turn1), cos(turn2), 0.5 * (abs(turn1) + abs(turn2)) + off, inf
        for s1, s2 in ((sin(turn1), sin(turn2)), (-sin(turn1), -sin(turn2))):
            there = self.constraint_parts(
                FLOATS, c1 * r1x - s1 * r1z, c1 * r1z + s1 * r1x, c2 * r2x - s2 * r2z, c2 * r2z + s2 * r2x
            )
            mean = tuple([0.5 * (a + b) for a, b in zip(at.parts[: len(there)], there, strict=True)])
            least = min(least, self.constraint_guarantee(mean, turn))
        return least

    def _sine_floor(self, r: float, move: float) -> float:
        """Smallest |sin(q - psi)| while |A P| stays within `move` of r."""
        return self._sine_between(r - move, r + move)

    def _sine_between(self, near: float, far: float) -> float:
        """Smallest |sin(q - psi)| for |A P| in a range: S^2 = 1 - ((r^2 - l1^2 - l2^2)/(2 l1 l2))^2."""
        middle, span = self._squares
        low, high = middle - near * near, far * far - middle
        worst = low if low > high else high
        return sqrt((span - worst) * (span + worst)) / span if near > 0.0 and worst < span else 0.0

    def clearance(self, at: Posture) -> float:
        """Type 1: exact. Type 2 with parallel rods: exact distance to the locus arcs of this working mode. Type 2 with
        rods in line: what the rods still have to turn, over their speed while the platform stays within a ball."""
        reach1, reach2 = at.reach
        reach = nearest = reach1 if reach1 < reach2 else reach2
        x, z = at.pose
        rod = self.loop.rod
        for cx, cz, toward_x, toward_z, cosine, from_x, from_z, to_x, to_z in self._arcs.get(at.working_mode, ()):
            dx, dz = x - cx, z - cz
            r = hypot(dx, dz)
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
        """What the distance to an arc takes: centre, direction of its middle, cosine of half its length, both ends."""
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


def _span(x: float, z: float, dx: float, dz: float, rest: float) -> tuple[float, float]:
    """Smallest and largest distance of (x, z) + s (dx, dz), s in -1..1, from the origin, if it is off by `rest`."""
    along, square = x * dx + z * dz, dx * dx + dz * dz
    high = hypot(x + dx, z + dz) if along > 0.0 else hypot(x - dx, z - dz)
    if abs(along) < square:
        low = abs(x * dz - z * dx) / hypot(dx, dz)  # the root of a square that is hardly a number has no digits
    else:
        low = hypot(x - dx, z - dz) if along > 0.0 else hypot(x + dx, z + dz)
    return low - rest, high + rest


def coincident_elbows(loop: Loop) -> list[tuple[float, float]]:
    """Joint positions where both elbows meet (psi_I = psi_II), sheet section 6: none, or two isolated points, which
    are one if the cranks just reach each other."""
    b0, l1 = loop.half_base, loop.crank
    if not 0.0 < abs(b0) <= l1:
        return []
    g = acos(abs(b0) / l1)
    return [(g, pi - g), (-g, g - pi)] if b0 > 0.0 else [(pi - g, g), (g - pi, -g)]


def coincident_arcs(loop: Loop, mode: Signs) -> list[Arc]:
    """Arcs of platform points with psi_I = psi_II in one working mode: |sin(q_k - psi)| keeps its sign between
    psi = q_k and q_k + pi, so each circle is cut at four angles."""
    arcs = []
    for q1, q2 in coincident_elbows(loop):
        cx, cz = -loop.half_base + loop.crank * cos(q1), -loop.drop - loop.crank * sin(q1)
        cuts = sorted({angle % tau for angle in (q1, q1 + pi, q2, q2 + pi)})
        for start, end in zip(cuts, [*cuts[1:], cuts[0] + tau], strict=True):
            middle = 0.5 * (start + end)
            if sin(q1 - middle) * mode[0] > 0.0 and sin(q2 - middle) * mode[1] > 0.0:
                arcs.append((cx, cz, start, end - start))
    return arcs


def arc_distance(dx: float, dz: float, radius: float, start: float, length: float) -> float:
    """Distance from a point, seen from the centre, to an arc."""
    after = (FLOATS.atan2(-dz, dx) - start) % tau
    if after <= length:
        return abs(hypot(dx, dz) - radius)
    return min(hypot(dx - radius * cos(end), dz + radius * sin(end)) for end in (start, start + length))
