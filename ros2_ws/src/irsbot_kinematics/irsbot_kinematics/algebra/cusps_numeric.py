"""Cusps of any slice by Newton's method from many starts. Numeric: every result is a cusp, but some may be missing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from math import atan2, inf
from typing import Any

import numpy as np

from irsbot_kinematics.algebra.cusp_records import Cusp, Cusps
from irsbot_kinematics.algebra.determinants import jacobian
from irsbot_kinematics.algebra.model.parse import cosine_of, sine_of
from irsbot_kinematics.algebra.model.polynomial import fraction
from irsbot_kinematics.algebra.model.system import System
from irsbot_kinematics.algebra.sampling import Numeric

STARTS = 600
"""1: random starts."""

STEPS = 40
"""1: Newton steps."""

CONVERGED = 1e-10
"""1: relative size of the last step."""

APART = 1e-6
"""1: cusps that differ by less are the same."""


def numeric_cusps(system: System, space: str, free: Sequence[str], known: Mapping[str, Fraction]) -> Cusps:
    """F = 0, h = 0, w.D2F[v, v] = 0: h is the entry that borders dF/dU to a regular matrix, v and w its kernels."""
    unknown = (*system.pose, *system.passive) if space == "joint" else (*system.joints, *system.passive)
    gens, parameters = system.gens(unknown), system.gens(free)
    names = (*gens, *parameters)
    polys = [p for p in (*system.polys(known), *system.circles(unknown)) if p != 0]
    circles = system.circles(free)
    n = len(gens)
    if len(polys) != n:
        return Cusps([], "numeric", None)
    rows = jacobian(polys, gens)
    slopes = [p for row in rows for p in row]
    bends = [p.derivative(g) for p in slopes for g in gens]
    table = Table([*polys, *circles, *slopes, *bends], names)
    ends = np.cumsum([len(polys) + len(circles), len(slopes)])
    rng = np.random.default_rng(7)
    border, other, corner = rng.normal(size=(n, 1)), rng.normal(size=(1, n)), np.zeros((1, 1))
    size = _size(system)
    points = _starts(rng, system, names, size)

    def conditions(at: Any) -> Any:
        count = len(at)
        flat, slope, bend = np.split(table(at), ends, axis=1)
        A = slope.reshape(count, n, n)
        full = np.concatenate(
            [
                np.concatenate([A, np.broadcast_to(border, (count, n, 1))], axis=2),
                np.broadcast_to(np.concatenate([other, corner], axis=1), (count, 1, n + 1)),
            ],
            axis=1,
        )
        right = np.zeros((count, n + 1, 1), dtype=at.dtype)
        right[:, n] = 1.0
        v = np.linalg.solve(full, right)[:, :, 0]
        w = np.linalg.solve(np.swapaxes(full, 1, 2), right)[:, :, 0]
        curve = np.einsum("ki,kijl,kj,kl->k", w[:, :n], bend.reshape(count, n, n, n), v[:, :n], v[:, :n])
        return np.concatenate([flat, v[:, n:], curve[:, None]], axis=1)

    change = np.full(len(points), inf)
    with np.errstate(all="ignore"):
        for _ in range(STEPS):
            try:
                value = conditions(points)
                columns = []
                for i in range(len(names)):
                    moved = points.astype(complex)
                    moved[:, i] += 1e-30j
                    columns.append(conditions(moved).imag / 1e-30)
                slope = np.stack(columns, axis=2)
                step = np.linalg.solve(slope, value[:, :, None])[:, :, 0]
            except np.linalg.LinAlgError:
                points = points + rng.normal(size=points.shape) * 1e-6
                continue
            length = np.abs(step).max(axis=1, keepdims=True)
            step = step * np.minimum(1.0, size / np.where(length > 0.0, length, 1.0))
            points = points - step
            change = np.abs(step).max(axis=1) / (1.0 + np.abs(points).max(axis=1))
            ok = np.isfinite(points).all(axis=1)
            points, change = points[ok], change[ok]
            if not len(points):
                break
    return Cusps(_distinct(system, free, known, names, points[change < CONVERGED]), "numeric", None)


class Table:
    """Many polynomials over one list of monomials: values (N, K) at points (N, n)."""

    def __init__(self, polys: Sequence[Any], names: Sequence[str]) -> None:
        own = tuple(polys[0].context().names())
        place = [own.index(name) for name in names]
        index: dict[tuple[int, ...], int] = {}
        entries = []
        for k, poly in enumerate(polys):
            for m, c in zip(poly.monoms(), poly.coeffs(), strict=True):
                row = index.setdefault(tuple(int(m[i]) for i in place), len(index))
                entries.append((row, k, float(fraction(c))))
        self.powers = np.array(list(index)).reshape(-1, len(names))
        self.matrix = np.zeros((len(index), len(polys)))
        for row, k, value in entries:
            self.matrix[row, k] = value

    def __call__(self, points: Any) -> Any:
        found = np.ones((len(points), len(self.powers)), dtype=points.dtype)
        for i in range(self.powers.shape[1]):
            column = np.stack([points[:, i] ** k for k in range(self.powers[:, i].max() + 1)], axis=1)
            found = found * column[:, self.powers[:, i]]
        return found @ self.matrix


def _size(system: System) -> float:
    lengths = [abs(float(v)) for v in system.values.values() if isinstance(v, Fraction)]
    return max(lengths, default=1.0) or 1.0


def _starts(rng: Any, system: System, names: Sequence[str], size: float) -> Any:
    points = rng.uniform(-2.0 * size, 2.0 * size, (STARTS, len(names)))
    for angle in system.angles:
        if cosine_of(angle) in names:
            turn = rng.uniform(-np.pi, np.pi, STARTS)
            points[:, names.index(cosine_of(angle))] = np.cos(turn)
            points[:, names.index(sine_of(angle))] = np.sin(turn)
    return points


def _distinct(
    system: System, free: Sequence[str], known: Mapping[str, Fraction], names: Sequence[str], points: Any
) -> list[Cusp]:
    found: list[Cusp] = []
    kept: list[Any] = []
    variables = (*system.pose, *system.joints)
    for point in points:
        if any(np.abs(point - other).max() < APART * (1.0 + np.abs(point).max()) for other in kept):
            continue
        at = {**{g: float(v) for g, v in known.items()}, **dict(zip(names, point.tolist(), strict=True))}
        values = {
            name: atan2(at[sine_of(name)], at[cosine_of(name)]) if name in system.angles else at[name]
            for name in variables
        }
        if all(_positive(system, poly, at) for poly in system.positive()):
            kept.append(point)
            found.append(Cusp({n: values[n] for n in system.pose}, {n: values[n] for n in system.joints}, inf))
    found.sort(key=lambda cusp: [({**cusp.joints, **cusp.pose})[name] for name in free])
    return found


def _positive(system: System, poly: Any, at: Mapping[str, float]) -> bool:
    names = [n for n in system.gens(system.names) if n in at]
    compiled = Numeric(poly, [*names]) if all(n in at for n in occurring(poly)) else None
    return compiled is None or bool(compiled(np.array([[at[n] for n in names]]))[0] > 0.0)


def occurring(poly: Any) -> set[str]:
    """Names of the generators that occur."""
    return {name for name, degree in zip(poly.context().names(), poly.degrees(), strict=True) if degree > 0}
