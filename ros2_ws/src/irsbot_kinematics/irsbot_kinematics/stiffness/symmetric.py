"""Small symmetric matrices with the samples last: (3, 3, ...) arrays, so that every operation runs over all samples.

A structure that mirrors itself in the plane of motion (x0, z0) answers a wrench in that plane within it, and a wrench
across it across it. Its 6 x 6 stiffness falls into two blocks of 3 x 3:
    planar   twist [dx dz ry], wrench [fx fz my]
    lateral  twist [dy rx rz], wrench [fy mx mz]
"""

from __future__ import annotations

import numpy as np

from irsbot_kinematics.numerics.arithmetic import Array

PLANAR = (0, 2, 4)
LATERAL = (1, 3, 5)


def inverse3(K: Array) -> Array:
    """Inverse of symmetric (3, 3, ...) by cofactors; infinite or NaN where the determinant is 0."""
    a, b, c, d, e, f = K[0, 0], K[1, 1], K[2, 2], K[0, 1], K[0, 2], K[1, 2]
    A, B, C = b * c - f * f, a * c - e * e, a * b - d * d
    D, E, F = e * f - c * d, d * f - b * e, d * e - a * f
    adjugate = np.array([[A, D, E], [D, B, F], [E, F, C]])
    inverse: Array = adjugate / (a * A + d * D + e * E)
    return inverse


def congruent(T: Array, C: Array) -> Array:
    """T' C T of (i, a, ...), (i, j, ...)."""
    product: Array = np.einsum("ia...,ib...->ab...", T, np.einsum("ij...,jb...->ib...", C, T))
    return product


def apply(C: Array, v: Array) -> Array:
    """C v of (i, j, ...), (j, ...)."""
    product: Array = np.einsum("ij...,j...->i...", C, v)
    return product


def dot(a: Array, b: Array) -> Array:
    """a . b of (i, ...)."""
    product: Array = np.einsum("i...,i...->...", a, b)
    return product


def condensed(W: tuple[Array, Array], M: tuple[Array, Array, Array]) -> tuple[Array, tuple[Array, Array]]:
    """Stiffness W M^-1 W' of two wrenches W (3, ...) with compliance M = (M11, M12, M22), and the two rows of M^-1 W'.

    M is positive definite. This is (11) of [S1] after its passive joints are eliminated: the structure carries nothing
    but the wrenches W.
    """
    (a, b), (m11, m12, m22) = W, M
    det = m11 * m22 - m12 * m12
    first, second = (m22 * a - m12 * b) / det, (m11 * b - m12 * a) / det
    return a[:, None] * first[None] + b[:, None] * second[None], (first, second)


def full(planar: Array, lateral: Array) -> Array:
    """(N, 6, 6) from blocks (3, 3, N)."""
    K = np.zeros((planar.shape[-1], 6, 6))
    K[np.ix_(range(len(K)), PLANAR, PLANAR)] = np.moveaxis(planar, -1, 0)
    K[np.ix_(range(len(K)), LATERAL, LATERAL)] = np.moveaxis(lateral, -1, 0)
    return K
