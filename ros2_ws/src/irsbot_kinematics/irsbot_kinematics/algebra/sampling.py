"""Complex points on the zero set of polynomials, by Newton's method from random starts. Numeric."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from irsbot_kinematics.algebra.model.polynomial import fraction

Complexes = NDArray[np.complex128]

STEPS = 60
"""1: Newton steps from each start."""

CONVERGED = 1e-13
"""1: size of the last Newton step relative to the point."""


class Numeric:
    """A flint polynomial compiled for arrays of points (N, n) in the order of `names`."""

    def __init__(self, poly: Any, names: Sequence[str]) -> None:
        own = tuple(poly.context().names())
        place = [own.index(name) for name in names]
        self.powers = np.array([[int(m[i]) for i in place] for m in poly.monoms()]).reshape(-1, len(names))
        exacts = [fraction(c) for c in poly.coeffs()]
        self.size = max(map(abs, exacts), default=1)
        self.coefficients = np.array([float(c / self.size) for c in exacts])

    def _monomials(self, points: Complexes, powers: NDArray[Any]) -> Complexes:
        found: Any = np.ones((len(points), len(powers)), dtype=points.dtype)
        for i in range(powers.shape[1]):
            if powers[:, i].any():
                table = np.ones((len(points), powers[:, i].max() + 1), dtype=points.dtype)
                for k in range(1, table.shape[1]):
                    table[:, k] = table[:, k - 1] * points[:, i]
                found = found * table[:, powers[:, i]]
        return np.asarray(found)

    def __call__(self, points: Any) -> Any:
        """Values (N,), scaled so that the largest coefficient is 1."""
        return self._monomials(points, self.powers) @ self.coefficients

    def relative(self, points: Any) -> NDArray[np.float64]:
        """|value| over the sum of the sizes of the terms, (N,)."""
        with np.errstate(all="ignore"):  # a far point may overflow: then it says nothing
            terms = self._monomials(points, self.powers) * self.coefficients
            size = np.abs(terms).sum(axis=1)
            found = np.abs(terms.sum(axis=1)) / np.where(size > 0.0, size, 1.0)
        return np.asarray(np.where(np.isfinite(found), found, 1.0))

    def gradient(self, points: Any) -> Any:
        """Derivatives (N, n)."""
        columns = []
        for i in range(self.powers.shape[1]):
            there = self.powers[:, i] > 0
            lower = self.powers[there].copy()
            factors = self.coefficients[there] * lower[:, i]
            lower[:, i] -= 1
            columns.append(self._monomials(points, lower) @ factors if there.any() else 0.0 * points[:, 0])
        return np.stack(columns, axis=1)


def sample_zeros(
    polys: Sequence[Any], names: Sequence[str], count: int, seed: int = 1, scale: float = 2.0
) -> Complexes:
    """Up to `count` complex points (N, n) where all polynomials vanish, each on a random plane of its own."""
    functions = [Numeric(poly, names) for poly in polys]
    n, m = len(names), len(functions)
    rng = np.random.default_rng(seed)

    def random(*shape: int) -> Any:
        return (rng.normal(size=shape) + 1j * rng.normal(size=shape)) * scale

    points = random(count, n)
    planes = random(count, n - m, n) if n > m else np.zeros((count, 0, n), dtype=complex)
    through = np.einsum("kij,kj->ki", planes, points)
    change = np.full(count, np.inf)
    with np.errstate(all="ignore"):
        for _ in range(STEPS):
            value = np.stack([f(points) for f in functions], axis=1)
            jacobian = np.stack([f.gradient(points) for f in functions], axis=1)
            value = np.concatenate([value, np.einsum("kij,kj->ki", planes, points) - through], axis=1)
            jacobian = np.concatenate([jacobian, planes], axis=1)
            ok = np.isfinite(value).all(axis=1) & np.isfinite(jacobian).all(axis=(1, 2))
            step = np.full_like(points, np.nan)
            if ok.any():
                step[ok] = _solved(jacobian[ok], value[ok])
            points = points - step
            change = np.abs(step).max(axis=1) / (1.0 + np.abs(points).max(axis=1))
        # A point where the system is not regular converges slowly, and its digits are few: left out.
        good = np.isfinite(points).all(axis=1) & (change < CONVERGED)
    return np.asarray(points[good])


def _solved(matrices: Complexes, right: Complexes) -> Complexes:
    try:
        return np.asarray(np.linalg.solve(matrices, right[..., None])[..., 0])
    except np.linalg.LinAlgError:
        return np.asarray((np.linalg.pinv(matrices) @ right[..., None])[..., 0])
