"""Singularity polynomials of the linear Delta robots in closed form, by conjugation instead of Groebner bases."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product as choices
from typing import Any

from irsbot_kinematics.algebra.manipulators.delta import DeltaRails
from irsbot_kinematics.algebra.model.polynomial import context, primitive, rational

Vector = tuple[Any, Any, Any]


def delta_projection(rails: DeltaRails, kind: str, space: str, names: Sequence[str]) -> Any:
    """Generator of the projection of the parallel or serial singularities on pose or joint space; fmpz_mpoly.

    names: x, y, z or the three joints.
    """
    ring = context(names)
    forms = {
        ("parallel", "joint"): _parallel_joint,
        ("serial", "pose"): _serial_pose,
        ("serial", "joint"): _serial_joint,
        ("parallel", "pose"): _parallel_pose,
    }
    return primitive(forms[kind, space](rails, ring))


def _constants(ring: Any, vector: Sequence[Any]) -> Vector:
    x, y, z = (ring.constant(rational(v)) for v in vector)
    return x, y, z


def _dot(a: Vector, b: Vector) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _less(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _slides(rails: DeltaRails, ring: Any) -> list[Vector]:
    found = []
    for rho, o, u in zip(ring.gens(), rails.origins, rails.directions, strict=True):
        ox, oy, oz = _constants(ring, o)
        ux, uy, uz = _constants(ring, u)
        found.append((ox + rho * ux, oy + rho * uy, oz + rho * uz))
    return found


def _triangle(rails: DeltaRails, ring: Any) -> tuple[list[Vector], Vector, Any, Any]:
    """Slides C_i, N, |N|^2 and a^2 b^2 c^2 - 4 L^2 |N|^2: negative iff there are two direct solutions."""
    slides = _slides(rails, ring)
    e, g = _less(slides[1], slides[0]), _less(slides[2], slides[0])
    h, normal = _less(g, e), _cross(e, g)
    square = _dot(normal, normal)
    sides = _dot(e, e) * _dot(g, g) * _dot(h, h)
    return slides, normal, square, sides - 4 * rational(rails.rod**2) * square


def _parallel_joint(rails: DeltaRails, ring: Any) -> Any:
    return _triangle(rails, ring)[3]


def _serial_joint(rails: DeltaRails, ring: Any) -> Any:
    """Product over i of ((u_i.Q)^2 - (4 L^2 |N|^2 - a^2 b^2 c^2)(u_i.N)^2)/|N|^2, Q = 2 |N|^2 (O_c - C_i)."""
    slides, normal, square, lack = _triangle(rails, ring)
    e, g = _less(slides[1], slides[0]), _less(slides[2], slides[0])
    ee, gg = _dot(e, e), _dot(g, g)
    ne, gn = _cross(normal, e), _cross(g, normal)
    middle = tuple(gg * ne[k] + ee * gn[k] for k in range(3))
    total = ring.constant(1)
    for slide, u in zip(slides, rails.directions, strict=True):
        away = _less(slides[0], slide)
        along = _constants(ring, u)
        q = _dot(along, tuple(middle[k] + 2 * square * away[k] for k in range(3)))
        across = _dot(along, normal)
        if across == 0:  # all rails parallel: the square of a polynomial, whose root is taken
            total = total * _divided(q, _root(square))
        else:
            total = total * _divided(q * q + lack * across * across, square)
    return total


def _divided(top: Any, bottom: Any) -> Any:
    whole, rest = divmod(top, bottom)
    return whole if rest == 0 else top


def _root(square: Any) -> Any:
    try:
        return square.sqrt()
    except ValueError:
        return square


def _legs(rails: DeltaRails, ring: Any) -> tuple[list[Vector], list[Vector], list[Any], list[Any]]:
    """P - o_i, u_i, (P - o_i).u_i and D_i = L^2 - |P - o_i|^2 + ((P - o_i).u_i)^2."""
    x, y, z = ring.gens()
    away = [_less((x, y, z), _constants(ring, o)) for o in rails.origins]
    along = [_constants(ring, u) for u in rails.directions]
    foot = [_dot(w, u) for w, u in zip(away, along, strict=True)]
    square = rational(rails.rod**2)
    return away, along, foot, [square - _dot(w, w) + f * f for w, f in zip(away, foot, strict=True)]


def _serial_pose(rails: DeltaRails, ring: Any) -> Any:
    first, second, third = _legs(rails, ring)[3]
    return first * second * third


def _parallel_pose(rails: DeltaRails, ring: Any) -> Any:
    """Norm of det A over the eight signs of s_i = rho_i - (P - o_i).u_i, divided by what Norm/det has in common."""
    away, along, foot, discriminants = _legs(rails, ring)
    # Row i of A is w_i - s_i u_i, w_i = P - o_i - foot_i u_i: det A is multilinear in the s_i.
    plain = [tuple(w[k] - f * u[k] for k in range(3)) for w, u, f in zip(away, along, foot, strict=True)]
    element: dict[tuple[int, ...], Any] = {}
    for signs in choices((0, 1), repeat=3):
        rows = [tuple(-u[k] for k in range(3)) if s else w for s, w, u in zip(signs, plain, along, strict=True)]
        element[signs] = _dot(rows[0], _cross(rows[1], rows[2]))
    norm = element
    rest: dict[tuple[int, ...], Any] = {(0, 0, 0): ring.constant(1)}
    for i in range(3):
        conjugate = {signs: -value if signs[i] else value for signs, value in norm.items()}
        rest = _times(rest, conjugate, discriminants)
        norm = _times(norm, conjugate, discriminants)
    total = primitive(norm[0, 0, 0])
    shared = total
    for value in rest.values():
        if value != 0:
            shared = shared.gcd(primitive(value))
    return total // shared if shared != 0 else total


def _times(a: dict[tuple[int, ...], Any], b: dict[tuple[int, ...], Any], squares: Sequence[Any]) -> Any:
    """Product in the basis s1^i s2^j s3^k with s_i^2 = D_i; parts that cancel are left out."""
    total: dict[tuple[int, ...], Any] = {}
    for p, u in a.items():
        if u == 0:
            continue
        for q, v in b.items():
            if v == 0:
                continue
            term = u * v
            for k in range(3):
                if p[k] and q[k]:
                    term = term * squares[k]
            key = tuple((p[k] + q[k]) % 2 for k in range(3))
            total[key] = total[key] + term if key in total else term
    return {key: value for key, value in total.items() if value != 0}
