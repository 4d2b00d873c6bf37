"""Where an IRSBot-2 is singular, from the corrected formulas of the papers, in complex numbers.

Postures of the distal loop that lose a constraint (Cases I to III of [S0], C1a, C1b), the arms that hold them, and
the curves of parallel singularities. A planar angle t is the number exp(-i t): x real, z imaginary.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from irsbot2_3d import Array, Design


class Point(NamedTuple):
    """One isolated constraint singularity of the robot."""

    kind: str
    psi: tuple[float, float]
    q: tuple[float, float]
    x: float
    z: float

    @property
    def working_mode(self) -> tuple[int, int]:
        return tuple(int(np.sign(np.sin(a - t))) for a, t in zip(self.q, self.psi, strict=True))


def distal_postures(d: Design) -> list[tuple[str, float, float]]:
    """(kind, psi_I, psi_II) of every constraint singularity of the distal loop, sheet section 8."""
    s, c = np.sin(d.beta), np.cos(d.beta)
    mu, D = d.a2 / (d.a1 - d.a2), d.D
    found: list[tuple[str, float, float]] = []
    quadratic = (
        -(d.l2eq**2) * s * s * mu,
        d.l2eq * c * c * (d.p - d.a2 * s),
        -d.p * (d.a1 - d.a2) * c * c * s + d.l2eq**2 * mu,
    )
    for X in np.roots(quadratic):
        if abs(X.imag) == 0.0 and abs(X.real) <= 1.0:
            found += [("I", psi + np.pi, psi) for psi in (np.arccos(X.real), -np.arccos(X.real))]
    p8 = d.a2 * s * np.tan(d.beta) ** 2
    if d.p < p8:
        X = np.sqrt(1.0 - d.p / p8)
        under = d.l2eq**2 - D**2 * d.p / p8
        if d.l2eq < D and under > 0.0:
            for theta in (np.arccos(-X), -np.arccos(-X)):
                for way in (1.0, -1.0):
                    lengths = D * X + way * np.sqrt(under), D * X - way * np.sqrt(under)
                    found.append(("II", *_psi(d, (theta + np.pi, theta), lengths)))
        elif d.l2eq > D:
            for cosine in (X, -X):
                for theta in (np.arccos(cosine), -np.arccos(cosine)):
                    lengths = D * cosine + np.sqrt(under), -D * cosine + np.sqrt(under)
                    found.append(("III", *_psi(d, (theta, theta), lengths)))
    if d.l2eq > D:
        upright = np.sqrt(d.l2eq**2 - D**2)
        for theta in (np.pi / 2, -np.pi / 2):
            found.append(("C1a", *_psi(d, (theta, theta), (upright, upright))))
            found.append(("C1b", *_psi(d, (theta, -theta), (upright, upright))))
    return found


def _psi(d: Design, theta: tuple[float, float], lam: tuple[float, float]) -> tuple[float, float]:
    """psi_k of l2eq u(psi_k) = lambda_k u(theta_k) - sigma_k D x."""
    rods = [length * np.exp(-1j * t) - sign * d.D for t, length, sign in zip(theta, lam, (1, -1), strict=True)]
    return -np.angle(rods[0]), -np.angle(rods[1])


def held_by_arms(d: Design, psi1: float, psi2: float) -> list[tuple[float, float, float, float]]:
    """(q_1, q_2, x, z): both ways in which two arms l1 span the gap that the distal loop leaves, if they can."""
    half = 0.5 * (d.l2eq * (np.exp(-1j * psi1) - np.exp(-1j * psi2)) - 2.0 * d.b0)
    rest = d.l1**2 - abs(half) ** 2
    if rest < 0.0:
        return []
    ways = []
    for side in (1j, -1j):
        middle = side * half / abs(half) * np.sqrt(rest)
        arm1, arm2 = middle - half, middle + half
        P = -d.b0 - 1j * d.e + arm1 + d.l2eq * np.exp(-1j * psi1)
        ways.append((-np.angle(arm1), -np.angle(arm2), P.real, P.imag))
    return ways


def constraint_points(d: Design) -> list[Point]:
    return [
        Point(kind, (psi1, psi2), (q1, q2), x, z)
        for kind, psi1, psi2 in distal_postures(d)
        for q1, q2, x, z in held_by_arms(d, psi1, psi2)
    ]


class Curve(NamedTuple):
    """Postures on a locus of parallel singularities."""

    q: Array
    x: Array
    z: Array


def parallel_rods(d: Design, number: int) -> Curve:
    """psi_I = psi_II: the elbows coincide at (0, -e +- sqrt(l1^2 - b0^2)), P runs on a circle around them."""
    psi = np.linspace(-np.pi, np.pi, number, endpoint=False)
    curves = []
    if abs(d.b0) < d.l1:
        for height in (1.0, -1.0):
            elbow = 1j * (height * np.sqrt(d.l1**2 - d.b0**2) - d.e)
            q = [np.full(number, -np.angle(elbow + sign * d.b0 + 1j * d.e)) for sign in (1.0, -1.0)]
            P = elbow + d.l2eq * np.exp(-1j * psi)
            curves.append((np.stack(q, axis=1), P.real, P.imag))
    return _joined(curves)


def rods_in_line(d: Design, number: int) -> Curve:
    """psi_I = psi_II + pi: P is halfway between the elbows, C_k = P -+ l2eq u(t)."""
    t = np.linspace(-np.pi, np.pi, number, endpoint=False)
    v = d.b0 - d.l2eq * np.exp(-1j * t)
    rest = d.l1**2 - np.abs(v) ** 2
    on = rest >= 0.0
    t, v, rest = t[on], v[on], rest[on]
    curves = []
    for side in (1j, -1j):
        P = side * v / np.abs(v) * np.sqrt(rest) - 1j * d.e
        elbows = P - d.l2eq * np.exp(-1j * t), P + d.l2eq * np.exp(-1j * t)  # psi_I = t, psi_II = t + pi
        q = [-np.angle(C + sign * d.b0 + 1j * d.e) for C, sign in zip(elbows, (1.0, -1.0), strict=True)]
        curves.append((np.stack(q, axis=1), P.real, P.imag))
    return _joined(curves)


def _joined(curves: list[tuple[Array, Array, Array]]) -> Curve:
    if not curves:
        return Curve(np.empty((0, 2)), np.empty(0), np.empty(0))
    return Curve(*(np.concatenate(parts) for parts in zip(*curves, strict=True)))
