"""All constraint-singular postures of one IRSBot-2, and the placements in which its arms hold them."""

from __future__ import annotations

from dataclasses import dataclass
from math import acos, atan2, cos, hypot, isnan, pi, sin, sqrt

from irsbot_kinematics.arguments import checked
from irsbot_kinematics.mechanism import Signs
from irsbot_kinematics.mechanisms.irsbot2_space import distal
from irsbot_kinematics.mechanisms.irsbot2_space.designs import Designs
from irsbot_kinematics.mechanisms.irsbot2_space.distal import Kind
from irsbot_kinematics.mechanisms.irsbot2_space.geometry import Irsbot2Geometry
from irsbot_kinematics.numerics.arithmetic import FLOATS
from irsbot_kinematics.numerics.tolerances import COINCIDENT_TOL_M, SIGN_DEAD_BAND

Pair = tuple[float, float]


@dataclass(frozen=True)
class SingularPosture:
    """A posture in which the distal loop loses a constraint. Pairs: leg I, leg II; planar angles as everywhere."""

    kind: Kind
    psi: Pair
    """rad, direction of H_k G_k."""
    theta: Pair
    """rad, direction of E_k F_k."""
    lam: Pair
    """m, length of E_k F_k."""
    axis_point: Pair
    """x, z seen from the platform point, m: P_I, a point of every axis of the gained rotations."""
    axis: tuple[float, float, float]
    """Unit direction of the gained rotation; of one of them for C1a, whose axes fill the horizontal plane."""

    @property
    def gained(self) -> str:
        """The motion that the platform gains, [S0] Figs. 8, 10 to 12."""
        if self.kind is Kind.C1A:
            return "2 rotations about the horizontal axes at the height of P_I and P_II"
        if self.kind is Kind.C1B:
            return "1 rotation about y"
        return "1 rotation about the line P_I P_II"

    @property
    def is_type_2(self) -> bool:
        """Also an actuation singularity: psi_I = psi_II + pi."""
        return self.kind in (Kind.CASE_1, Kind.C1B)


@dataclass(frozen=True)
class Placement:
    """One placement in which the arms hold a singular posture."""

    joints: Pair
    """q_I, q_II, rad."""
    pose: Pair
    """x, z of the platform point, m."""
    working_mode: Signs
    height: float
    """m of the platform point above the line through the motors, z + e."""
    assembly_mode: int
    """0 if the posture is also of Type 2, where two assembly modes meet."""


@dataclass(frozen=True)
class Reachability:
    """Placements in which the arms of one robot hold a singular posture."""

    slack: float
    """m by which l1 is too short; positive: out of reach."""
    placements: tuple[Placement, ...]
    anywhere: bool
    """The elbow frames coincide with the motors' distance: the arms can hold it at every q_I = q_II."""


@checked
def singular_postures(g: Irsbot2Geometry) -> tuple[SingularPosture, ...]:
    """All constraint-singular postures of the distal loop, by kind; they do not depend on l1, b and e.

    Cases I to III: [S0] (38)-(40). C1a, C1b: cos theta_I = cos theta_II = 0. If l2eq = D a leg can vanish; these
    postures are not listed.
    """
    d, D, l2 = Designs.of(g), g.D, g.l2eq
    roots = [X for X in distal.case_1_roots(d)[:, 0].tolist() if not isnan(X)]
    found = [_from_psi(g, Kind.CASE_1, (psi + pi, psi)) for X in roots for psi in _both(acos(X))]
    X_sq = float(distal.shared_root(d)[0])
    X = sqrt(max(X_sq, 0.0))
    if distal.has_case_2(d)[0]:
        r = sqrt(max(l2 * l2 - D * D * (1.0 - X_sq), 0.0))
        lengths = dict.fromkeys([(D * X + r, D * X - r), (D * X - r, D * X + r)])
        found += [_from_theta(g, Kind.CASE_2, (t + pi, t), lam) for t in _both(acos(-X)) for lam in lengths]
    if distal.has_case_3(d)[0]:
        r = sqrt(l2 * l2 - D * D * (1.0 - X_sq))
        sides = dict.fromkeys([X, -X])
        found += [_from_theta(g, Kind.CASE_3, (t, t), (D * x + r, r - D * x)) for x in sides for t in _both(acos(x))]
    if distal.has_condition_1(d)[0]:
        upright = sqrt((l2 - D) * (l2 + D))
        both = (upright, upright)
        found += [_from_theta(g, Kind.C1A, (t, t), both) for t in _both(0.5 * pi)]
        found += [_from_theta(g, Kind.C1B, (t, -t), both) for t in _both(0.5 * pi)]
    return tuple(found)


@checked
def reachability(g: Irsbot2Geometry, posture: SingularPosture) -> Reachability:
    """Placements in which the arms of a robot hold a posture: both, one at the end of the reach.

    With w = l2eq (u(psi_I) - u(psi_II)) - 2 b0 x the elbows close iff l1 (u(q_II) - u(q_I)) = w.
    """
    psi_1, psi_2 = posture.psi
    wx = g.l2eq * (cos(psi_1) - cos(psi_2)) - 2.0 * g.b0
    wz = -g.l2eq * (sin(psi_1) - sin(psi_2))
    half = 0.5 * hypot(wx, wz)
    slack = half - g.l1
    if half <= COINCIDENT_TOL_M:
        return Reachability(slack, (), True)
    if not slack <= 0.0:
        return Reachability(slack, (), False)
    rise = sqrt((g.l1 - half) * (g.l1 + half)) / half
    sides = (1.0, -1.0) if rise > 0.0 else (1.0,)
    return Reachability(slack, tuple(_place(g, posture, (0.5 * wx, 0.5 * wz), side * rise) for side in sides), False)


def _place(g: Irsbot2Geometry, posture: SingularPosture, half: Pair, rise: float) -> Placement:
    hx, hz = half
    arm_1, arm_2 = (-hx - rise * hz, -hz + rise * hx), (hx - rise * hz, hz + rise * hx)
    q = (atan2(-arm_1[1], arm_1[0]), atan2(-arm_2[1], arm_2[0]))
    psi_1, psi_2 = posture.psi
    x = -g.b0 + arm_1[0] + g.l2eq * cos(psi_1)
    height = arm_1[1] - g.l2eq * sin(psi_1)
    mode = (_sign(sin(q[0] - psi_1)), _sign(sin(q[1] - psi_2)))
    assembly = 0 if posture.is_type_2 else _sign(sin(psi_1 - psi_2))
    return Placement(q, (x, height - g.e), mode, height, assembly)


def _from_psi(g: Irsbot2Geometry, kind: Kind, psi: Pair) -> SingularPosture:
    """theta and lambda of (35), corrected: lambda u(theta) = l2eq u(psi) + sigma D x."""
    fx = (g.l2eq * cos(psi[0]) + g.D, g.l2eq * cos(psi[1]) - g.D)
    fz = (g.l2eq * sin(psi[0]), g.l2eq * sin(psi[1]))
    theta = (atan2(fz[0], fx[0]), atan2(fz[1], fx[1]))
    return _posture(g, kind, psi, theta, (hypot(fx[0], fz[0]), hypot(fx[1], fz[1])))


def _from_theta(g: Irsbot2Geometry, kind: Kind, theta: Pair, lam: Pair) -> SingularPosture:
    psi = (
        atan2(lam[0] * sin(theta[0]), lam[0] * cos(theta[0]) - g.D),
        atan2(lam[1] * sin(theta[1]), lam[1] * cos(theta[1]) + g.D),
    )
    return _posture(g, kind, psi, theta, lam)


def _posture(g: Irsbot2Geometry, kind: Kind, psi: Pair, theta: Pair, lam: Pair) -> SingularPosture:
    """P_I = F_I + mu lambda_I u(theta_I), F_I = P - s2g x; axis along n_1k x n_2k, (31)."""
    s, c = sin(g.beta), cos(g.beta)
    reach_1 = g.mu * lam[0]
    point = (-(g.a2 * s + g.p) + reach_1 * cos(theta[0]), -reach_1 * sin(theta[0]))
    if kind is Kind.C1B:
        axis = (0.0, 1.0, 0.0)
    elif kind is Kind.C1A:
        axis = (1.0, 0.0, 0.0)
    else:
        x, z = sin(theta[0]), c * c * cos(theta[0])
        axis = (x / hypot(x, z), 0.0, z / hypot(x, z))
    wrap = FLOATS.wrap
    return SingularPosture(kind, (wrap(psi[0]), wrap(psi[1])), (wrap(theta[0]), wrap(theta[1])), lam, point, axis)


def _both(angle: float) -> tuple[float, ...]:
    """The angle and its mirror image, which at 0 and pi are the same direction."""
    return (angle, -angle) if 0.0 < angle < pi else (angle,)


def _sign(value: float) -> int:
    return 0 if abs(value) <= SIGN_DEAD_BAND else 1 if value > 0.0 else -1
