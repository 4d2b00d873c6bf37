"""Results of a decomposition: cells, regions, areas, graph, location."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from math import pi
from typing import Any

import numpy as np

from irsbot_kinematics.algebra.charts import Axis
from irsbot_kinematics.algebra.model.engine import AlgebraError, flint
from irsbot_kinematics.algebra.model.polynomial import Polynomial, public, ring_of
from irsbot_kinematics.algebra.model.roots import RealRoot
from irsbot_kinematics.algebra.plane import Plane, Said
from irsbot_kinematics.arguments import checked, count

NODES = 24
"""1: Gauss-Legendre nodes of a column; walls with vertical tangents become smooth by the change of variable."""

Sample = tuple[Fraction | float, Fraction | float]


@dataclass(frozen=True)
class Cell:
    """One open cell. sample: a rational point (a float if the parameter is an angle). count: certified."""

    index: int
    column: int
    row: int
    sample: Sample
    chart: tuple[Fraction, Fraction] = field(repr=False)
    """The sample in chart coordinates, exact."""
    count: int
    """Number of real solutions that satisfy the inequalities."""


@dataclass(frozen=True)
class Region:
    """A connected component of adjacent cells with the same number of solutions; it does not depend on the columns."""

    index: int
    count: int
    cells: tuple[int, ...]
    area: float
    """Numeric, in the units of the two parameters; accurate to 1e-7 or better in all comparisons."""
    sample: Sample


@dataclass
class Cells:
    """A decomposed rectangle. Exact except for areas."""

    name: str
    space: str
    axes: tuple[Axis, Axis]
    walls: list[Polynomial]
    """Irreducible walls that meet the box; a parameter of axis kind 'square' denotes its square, 'tangent' tan(a/2)."""
    wall_kinds: list[str]
    """'singular' or 'limit' (an inequality), for each wall."""
    cells: list[Cell]
    graph: list[tuple[int, int]]
    """Pairs of cells that touch along a piece of line, certified."""
    regions: list[Region]
    fixed: dict[str, str]
    rounded: dict[str, Fraction]
    """Parameters that were rounded, and their rounded values."""
    cell_areas: list[float] = field(default_factory=list, repr=False)
    criticals: list[tuple[list[int], list[tuple[int, str, str]]]] = field(default_factory=list, repr=False)
    _plane: Plane | None = field(default=None, repr=False)

    @property
    def columns(self) -> int:
        """Number of columns."""
        return max(cell.column for cell in self.cells) + 1

    def areas(self) -> dict[int, float]:
        """Number of solutions -> area. Numeric."""
        found: dict[int, float] = {}
        for region in self.regions:
            found[region.count] = found.get(region.count, 0.0) + region.area
        return dict(sorted(found.items()))

    def counts(self) -> dict[int, tuple[int, int]]:
        """Number of solutions -> (cells, regions)."""
        known = sorted({cell.count for cell in self.cells})
        return {n: (sum(c.count == n for c in self.cells), sum(r.count == n for r in self.regions)) for n in known}

    @checked
    def locate(self, point: Sequence[Any]) -> Cell | None:
        """The cell of a point; None on a wall and outside the box; on a critical line the cell at its left.

        Exact for rational points. Raises BadInput for what is no point.
        """
        if len(point) != 2:
            raise AlgebraError(f"a point has two coordinates, got {point!r}")
        u, v = (axis.chart(value) for axis, value in zip(self.axes, point, strict=True))
        place = self.plane.locate(u, v)
        if place is None:
            return None
        return next(cell for cell in self.cells if (cell.column, cell.row) == place)

    @checked
    def region_of(self, cell: Cell | int) -> Region:
        """The region that contains a cell, given itself or by its index. Raises BadInput for another one."""
        index = count(cell.index if isinstance(cell, Cell) else cell, "cell", 0, len(self.cells) - 1)
        return next(region for region in self.regions if index in region.cells)

    @property
    def plane(self) -> Plane:
        """Columns and stacks; computed again if the cells come from the cache."""
        if self._plane is None:
            names = (self.axes[0].gen, self.axes[1].gen)
            samples = [next(c.chart[0] for c in self.cells if c.column == k) for k in range(self.columns)]
            polys = [(flint.fmpz_poly(row), places) for row, places in self.criticals]
            roots = [
                RealRoot.restored(poly, index, Fraction(low), Fraction(high))
                for poly, places in polys
                for index, low, high in places
            ]
            walls = [ring_of(wall, names) for wall in self.walls]
            self._plane = Plane.restored(walls, *self.axes, sorted(roots, key=lambda r: r.low), samples)
        return self._plane

    @classmethod
    def built(
        cls,
        name: str,
        space: str,
        plane: Plane,
        kinds: list[str],
        cells: list[Cell],
        fixed: dict[str, str],
        rounded: Mapping[str, Fraction],
        stated: Said,
    ) -> Cells:
        """Areas, graph and regions of counted cells."""
        place = {(cell.column, cell.row): cell.index for cell in cells}
        graph = [(place[a], place[b]) for a, b in plane.edges()]
        areas = cell_areas(plane, stated)
        index = [areas[cell.column][cell.row] for cell in cells]
        regions = _regions(cells, graph, index)
        criticals = [
            (
                [int(c) for c in poly.coeffs()],
                [(r.index, str(r.low), str(r.high)) for r in plane.criticals if r.poly is poly],
            )
            for poly in plane.critical_polys
        ]
        walls = [public(curve.poly) for curve in plane.curves]
        return cls(
            name,
            space,
            (plane.first, plane.second),
            walls,
            kinds,
            cells,
            graph,
            regions,
            fixed,
            dict(rounded),
            index,
            criticals,
            plane,
        )

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_plane": None}


def _regions(cells: Sequence[Cell], graph: Sequence[tuple[int, int]], areas: Sequence[float]) -> list[Region]:
    parent = list(range(len(cells)))

    def top(i: int) -> int:
        while parent[i] != i:
            parent[i] = parent[parent[i]]
            i = parent[i]
        return i

    for a, b in graph:
        if cells[a].count == cells[b].count:
            parent[top(a)] = top(b)
    groups: dict[int, list[int]] = {}
    for cell in cells:
        groups.setdefault(top(cell.index), []).append(cell.index)
    found = []
    for members in groups.values():
        largest = max(members, key=lambda i: areas[i])
        found.append((cells[largest].count, tuple(members), sum(areas[i] for i in members), cells[largest].sample))
    found.sort(key=lambda item: (item[0], -item[2]))
    return [Region(i, *item) for i, item in enumerate(found)]


def cell_areas(plane: Plane, stated: Said) -> list[list[float]]:
    """Area of every cell [column][row] by Gauss-Legendre in th, u = a + (b - a)(1 - cos th)/2. Numeric."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    th = 0.5 * pi * (nodes + 1.0)
    first, second = plane.first, plane.second
    cuts = [first.box[0], *(first.user(float(root)) for root in plane.criticals), first.box[1]]
    found = []
    for k in range(len(plane.columns)):
        stated("areas", k + 1, len(plane.columns))
        a, b = cuts[k], cuts[k + 1]
        total: Any = np.zeros(plane.rows(k))
        used = 0.0
        for angle, weight in zip(th, weights, strict=True):
            u = a + (b - a) * 0.5 * (1.0 - np.cos(angle))
            stack = float_stack(plane, first.chart_float(float(u)))
            if len(stack) != plane.rows(k) - 1:
                continue  # a node within rounding of a critical value; its weight goes to the others
            heights = np.array([second.box[0], *(second.user(v) for v in stack), second.box[1]])
            share = weight * np.sin(angle)
            total, used = total + share * np.diff(heights), used + share
        if used == 0.0:
            heights = np.array([second.box[0], *(second.user(float(v)) for v in plane.stacks[k]), second.box[1]])
            total, used = np.diff(heights), 1.0
        found.append((total * (b - a) / used).tolist())
    return found


def float_stack(plane: Plane, u: Fraction) -> list[float]:
    """Walls over a first coordinate as floats, ascending, within the box."""
    low, high = float(plane.second.low), float(plane.second.high)
    found = []
    for curve in plane.curves:
        poly = curve.at_u(u.numerator, u.denominator)
        if poly.degree() > 0:
            roots = (flint.fmpz_poly(poly) // poly.gcd(poly.derivative())).complex_roots()
            found += [float(root.real.mid()) for root, _ in roots if root.imag == 0]
    return sorted(v for v in found if low < v < high)
