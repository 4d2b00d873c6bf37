"""The IRSBot-2 and its planar loop with 40 digits: intersections of circles, and a singular value decomposition."""

from __future__ import annotations

from typing import Any

import mpmath as mp

Number = Any


def loop(g: Any) -> tuple[Number, Number, Number, Number]:
    """half base, drop, crank, rod of the equivalent five-bar, from the exact values of the floats."""
    b0 = mp.mpf(g.b) - mp.mpf(g.p) - mp.mpf(g.a1) * mp.sin(mp.mpf(g.beta))
    return b0, mp.mpf(g.e), mp.mpf(g.l1), mp.mpf(g.l2eq)


def across(centre1: Number, r1: Number, centre2: Number, r2: Number, side: int) -> Number:
    """Intersection of two circles in the complex plane, left (+1) or right (-1) of the way from 1 to 2."""
    line = centre2 - centre1
    d = abs(line)
    along = (d * d + r1 * r1 - r2 * r2) / (2 * d)
    return centre1 + line / d * (along + 1j * side * mp.sqrt(r1 * r1 - along * along))


def direct(g: Any, q: tuple[float, float], assembly: int) -> tuple[Number, Number, Number, Number]:
    """x, z, psi_1, psi_2."""
    b0, e, l1, l2 = loop(g)
    C = [sign * b0 - 1j * e + l1 * mp.expj(-mp.mpf(angle)) for sign, angle in zip((-1, 1), q, strict=True)]
    P = across(C[0], l2, C[1], l2, assembly)
    return P.real, P.imag, -mp.arg(P - C[0]), -mp.arg(P - C[1])


def inverse(g: Any, pose: tuple[float, float], mode: tuple[int, int]) -> tuple[Number, Number]:
    """q_1, q_2. The elbow with sin(q - psi) > 0 lies left of the way from A to P, as drawn with x right and z up."""
    b0, e, l1, l2 = loop(g)
    P = mp.mpf(pose[0]) + 1j * mp.mpf(pose[1])
    angles = []
    for sign, w in zip((-1, 1), mode, strict=True):
        A = sign * b0 - 1j * e
        elbow = across(A, l1, P, l2, -w)
        angles.append(-mp.arg(elbow - A))
    return angles[0], angles[1]


def kappa(g: Any, psi1: Number, psi2: Number) -> Number:
    """Third singular value of the moments of both legs, from cross products of 3-D vectors."""
    a1, a2, p, l2, beta = (mp.mpf(value) for value in (g.a1, g.a2, g.p, g.l2eq, g.beta))
    s, c = mp.sin(beta), mp.cos(beta)
    columns, meets = [], []
    for sigma, psi in ((1, psi1), (-1, psi2)):
        EF = mp.matrix([l2 * mp.cos(psi) + sigma * (a1 - a2) * s, 0, -l2 * mp.sin(psi)])  # lambda u(theta)
        for side in (1, -1):
            e1 = mp.matrix([sigma * s, side * c, 0])
            normal = cross(e1, cross(e1, EF - (a1 - a2) * e1))
            columns.append(normal / mp.norm(normal))
        # The rod lines meet in the plane y = 0, beyond F by a2/(a1 - a2) of EF; seen from the platform point.
        meets.append(mp.matrix([-sigma * (p + a2 * s), 0, 0]) + a2 / (a1 - a2) * EF)
    line = meets[1] - meets[0]
    columns.append(cross(unit_y, line) / (2 * (p + a2 / (a1 - a2) * l2)))
    M = mp.matrix(3, 5)
    for i, column in enumerate(columns):
        M[:, i] = column
    return min(mp.svd_r(M, compute_uv=False))


unit_y = mp.matrix([0, 1, 0])


def cross(a: Any, b: Any) -> Any:
    return mp.matrix([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
