"""Direct kinematics of the 3-PRS: three rod angles from three distances, a polynomial of degree 16."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from math import copysign, sqrt
from typing import Any

import numpy as np

from irsbot_kinematics.algebra.manipulators.spatial import UprightRods
from irsbot_kinematics.algebra.model.engine import AlgebraError, flint
from irsbot_kinematics.algebra.model.exact import pair_of_tangent
from irsbot_kinematics.algebra.model.polynomial import context, primitive, rational, univariate
from irsbot_kinematics.algebra.model.roots import real_balls, squarefree_part
from irsbot_kinematics.algebra.model.system import System

BITS = 400
"""bit: precision of the enclosures."""

TURN = Fraction(3, 11)
"""1: half tangent of the direction from which rod angles count, so that none is pi."""


def eliminant(system: System, fixed: Mapping[str, Fraction]) -> tuple[Any, list[Any]]:
    """Polynomial in t_1 whose roots are the direct solutions (degree 16), and the three equations in Z[t1, t2, t3]."""
    rods = system.structure
    assert isinstance(rods, UprightRods)
    ring = context(("t1", "t2", "t3"))
    values = system.values
    platform, rod = values["p"], values["l"]
    k, h = (rational(v) for v in pair_of_tangent(TURN))
    points = []
    for i, t in enumerate(ring.gens(), 1):
        driven = fixed[f"rho{i}"]
        radius, height = (values["radius"], driven) if rods.radius is not None else (driven, Fraction(0))
        w, c, s = 1 + t * t, 1 - t * t, 2 * t
        assert isinstance(rod, Fraction)
        assert isinstance(radius, Fraction)
        length = rational(rod)
        points.append(
            (rational(radius) * w + length * (k * c - h * s), rational(height) * w + length * (h * c + k * s), w)
        )
    assert isinstance(platform, Fraction)
    square = rational(3 * platform * platform)
    equations = []
    for i, j in ((0, 1), (1, 2), (0, 2)):
        (ri, zi, wi), (rj, zj, wj) = points[i], points[j]
        a, b = ri * wj, rj * wi
        closed = a * a + b * b + a * b + (zi * wj - zj * wi) ** 2 - square * wi * wi * wj * wj
        equations.append(_bare(primitive(closed), (f"t{i + 1}", f"t{j + 1}")))
    reduced = _bare(equations[0].resultant(equations[1], "t2"), ("t1", "t3"))
    whole = _bare(reduced.resultant(equations[2], "t3"), ("t1",))
    return squarefree_part(univariate(whole, "t1")), equations


def _bare(poly: Any, names: tuple[str, ...]) -> Any:
    """Without the factors 1 + t^2 of the isotropic directions."""
    for name in names:
        t = poly.context().gen(poly.context().variable_to_index(name))
        while poly != 0 and divmod(poly, 1 + t * t)[1] == 0:
            poly = divmod(poly, 1 + t * t)[0]
    return poly


def upright_poses(system: System, fixed: Mapping[str, Fraction]) -> list[tuple[dict[str, float], float]]:
    """All poses at given joints, each rotation once (quaternion with its first part that is not 0 positive)."""
    poly, equations = eliminant(system, fixed)
    if poly == 0:
        raise AlgebraError(f"{system.name}: infinitely many poses at these joints")
    found = []
    with flint.ctx.workprec(BITS):
        for t1 in real_balls(poly, BITS):
            seconds = _real_roots(equations[0], "t1", t1, "t2")
            thirds = _real_roots(equations[2], "t1", t1, "t3")
            found += [
                _pose(system, fixed, (t1, t2, t3))
                for t2 in seconds
                for t3 in thirds
                if _value(equations[1], {"t1": t1, "t2": t2, "t3": t3}).contains(0)
            ]
    return found


def _value(poly: Any, point: Mapping[str, Any]) -> Any:
    total = flint.arb(0)
    for powers, coefficient in zip(poly.monoms(), poly.coeffs(), strict=True):
        term = flint.arb(coefficient)
        for name, power in zip(poly.context().names(), powers, strict=True):
            if power:
                term = term * point[name] ** int(power)
        total = total + term
    return total


def _real_roots(poly: Any, known: str, value: Any, name: str) -> list[Any]:
    names = poly.context().names()
    i, k = names.index(known), names.index(name)
    row = [flint.arb(0)] * (int(poly.degrees()[k]) + 1)
    for powers, coefficient in zip(poly.monoms(), poly.coeffs(), strict=True):
        row[int(powers[k])] = row[int(powers[k])] + flint.arb(coefficient) * value ** int(powers[i])
    roots = flint.acb_poly(row).roots(tol=flint.arb(2) ** (-BITS // 2), maxprec=4 * BITS)
    return [root.real for root in roots if abs(root.imag).upper() < flint.arb(2) ** (-BITS // 4)]


def _pose(
    system: System, fixed: Mapping[str, Fraction], tangents: tuple[Any, Any, Any]
) -> tuple[dict[str, float], float]:
    rods, values = system.structure, system.values
    k, h = (float(v) for v in pair_of_tangent(TURN))
    places = []
    for i, (t, (ux, uy)) in enumerate(
        zip(tangents, ((1.0, 0.0), (-0.5, sqrt(0.75)), (-0.5, -sqrt(0.75))), strict=True), 1
    ):
        middle = float(t.mid())
        c, s = (1.0 - middle * middle) / (1.0 + middle * middle), 2.0 * middle / (1.0 + middle * middle)
        driven, rod = float(fixed[f"rho{i}"]), float(rods.rod)
        radius, height = (float(rods.radius), driven) if rods.radius is not None else (driven, 0.0)
        r, z = radius + rod * (k * c - h * s), height + rod * (h * c + k * s)
        places.append(np.array([r * ux, r * uy, z]))
    centre = np.sum(places, axis=0) / 3.0
    platform = float(values["p"])  # type: ignore[arg-type]
    ex = (places[0] - centre) / platform
    ey = (places[1] - places[2]) / (sqrt(3.0) * platform)
    a, b, c, d = quaternion(np.stack([ex, ey, np.cross(ex, ey)], axis=1))
    x, y, z = (float(v) for v in centre)
    radius_ = max(float(t.rad()) for t in tangents) * 10.0 + 1e-15
    return {"x": x, "y": y, "z": z, "a": a, "b": b, "c": c, "d": d}, radius_


def quaternion(rotation: Any) -> tuple[float, float, float, float]:
    """Unit quaternion of a rotation matrix; the first part that is not 0 is positive."""
    m = rotation
    squares = np.array([
        1.0 + m[0, 0] + m[1, 1] + m[2, 2], 1.0 + m[0, 0] - m[1, 1] - m[2, 2],
        1.0 - m[0, 0] + m[1, 1] - m[2, 2], 1.0 - m[0, 0] - m[1, 1] + m[2, 2],
    ])  # fmt: skip
    i = int(squares.argmax())
    size = 0.5 * sqrt(squares[i])
    rest = 0.25 / size
    rows = (
        (size, (m[2, 1] - m[1, 2]) * rest, (m[0, 2] - m[2, 0]) * rest, (m[1, 0] - m[0, 1]) * rest),
        ((m[2, 1] - m[1, 2]) * rest, size, (m[0, 1] + m[1, 0]) * rest, (m[0, 2] + m[2, 0]) * rest),
        ((m[0, 2] - m[2, 0]) * rest, (m[0, 1] + m[1, 0]) * rest, size, (m[1, 2] + m[2, 1]) * rest),
        ((m[1, 0] - m[0, 1]) * rest, (m[0, 2] + m[2, 0]) * rest, (m[1, 2] + m[2, 1]) * rest, size),
    )
    found = [float(v) for v in rows[i]]
    lead = next(v for v in found if abs(v) > 1e-12)
    sign = copysign(1.0, lead)
    return sign * found[0], sign * found[1], sign * found[2], sign * found[3]
