"""IRSBot-2: two translations in a plane with two spatial legs.

Sources: [S1] Germain et al. 2011 for the kinematics, [S0] Germain et al. 2013 for the constraint singularities, both
with the corrections listed in docs/explanation/sources.md. The planar kinematics is that of the equivalent five-bar;
the spatial legs add the constraint margin.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import asin, atan2, cos, hypot, inf, pi, sin, sqrt
from typing import ClassVar

import numpy as np

from irsbot_kinematics.bounds.sizes import least_singular
from irsbot_kinematics.mechanism import Floats, Legs, Posture, Signs
from irsbot_kinematics.mechanisms.irsbot2_space import constraint_columns
from irsbot_kinematics.mechanisms.irsbot2_space.geometry import Irsbot2Geometry
from irsbot_kinematics.mechanisms.irsbot2_space.singular_postures import reachability, singular_postures
from irsbot_kinematics.mechanisms.planar_loop import Loop
from irsbot_kinematics.mechanisms.planar_pair import PlanarPair
from irsbot_kinematics.numerics.arithmetic import Arithmetic, Array, N
from irsbot_kinematics.skeleton import BASE, Cut, Link, Rod, Skeleton, Vector, Y, added

_SMALLEST = 1e-150
"""m: keeps the normal of a rod defined if its leg has length 0, which requires l2eq = D; nothing is certified then."""
ROOT2 = sqrt(2.0)


class Irsbot2(PlanarPair):
    """Joints: angles of the two proximal arms. Task: x, z of the platform point."""

    kind: ClassVar[str] = "irsbot2"
    geometry: Irsbot2Geometry

    def __init__(self, geometry: Irsbot2Geometry) -> None:
        g = geometry
        super().__init__(Loop(g.b0, g.e, g.l1, g.l2eq))
        self.geometry = geometry
        self._places: dict[Signs, list[tuple[float, float, float]]] | None = None
        s, c = sin(g.beta), cos(g.beta)
        # Numbers of sheet section 7 that do not depend on the posture.
        self._numbers = (s, c, g.l2eq, g.D, g.ell / g.Lc, 2.0 * g.p / g.Lc)
        turn = _largest_normal_turn(g.l2eq, g.D, c)
        self._slope_y = sqrt(2.0) * s * turn
        self._slope_xz = sqrt(2.0 * turn * turn + (g.ell / g.Lc) ** 2) if turn < inf else inf

    def constraint_parts(self, k: Arithmetic[N], c1: N, mz1: N, c2: N, mz2: N) -> tuple[N, N]:
        """sigma_y (0: Condition 1) and sigma_xz (0: Condition 2) of sheet section 7.

        Their minimum is kappa, the third singular value of the platform's constraint moments: 0 iff the platform
        gains a rotation. sigma_y lies in 0..2 sin(beta).
        """
        s, c, l2, D, reach_x, offset_x = self._numbers
        ux, uz = c * (l2 * c1 + D), l2 * mz1
        vx, vz = c * (l2 * c2 - D), l2 * mz2
        nu, nv = k.hypot(ux, uz) + _SMALLEST, k.hypot(vx, vz) + _SMALLEST  # see _SMALLEST
        ux, uz, vx, vz = ux / nu, uz / nu, vx / nv, vz / nv
        sigma_y = s * k.sqrt(2.0 * (ux * ux + vx * vx))
        ux, vx = c * ux, c * vx
        # P_IP_II.z / Lc and -P_IP_II.x / Lc
        wx = reach_x * (mz2 - mz1)
        wz = reach_x * (c1 - c2) - offset_x
        uv, uw, vw = ux * vz - uz * vx, ux * wz - uz * wx, vx * wz - vz * wx
        det = 4.0 * uv * uv + 2.0 * (uw * uw + vw * vw)
        trace = 2.0 * (ux * ux + uz * uz + vx * vx + vz * vz) + wx * wx + wz * wz
        sigma_xz = k.sqrt(2.0 * det / (trace + k.safe_sqrt(trace * trace - 4.0 * det)))
        return sigma_y, sigma_xz

    def constraint_bound(self, parts: Floats, turn_rad: float) -> float:
        """Singular values change by no more than the Frobenius norm of the change of the matrix (Weyl); its columns
        are rod normals, which turn by at most a known multiple of the rods' turn, and (y x P_IP_II)/Lc."""
        if not turn_rad < inf:
            return 0.0
        left_y, left_xz = parts[0] - self._slope_y * turn_rad, parts[1] - self._slope_xz * turn_rad
        left = left_y if left_y < left_xz else left_xz
        return left if left > 0.0 else 0.0

    def constraint_bound_many(self, parts: Sequence[Array], turn_rad: Array) -> Array:
        """The equation of `constraint_bound`."""
        left = np.minimum(parts[0] - self._slope_y * turn_rad, parts[1] - self._slope_xz * turn_rad)
        return np.where(left > 0.0, left, 0.0)

    def constraint_over(
        self, at: Posture, turns: tuple[tuple[float, float], tuple[float, float]], rests: tuple[float, float]
    ) -> float:
        """sigma_y from the ranges of both rods' directions, exact. sigma_xz is the second singular value of the columns
        sqrt 2 n_I, sqrt 2 n_II, (y x P_IP_II)/Lc, projected on x and z; of them the first derivatives are exact, the
        second ones bounded (boxes.least_singular)."""
        s, c, l2, D, reach, offset = self._numbers
        (c1, m1), (c2, m2) = at.screws
        normals, square, room = [], 0.0, 0.0
        for cosine, down, side, (a, b), rest in ((c1, m1, D, turns[0], rests[0]), (c2, m2, -D, turns[1], rests[1])):
            turn = abs(a) + abs(b)
            low, high = _cosines(cosine, down, turn + rest)
            normal = _normal_over(l2, side, c, low, high)
            x, z = c * (l2 * cosine + side), l2 * down
            size = hypot(x, z)
            if normal is None or not size > 0.0:
                return 0.0
            least, rate, bend = normal
            square += least * least
            x, z = x / size, z / size
            slope = c * (l2 + side * cosine) * l2 / (size * size)  # turn of the normal per turn of the rod
            normals.append((c * x, z, -c * z * slope, x * slope, a, b))
            error = 0.5 * bend * turn * turn + rate * rest
            room += 2.0 * error * error
        error = reach * sum(
            [0.5 * (abs(a) + abs(b)) ** 2 + rest for (a, b), rest in zip(turns, rests, strict=True)], 0.0
        )
        (ux, uz, dux, duz, u1, u2), (vx, vz, dvx, dvz, v1, v2) = normals
        # P_IP_II.z / Lc and -P_IP_II.x / Lc; a rod (cos, -sin) that turns by t gains t (sin, cos).
        base = ((ROOT2 * ux, ROOT2 * uz), (ROOT2 * vx, ROOT2 * vz), (reach * (m2 - m1), reach * (c1 - c2) - offset))
        ways = [
            (
                (ROOT2 * dux * a, ROOT2 * duz * a),
                (ROOT2 * dvx * b, ROOT2 * dvz * b),
                (reach * (c2 * b - c1 * a), reach * (m2 * b - m1 * a)),
            )
            for a, b in ((u1, v1), (u2, v2))
        ]
        sigma_y = s * sqrt(2.0 * square)
        sigma_xz = least_singular(base, ways, sqrt(room + error * error))
        return sigma_y if sigma_y < sigma_xz else sigma_xz

    def constraint_over_many(
        self, legs: Legs[Array], turns: tuple[tuple[Array, Array], tuple[Array, Array]], error: Array
    ) -> Array:
        """The equations of `constraint_over`."""
        return constraint_columns.constraint_over(self._numbers, legs.screws, turns, error)

    def skeleton(self) -> Skeleton:
        """The elbows stay level, which takes the proximal parallelograms; the first rod of leg I carries the platform.
        Points and axes of sheet section 1: axis e_1jk of a rod is the first one of its universal joints."""
        g, links, cuts = self.geometry, [], []
        for leg, (joint, sign) in enumerate(zip(self.joints, (1.0, -1.0), strict=True), 1):
            links.append(Link(f"arm_{leg}", joint.name, BASE, (-sign * g.b, 0.0, 0.0), Y, shape=((g.l1, 0.0, 0.0),)))
            ends = tuple(rod.origin for rod, _corner in self._rods(leg, sign))
            links.append(Link(f"elbow_{leg}", f"elbow_{leg}", f"arm_{leg}", (g.l1, 0.0, 0.0), Y, shape=ends))
            for rod, corner in self._rods(leg, sign):
                links += rod.links()
                cuts.append(Cut(rod.name, rod.end, corner))
        (carrier, _), _ = self._rods(1, 1.0)
        links += carrier.carry([cut.platform_point for cut in cuts])
        drives = tuple(joint.name for joint in self.joints)
        return Skeleton(tuple(links), drives, tuple(cuts[1:]), self._passive)

    def _rods(self, leg: int, sign: float) -> list[tuple[Rod, Vector]]:
        """Both rods of a leg relative to its elbow, and their attachments relative to the platform point."""
        g = self.geometry
        s, c = sin(g.beta), cos(g.beta)
        found = []
        for number, side in ((1, -1.0), (2, 1.0)):
            axis = (sign * s, side * c, 0.0)
            x, y, _z = axis
            rod = Rod(f"rod_{leg}{number}", f"elbow_{leg}", (g.a1 * x, g.a1 * y, -g.e), axis, (0.0, 0.0, -1.0), g.l2)
            found.append((rod, (g.a2 * x - sign * (g.p + g.a2 * s), g.a2 * y, 0.0)))
        return found

    def _passive(self, joints: Floats, pose: Floats) -> dict[str, float]:
        g, angles = self.geometry, {}
        for leg, (q, sign) in enumerate(zip(joints, (1.0, -1.0), strict=True), 1):
            angles[f"elbow_{leg}"] = -q
            elbow = (g.l1 * cos(q) - sign * g.b, 0.0, -g.l1 * sin(q))
            for rod, (x, y, _z) in self._rods(leg, sign):
                start = added(elbow, rod.origin)
                way = (pose[0] + x - start[0], y - start[1], pose[1] - start[2])
                angles.update(rod.near(way))
                if rod.name == "rod_11":
                    angles.update(rod.far(way))
        return angles

    def foot_error(self, slack_m: float) -> float:
        """Along x the places of motor and wrist and the arm's a1 sin(beta), along z both places and e."""
        g, tilt = self.geometry, slack_m / self.geometry.a1
        if not tilt < min(g.beta, 0.5 * pi - g.beta):
            return inf
        longest = (g.a1 + slack_m) * sin(g.beta + tilt)
        shortest = (g.a1 - slack_m) * sin(g.beta - tilt)
        inwards = g.a1 * sin(g.beta)
        return hypot(2.0 * slack_m + max(longest - inwards, inwards - shortest), 3.0 * slack_m)

    def parts_left(self, at: Posture, turn_rad: float, slack_m: float) -> Floats:
        """At fixed psi a rod's normal changes with the direction of (c (cos psi + sigma D/l2eq), -sin psi), whose size
        falls by no more than the rods' turn, and with beta; P_I P_II/Lc with p, mu l2eq and the wrists' places."""
        g, s, tilt = self.geometry, slack_m, slack_m / self.geometry.a1
        sine, c, l2, D, _, _ = self._numbers
        nothing = (0.0, 0.0, *at.parts[2:])
        if not (tilt < min(g.beta, 0.5 * pi - g.beta) and 2.0 * s < g.a1 - g.a2 and s < l2):
            return nothing
        less_cos, less_sin = c - cos(g.beta + tilt), sine - sin(g.beta - tilt)  # both concave: the larger changes
        apart, share = g.a1 - g.a2, D / l2
        change = max(
            (apart + 2.0 * s) * sin(g.beta + tilt) / (l2 - s) - share,
            share - (apart - 2.0 * s) * sin(g.beta - tilt) / (l2 + s),
        )
        off = less_cos * (1.0 + share + change) + c * change
        turns = []
        for (rx, rz), inwards in zip(at.screws, (share, -share), strict=True):
            size = max(hypot(c * (rx + inwards), rz) - turn_rad, c * abs(1.0 - share))
            if not off < size:
                return nothing
            turns.append(asin(off / size))
        longer = max(
            (g.a2 + s) * (l2 + s) / (apart - 2.0 * s) - g.ell, g.ell - (g.a2 - s) * (l2 - s) / (apart + 2.0 * s)
        )
        scale = 2.0 * (s + longer)  # change of Lc
        if not scale < g.Lc:
            return nothing
        line = (2.0 * (sqrt(2.0) * s + longer) + scale) / (g.Lc - scale)
        one, two = turns
        less_y = sqrt(2.0) * hypot(sine * one + less_sin, sine * two + less_sin)
        less_xz = hypot(sqrt(2.0) * hypot(one + less_cos, two + less_cos), line)
        return (at.parts[0] - less_y, at.parts[1] - less_xz, *at.parts[2:])

    def clearance(self, at: Posture) -> float:
        """Clearance of the planar pair, and exact for the constraint singularities: points of the workspace of one
        mode."""
        nearest = super().clearance(at)
        x, z = at.pose
        for cx, cz, radius in self.constraint_places.get(at.working_mode, ()):
            dx, dz = x - cx, z - cz
            away = abs(sqrt(dx * dx + dz * dz) - radius)
            if away < nearest:
                nearest = away
        return nearest

    def prepare(self) -> None:
        """Compute the places of the constraint singularities: milliseconds, and an import."""
        _ = self.constraint_places

    def constraint_points(self, mode: Signs) -> tuple[Floats, ...]:
        return tuple((x, z) for x, z, radius in self.constraint_places[mode] if radius == 0.0)

    @property
    def constraint_places(self) -> dict[Signs, list[tuple[float, float, float]]]:
        """Per working mode, poses of constraint singularities: circles (x, z, radius) in m. The radius is 0 unless the
        arms can hold the singular posture at every angle."""
        if self._places is None:
            self._places = self._found_places()
        return self._places

    def _found_places(self) -> dict[Signs, list[tuple[float, float, float]]]:
        g = self.geometry
        places: dict[Signs, list[tuple[float, float, float]]] = {mode: [] for mode in self.working_modes}
        for posture in singular_postures(g):
            held = reachability(g, posture)
            for placement in held.placements:
                if placement.working_mode in places:  # else a leg is straight: Type 1 is there too
                    places[placement.working_mode].append((*placement.pose, 0.0))
            if held.anywhere:
                psi = posture.psi[0]
                for mode in places:
                    places[mode].append((g.l2eq * cos(psi) - g.b0, -g.e - g.l2eq * sin(psi), g.l1))
        return places


def _cosines(cosine: float, down: float, turn: float) -> tuple[float, float]:
    """Smallest and largest cosine of a direction (cos, -sin) that turns by at most `turn`."""
    if not turn < pi:
        return -1.0, 1.0
    angle = atan2(abs(down), cosine)  # 0..pi
    low = -1.0 if angle + turn >= pi else cos(angle + turn)
    high = 1.0 if angle - turn <= 0.0 else cos(angle - turn)
    return low, high


def _normal_over(l2: float, D: float, c: float, low: float, high: float) -> tuple[float, float, float] | None:
    """Over rods with X = cos psi in low..high: the smallest |x| of the unit normal (c (l2 X + D), -l2 sin psi)/|.|, the
    largest turn of the normal per turn of the rod, and the largest size of its second derivative; None where the normal
    may vanish.

    |normal|^2 = p X^2 + r X + t is concave, its x^2 over z^2 is stationary at X = -D/l2, where x is 0, and at
    X = -l2/D; the turn is c l2 (l2 + D X)/|normal|^2.
    """
    p, r, t = l2 * l2 * (c * c - 1.0), 2.0 * c * c * l2 * D, c * c * D * D + l2 * l2
    below = [(p * X + r) * X + t for X in (low, high)]
    small = min(below)
    if not small * small > 0.0:
        return None
    least = 0.0
    if not low <= -D / l2 <= high:
        places = [low, high]
        if D != 0.0 and low < -l2 / D < high:
            places.append(-l2 / D)
        least = min([c * abs(l2 * X + D) / sqrt((p * X + r) * X + t) for X in places])
    rate = c * l2 * max(abs(l2 + D * low), abs(l2 + D * high)) / small
    # d rate/dX is c l2 N/|normal|^4 with N = -D p X^2 - 2 p l2 X + D t - l2 r, stationary at X = -l2/D.
    ends = [low, high, *([-l2 / D] if D != 0.0 and low < -l2 / D < high else [])]
    most = max([abs((-D * p * X - 2.0 * p * l2) * X + D * t - l2 * r) for X in ends])
    sine = 1.0 if low <= 0.0 <= high else sqrt(max(1.0 - min(low * low, high * high), 0.0))
    slope = c * l2 * most * sine / (small * small)
    return least, rate, hypot(rate * rate, slope)


def _largest_normal_turn(l2: float, D: float, c: float) -> float:
    """Largest turn of a rod's unit normal n_jk per radian of psi, over all psi; infinite if the rod can vanish.

    With X = cos psi the turn is c l2 |l2 + D X| / (c^2 (l2 X + D)^2 + l2^2 (1 - X^2)); leg II is leg I mirrored. A
    quotient (a + b X)/(p X^2 + r X + t) is largest at X = +-1 or where b p X^2 + 2 a p X + a r - b t = 0.
    """
    p, r, t = l2 * l2 * (c * c - 1.0), 2.0 * c * c * l2 * D, c * c * D * D + l2 * l2
    stationary = [-1.0, 1.0, *_real_roots(D * p, 2.0 * l2 * p, l2 * r - D * t)]
    turns = []
    for X in stationary:
        if -1.0 <= X <= 1.0:
            below = (p * X + r) * X + t
            turns.append(c * l2 * abs(l2 + D * X) / below if below > 0.0 else inf)
    return max(turns)


def _real_roots(a: float, b: float, c: float) -> list[float]:
    """Real roots of a X^2 + b X + c, without cancellation."""
    if a == 0.0:
        return [-c / b] if b != 0.0 else []
    delta = b * b - 4.0 * a * c
    if delta < 0.0:
        return []
    half = -0.5 * (b + (sqrt(delta) if b >= 0.0 else -sqrt(delta)))
    return [half / a, *([c / half] if half != 0.0 else [])]
