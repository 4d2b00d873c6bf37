"""Open cylindrical decomposition of a box in the plane by algebraic curves (walls). Exact."""

from __future__ import annotations

import itertools
from bisect import bisect_left
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

from irsbot_kinematics.algebra.bivariate import Curve, discriminant, resultant
from irsbot_kinematics.algebra.charts import Axis
from irsbot_kinematics.algebra.model.engine import flint
from irsbot_kinematics.algebra.model.roots import RealRoot, isolate, merged, squarefree_part

NEAR_BITS = 120
"""bit: width of the interval about a critical value in which two columns are compared, relative to the box."""

GAP_BITS = 30
"""bit: gaps between two columns that are narrower, relative to the box, are the ends of walls that meet."""

Said = Callable[[str, int, int], None]
"""Progress callback: task, done, total."""


class Plane:
    """Columns between critical values of the first coordinate, stacks of cells between walls in each."""

    def __init__(self, walls: Sequence[Any], first: Axis, second: Axis, stated: Said | None = None) -> None:
        """walls: irreducible polynomials of Z[first.gen, second.gen] without common factors."""
        self.first, self.second = first, second
        self.curves = [Curve(wall) for wall in walls]
        self.stated = stated or (lambda _what, _done, _total: None)
        self.criticals = self._criticals()
        ends = [first.low, *[None] * len(self.criticals), first.high]
        self.columns: list[Fraction] = []
        for k in range(len(ends) - 1):
            self.columns.append(first.sample(*self._between(k)))
        self.stacks = [self.stack(u) for u in self.columns]

    @classmethod
    def restored(
        cls, walls: Sequence[Any], first: Axis, second: Axis, criticals: list[RealRoot], columns: list[Fraction]
    ) -> Plane:
        """A plane with known critical values."""
        plane = cls.__new__(cls)
        plane.first, plane.second, plane.curves = first, second, [Curve(wall) for wall in walls]
        plane.stated = lambda _what, _done, _total: None
        plane.criticals, plane.columns, plane.critical_polys = criticals, columns, []
        plane.stacks = [plane.stack(u) for u in columns]
        return plane

    def stack(self, u: Fraction) -> list[RealRoot]:
        """Walls over a first coordinate that is not critical, ascending, within the box."""
        groups = []
        for curve in self.curves:
            poly = squarefree_part(curve.at_u(u.numerator, u.denominator))
            inside = [r for r in isolate(poly) if self._inside(r, self.second)]
            groups.append(inside)
        return merged(groups)

    def rows(self, column: int) -> int:
        """Number of cells in a column."""
        return len(self.stacks[column]) + 1

    def sample(self, column: int, row: int) -> tuple[Fraction, Fraction]:
        """A simple point of a cell, in chart coordinates."""
        stack = self.stacks[column]
        low = self.second.low if row == 0 else stack[row - 1]
        high = self.second.high if row == len(stack) else stack[row]
        return self.columns[column], self.second.sample(*_apart(low, high))

    def locate(self, u: Fraction, v: Fraction) -> tuple[int, int] | None:
        """Column and row of a point in chart coordinates; None on a wall or outside. Exact.

        A point of a critical line that is on no wall belongs to the cell at its left.
        """
        if not (self.first.low < u < self.first.high and self.second.low < v < self.second.high):
            return None
        column = 0
        for k, root in enumerate(self.criticals):
            side = root.compare(u)
            if side == 0:
                return self._beside_critical(k, u, v)
            column += side < 0
        row = 0
        for root in self.stack(u):
            side = root.compare(v)
            if side == 0:
                return None
            row += side < 0
        return column, row

    def _beside_critical(self, k: int, u: Fraction, v: Fraction) -> tuple[int, int] | None:
        at = flint.fmpq(v.numerator, v.denominator)
        if any(curve.at_u(u.numerator, u.denominator)(at) == 0 for curve in self.curves):
            return None
        left = (self._between(k)[0] + u) / 2
        while not self._free(left, u, v):
            left = (left + u) / 2
        return self.locate(left, v)

    # --- critical values -----------------------------------------------------------------------------------------

    def _criticals(self) -> list[RealRoot]:
        found: list[Any] = []
        total = len(self.curves) * (len(self.curves) + 3) // 2
        done = 0

        def add(poly: Any) -> None:
            if poly.degree() < 1:
                return
            bare = squarefree_part(poly)
            for known in found:
                shared = bare.gcd(known)
                if shared.degree() > 0:
                    bare = bare // shared
            if bare.degree() > 0:
                found.append(bare)

        for i, curve in enumerate(self.curves):
            for end in (self.second.low, self.second.high):
                add(curve.at_v(end.numerator, end.denominator))
            add(curve.leading())
            if curve.dv > 1:
                add(discriminant(curve))
            for other in self.curves[:i]:
                if curve.dv and other.dv:
                    add(resultant(curve, other))
                done += 1
            done += 2
            self.stated("critical values", done, total)
        self.critical_polys = found
        return merged([[r for r in isolate(poly) if self._inside(r, self.first)] for poly in found])

    @staticmethod
    def _inside(root: RealRoot, axis: Axis) -> bool:
        return root.compare(axis.low) > 0 and root.compare(axis.high) < 0

    def _between(self, k: int) -> tuple[Fraction, Fraction]:
        low = self.first.low if k == 0 else self.criticals[k - 1]
        high = self.first.high if k == len(self.criticals) else self.criticals[k]
        return _apart(low, high)

    # --- neighbours ----------------------------------------------------------------------------------------------

    def edges(self) -> list[tuple[tuple[int, int], tuple[int, int]]]:
        """Pairs of cells of neighbouring columns that touch along an open piece of their common line.

        Each pair is certified by a segment that crosses no wall.
        """
        found = []
        span_u, span_v = self.first.high - self.first.low, self.second.high - self.second.low
        for k, root in enumerate(self.criticals):
            self.stated("cell graph", k + 1, len(self.criticals))
            left, right = self.beside(root, span_u)
            stacks = [self.stack(left), self.stack(right)]
            for stack in stacks:
                for wall in stack:
                    while wall.high - wall.low > span_v / 2**NEAR_BITS and not wall.exact:
                        wall.refine(NEAR_BITS)
            cuts = sorted({self.second.low, self.second.high, *(w.high for s in stacks for w in s)})
            heights = [[wall.high for wall in stack] for stack in stacks]
            seen = set()
            for low, high in itertools.pairwise(cuts):
                if high - low < span_v / 2**GAP_BITS:
                    continue
                middle = (low + high) / 2
                pair = tuple(bisect_left(row, middle) for row in heights)
                if pair in seen:
                    continue
                for share in (Fraction(1, 2), Fraction(1, 3), Fraction(5, 6), Fraction(1, 8)):
                    v = low + share * (high - low)
                    near = (high - low) / 64
                    if self._free(left, right, _short(v - near, v + near)):
                        seen.add(pair)
                        found.append(((k, pair[0]), (k + 1, pair[1])))
                        break
        return found

    def wall_of(self, u: Fraction, root: RealRoot) -> int:
        """Index of the curve that a root of `stack(u)` belongs to."""
        shared = (curve.at_u(u.numerator, u.denominator).gcd(root.poly) for curve in self.curves)
        return next(i for i, part in enumerate(shared) if part.degree() > 0)

    def beside(self, root: RealRoot, span: Fraction) -> tuple[Fraction, Fraction]:
        """Rational numbers close to a critical value, below and above it. span: range of the first coordinate."""
        while root.high - root.low > span / 2**NEAR_BITS and not root.exact:
            root.refine(NEAR_BITS)
        wide = span / 2**NEAR_BITS
        return _short(root.low - 2 * wide, root.low - wide), _short(root.high + wide, root.high + 2 * wide)

    def _free(self, left: Fraction, right: Fraction, v: Fraction) -> bool:
        """True if no wall meets the segment from (left, v) to (right, v): enclosures that exclude 0."""
        with flint.ctx.workprec(4 * NEAR_BITS):
            middle = flint.arb(flint.fmpq((left + right).numerator, 2 * (left + right).denominator))
            half = flint.arb(flint.fmpq((right - left).numerator, 2 * (right - left).denominator))
            ball = middle + flint.arb(0, half.abs_upper())
            for curve in self.curves:
                poly = flint.arb_poly(curve.at_v(v.numerator, v.denominator))
                offset = poly(flint.arb_poly([middle, 1]))(ball - middle)
                if offset.contains(0):
                    return False
        return True


def _apart(low: Fraction | RealRoot, high: Fraction | RealRoot) -> tuple[Fraction, Fraction]:
    """Rational ends of an open interval strictly between two different numbers."""
    while True:
        bottom = low.high if isinstance(low, RealRoot) else low
        top = high.low if isinstance(high, RealRoot) else high
        if bottom < top:
            return bottom, top
        for end in (low, high):
            if isinstance(end, RealRoot):
                end.refine()


def _short(low: Fraction, high: Fraction) -> Fraction:
    """A dyadic number between two, with few bits."""
    width = high - low
    bits = max(0, (width.denominator // max(width.numerator, 1)).bit_length() + 2)
    scale = 2**bits
    return Fraction(-((-low.numerator * scale) // low.denominator) + 1, scale)
