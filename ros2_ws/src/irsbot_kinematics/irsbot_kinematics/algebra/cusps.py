"""Cusps: joints with a triple direct solution (joint space), poses with a triple inverse solution (pose space)."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from math import atan2
from typing import Any

from irsbot_kinematics.algebra.cusp_records import BITS, Cusp, Cusps, ball_roots, ball_value, constant, tangent_pair
from irsbot_kinematics.algebra.cusps_numeric import numeric_cusps
from irsbot_kinematics.algebra.cusps_serial import serial_cusps
from irsbot_kinematics.algebra.manipulators.planar import PlanarLegs
from irsbot_kinematics.algebra.manipulators.serial import Orthogonal3R
from irsbot_kinematics.algebra.model.engine import AlgebraError, flint
from irsbot_kinematics.algebra.model.exact import pair_of_tangent, square_root
from irsbot_kinematics.algebra.model.polynomial import context, primitive, rational, univariate
from irsbot_kinematics.algebra.model.roots import real_balls, squarefree_part
from irsbot_kinematics.algebra.model.system import System
from irsbot_kinematics.algebra.singular import complete, one_of, slice_values
from irsbot_kinematics.algebra.store import stored_result
from irsbot_kinematics.arguments import checked

TURN = Fraction(3, 11)
"""1: half tangent of the turn of the axes from which angles count, so that none is pi."""


@checked
def cusps(system: System, fixed: Mapping[str, Any] | None = None, space: str = "joint", *, cache: bool = True) -> Cusps:
    """Cusps of a slice with two free parameters.

    space 'joint': triple direct solutions; 'pose': triple inverse solutions. fixed: the other parameters of the space.
    3-RPR over joints and serial 3R over the pose (y = 0) are certified; others numeric. Raises AlgebraError.
    """
    complete(system, "cusps")
    one_of(space, ("joint", "pose"), "space")
    names = system.joints if space == "joint" else system.pose
    if isinstance(system.structure, Orthogonal3R) and space == "pose":
        if fixed not in (None, {}, {"y": 0}):
            raise AlgebraError("serial_3r turns about z: its cusps are circles, given at y = 0; leave fixed out")
        return stored_result(system, ("cusps", space), Cusps, lambda: serial_cusps(system), cache)
    known = slice_values(system, names, fixed)
    free = [name for name in names if name not in (fixed or {})]
    if len(free) != 2:
        raise AlgebraError(f"cusps are points of a slice with two free parameters; free are {', '.join(free)}")
    key = ("cusps", space, sorted(known.items()))
    if _is_plane_map(system, free) and space == "joint":
        return stored_result(system, key, Cusps, lambda: _plane_map(system, free, known), cache)
    return stored_result(system, key, Cusps, lambda: numeric_cusps(system, space, free, known), cache)


# --- planar platform whose two free legs change their lengths: the plane map (alpha, phi) -> (rho_2^2, rho_3^2) -----


def _is_plane_map(system: System, free: list[str]) -> bool:
    if not isinstance(system.structure, PlanarLegs) or len(system.structure.legs) != 3:
        return False
    by_joint = {leg.square: leg for leg in system.structure.legs}
    moving = {
        joint
        for joint in system.joints
        if any(joint in text for leg in system.structure.legs for text in (leg.kx, leg.ky))
    }
    return all(f"{name}^2" in by_joint for name in free) and not moving


def _plane_map(system: System, free: list[str], known: Mapping[str, Fraction]) -> Cusps:
    """J = det d(u, v)/d(alpha, phi); a cusp has J = 0 and no derivative of J along the kernel."""
    assert isinstance(system.structure, PlanarLegs)
    legs = {leg.square: leg for leg in system.structure.legs}
    moving = [legs[f"{name}^2"] for name in free]
    base = next(leg for leg in system.structure.legs if leg not in moving)

    def value(text: str) -> Any:
        return rational(constant(system, text, known))

    ring = context(("ca", "sa", "c", "s"))
    ca, sa, c, s = ring.gens()
    length = rational(square_root(constant(system, base.square, known), 60))
    turn = pair_of_tangent(TURN)
    k, h = rational(turn[0]), rational(turn[1])
    east, north = k * ca - h * sa, h * ca + k * sa
    cosine, sine = k * c - h * s, h * c + k * s
    squares = []
    for leg in moving:
        bx, by = value(leg.bx) - value(base.bx), value(leg.by) - value(base.by)
        x = length * east + bx * cosine - by * sine + value(base.kx) - value(leg.kx)
        y = length * north + bx * sine + by * cosine + value(base.ky) - value(leg.ky)
        squares.append(x * x + y * y)

    def by_alpha(p: Any) -> Any:
        return ca * p.derivative("sa") - sa * p.derivative("ca")

    def by_phi(p: Any) -> Any:
        return c * p.derivative("s") - s * p.derivative("c")

    u, v = squares
    J = by_alpha(u) * by_phi(v) - by_phi(u) * by_alpha(v)
    K2 = by_alpha(J) * by_phi(u) - by_phi(J) * by_alpha(u)
    K3 = by_alpha(J) * by_phi(v) - by_phi(J) * by_alpha(v)
    forms = [_half_tangents(p) for p in (J, K2, K3)]
    bare = squarefree_part(_without_isotropic(_shared(forms)))
    found = []
    with flint.ctx.workprec(BITS):
        for t in real_balls(bare, BITS):
            for a in _common_roots(forms, t):
                pairs = tangent_pair(a), tangent_pair(t)
                point = {"ca": pairs[0][0], "sa": pairs[0][1], "c": pairs[1][0], "s": pairs[1][1]}
                at = [ball_value(p, point) for p in (*squares, east, north, cosine, sine)]
                if at[0] > 0 and at[1] > 0:
                    found.append(_planar_cusp(system, free, known, base, length, at, value))
    found.sort(key=lambda cusp: [cusp.joints[name] for name in free])
    return Cusps(found, "certified", int(bare.degree()))


def _half_tangents(poly: Any) -> Any:
    """In Z[a, t], a = tan(alpha'/2), t = tan(phi'/2)."""
    ring = context(("a", "t"))
    a, t = ring.gens()
    most = [max((int(m[i]) + int(m[i + 1]) for m in poly.monoms()), default=0) for i in (0, 2)]
    total = ring.constant(0)
    for (i, k, m, n), coefficient in zip(poly.monoms(), poly.coeffs(), strict=True):
        i, k, m, n = map(int, (i, k, m, n))
        term = (1 - a * a) ** i * (2 * a) ** k * (1 + a * a) ** (most[0] - i - k)
        total = total + coefficient * term * (1 - t * t) ** m * (2 * t) ** n * (1 + t * t) ** (most[1] - m - n)
    return primitive(total)


def _shared(forms: list[Any]) -> Any:
    first = univariate(forms[0].resultant(forms[1], "a"), "t")
    second = univariate(forms[0].resultant(forms[2], "a"), "t")
    return first.gcd(second)


def _without_isotropic(poly: Any) -> Any:
    circle = flint.fmpz_poly([1, 0, 1])
    while poly.degree() > 1 and poly % circle == 0:
        poly = poly // circle
    return poly


def _common_roots(forms: list[Any], t: Any) -> list[Any]:
    """Real a with J = K2 = K3 = 0 at a root t: roots of J whose enclosures cannot be told from zeros of the others."""
    row = _in_a(forms[0], t)
    found = []
    for root in ball_roots(row):
        if abs(root.imag).upper() < flint.arb(2) ** (-BITS // 4):
            a = root.real
            if all(flint.arb_poly(_in_a(p, t))(a).contains(0) for p in forms[1:]):
                found.append(a)
    return found


def _in_a(poly: Any, t: Any) -> list[Any]:
    row = [flint.arb(0)] * (int(poly.degrees()[0]) + 1)
    for (i, k), coefficient in zip(poly.monoms(), poly.coeffs(), strict=True):
        row[int(i)] = row[int(i)] + flint.arb(coefficient) * t ** int(k)
    return row


def _planar_cusp(
    system: System, free: list[str], known: Mapping[str, Fraction], base: Any, length: Any, at: list[Any], value: Any
) -> Cusp:
    u, v, east, north, cosine, sine = at
    bx, by = value(base.bx), value(base.by)
    x = value(base.kx) + length * east - bx * cosine + by * sine
    y = value(base.ky) + length * north - bx * sine - by * cosine
    joints = {name: float(known[name]) for name in system.joints if name in known}
    joints |= {free[0]: float(u.sqrt().mid()), free[1]: float(v.sqrt().mid())}
    pose = {"x": float(x.mid()), "y": float(y.mid()), "phi": atan2(float(sine.mid()), float(cosine.mid()))}
    radius = max(float(ball.rad()) for ball in (u.sqrt(), v.sqrt(), x, y, sine, cosine))
    return Cusp(pose, {name: joints[name] for name in system.joints}, radius)
