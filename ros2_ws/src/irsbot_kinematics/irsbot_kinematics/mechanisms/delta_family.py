"""Linear Delta robots: three slides on straight rails, three rods of one length, a platform that only translates.

Slide C_i = o_i + rho_i u_i, rod from C_i to the platform point P, |P - C_i| = L. Orthoglide, Hybridglide, Triaglide
and UraneSX of [S4] differ in the rails alone. Source: [S4] (3)-(9) with the corrections listed in
docs/explanation/sources.md.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import asin, inf, nan, sin, sqrt
from operator import sub
from typing import NamedTuple

from irsbot_kinematics import statics
from irsbot_kinematics.bounds.boxes import Rod, reached
from irsbot_kinematics.bounds.displacement import EXACT, Errors, displacement, least_cosine, level_after
from irsbot_kinematics.bounds.sizes import distances
from irsbot_kinematics.mechanism import (
    CertifiedBounds,
    Coordinate,
    Cuspidal,
    Floats,
    Legs,
    Mechanism,
    Posture,
    Signs,
    Status,
    sign_of,
)
from irsbot_kinematics.mechanisms.geometry_checks import require, require_finite, require_size
from irsbot_kinematics.numerics.arithmetic import FLOATS, Arithmetic, N
from irsbot_kinematics.numerics.tolerances import CLOSURE_TOL_M, COINCIDENT_TOL_M, FARTHEST
from irsbot_kinematics.skeleton import BASE, HERE, Cut, Link, Skeleton, Vector, added, cross, dot, scaled
from irsbot_kinematics.skeleton import Rod as Bar

CLEARANCE_BALL = 0.9
"""1: share of the smallest reach within which the clearance from Type 2 is searched."""
_TINY = 1e-200
"""m, m^2 or m^4: keeps a quotient defined if slides coincide or are in line; the assembly clearances then mark the
result as invalid."""


class Rail(NamedTuple):
    """A rail: the slide's place at rho = 0 (m), and the unit vector along which it moves."""

    origin: Vector
    direction: Vector


@dataclass(frozen=True)
class DeltaGeometry:
    """Lengths in metres."""

    L: float
    """Rods."""
    limits: tuple[float, float]
    """Open range of every slide."""

    def __post_init__(self) -> None:
        require_finite(self)
        require_size(self, 2, "limits")
        require("L > 0", self.L > 0.0, self.L, 0.0)
        lower, upper = self.limits
        require("limits[0] < limits[1]", lower < upper, lower, upper)


class DeltaFamily(Mechanism):
    """Joints: slides rho_i in m. Task: x, y, z of the platform point.

    Working mode s_i = sign of rho_i - (P - o_i).u_i: the slide ahead of or behind the platform along its rail. Assembly
    mode = sign of det A: the side of the plane of the slides on which the platform is.
    """

    geometry: DeltaGeometry
    rails: tuple[Rail, Rail, Rail]
    cuspidal = Cuspidal(
        "no", "two assembly modes, mirror images with opposite signs of det A at the same joints: the sign is a label"
    )

    def __init__(self, geometry: DeltaGeometry) -> None:
        self.geometry = geometry
        self.rod = self.length_m = geometry.L
        self.joints = tuple(Coordinate(f"slide_{i}", "m", *geometry.limits) for i in (1, 2, 3))
        self.task = tuple(Coordinate(name, "m", -inf, inf) for name in "xyz")
        self.working_modes = tuple((a, b, c) for a in (1, -1) for b in (1, -1) for c in (1, -1))
        self.assembly_modes = (-1, 1)
        self.usual_working_mode = (1, 1, 1)
        self.usual_assembly_mode = -1
        self._nothing = CertifiedBounds((0.0, 0.0, 0.0), 0.0, nan, (0.0, 0.0, 0.0)[: self.limb_count])

    # --- equations, floats or arrays -------------------------------------------------------------------------

    def inverse(self, k: Arithmetic[N], pose: Sequence[N], mode: Signs) -> tuple[tuple[N, ...], tuple[N, ...]]:
        """rho_i = (P - o_i).u_i + s_i sqrt(L^2 - d_i^2), d_i the distance of P from rail i; reach L - d_i."""
        x, y, z = pose
        joints, reach = [], []
        for ((ox, oy, oz), (ux, uy, uz)), sign in zip(self.rails, mode, strict=True):
            dx, dy, dz = x - ox, y - oy, z - oz
            along = dx * ux + dy * uy + dz * uz
            cx, cy, cz = dy * uz - dz * uy, dz * ux - dx * uz, dx * uy - dy * ux
            across = k.safe_sqrt(cx * cx + cy * cy + cz * cz)
            joints.append(along + sign * k.safe_sqrt((self.rod - across) * (self.rod + across)))
            reach.append(self.rod - across)
        return tuple(joints), tuple(reach)

    def direct(self, k: Arithmetic[N], joints: Sequence[N], assembly: int) -> tuple[tuple[N, ...], tuple[N, N]]:
        """P = circumcentre of the slides +- sqrt(L^2 - Rc^2) along their plane's normal n = e x g.

        Gaps: [0] L (L - Rc)/(L + Rc), defined for slides in line too; [1] at most, and at least 1/sqrt(3) of, the
        smallest height of the triangle of the slides.
        """
        L = self.rod
        (x, y, z), (x2, y2, z2), (x3, y3, z3) = self.slides(joints)
        ex, ey, ez, gx, gy, gz = x2 - x, y2 - y, z2 - z, x3 - x, y3 - y, z3 - z
        hx, hy, hz = gx - ex, gy - ey, gz - ez
        nx, ny, nz = ey * gz - ez * gy, ez * gx - ex * gz, ex * gy - ey * gx
        ee, gg, hh = ex * ex + ey * ey + ez * ez, gx * gx + gy * gy + gz * gz, hx * hx + hy * hy + hz * hz
        nn = nx * nx + ny * ny + nz * nz
        product = ee * gg * hh  # Rc^2 = product / (4 nn)
        double_area, sides = k.sqrt(nn), k.sqrt(product) / L
        gap = L * (2.0 * double_area - sides) / (2.0 * double_area + sides + _TINY)
        per_nn = 1.0 / (nn + _TINY)
        half = 0.5 * per_nn
        vx, vy, vz = gg * ex - ee * gx, gg * ey - ee * gy, gg * ez - ee * gz
        up = assembly * k.safe_sqrt((L * L - 0.5 * half * product) * per_nn)
        return (
            x + (ny * vz - nz * vy) * half + up * nx,
            y + (nz * vx - nx * vz) * half + up * ny,
            z + (nx * vy - ny * vx) * half + up * nz,
        ), (gap, double_area / (k.sqrt(ee + gg + hh) + _TINY))

    def slides(self, joints: Sequence[N]) -> tuple[tuple[N, N, N], ...]:
        """C_i = o_i + rho_i u_i, m."""
        return tuple(
            [
                (ox + q * ux, oy + q * uy, oz + q * uz)
                for ((ox, oy, oz), (ux, uy, uz)), q in zip(self.rails, joints, strict=True)
            ]
        )

    def legs(self, k: Arithmetic[N], joints: Sequence[N], pose: Sequence[N]) -> Legs[N]:
        """Rows (P - C_i)/L; levers and sines (rho_i - (P - o_i).u_i)/L: cosine between rod and rail."""
        L = self.rod
        x, y, z = pose
        screws, normalised_levers, reach, closure = [], [], [], []
        for (cx, cy, cz), (_, (ux, uy, uz)) in zip(self.slides(joints), self.rails, strict=True):
            rx, ry, rz = (x - cx) / L, (y - cy) / L, (z - cz) / L
            square = rx * rx + ry * ry + rz * rz
            along = rx * ux + ry * uy + rz * uz
            screws.append((rx, ry, rz))
            normalised_levers.append(-along)
            reach.append(L - L * k.safe_sqrt(square - along * along))
            closure.append(L * k.sqrt(square) - L)
        levers = tuple(normalised_levers)
        limb = tuple([k.abs(sine) for sine in normalised_levers[: self.limb_count]])
        return Legs(tuple(screws), levers, levers, tuple(reach), tuple(closure), None, limb)

    def skeleton(self) -> Skeleton:
        """Rods on universal joints in place of parallelograms: both keep the platform parallel to the base. The first
        rod carries it."""
        links, rails = [], []
        low, high = self.geometry.limits
        for joint, rod, (origin, along) in zip(self.joints, self._rods, self.rails, strict=True):
            links.append(Link(rod.parent, joint.name, BASE, origin, along, slides=True))
            links += rod.links()
            rails.append((added(origin, scaled(low, along)), added(origin, scaled(high, along))))
        links += self._rods[0].carry((HERE,))
        cuts = tuple(Cut(rod.name, rod.end, HERE) for rod in self._rods[1:])
        return Skeleton(tuple(links), tuple(joint.name for joint in self.joints), cuts, self._passive, tuple(rails))

    @property
    def _rods(self) -> list[Bar]:
        """Each on its slide; the first axis is normal to the rail."""
        rods = []
        for leg, (_, (x, y, z)) in enumerate(self.rails, 1):
            aside = (0.0, z, -y) if abs(x) <= abs(y) else (-z, 0.0, x)
            turn = scaled(1.0 / sqrt(dot(aside, aside)), aside)
            rods.append(Bar(f"rod_{leg}", f"carriage_{leg}", HERE, turn, cross((x, y, z), turn), self.rod))
        return rods

    def _passive(self, joints: Floats, pose: Floats) -> dict[str, float]:
        angles: dict[str, float] = {}
        ways = [(x, y, z) for x, y, z in self.at(joints, pose, 0, (0.0, 0.0)).screws]
        for rod, way in zip(self._rods, ways, strict=True):
            angles.update(rod.near(way))
        return {**angles, **self._rods[0].far(ways[0])}

    def posture(self, joints: Sequence[float], assembly: int) -> Posture:
        """The equations of `direct` and `legs` in one function for one sample: twice as fast."""
        q1, q2, q3 = joints
        if not abs(q1) + abs(q2) + abs(q3) <= FARTHEST:
            return super().posture(joints, assembly)
        L = self.rod
        (o1x, o1y, o1z), (u1x, u1y, u1z) = self.rails[0]
        (o2x, o2y, o2z), (u2x, u2y, u2z) = self.rails[1]
        (o3x, o3y, o3z), (u3x, u3y, u3z) = self.rails[2]
        x1, y1, z1 = o1x + q1 * u1x, o1y + q1 * u1y, o1z + q1 * u1z
        x2, y2, z2 = o2x + q2 * u2x, o2y + q2 * u2y, o2z + q2 * u2z
        x3, y3, z3 = o3x + q3 * u3x, o3y + q3 * u3y, o3z + q3 * u3z
        ex, ey, ez, gx, gy, gz = x2 - x1, y2 - y1, z2 - z1, x3 - x1, y3 - y1, z3 - z1
        hx, hy, hz = gx - ex, gy - ey, gz - ez
        nx, ny, nz = ey * gz - ez * gy, ez * gx - ex * gz, ex * gy - ey * gx
        ee, gg, hh = ex * ex + ey * ey + ez * ez, gx * gx + gy * gy + gz * gz, hx * hx + hy * hy + hz * hz
        nn = nx * nx + ny * ny + nz * nz
        product = ee * gg * hh
        double_area, sides = sqrt(nn), sqrt(product) / L
        gap = L * (2.0 * double_area - sides) / (2.0 * double_area + sides + _TINY)
        height = double_area / (sqrt(ee + gg + hh) + _TINY)
        if not (gap > 0.0 and height > COINCIDENT_TOL_M):
            return super().posture(joints, assembly)
        half = 0.5 / nn
        vx, vy, vz = gg * ex - ee * gx, gg * ey - ee * gy, gg * ez - ee * gz
        up = assembly * sqrt(max(L * L - 0.5 * half * product, 0.0) / nn)
        x = x1 + (ny * vz - nz * vy) * half + up * nx
        y = y1 + (nz * vx - nx * vz) * half + up * ny
        z = z1 + (nx * vy - ny * vx) * half + up * nz
        ax, ay, az = (x - x1) / L, (y - y1) / L, (z - z1) / L
        bx, by, bz = (x - x2) / L, (y - y2) / L, (z - z2) / L
        cx, cy, cz = (x - x3) / L, (y - y3) / L, (z - z3) / L
        aa, bb, cc = ax * ax + ay * ay + az * az, bx * bx + by * by + bz * bz, cx * cx + cy * cy + cz * cz
        s1 = -(ax * u1x + ay * u1y + az * u1z)
        s2 = -(bx * u2x + by * u2y + bz * u2z)
        s3 = -(cx * u3x + cy * u3y + cz * u3z)
        px, py, pz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        qx, qy, qz = cy * az - cz * ay, cz * ax - cx * az, cx * ay - cy * ax
        rx, ry, rz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        det = ax * px + ay * py + az * pz
        size = abs(det)
        normalised_levers = (s1, s2, s3)
        residual = L * max(abs(sqrt(aa) - 1.0), abs(sqrt(bb) - 1.0), abs(sqrt(cc) - 1.0))
        if not residual <= CLOSURE_TOL_M:
            return super().posture(joints, assembly)
        return Posture(
            Status.SOLVED,
            (q1, q2, q3),
            (x, y, z),
            (sign_of(s1), sign_of(s2), sign_of(s3)),
            assembly,
            ((ax, ay, az), (bx, by, bz), (cx, cy, cz)),
            normalised_levers,
            normalised_levers,
            (
                L - L * sqrt(max(aa - s1 * s1, 0.0)),
                L - L * sqrt(max(bb - s2 * s2, 0.0)),
                L - L * sqrt(max(cc - s3 * s3, 0.0)),
            ),
            (gap, height),
            (
                FLOATS.ratio(size, sqrt(px * px + py * py + pz * pz)),
                FLOATS.ratio(size, sqrt(qx * qx + qy * qy + qz * qz)),
                FLOATS.ratio(size, sqrt(rx * rx + ry * ry + rz * rz)),
            ),
            det,
            nan,
            (abs(s1), abs(s2), abs(s3))[: self.limb_count],
            residual,
            (),
            (),
        )

    def bias(self, at: Posture, joint_rates: Sequence[float], pose_rates: Sequence[float]) -> Floats:
        """Second derivative of |P - C_i|^2/(2 L): c_i = |Pdot - rhodot_i u_i|^2/L."""
        vx, vy, vz = pose_rates
        c = []
        for (_, (ux, uy, uz)), rate in zip(self.rails, joint_rates, strict=True):
            c.append(((vx - rate * ux) ** 2 + (vy - rate * uy) ** 2 + (vz - rate * uz) ** 2) / self.rod)
        return tuple(c)

    # --- guarantees, one sample --------------------------------------------------------------------------------

    def certified_bounds(self, at: Posture, travel: Sequence[float], slack_m: float = 0.0) -> CertifiedBounds:
        """The platform moves by at most guarantees.displacement, with |column i of A^-1| = 1/cos alpha_i.

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
