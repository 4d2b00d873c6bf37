"""Vertices of walls: cusps, crossings, tangents; the numbers of distinct solutions there. Places are numeric."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from irsbot_kinematics.algebra.bivariate import discriminant
from irsbot_kinematics.algebra.cells import Cells
from irsbot_kinematics.algebra.model.roots import RealRoot
from irsbot_kinematics.algebra.plane import Plane
from irsbot_kinematics.arguments import checked

TOGETHER = 2.0**-30
"""1: walls closer than this beside a critical value, over the height of the box, meet there: the columns that are
compared are 2^-119 of the width apart, and the distance of walls that meet is at most about its square root."""


@dataclass(frozen=True)
class WallVertex:
    """A point where pieces of walls meet, or where a wall is vertical."""

    kind: str
    """'cusp', 'crossing', 'touch' (of two walls), 'tangent' (vertical: an ordinary point of the wall), 'unknown'."""
    point: tuple[float, float]
    """In the units of the two parameters. Numeric."""
    walls: tuple[int, ...]
    """Indices into `Cells.walls`."""
    cells: tuple[int, ...]
    """Cells that touch the vertex."""
    count: int | None
    """Distinct real solutions that satisfy the inequalities; None if the cells around do not determine the number."""


@checked
def wall_vertices(cells: Cells) -> list[WallVertex]:
    """Numbers of distinct solutions at the vertices of the walls (DVNumberOfSolutionsPlus of [S4]).

    What a point of one wall is follows from the exact multiplicity of its critical value in the discriminant (1
    vertical tangent, 2 crossing, 3 cusp), that of two walls from their order on both sides. The numbers follow from the
    cells around: on a fold half of the solutions of both sides, where an inequality becomes an equation those of the
    smaller side, at a crossing one after the other, at a cusp those outside it. Where more pieces meet, the kind is
    'unknown'. Isolated points of walls are left out; they have the number of their cell.
    """
    plane, place = cells.plane, {(cell.column, cell.row): cell for cell in cells.cells}
    powers = _Powers(plane)
    span_u, span_v = plane.first.high - plane.first.low, plane.second.high - plane.second.low
    found = []
    for k, root in enumerate(plane.criticals):
        left, right = plane.beside(root, span_u)
        sides = [(u, plane.stack(u)) for u in (left, right)]
        near = sorted((float(wall), s, row) for s, (_, stack) in enumerate(sides) for row, wall in enumerate(stack))
        met: list[tuple[list[list[int]], list[list[int]], float]] = []
        for group in _groups(near, float(span_v) * TOGETHER):
            rows = [[row for _, side, row in group if side == which] for which in (0, 1)]
            if len(group) == 1 or len(rows[0]) == len(rows[1]) == 1:
                continue  # a wall that leaves the box, or continues
            walls = [[plane.wall_of(sides[s][0], sides[s][1][row]) for row in rows[s]] for s in (0, 1)]
            height = sum(entry[0] for entry in group) / len(group)
            met.append((rows, walls, height))
        for rows, walls, height in met:
            around = []
            for s in (0, 1):
                below = sum(1 for other, side, _ in near if side == s and other < height)
                span = range(rows[s][0], rows[s][-1] + 2) if rows[s] else [below]
                around.append([place[k + s, row] for row in span])
            alike = sum(sorted(map(sorted, other)) == sorted(map(sorted, walls)) for _, other, _ in met)
            kind = _kind(walls, root, alike, powers)
            folds = [cells.wall_kinds[i] == "singular" for i in max(walls, key=len)]
            count = _number(kind, folds, [[cell.count for cell in side] for side in around])
            indices = tuple(sorted({i for side in walls for i in side}))
            point = plane.first.user(float(root)), plane.second.user(height)
            found.append(WallVertex(kind, point, indices, tuple(c.index for side in around for c in side), count))
    return found


def _number(kind: str, folds: Sequence[bool], numbers: Sequence[Sequence[int]]) -> int | None:
    """folds: of the walls on the left (or the only) side, the lower one first: True if they are folds."""
    low, high = min(map(min, numbers)), max(map(max, numbers))
    if kind == "tangent":
        return _half(low + high, 2) if folds[0] else low
    if kind == "cusp":
        return low
    if kind == "crossing":
        (below, left, above), (_, right, _) = numbers
        if all(folds):
            return _half(below + left + right + above, 4)
        if folds[0]:
            return _half(min(below + left, right + above), 2)
        if folds[1]:
            return _half(min(below + right, left + above), 2)
        return low
    if kind == "touch" and (numbers[0][1] != numbers[1][1] or high == 0):
        return low  # the solution that ends is one of those that meet
    return None


def _half(total: int, of: int) -> int | None:
    return total // of if total % of == 0 else None


class _Powers:
    """Multiplicities of critical values, each polynomial factored once."""

    def __init__(self, plane: Plane) -> None:
        self._curves = plane.curves
        self._known: dict[int, list[tuple[Any, int]]] = {}

    def __call__(self, i: int, root: RealRoot) -> int:
        """Of a root in the discriminant of wall i."""
        if i not in self._known:
            parts = discriminant(self._curves[i]).factor_squarefree()[1]
            self._known[i] = [(part, int(power)) for part, power in parts]
        return next((power for part, power in self._known[i] if _is_root(part, root)), 0)


def _is_root(part: Any, root: RealRoot) -> bool:
    """True if a root is also one of a squarefree polynomial. Exact."""
    shared = part.gcd(root.poly)
    if shared.degree() < 1:
        return False
    if root.exact:
        return _sign(shared, root.low) == 0
    return _sign(shared, root.low) * _sign(shared, root.high) < 0  # the interval holds one root of root.poly


def _sign(poly: Any, at: Fraction) -> int:
    value = sum(int(poly[k]) * at**k for k in range(int(poly.degree()) + 1))
    return (value > 0) - (value < 0)


def _kind(walls: Sequence[Sequence[int]], root: RealRoot, alike: int, powers: _Powers) -> str:
    """Kind of a vertex. alike: vertices of the same walls over the critical value, which share its multiplicity."""
    before, after = walls
    if sorted((len(before), len(after))) == [0, 2]:
        i, j = before or after
        power = powers(i, root) if i == j else 0
        if power in (alike, 3 * alike):
            return "tangent" if power == alike else "cusp"
    if len(before) == len(after) == 2 and sorted(before) == sorted(after):
        i, j = before
        if i != j:
            return "crossing" if before != after else "touch"
        if powers(i, root) == 2 * alike:
            return "crossing"
    return "unknown"


def _groups(near: Sequence[tuple[float, int, int]], width: float) -> list[list[tuple[float, int, int]]]:
    found: list[list[tuple[float, int, int]]] = []
    for entry in near:
        if found and entry[0] - found[-1][-1][0] < width:
            found[-1].append(entry)
        else:
            found.append([entry])
    return found
