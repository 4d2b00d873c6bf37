"""Kinematics of linear Delta robots: three slides on straight rails, three rods of one length, a platform that only
translates.

Slide C_i = o_i + rho_i u_i, rod from C_i to the platform point P, |P - C_i| = L. Orthoglide, Hybridglide, Triaglide
and UraneSX of [S4] differ in the rails alone. Source: [S4] (3)-(9) with the corrections listed in
docs/explanation/sources.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, nan, sqrt
from typing import NamedTuple

from irsbot_kinematics.mechanism import Coordinate, Cuspidal, Floats, Legs, Mechanism, Posture, Signs, Status, sign_of
from irsbot_kinematics.mechanisms.geometry_checks import require, require_finite, require_size
from irsbot_kinematics.numerics.arithmetic import FLOATS, Arithmetic, N
from irsbot_kinematics.numerics.tolerances import CLOSURE_TOL_M, COINCIDENT_TOL_M, FARTHEST
from irsbot_kinematics.skeleton import BASE, HERE, Cut, Link, Rod, Skeleton, Vector, added, cross, dot, scaled

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


class DeltaKinematics(Mechanism):
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
    def _rods(self) -> list[Rod]:
        """Each on its slide; the first axis is normal to the rail."""
        rods = []
        for leg, (_, (x, y, z)) in enumerate(self.rails, 1):
            aside = (0.0, z, -y) if abs(x) <= abs(y) else (-z, 0.0, x)
            turn = scaled(1.0 / sqrt(dot(aside, aside)), aside)
            rods.append(Rod(f"rod_{leg}", f"carriage_{leg}", HERE, turn, cross((x, y, z), turn), self.rod))
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
