"""Relations of cells and spaces: numbers of solutions on walls, pairs of joint cells and pose cells, images of
paths."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from irsbot_kinematics.algebra.cells import Cell, Cells
from irsbot_kinematics.algebra.model.engine import AlgebraError
from irsbot_kinematics.algebra.model.exact import exact
from irsbot_kinematics.algebra.model.polynomial import Polynomial
from irsbot_kinematics.algebra.model.system import System
from irsbot_kinematics.algebra.solving import Configuration, configurations
from irsbot_kinematics.arguments import checked, count

BISECTIONS = 30
"""1: bisections of a segment on which the cell changes."""


@dataclass(frozen=True)
class WallArc:
    """A piece of wall between two cells of one column. count: distinct real solutions on it."""

    wall: Polynomial
    below: int
    above: int
    count: int


@checked
def wall_counts(cells: Cells) -> list[WallArc]:
    """Numbers of distinct solutions on the arcs of the discriminant variety (DVNumberOfSolutionsPlus of [S4]).

    On a singular arc pairs of solutions meet: the number is half the sum of both sides. On a limit, its solutions do
    not count: the number is that of the smaller side. Certified, because arcs avoid the points where walls meet
    (`wall_vertices`).
    """
    place = {(cell.column, cell.row): cell for cell in cells.cells}
    plane, found = cells.plane, []
    for column, u in enumerate(plane.columns):
        for row, root in enumerate(plane.stacks[column]):
            i = plane.wall_of(u, root)
            below, above = place[column, row], place[column, row + 1]
            fold = cells.wall_kinds[i] == "singular"
            number = (below.count + above.count) // 2 if fold else min(below.count, above.count)
            found.append(WallArc(cells.walls[i], below.index, above.index, number))
    return found


@checked
def pairing(system: System, joint_cells: Cells, pose_cells: Cells) -> dict[int, list[int | None]]:
    """Pose cells in the antecedent of each joint cell (DirectInverseKinematics of [S4]): joint cell -> pose cells.

    Every direct solution of the joint cell's sample is located; None: on a wall or outside the box of the pose cells.
    Both decompositions must cover all variables of their space that they do not fix. Certified.
    """
    if joint_cells.space != "joint" or pose_cells.space != "pose":
        raise AlgebraError("give joint cells first, then pose cells")
    found: dict[int, list[int | None]] = {}
    for cell in joint_cells.cells:
        if cell.count == 0:
            found[cell.index] = []
            continue
        known: dict[str, Any] = {n: Fraction(v) for n, v in joint_cells.fixed.items()}
        known |= {axis.name: value for axis, value in zip(joint_cells.axes, cell.sample, strict=True)}
        found[cell.index] = [_located(pose_cells, c) for c in configurations(system, known)]
    return found


def _located(cells: Cells, configuration: Configuration) -> int | None:
    point = [
        Fraction(configuration.values[axis.name]) if axis.kind != "tangent" else configuration.values[axis.name]
        for axis in cells.axes
    ]
    cell = cells.locate(point)
    return None if cell is None else cell.index


def _listed(names: Iterable[str]) -> str:
    return ", ".join(names) or "no names"


@dataclass(frozen=True)
class ImagePoint:
    """One point of a path and its image."""

    share: float
    """Place along the path, 0..1, by segments."""
    values: dict[str, float]
    images: list[Configuration]
    """All solutions, sorted by the first unknown."""
    cell: int | None
    """Cell of the point; None on a wall, outside, or without cells."""


@checked
def image_of_path(
    system: System, path: Sequence[Mapping[str, Any]], cells: Cells | None = None, per_segment: int = 10
) -> list[ImagePoint]:
    """Image of a path of joints in pose space or of poses in joint space (ImageTrajectory of [S4]).

    path: corners, each name -> value, all joints or all pose variables; straight between them. cells: of the same
    space; where the cell changes between two samples, the place is bisected and both sides are added. Raises BadInput.
    """
    count(per_segment, "per_segment", 1)
    if len(path) < 2:
        raise AlgebraError("a path needs two points at least")
    for number, point in enumerate(path, 1):
        if set(point) != set(path[0]):
            raise AlgebraError(f"point {number} of the path has {_listed(point)}, the first has {_listed(path[0])}")
    if cells is not None and not {axis.name for axis in cells.axes} <= set(path[0]):
        axes = _listed([axis.name for axis in cells.axes])
        raise AlgebraError(f"the cells lie over {axes}, the path has {_listed(path[0])}: give cells of the same space")
    corners = [{name: exact(value, name) for name, value in point.items()} for point in path]
    total = (len(corners) - 1) * per_segment

    def at(k: Fraction) -> dict[str, Fraction]:
        i = min(int(k), len(corners) - 2)
        a, b = corners[i], corners[i + 1]
        return {name: a[name] + (k - i) * (b[name] - a[name]) for name in a}

    def cell_of(k: Fraction) -> Cell | None:
        if cells is None:
            return None
        values = at(k)
        return cells.locate(
            [values[axis.name] if axis.kind != "tangent" else float(values[axis.name]) for axis in cells.axes]
        )

    places = [Fraction(i, per_segment) for i in range(total + 1)]
    crossings: list[Fraction] = []
    if cells is not None:
        for a, b in itertools.pairwise(places):
            if cell_of(a) != cell_of(b):
                low, high, first = a, b, cell_of(a)
                for _ in range(BISECTIONS):
                    middle = (low + high) / 2
                    low, high = (middle, high) if cell_of(middle) == first else (low, middle)
                crossings += [low, high]
    found = []
    for k in sorted({*places, *crossings}):
        values = at(k)
        cell = cell_of(k)
        found.append(
            ImagePoint(
                float(k / (len(corners) - 1)),
                {n: float(v) for n, v in values.items()},
                configurations(system, values),
                None if cell is None else cell.index,
            )
        )
    return found
