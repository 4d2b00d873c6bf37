"""Follows one branch of the direct kinematics along joint motions, with a proof for every step (Krawczyk, 1969)."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import atan2
from typing import Any

import numpy as np
from numpy.typing import NDArray

from irsbot_kinematics.algebra.determinants import jacobian
from irsbot_kinematics.algebra.model.engine import AlgebraError, flint
from irsbot_kinematics.algebra.model.parse import cosine_of, sine_of
from irsbot_kinematics.algebra.model.system import System

Floats = NDArray[np.float64]

WIDER = 1.5
"""1: width of a tried box, as a multiple of the first-order motion of the solution."""

INFLATIONS = 4
"""1: number of boxes that are tried before a step is halved."""

SMALLEST = 2.0**-30
"""1: shares of a segment below which the branch counts as lost."""

FLOOR = 1e-12
"""1: least relative radius of a box; below it rounding errors dominate."""


@dataclass(frozen=True)
class Followed:
    """Result of following a path. lost_at: index of the path point from which no step could be proved, or None."""

    poses: list[dict[str, float]]
    """At every path point."""
    dets: list[float]
    """det dF/d(X, P) over 2 per angle, at every path point; its sign is constant if lost_at is None. Numeric."""
    steps: int
    """Proved steps."""
    lost_at: int | None


class Tracker:
    """Follows solutions of a system; the unknowns are pose and passive variables."""

    def __init__(self, system: System) -> None:
        self.system = system
        self.unknown = system.gens((*system.pose, *system.passive))
        self.joint_gens = system.gens(system.joints)
        self.names = (*self.unknown, *self.joint_gens)
        polys = [*system.polys(), *system.circles((*system.pose, *system.passive))]
        self._values = [self._terms(p) for p in polys]
        self._slopes = [[self._terms(p) for p in row] for row in jacobian(polys, self.unknown)]
        self._float_values = [self._compiled(terms) for terms in self._values]
        self._float_slopes = [[self._compiled(terms) for terms in row] for row in self._slopes]
        turned = sum(name in system.angles for name in (*system.pose, *system.passive))
        self._scale = 2.0**-turned

    def follow(self, path: Sequence[Sequence[float]], start: Mapping[str, float]) -> Followed:
        """From a pose (and passive values) near `start`, along straight segments between joint positions."""
        points = [np.asarray(q, dtype=float) for q in path]
        U = self._newton(self._gens_of(start), points[0])
        if U is None:
            raise AlgebraError(f"{self.system.name}: no solution near the given start")
        poses, dets = [self._pose(U)], [self._det(U, points[0])]
        steps = 0
        box: list[Any] | None = None
        for index, (a, b) in enumerate(itertools.pairwise(points)):
            left, share = 0.0, 1.0
            while left < 1.0:
                share = min(share, 1.0 - left)
                ends = a + left * (b - a), a + (left + share) * (b - a)
                found = self._step(U, *ends, box)
                if found is not None:
                    U, box = found
                    left, share, steps = left + share, 2.0 * share, steps + 1
                elif share > SMALLEST:
                    share *= 0.5
                else:
                    return Followed(poses, dets, steps, index)
            poses.append(self._pose(U))
            dets.append(self._det(U, b))
        return Followed(poses, dets, steps, None)

    # --- one step --------------------------------------------------------------------------------------------------

    def _step(self, U: Floats, qa: Floats, qb: Floats, inside: list[Any] | None) -> tuple[Floats, list[Any]] | None:
        """Proof that one regular solution connects U at qa to the returned one at qb; None without proof.

        inside: the box of the step before; the enclosure of its solution at qa has to lie in the new box.
        """
        ahead = self._newton(U, qb)
        if ahead is None:
            return None
        middle = 0.5 * (U + ahead)
        better = self._newton(middle, 0.5 * (qa + qb))
        centre = middle if better is None else better
        slopes = self._slope_floats(centre, 0.5 * (qa + qb))
        try:
            inverse: Floats = np.asarray(np.linalg.inv(slopes), dtype=float)
        except np.linalg.LinAlgError:
            return None
        joints = self._joint_balls(qa, qb)
        shift = self._shift(inverse, centre, joints)
        floor = FLOOR * (1.0 + np.abs(centre).max())
        image = np.array([_upper(s) for s in shift])
        for _ in range(INFLATIONS):
            radius = WIDER * image + floor
            box = [flint.arb(c, r) for c, r in zip(centre, radius, strict=True)]
            image = self._image(inverse, shift, box, radius, joints)
            if (image < radius).all():
                break
        else:
            return None
        for end, q in ((U, qa), (ahead, qb)):
            if not self._encloses(box, end, q):
                return None
        if inside is not None and not self._encloses(inside, U, qa):
            return None
        return ahead, box

    def _encloses(self, box: Sequence[Any], U: Floats, q: Floats) -> bool:
        """True if a tight box about U contains a solution at q and lies in `box`."""
        n, size = len(U), 1e-9 * (1.0 + np.abs(U).max())
        small = [flint.arb(c, size) for c in U]
        if not all(outer.contains(inner) for outer, inner in zip(box, small, strict=True)):
            return False
        joints = self._joint_balls(q, q)
        try:
            inverse: Floats = np.asarray(np.linalg.inv(self._slope_floats(U, q)), dtype=float)
        except np.linalg.LinAlgError:
            return False
        return self._contracts(inverse, self._shift(inverse, U, joints), small, np.full(n, size), joints)

    def _shift(self, inverse: Floats, centre: Floats, joints: Sequence[Any]) -> list[Any]:
        """-Y F(centre, joints): distance of the solution from the centre, to first order."""
        exact = [flint.arb(c) for c in centre]
        residual = [_value(terms, (*exact, *joints)) for terms in self._values]
        return [-sum((flint.arb(y) * r for y, r in zip(row, residual, strict=True)), flint.arb(0)) for row in inverse]

    def _contracts(
        self, inverse: Floats, shift: Sequence[Any], box: Sequence[Any], radius: Floats, joints: Sequence[Any]
    ) -> bool:
        """Krawczyk's test: for all these joints exactly one solution lies in the box, and dF/dU is regular in it."""
        return bool((self._image(inverse, shift, box, radius, joints) < radius).all())

    def _image(
        self, inverse: Floats, shift: Sequence[Any], box: Sequence[Any], radius: Floats, joints: Sequence[Any]
    ) -> Floats:
        """Upper bounds (n,) of |K(box) - centre|, K Krawczyk's operator."""
        slope = [[_value(terms, (*box, *joints)) for terms in row] for row in self._slopes]
        n, found = len(radius), []
        for i in range(n):
            total = shift[i]
            for j in range(n):
                entry = flint.arb(int(i == j)) - sum(
                    (flint.arb(inverse[i, k]) * slope[k][j] for k in range(n)), flint.arb(0)
                )
                total = total + entry * flint.arb(0, radius[j])
            found.append(_upper(total))
        return np.array(found)

    # --- values ----------------------------------------------------------------------------------------------------

    def _terms(self, poly: Any) -> list[tuple[Any, list[tuple[int, int]]]]:
        own = tuple(poly.context().names())
        place = {own.index(name): k for k, name in enumerate(self.names)}
        return [
            (flint.arb(c), [(place[i], int(p)) for i, p in enumerate(m) if p])
            for m, c in zip(poly.monoms(), poly.coeffs(), strict=True)
        ]

    @staticmethod
    def _compiled(terms: list[tuple[Any, list[tuple[int, int]]]]) -> list[tuple[float, list[tuple[int, int]]]]:
        return [(float(c.mid()), powers) for c, powers in terms]

    def _slope_floats(self, U: Floats, q: Floats) -> Floats:
        at = (*U, *self._joint_floats(q))
        return np.array([[_value(terms, at) for terms in row] for row in self._float_slopes], dtype=float)

    def _det(self, U: Floats, q: Floats) -> float:
        return float(np.linalg.det(self._slope_floats(U, q)) * self._scale)

    def _newton(self, U: Floats, q: Floats) -> Floats | None:
        for _ in range(8):
            at = (*U, *self._joint_floats(q))
            value = np.array([_value(terms, at) for terms in self._float_values], dtype=float)
            try:
                step = np.linalg.solve(self._slope_floats(U, q), value)
            except np.linalg.LinAlgError:
                return None
            U = U - step
            if not np.isfinite(U).all():
                return None
            if np.abs(step).max() <= 1e-13 * (1.0 + np.abs(U).max()):
                return U
        return None

    def _joint_floats(self, q: Floats) -> list[float]:
        row: list[float] = []
        for name, value in zip(self.system.joints, q, strict=True):
            row += [float(np.cos(value)), float(np.sin(value))] if name in self.system.angles else [float(value)]
        return row

    def _joint_balls(self, qa: Floats, qb: Floats) -> list[Any]:
        row = []
        for name, a, b in zip(self.system.joints, qa, qb, strict=True):
            ball = flint.arb(a).union(flint.arb(b))
            row += [ball.cos(), ball.sin()] if name in self.system.angles else [ball]
        return row

    def _gens_of(self, start: Mapping[str, float]) -> Floats:
        row: list[float] = []
        for name in (*self.system.pose, *self.system.passive):
            if name not in start:
                raise AlgebraError(f"the start lacks '{name}'")
            value = float(start[name])
            row += [float(np.cos(value)), float(np.sin(value))] if name in self.system.angles else [value]
        return np.array(row)

    def _pose(self, U: Floats) -> dict[str, float]:
        values = dict(zip(self.unknown, U.tolist(), strict=True))
        return {
            name: atan2(values[sine_of(name)], values[cosine_of(name)]) if name in self.system.angles else values[name]
            for name in (*self.system.pose, *self.system.passive)
        }


def _upper(ball: Any) -> float:
    """A float that is at least |ball|; NaN and infinity become infinity."""
    value = float(ball.abs_upper())
    return float(np.nextafter(value, np.inf)) if np.isfinite(value) else np.inf


def _value(terms: list[tuple[Any, list[tuple[int, int]]]], at: Sequence[Any]) -> Any:
    total: Any = 0.0
    for coefficient, powers in terms:
        term = coefficient
        for i, power in powers:
            term = term * (at[i] if power == 1 else at[i] ** power)
        total = total + term
    return total
