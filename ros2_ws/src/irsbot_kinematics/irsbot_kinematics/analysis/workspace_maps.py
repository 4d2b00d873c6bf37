"""Maps of a workspace: margins on a grid of poses in one working mode, the area reached, loci, the free rectangle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from irsbot_kinematics import arguments, statics
from irsbot_kinematics.arguments import checked
from irsbot_kinematics.batch import evaluate_many
from irsbot_kinematics.errors import BadInput
from irsbot_kinematics.mechanism import Coordinate, Mechanism, Signs, Status
from irsbot_kinematics.numerics.arithmetic import ARRAYS, Array
from irsbot_kinematics.numerics.tolerances import FARTHEST

QUANTITIES = ("type1", "type2", "constraint", "limb", "reach", "smallest")
"""Quantities of a map; `smallest` is the least of the margins, `reach` the distance to the workspace boundary in m."""

MOST_NODES = 10**5
"""1: largest number of nodes along one axis of a map."""


@dataclass(frozen=True)
class Map:
    """Margins on a grid over the first two task coordinates; NaN where the pose is not reached.

    Arrays have the shape (len(second), len(first)); `assembly` is the sign of the posture's det A.
    """

    axes: tuple[str, str]
    units: tuple[str, str]
    first: Array
    second: Array
    working_mode: Signs
    type1: Array
    type2: Array
    constraint: Array
    limb: Array
    reach: Array
    assembly: Array

    @property
    def smallest(self) -> Array:
        """The least margin of each pose."""
        least: Array = np.fmin(np.fmin(self.type1, self.type2), np.fmin(self.constraint, self.limb))
        return least

    @property
    def area(self) -> float:
        """Reached area, in the square of the unit of the axes: every node for its part of the box, half a cell at an
        edge of the box and a quarter at a corner."""
        return area_where(np.isfinite(self.type1), self.first, self.second)


def area_where(holds: NDArray[np.bool_], first: Array, second: Array) -> float:
    """Area of the nodes (len(second), len(first)) of an even grid at which a condition holds."""
    parts = [np.full(len(axis), axis[1] - axis[0]) for axis in (first, second)]
    for part in parts:
        part[[0, -1]] *= 0.5
    return float(parts[1] @ holds @ parts[0])


class Box(NamedTuple):
    """Ranges of the first two task coordinates, and the other coordinates."""

    first: tuple[float, float]
    second: tuple[float, float]
    others: tuple[float, ...]


@checked
def workspace_map(mechanism: Mechanism, mode: Signs | str, box: Box, nodes: tuple[int, int]) -> Map:
    """Margins of the poses of a grid of nodes[0] x nodes[1] in one working mode, row by row in bounded memory.

    Raises BadInput for an invalid box or number of nodes.
    """
    mode = arguments.working_mode(mechanism, mode)
    first, second = axis_of(box.first, nodes[0]), axis_of(box.second, nodes[1])
    if len(box.others) != len(mechanism.task) - 2:
        rest = ", ".join(coordinate.name for coordinate in mechanism.task[2:]) or "none"
        raise BadInput(f"a map needs a value for each further coordinate ({rest}), got {len(box.others)}: --at VALUE")
    if not all(map(isfinite, box.others)):
        raise BadInput(f"the further coordinates of a map must be finite, got {list(box.others)}")
    rows = [_row(mechanism, mode, first, value, box.others) for value in second]
    stacked = [np.array(column) for column in zip(*rows, strict=True)]
    names, units = _axes(mechanism.task[0], mechanism.task[1])
    return Map(names, units, first, second, mode, *stacked)


@checked
def joint_map(mechanism: Mechanism, assembly: int, box: Box, nodes: tuple[int, int]) -> Map:
    """Margins over the first two joints in one assembly mode, in any working mode; NaN where not assembled.

    box.others: the further joints. `working_mode` of the result is empty: it varies over the map. Raises BadInput like
    `workspace_map`.
    """
    first, second = axis_of(box.first, nodes[0]), axis_of(box.second, nodes[1])
    if len(box.others) != len(mechanism.joints) - 2 or assembly not in mechanism.assembly_modes:
        further = len(mechanism.joints) - 2
        raise BadInput(f"a joint map of {mechanism.kind} needs {further} further joints and an assembly mode it has")
    columns: list[list[Array]] = [[] for _ in range(6)]
    for value in second:
        row = np.column_stack([first, *(np.full_like(first, joint) for joint in (value, *box.others))])
        found = evaluate_many(mechanism, row, assembly)
        limb = found.limb_margin.min(axis=1) if found.limb_margin.shape[1] else np.full_like(first, np.nan)
        sign = np.where(found.status == Status.SOLVED, float(assembly), np.nan)
        parts = (found.type1_margin.min(axis=1), found.type2_margin, found.constraint_margin, limb, found.reach, sign)
        for column, part in zip(columns, parts, strict=True):
            column.append(part)
    names, units = _axes(mechanism.joints[0], mechanism.joints[1])
    return Map(names, units, first, second, (), *(np.array(column) for column in columns))


def _axes(first: Coordinate, second: Coordinate) -> tuple[tuple[str, str], tuple[str, str]]:
    """Names and units."""
    return (first.name, second.name), (first.unit, second.unit)


@checked
def reachable_box(mechanism: Mechanism, others: Sequence[float] = ()) -> Box:
    """A box around everything that can be reached. Raises BadInput if no bound is known."""
    ranges = mechanism.workspace_ranges()
    if ranges is None:
        first, second = (coordinate.name for coordinate in mechanism.task[:2])
        stated = f"the ranges of {first} and {second}: --box LOW HIGH LOW HIGH"
        raise BadInput(f"how far {mechanism.kind} reaches is not known in closed form; give {stated}")
    return Box(*ranges, tuple(others))


@checked
def type2_crossings(found: Map) -> Array:
    """Points (N, 2) at which det A changes its sign between two neighbours of the grid: Type 2 poses of any mechanism,
    by linear interpolation of the signed margin, and nodes at which it is zero. Sign changes within a cell may be
    missed."""
    signed = found.type2 * found.assembly
    row, column = np.nonzero(signed == 0.0)
    points = [np.column_stack((found.first[column], found.second[row]))]
    for values, along, across, swapped in (
        (signed, found.first, found.second, False),
        (signed.T, found.second, found.first, True),
    ):
        with np.errstate(invalid="ignore"):
            row, column = np.nonzero(values[:, :-1] * values[:, 1:] < 0.0)
        before, after = values[row, column], values[row, column + 1]
        at = along[column] + (along[column + 1] - along[column]) * before / (before - after)
        points.append(np.column_stack((across[row], at) if swapped else (at, across[row])))
    return np.concatenate(points)


def _row(mechanism: Mechanism, mode: Signs, first: Array, value: float, others: Sequence[float]) -> tuple[Array, ...]:
    pose = (first, *(np.full_like(first, coordinate) for coordinate in (value, *others)))
    with np.errstate(invalid="ignore", divide="ignore"):
        joints, reach = mechanism.inverse(ARRAYS, pose, mode)
        nearest = np.minimum.reduce(reach)
        reached = nearest >= 0.0
        legs = mechanism.legs(ARRAYS, joints, pose)
        det, cosines = statics.pressure_cosines(ARRAYS, legs.screws, legs.attachments)
        type1 = np.minimum.reduce([np.abs(sine) for sine in legs.normalised_levers])
        none = np.full_like(first, np.nan)
        constraint = none if legs.constraint is None else legs.constraint
        limb = np.minimum.reduce(legs.limb) if legs.limb else none
        type1, type2, constraint, limb, sign = (
            np.where(reached, part, np.nan)  # legs without joints in their equations have margins everywhere
            for part in (type1, np.minimum.reduce(cosines), constraint, limb, np.sign(det))
        )
        return type1, type2, constraint, limb, nearest, sign


def axis_of(limits: tuple[float, float], nodes: int) -> Array:
    """(nodes,) places along a range. Raises BadInput."""
    low, high = arguments.interval(limits, "range of a map", -FARTHEST, FARTHEST)
    return np.linspace(low, high, arguments.count(nodes, "nodes", 2, MOST_NODES))
