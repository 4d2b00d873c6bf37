"""Direct kinematics of a planar platform on three circles, as one equation of degree 6 in tan(phi/2).

With h_i = R b_i - k_i the differences of |p + h_i|^2 = l_i^2 leave D p = a; f = |a + D h_1|^2 - l_1^2 D^2. All are
polynomials in t = tan(phi/2) and the joints after division by powers of 1 + t^2. Two poses may share a turn where
D = 0: there f has a double root although nothing is singular.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import Any, NamedTuple

from irsbot_kinematics.algebra.manipulators.planar import PlanarLegs
from irsbot_kinematics.algebra.model.polynomial import (
    context,
    integer_context,
    irreducible,
    is_even,
    moved,
    primitive,
    renamed,
)
from irsbot_kinematics.algebra.model.system import System
from irsbot_kinematics.algebra.tangents import without_circles

T = "t_phi"
"""Name of tan(phi/2)."""


class Closing(NamedTuple):
    """Polynomials of Z[t, joints]: the closing polynomial f, the determinant D and the numerators a."""

    f: Any
    D: Any
    ax: Any
    ay: Any


def closing(system: System, fixed: Mapping[str, Fraction]) -> Closing:
    """f, D, a of a system whose structure is PlanarLegs, some joints' generators fixed."""
    assert isinstance(system.structure, PlanarLegs)
    free = tuple(g for g in system.gens(system.joints) if g not in fixed)
    ring = context((T, *free))
    t = ring.gen(0)
    w = 1 + t * t

    def put(text: str) -> Any:
        return moved(system.evaluated(system.expression(text), fixed), ring)

    arms, squares = [], []
    for leg in system.structure.legs:
        bx, by, kx, ky = map(put, (leg.bx, leg.by, leg.kx, leg.ky))
        turned = (bx * (1 - t * t) - 2 * by * t, 2 * bx * t + by * (1 - t * t))
        arms.append((turned[0] - w * kx, turned[1] - w * ky))
        size = w * (bx * bx + by * by + kx * kx + ky * ky) - 2 * (kx * turned[0] + ky * turned[1])
        squares.append(w * put(leg.square) - size)
    (x1, y1), (x2, y2) = arms[0], arms[1]
    lines = [(x2 - x1, y2 - y1, (squares[1] - squares[0]) / 2)]
    if len(arms) == 3:
        lines.append((arms[2][0] - x1, arms[2][1] - y1, (squares[2] - squares[0]) / 2))
    else:  # the platform's x axis passes through (r, 0): -sin phi x + cos phi y = -sin phi r
        lines.append((-2 * t, 1 - t * t, -2 * t * put(system.structure.line or "0")))
    (n1x, n1y, e1), (n2x, n2y, e2) = lines
    ax, ay, D = e1 * n2y - e2 * n1y, e2 * n1x - e1 * n2x, n1x * n2y - n2x * n1y
    l1 = put(system.structure.legs[0].square)
    f = (w * ax + D * x1) ** 2 + (w * ay + D * y1) ** 2 - l1 * (w * D) ** 2
    forms = [without_circles(primitive(p)) if p != 0 else primitive(p) for p in (f, D, ax, ay)]
    return Closing(*forms)


def parallel_joint(system: System, fixed: Mapping[str, Fraction]) -> list[Any]:
    """Irreducible factors over Z[joints] of the discriminant of f on which det A really vanishes."""
    forms = closing(system, fixed)
    names = tuple(forms.f.context().names())[1:]
    squares = [name for name in names if all(is_even(poly, name) for poly in forms)]
    for name in squares:
        forms = Closing(*(renamed(poly, name, name, 2) for poly in forms))
    spurious = [forms.D.resultant(part, T) for part in (forms.ax, forms.ay)]
    shared = primitive(spurious[0]).gcd(primitive(spurious[1])) if all(s != 0 for s in spurious) else None
    found = []
    for factor, _ in irreducible(primitive(without_t(forms.f.discriminant(T)))):
        if shared is not None and divmod(without_t(shared), factor)[1] == 0:
            continue
        for name in squares:
            factor = unsquared(factor, name)
        found += [part for part, _ in irreducible(factor)]
    return found


def without_t(poly: Any) -> Any:
    """The same polynomial in the ring without t."""
    names = tuple(n for n in poly.context().names() if n != T)
    return primitive(poly, names)


def unsquared(poly: Any, name: str) -> Any:
    """An integer polynomial with name replaced by name^2."""
    names = tuple(poly.context().names())
    i = names.index(name)
    return integer_context(names).from_dict(
        {(*m[:i], 2 * int(m[i]), *m[i + 1 :]): c for m, c in poly.to_dict().items()}
    )
