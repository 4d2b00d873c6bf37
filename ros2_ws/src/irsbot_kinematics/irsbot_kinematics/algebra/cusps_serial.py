"""Cusps of the serial 3R with orthogonal axes: both invariants of a quartic vanish."""

from __future__ import annotations

from math import atan2, sqrt
from typing import Any

from irsbot_kinematics.algebra.cusp_records import BITS, Cusp, Cusps, ball_roots, ball_value, constant, tangent_pair
from irsbot_kinematics.algebra.model.engine import flint
from irsbot_kinematics.algebra.model.polynomial import context, primitive, rational, univariate
from irsbot_kinematics.algebra.model.roots import real_balls, squarefree_part
from irsbot_kinematics.algebra.model.system import System


def serial_cusps(system: System) -> Cusps:
    """K^2 + z^2 = A^2 is a quartic in tan(th3/2); it has a triple root where both its invariants vanish."""
    d2, d3, d4, r2 = (rational(constant(system, name, {})) for name in ("d2", "d3", "d4", "r2"))
    ring = context(("t", "S", "Z"))  # S = rho^2, Z = z^2
    t, S, Z = ring.gens()
    w = 1 + t * t
    A, B = d3 * w + d4 * (1 - t * t), r2 * w + 2 * d4 * t
    K2 = (S + Z - d2 * d2) * w * w - A * A - B * B  # 2 d2 K w^2
    quartic = K2 * K2 + 4 * d2 * d2 * w * w * (Z * w * w - A * A)
    whole = primitive(quartic)
    row: list[Any] = []
    reduced = _divided_by(whole, primitive(w * w))
    coefficients = _powers(reduced)
    row = [coefficients.get(k, 0 * reduced) for k in range(5)]
    a0, a1, a2, a3, a4 = row
    invariant = 12 * a0 * a4 - 3 * a1 * a3 + a2 * a2
    second = 72 * a0 * a2 * a4 + 9 * a1 * a2 * a3 - 27 * a0 * a3 * a3 - 27 * a4 * a1 * a1 - 2 * a2 * a2 * a2
    forms = [primitive(p, ("S", "Z")) for p in (invariant, second)]
    eliminant = univariate(forms[0].resultant(forms[1], "Z"), "S")
    bare = squarefree_part(eliminant)
    found: list[Cusp] = []
    with flint.ctx.workprec(BITS):
        for square in real_balls(bare, BITS):
            if not square > 0:
                continue
            column = [flint.arb(0)] * (int(forms[0].degrees()[1]) + 1)
            for (i, k), coefficient in zip(forms[0].monoms(), forms[0].coeffs(), strict=True):
                column[int(k)] = column[int(k)] + flint.arb(coefficient) * square ** int(i)
            for root in ball_roots(column):
                height = root.real
                point = {"S": square, "Z": height}
                if abs(root.imag).upper() > flint.arb(2) ** (-BITS // 4) or not ball_value(forms[1], point).contains(0):
                    continue
                if height > 0:
                    found += _at(system, square, height, row)
    found.sort(key=lambda cusp: (cusp.pose["x"], cusp.pose["z"]))
    return Cusps(found, "certified", 2 * int(bare.degree()))


def _divided_by(poly: Any, other: Any) -> Any:
    whole, rest = divmod(poly, other)
    return whole if rest == 0 else poly


def _powers(poly: Any) -> dict[int, Any]:
    ring = poly.context()
    groups: dict[int, dict[tuple[int, ...], Any]] = {}
    for m, c in poly.to_dict().items():
        without = (0, *m[1:])
        groups.setdefault(int(m[0]), {})[without] = c
    return {k: ring.from_dict(terms) for k, terms in groups.items()}


def _at(system: System, square: Any, height: Any, row: list[Any]) -> list[Cusp]:
    """Both signs of z, with y = 0 and x > 0; the triple root is that of the rest of f' divided by f''."""
    values = {"S": square, "Z": height, "t": flint.arb(0)}
    _, a1, a2, a3, a4 = (ball_value(p, values) for p in row)
    # f' - (t/3 + a3/(12 a4)) f'' = (4 a2/3 - a3^2/(2 a4)) t + a1 - a2 a3/(6 a4)
    t = -(a1 - a2 * a3 / (6 * a4)) / (4 * a2 / 3 - a3 * a3 / (2 * a4))
    cosine, sine = tangent_pair(t)
    d2, d3, d4, r2 = (float(constant(system, name, {})) for name in ("d2", "d3", "d4", "r2"))
    c3, s3 = float(cosine.mid()), float(sine.mid())
    A, B = d3 + d4 * c3, r2 + d4 * s3
    rho, z = sqrt(float(square.mid())), sqrt(float(height.mid()))
    K = (rho * rho + z * z - d2 * d2 - A * A - B * B) / (2.0 * d2)
    radius = max(float(square.sqrt().rad()), float(height.sqrt().rad()))
    found = []
    for side in (z, -z):
        th2 = atan2(-side / A, K / A)
        reach = d2 + K
        th1 = atan2(-B, reach)
        joints = {"th1": th1, "th2": th2, "th3": atan2(s3, c3)}
        found.append(Cusp({"x": rho, "y": 0.0, "z": side}, joints, radius))
    return found
