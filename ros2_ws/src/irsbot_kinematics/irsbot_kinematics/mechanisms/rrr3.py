"""Planar 3-RRR with actuated elbows and equilateral triangles.

Source: [S2], corrected as docs/explanation/sources.md lists.

Frame: x, y in the plane, turns counter-clockwise. Base corners A_i and platform corners B_i at 210, 330 and 90 deg.
Elbow i sets the distance rho_i = |A_iB_i| = 2 l |cos(q_i/2)|; the leg pushes along A_iB_i.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, cos, hypot, inf, nan, pi, sin, sqrt
from typing import ClassVar

from irsbot_kinematics.bounds.boxes import Reached, Rod
from irsbot_kinematics.bounds.displacement import CHORD, EXACT, HALF, Errors
from irsbot_kinematics.mechanism import Coordinate, Cuspidal, Floats, Legs, Posture, Signs, Status, sign_of
from irsbot_kinematics.mechanisms.geometry_checks import require, require_finite
from irsbot_kinematics.mechanisms.turning_platform import Travel, TurningPlatform
from irsbot_kinematics.numerics.arithmetic import FLOATS, Arithmetic, N
from irsbot_kinematics.numerics.tolerances import CLOSURE_TOL_M, COINCIDENT_TOL_M
from irsbot_kinematics.skeleton import BASE, Cut, Link, Skeleton, Z, planar_end

_CORNERS = tuple((cos(angle), sin(angle)) for angle in (7.0 * pi / 6.0, 11.0 * pi / 6.0, 0.5 * pi))
_TINY = 1e-150
"""m or m^2: keeps a quotient defined if a leg is folded to length 0; the assembly clearances then mark the result as
invalid."""


@dataclass(frozen=True)
class Rrr3Geometry:
    """Lengths in metres."""

    rb: float
    """Circumradius of the base triangle."""
    rp: float
    """Circumradius of the platform triangle."""
    l: float
    """Both links of every leg."""

    def __post_init__(self) -> None:
        require_finite(self)
        for name in ("rb", "rp", "l"):
            require(f"{name} > 0", getattr(self, name) > 0.0, getattr(self, name), 0.0)
        apart = abs(self.rb - self.rp)
        require("|rb - rp| <= 2 l (assembly)", apart <= 2.0 * self.l, apart, 2.0 * self.l)


class Rrr3(TurningPlatform):
    """Joints: elbow angles q_i in -pi..pi, 0 stretched, pi folded. Task: x, y of the platform centre, its turn phi.

    Working mode: signs of q_i. Assembly mode: its sign is that of det A; 1 with the platform centre inside the circle
    of Type 2 (|p|^2 < K), 2 outside; K = rb^2 + rp^2 - 2 rb rp cos phi. A folded leg can swing
    about its base joint while everything else stands, and pushes in no direction: the limb margin is |cos(q_i/2)|.
    """

    kind: ClassVar[str] = "rrr3"
    geometry: Rrr3Geometry
    cuspidal = Cuspidal(
        "no", "det A = const sin(phi) (K - |p|^2)/...: both factors keep their signs, and their pair is the label"
    )
    limb_count = 3

    def __init__(self, geometry: Rrr3Geometry) -> None:
        self.geometry = geometry
        self.radius = self.length_m = geometry.rp
        self.diameter = sqrt(3.0) * geometry.rp
        self.joints = tuple(Coordinate(f"elbow_{i}", "rad", -pi, pi) for i in (1, 2, 3))
        self.task = (
            Coordinate("x", "m", -inf, inf),
            Coordinate("y", "m", -inf, inf),
            Coordinate("phi", "rad", -inf, inf),
        )
        self.working_modes = tuple((a, b, c) for a in (1, -1) for b in (1, -1) for c in (1, -1))
        self.assembly_modes = (1, -1, 2, -2)
        self.usual_working_mode = (1, 1, 1)
        self.usual_assembly_mode = 1

    # --- equations, floats or arrays -------------------------------------------------------------------------

    def inverse(self, k: Arithmetic[N], pose: Sequence[N], mode: Signs) -> tuple[tuple[N, ...], tuple[N, ...]]:
        """tan(q/2) = sqrt(4 l^2 - rho^2)/rho; reach 2 l - rho."""
        far = 2.0 * self.geometry.l
        joints, reach = [], []
        for (dx, dy, _, _), sign in zip(self._spokes(k, pose), mode, strict=True):
            rho = k.hypot(dx, dy)
            joints.append(2.0 * sign * k.atan2(k.safe_sqrt((far - rho) * (far + rho)), rho))
            reach.append(far - rho)
        return tuple(joints), tuple(reach)

    def _spokes(self, k: Arithmetic[N], pose: Sequence[N]) -> list[tuple[N, N, N, N]]:
        """A_iB_i and attachment vector PB_i of each leg, m."""
        rb, rp = self.geometry.rb, self.geometry.rp
        x, y, phi = pose
        cosine, sine = k.cos_sin(phi)
        c, s = rp * cosine, rp * sine
        spokes = []
        for ex, ey in _CORNERS:
            ax, ay = c * ex - s * ey, s * ex + c * ey
            spokes.append((x + ax - rb * ex, y + ay - rb * ey, ax, ay))
        return spokes

    def direct(self, k: Arithmetic[N], joints: Sequence[N], assembly: int) -> tuple[tuple[N, ...], tuple[N, N]]:
        """Closed form for similar triangles: K^2 - S K + |w|^2 = 0, p = M(phi) w/K with S the mean of rho_i^2,
        w = mean (rho_i^2 - S) e_i, M = rp R(phi) - rb.

        Gaps: [0] the smallest of (|p| - sqrt K)^2/(|p| + sqrt K) and sqrt K's distance from |rb - rp| and rb + rp;
        [1] the smallest rho_i, or sqrt K.
        """
        rb, rp, l = self.geometry.rb, self.geometry.rp, self.geometry.l
        rhos = [2.0 * l * k.cos_sin(0.5 * q)[0] for q in joints]
        a, b, c = [rho * rho for rho in rhos]
        mean = (a + b + c) / 3.0
        (x1, y1), (x2, y2), (x3, y3) = _CORNERS
        wx, wy = ((a * x1 + b * x2) + c * x3) / 3.0, ((a * y1 + b * y2) + c * y3) / 3.0
        w = k.hypot(wx, wy)
        apart = mean - 2.0 * w
        large = 0.5 * (mean + k.safe_sqrt(apart * (mean + 2.0 * w)))
        inside = abs(assembly) == 1
        K = large if inside else w * w / (large + _TINY)
        root = k.safe_sqrt(K)
        short, long = root - abs(rb - rp), rb + rp - root
        sign = 1 if (assembly > 0) == inside else -1
        sine = sign * k.safe_sqrt(short * (root + abs(rb - rp)) * long * (root + rb + rp))
        cosine = rb * rb + rp * rp - K
        phi = k.atan2(sine, cosine)
        mx, my = 0.5 * cosine / rb - rb, 0.5 * sine / rb  # M = (mx, -my; my, mx)
        per_K = 1.0 / (K + _TINY)
        gap = k.minimum(apart / (k.safe_sqrt(mean + 2.0 * w) + _TINY), k.minimum(short, long))
        rho = k.safe_sqrt(k.minimum(k.minimum(a, b), k.minimum(c, K)))
        return ((mx * wx - my * wy) * per_K, (my * wx + mx * wy) * per_K, phi), (gap, rho)

    def legs(self, k: Arithmetic[N], joints: Sequence[N], pose: Sequence[N]) -> Legs[N]:
        """Rows (r_i, PB_i x r_i) with r_i along A_iB_i; levers l sin(q_i/2), the arms of the forces about C_i."""
        l = self.geometry.l
        screws, normalised_levers, reach, closure, attachments, limb = [], [], [], [], [], []
        for (dx, dy, ax, ay), q in zip(self._spokes(k, pose), joints, strict=True):
            cosine, sine = k.cos_sin(0.5 * k.wrap(q))
            rho = k.hypot(dx, dy)
            rx, ry = dx / (rho + _TINY), dy / (rho + _TINY)
            screws.append((rx, ry, ax * ry - ay * rx))
            normalised_levers.append(sine)
            reach.append(2.0 * l - rho)
            closure.append(rho - 2.0 * l * cosine)
            attachments.append((ax, ay))
            limb.append(k.abs(cosine))
        legs = Legs(
            tuple(screws),
            tuple([l * s for s in normalised_levers]),
            tuple(normalised_levers),
            tuple(reach),
            tuple(closure),
        )
        legs.attachments = tuple(attachments)
        legs.limb = tuple(limb)
        return legs

    def posture(self, joints: Sequence[float], assembly: int) -> Posture:
        """The equations of `direct` and `legs` in one function for one sample: twice as fast."""
        q1, q2, q3 = joints
        if not (abs(q1) < pi and abs(q2) < pi and abs(q3) < pi):
            return super().posture(joints, assembly)
        rb, rp, l = self.geometry.rb, self.geometry.rp, self.geometry.l
        (e1x, e1y), (e2x, e2y), (e3x, e3y) = _CORNERS
        far = 2.0 * l
        want1, want2, want3 = far * cos(0.5 * q1), far * cos(0.5 * q2), far * cos(0.5 * q3)  # rho_i
        a, b, c = want1 * want1, want2 * want2, want3 * want3
        mean = (a + b + c) / 3.0
        wx, wy = (a * e1x + b * e2x + c * e3x) / 3.0, (a * e1y + b * e2y + c * e3y) / 3.0
        w = 2.0 * hypot(wx, wy)
        apart, closed = mean - w, mean + w
        if not apart > 0.0:
            return super().posture(joints, assembly)
        K = large = 0.5 * (mean + sqrt(apart * closed))
        inside = assembly in (1, -1)
        if not inside:
            K = 0.25 * w * w / large
        root = sqrt(K)
        sum_, difference = rb + rp, abs(rb - rp)
        short, long = root - difference, sum_ - root
        gap = min(apart / sqrt(closed), short, long)
        least = min(want1, want2, want3, root)
        if not (gap > 0.0 and least > COINCIDENT_TOL_M):
            return super().posture(joints, assembly)
        sine = sqrt(short * (root + difference) * long * (root + sum_)) / (2.0 * rb * rp)
        if (assembly > 0) != inside:
            sine = -sine
        cosine = (rb * rb + rp * rp - K) / (2.0 * rb * rp)
        mx, my = (rp * cosine - rb) / K, rp * sine / K
        x, y = mx * wx - my * wy, my * wx + mx * wy
        u, v = rp * cosine, rp * sine
        a1x, a1y = u * e1x - v * e1y, v * e1x + u * e1y
        a2x, a2y = u * e2x - v * e2y, v * e2x + u * e2y
        a3x, a3y = u * e3x - v * e3y, v * e3x + u * e3y
        d1x, d1y = x + a1x - rb * e1x, y + a1y - rb * e1y
        d2x, d2y = x + a2x - rb * e2x, y + a2y - rb * e2y
        d3x, d3y = x + a3x - rb * e3x, y + a3y - rb * e3y
        rho1, rho2, rho3 = hypot(d1x, d1y), hypot(d2x, d2y), hypot(d3x, d3y)
        r1x, r1y, r2x, r2y, r3x, r3y = d1x / rho1, d1y / rho1, d2x / rho2, d2y / rho2, d3x / rho3, d3y / rho3
        m1, m2, m3 = a1x * r1y - a1y * r1x, a2x * r2y - a2y * r2x, a3x * r3y - a3y * r3x
        v1x, v1y, w1 = r2y * m3 - m2 * r3y, m2 * r3x - r2x * m3, r2x * r3y - r2y * r3x
        v2x, v2y, w2 = r3y * m1 - m3 * r1y, m3 * r1x - r3x * m1, r3x * r1y - r3y * r1x
        v3x, v3y, w3 = r1y * m2 - m1 * r2y, m1 * r2x - r1x * m2, r1x * r2y - r1y * r2x
        det = r1x * v1x + r1y * v1y + m1 * w1
        size = abs(det)
        s1, s2, s3 = sin(0.5 * q1), sin(0.5 * q2), sin(0.5 * q3)
        residual = max(abs(rho1 - want1), abs(rho2 - want2), abs(rho3 - want3))
        if not residual <= CLOSURE_TOL_M:
            return super().posture(joints, assembly)
        return Posture(
            Status.SOLVED,
            (q1, q2, q3),
            (x, y, atan2(sine, cosine)),
            (sign_of(s1), sign_of(s2), sign_of(s3)),
            assembly,
            ((r1x, r1y, m1), (r2x, r2y, m2), (r3x, r3y, m3)),
            (l * s1, l * s2, l * s3),
            (s1, s2, s3),
            (far - rho1, far - rho2, far - rho3),
            (gap, least),
            (
                FLOATS.ratio(size, hypot(v1x - w1 * a1y, v1y + w1 * a1x)),
                FLOATS.ratio(size, hypot(v2x - w2 * a2y, v2y + w2 * a2x)),
                FLOATS.ratio(size, hypot(v3x - w3 * a3y, v3y + w3 * a3x)),
            ),
            det,
            nan,
            (want1 / far, want2 / far, want3 / far),
            residual,
            ((a1x, a1y), (a2x, a2y), (a3x, a3y)),
            (hypot(v1x, v1y), hypot(v2x, v2y), hypot(v3x, v3y), abs(w1), abs(w2), abs(w3)),
        )

    def skeleton(self) -> Skeleton:
        """Leg 1 carries the platform; at 0 a leg is stretched along +x."""
        g, links = self.geometry, []
        corners = [(g.rp * x, g.rp * y, 0.0) for x, y in _CORNERS]
        for leg, (joint, (x, y)) in enumerate(zip(self.joints, _CORNERS, strict=True), 1):
            bar = ((g.l, 0.0, 0.0),)
            links.append(Link(f"arm_{leg}", f"base_{leg}", BASE, (g.rb * x, g.rb * y, 0.0), Z, shape=bar))
            links.append(Link(f"rod_{leg}", joint.name, f"arm_{leg}", (g.l, 0.0, 0.0), Z, shape=bar))
        links += planar_end("rod_1", g.l, Z, corners)
        cuts = tuple(Cut(f"rod_{leg}", (g.l, 0.0, 0.0), corners[leg - 1]) for leg in (2, 3))
        return Skeleton(tuple(links), tuple(joint.name for joint in self.joints), cuts, self._passive)

    def _passive(self, joints: Floats, pose: Floats) -> dict[str, float]:
        """A leg of equal links points to one side by half of its elbow's angle."""
        rows = self.at(joints, pose, 0, (0.0, 0.0)).screws
        starts = [atan2(ry, rx) - 0.5 * FLOATS.wrap(q) for q, (rx, ry, _) in zip(joints, rows, strict=True)]
        angles = {f"base_{leg}": start for leg, start in enumerate(starts, 1)}
        return {**angles, "wrist_1": pose[2] - starts[0] - joints[0]}

    def bias(self, at: Posture, joint_rates: Sequence[float], pose_rates: Sequence[float]) -> Floats:
        """Second derivative of rho_i - 2 l cos(q_i/2)."""
        l = self.geometry.l
        vx, vy, w = pose_rates
        c = []
        for q, rate, (rx, ry, _), (ax, ay), reach in zip(
            at.joints, joint_rates, at.screws, at.attachments, at.reach, strict=True
        ):
            across = rx * (vy + w * ax) - ry * (vx - w * ay)
            swing = across * across / (2.0 * l - reach + _TINY)
            c.append(swing - w * w * (ax * rx + ay * ry) + 0.5 * l * rate * rate * abs(cos(0.5 * q)))
        return tuple(c)

    # --- guarantees, one sample --------------------------------------------------------------------------------

    def travel_of(self, at: Posture, travel: Sequence[float], slack_m: float) -> Travel:
        """rho_i changes by D <= |B_ii| travel + l travel^2/4, the errors of the leg added; drive D + D^2/(2 rho_i)."""
        l = self.geometry.l
        rod = 2.0 * l - max(at.reach)
        if not rod > 0.0:
            return Travel((inf, inf, inf), slack_m, 0.0)
        b1, b2, b3 = at.levers
        t1, t2, t3 = travel
        ends, length, _ = self.geometry_errors(slack_m) if slack_m else EXACT
        D1 = (abs(b1) + 0.25 * l * t1) * t1 + length
        D2 = (abs(b2) + 0.25 * l * t2) * t2 + length
        D3 = (abs(b3) + 0.25 * l * t3) * t3 + length
        half = 0.5 / rod
        return Travel((D1 + half * D1 * D1 + ends, D2 + half * D2 * D2 + ends, D3 + half * D3 * D3 + ends), ends, rod)

    def geometry_errors(self, slack_m: float) -> Errors:
        """The places of both corners; |d rho/d l| <= 1 for either link."""
        place = sqrt(2.0) * slack_m
        return Errors(2.0 * place, 2.0 * slack_m, place)

    def rods_of(self, at: Posture, travel: Sequence[float], slack_m: float) -> list[Rod]:
        """The near ends stay; rho_i = 2 l cos(q_i/2) grows by -B_ii per rad and bends by -rho_i/8 per rad^2, its third
        derivative is -1/4 of the first, its fourth at most l/8."""
        l = self.geometry.l
        ends, length, _ = self.geometry_errors(slack_m) if slack_m else EXACT
        rods = []
        for lever, reach, h in zip(at.levers, at.reach, travel, strict=True):
            rho = 2.0 * l - reach
            growth, off = -lever * h, l * h * h * h * h / 192.0 + length
            rods.append(Rod(rho, (0.0, 0.0), ends, growth, off, (), -0.125 * rho * h * h, (), -growth * h * h / 24.0))
        return rods

    def sines_over(self, at: Posture, travel: Sequence[float], met: Reached, slack_m: float) -> Floats:
        """Independent of the platform."""
        return self.sine_floors(at, travel, 0.0, slack_m)

    def sine_floors(self, at: Posture, travel: Sequence[float], turn_rad: float, slack_m: float = 0.0) -> Floats:
        """The sine is |sin(q_i/2)|, whatever the platform does.

        Of links a < b it is the lever a b sin(q)/rho over its largest size a: the same times (1 + x)/sqrt(1 + x^2 T)
        with x = (b - a)/(b + a) <= slack/l and T = tan^2(q/2), which is least at an end of the range of x.
        """
        s1, s2, s3 = at.normalised_levers
        t1, t2, t3 = travel
        floors = _sine_floor(s1, t1), _sine_floor(s2, t2), _sine_floor(s3, t3)
        if slack_m:
            x = slack_m / self.geometry.l
            limbs = self.limb_floors(at, travel, slack_m, floors)
            floors = tuple([sine * _unequal(x, cosine) for sine, cosine in zip(floors, limbs, strict=True)])  # type: ignore[assignment]
        return floors

    def limb_floors(self, at: Posture, travel: Sequence[float], slack_m: float, type1: Floats) -> Floats:
        """|cos(q_i/2)| falls no faster than |sin(q_i/2)| would from the same value. Of links a, b the margin is rho
        over its largest size a + b, which is at least that."""
        return tuple([_sine_floor(c, t) for c, t in zip(at.limb, travel, strict=True)])

    def turn_rate(self, at: Posture) -> tuple[float, float]:
        """A rod that keeps half its length turns by at most asin(move/rho_i) <= CHORD move/rho_i."""
        rod = 2.0 * self.geometry.l - max(at.reach)
        return min(min(at.reach), HALF * rod), CHORD / rod if rod > 0.0 else inf


def _unequal(x: float, cosine: float) -> float:
    """The smallest (1 + x)/sqrt(1 + x^2 tan^2(q/2)) from 0 to x for cos(q/2) at least `cosine`; 0 if unknown."""
    return min((1.0 + x) * cosine / hypot(cosine, x * sqrt(1.0 - cosine * cosine)), 1.0) if x < 1.0 else 0.0


def _sine_floor(sine: float, travel: float) -> float:
    """Smallest |sin(q/2)| while q moves by at most `travel`: its slope is cos(q/2)/2, its curvature at most 1/4."""
    left = abs(sine) - 0.5 * travel * sqrt(abs(1.0 - sine * sine)) - 0.125 * travel * travel
    return left if left > 0.0 else 0.0
