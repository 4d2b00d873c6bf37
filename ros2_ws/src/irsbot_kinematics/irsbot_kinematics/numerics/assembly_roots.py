"""All turns with which a platform can be assembled: roots of a trigonometric polynomial of degree 3.

The legs' equations, freed of the position of the platform, leave one equation T(phi) = 0 for its turn. T is known by
its values at 8 turns; a half-angle substitution about the turn where |T| is largest makes it a polynomial of degree 6
with a large leading coefficient, whose roots are eigenvalues of a companion matrix. Arrays, one row per sample.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from irsbot_kinematics.numerics.arithmetic import Array

DEGREE = 3
SAMPLED_TURNS: Array = np.arange(8.0) * (np.pi / 4.0)
"""(8,) rad: where T has to be given; 7 would do."""


def _half_angle_powers() -> NDArray[np.complex128]:
    """Row k + 3: coefficients in t, highest first, of e^(ik psi) (1 + t^2)^3 with t = tan(psi/2)."""
    rows = []
    for k in range(-DEGREE, DEGREE + 1):
        row = np.array([1.0 + 0.0j])
        for factor in [[1j, 1.0]] * (DEGREE + k) + [[-1j, 1.0]] * (DEGREE - k):
            row = np.convolve(row, factor)
        rows.append(row)
    return np.array(rows)


_POWERS = _half_angle_powers()
_ORDERS = np.arange(-DEGREE, DEGREE + 1)


def trigonometric_roots(values: Array) -> tuple[Array, Array]:
    """All six roots of a trigonometric polynomial T(phi) of degree 3.

    values: (N, 8) T at SAMPLED_TURNS, in any unit; one row per joint position.
    Returns turns (N, 6), rad in -pi..pi, and how far each is from real (N, 6): |log |e^(i phi)||, 0 for a real root.
    Two roots that are not real share the turn of both. NaN where T is 0 throughout; nothing raises.
    Eigenvalues of the companion matrix of a polynomial of degree 6 in tan(psi/2), see the head of the file.
    """
    fourier = values @ np.exp(-1j * np.outer(SAMPLED_TURNS, _ORDERS)) / len(SAMPLED_TURNS)
    middle = SAMPLED_TURNS[np.argmax(np.abs(values), axis=1)] - np.pi
    coefficients = np.real((fourier * np.exp(1j * np.outer(middle, _ORDERS))) @ _POWERS)
    companion = np.zeros((len(values), 6, 6))
    companion[:, np.arange(1, 6), np.arange(5)] = 1.0
    with np.errstate(divide="ignore", invalid="ignore"):
        companion[:, 0, :] = -coefficients[:, 1:] / coefficients[:, :1]
    known = np.isfinite(companion).all(axis=(1, 2))
    t = np.full((len(values), 6), np.nan, dtype=complex)
    t[known] = np.linalg.eigvals(companion[known])
    with np.errstate(divide="ignore", invalid="ignore"):
        z = (1.0 + 1j * t) / (1.0 - 1j * t)
        turns = middle[:, None] + np.angle(z)
        return turns - 2.0 * np.pi * np.round(turns / (2.0 * np.pi)), np.abs(np.log(np.abs(z)))


Pair = tuple[Array, Array]


def planar_position(ends: Sequence[Pair], lengths_m: Sequence[Array | float]) -> tuple[Pair, Array]:
    """a, m^3, and D, m^2, with D P = a: where two differences of |P + k_i|^2 = length_i^2, i = 1, 2, 3, put P.

    ends: k_i (x, y), m, arrays: the platform joint, seen from P, less the base point of its leg.
    lengths_m: (3,) of the legs, m.
    """
    (x1, y1), (x2, y2), (x3, y3) = ends
    s1, s2, s3 = [length * length - x * x - y * y for length, (x, y) in zip(lengths_m, ends, strict=True)]
    h2, h3 = 0.5 * (s2 - s1), 0.5 * (s3 - s1)
    x2, y2, x3, y3 = x2 - x1, y2 - y1, x3 - x1, y3 - y1
    return (h2 * y3 - h3 * y2, h3 * x2 - h2 * x3), x2 * y3 - y2 * x3


def planar_closing(ends: Sequence[Pair], lengths_m: Sequence[Array | float]) -> Array:
    """What vanishes at a turn with which three legs of given lengths meet a planar platform.

    ends: k_i (x, y), m, arrays: the platform joint, turned and seen from P, less the base point of its leg.
    lengths_m: (3,) of the legs, m, numbers or arrays.
    Returns |a|^2 + 2 D a.k_1 + D^2 (|k_1|^2 - length_1^2), m^6, with D P = a of `planar_position`: a trigonometric
    polynomial of degree 3 in the turn. Source: [S4], Listing 8.
    """
    (ax, ay), D = planar_position(ends, lengths_m)
    kx, ky = ends[0]
    closing: Array = ax * ax + ay * ay + 2.0 * D * (ax * kx + ay * ky) + D * D * (kx * kx + ky * ky - lengths_m[0] ** 2)
    return closing


def planar_meetings(
    ends: Sequence[Pair], lengths_m: Sequence[Array | float], turn: Array
) -> tuple[Array, Array, Array]:
    """Poses that may belong to given turns: both points where the circle of leg 1 meets that of leg 2 or 3, whichever
    has its centre farther away.

    ends: k_i (x, y), (N, M) m, at these turns, as in `planar_closing`. lengths_m: (3,) of the legs, m.
    turn: (N, M) rad. Returns x, y, m, and turn, (N, 2 M) each; whether the third leg closes is for the caller to check.

    P = a/D of `planar_position` is one of them, but is 0/0 where two poses share a turn.
    """
    (x1, y1), (x2, y2), (x3, y3) = ends
    first, second, third = lengths_m
    farther = np.hypot(x3 - x1, y3 - y1) > np.hypot(x2 - x1, y2 - y1)
    x2, y2, second = np.where(farther, x3, x2), np.where(farther, y3, y2), np.where(farther, third, second)
    dx, dy = x1 - x2, y1 - y2  # from centre to centre: they are at minus the ends
    square = dx * dx + dy * dy
    along = 0.5 * (1.0 + (first - second) * (first + second) / square)
    aside = np.sqrt(np.maximum(first * first / square - along * along, 0.0))
    x, y = along * dx - x1, along * dy - y1
    both_x = np.concatenate([x - aside * dy, x + aside * dy], axis=1)
    both_y = np.concatenate([y + aside * dx, y - aside * dx], axis=1)
    return both_x, both_y, np.tile(turn, (1, 2))
