"""Maps of a workspace: margins on a grid of poses in one working mode, the area reached, loci, the free rectangle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite, tau
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from irsbot_kinematics import statics
from irsbot_kinematics.arithmetic import ARRAYS, Array
from irsbot_kinematics.batch import evaluate_many
from irsbot_kinematics.design.rectangle import Limits, Rectangle, largest_rectangle
from irsbot_kinematics.errors import BadInput
from irsbot_kinematics.mechanism import Mechanism, Signs, Status
from irsbot_kinematics.mechanisms.irsbot2 import Irsbot2
from irsbot_kinematics.mechanisms.planar_pair import PlanarPair, coincident_arcs

QUANTITIES = ("type1", "type2", "constraint", "limb", "reach", "smallest")
"""What can be mapped; `smallest` is the least of the margins, `reach` the distance to the workspace boundary in m."""

LOCUS_POINTS = 720
"""Points per turn along a locus: half a degree."""


@dataclass(frozen=True)
class Map:
    """Margins on a grid over the first two task coordinates; NaN where the pose is not reached.

    Arrays have the shape (len(second), len(first)); `assembly` is the sign of the posture's det A.
    """

    axes: tuple[str, str]
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
    """Area of the nodes (len(second), len(first)) of an even grid at which something holds."""
    parts = [np.full(len(axis), axis[1] - axis[0]) for axis in (first, second)]
    for part in parts:
        part[[0, -1]] *= 0.5
    return float(parts[1] @ holds @ parts[0])


class Locus(NamedTuple):
    """A curve of poses at which one working mode is singular."""

    kind: str  # "type1" or "type2"
    points: Array  # (N, 2) m


class Box(NamedTuple):
    """Ranges of the first two task coordinates, and the other coordinates."""

    first: tuple[float, float]
    second: tuple[float, float]
    others: tuple[float, ...]


def workspace_map(mechanism: Mechanism, mode: Signs, box: Box, nodes: tuple[int, int]) -> Map:
    """Margins of the poses of a grid of nodes[0] x nodes[1] in one working mode, row by row in bounded memory.

    Raises BadInput for a box or a number of nodes that is none.
    """
    first, second = _axis(box.first, nodes[0]), _axis(box.second, nodes[1])
    if len(box.others) != len(mechanism.task) - 2:
        rest = ", ".join(coordinate.name for coordinate in mechanism.task[2:]) or "none"
        raise BadInput(f"a map needs a value for each further coordinate ({rest}), got {len(box.others)}: --at VALUE")
    rows = [_row(mechanism, mode, first, value, box.others) for value in second]
    stacked = [np.array(column) for column in zip(*rows, strict=True)]
    names = (mechanism.task[0].name, mechanism.task[1].name)
    return Map(names, first, second, mode, *stacked)


def joint_map(mechanism: Mechanism, assembly: int, box: Box, nodes: tuple[int, int]) -> Map:
    """Margins over the first two joints in one assembly mode, whatever the working mode; NaN where not assembled.

    box.others: the further joints. `working_mode` of the result is empty: it varies over the map.
    Raises BadInput like `workspace_map`.
    """
    first, second = _axis(box.first, nodes[0]), _axis(box.second, nodes[1])
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
    names = (mechanism.joints[0].name, mechanism.joints[1].name)
    return Map(names, first, second, (), *(np.array(column) for column in columns))


def reachable_box(mechanism: Mechanism, others: Sequence[float] = ()) -> Box:
    """A box around everything that can be reached. Raises BadInput where no bound is known."""
    if isinstance(mechanism, PlanarPair):
        far = mechanism.loop.crank + mechanism.loop.rod
        side = far - abs(mechanism.loop.half_base)
        return Box((-side, side), (-far - mechanism.loop.drop, far - mechanism.loop.drop), tuple(others))
    bounds = [(coordinate.lower, coordinate.upper) for coordinate in mechanism.task[:2]]
    if not all(isfinite(low) and isfinite(high) for low, high in bounds):
        first, second = (coordinate.name for coordinate in mechanism.task[:2])
        ranges = f"the ranges of {first} and {second}: --box LOW HIGH LOW HIGH"
        raise BadInput(f"how far {mechanism.kind} reaches is not known in closed form; give {ranges}")
    return Box(bounds[0], bounds[1], tuple(others))


def loci(mechanism: PlanarPair, mode: Signs) -> tuple[Locus, ...]:
    """Type 1 boundary and Type 2 curves of one working mode, from their equations (IRSBot-2 sheet section 6)."""
    b0, drop, l1, l2 = mechanism.loop
    t = np.linspace(0.0, tau, LOCUS_POINTS + 1)
    found = []
    for foot in (-b0, b0):
        for radius in (l1 + l2, abs(l1 - l2)):
            circle = np.column_stack((foot + radius * np.cos(t), -drop - radius * np.sin(t)))
            other = np.hypot(circle[:, 0] + foot, circle[:, 1] + drop)
            inside = (other <= l1 + l2) & (other >= abs(l1 - l2))
            found.append(Locus("type1", np.where(inside[:, np.newaxis], circle, np.nan)))
    for cx, cz, start, length in coincident_arcs(mechanism.loop, mode):
        along = start + length * np.linspace(0.0, 1.0, LOCUS_POINTS + 1)
        found.append(Locus("type2", np.column_stack((cx + l2 * np.cos(along), cz - l2 * np.sin(along)))))
    return (*found, *(_in_line(mechanism, mode, side, t) for side in (1.0, -1.0)))


def type2_crossings(found: Map) -> Array:
    """Points (N, 2) at which det A changes its sign between two neighbours of the grid: Type 2 poses of any mechanism,
    by linear interpolation of the signed margin, and nodes at which it is zero.
    Narrower places than a cell may be missed."""
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


def constraint_points(mechanism: Irsbot2, mode: Signs) -> Array:
    """Poses (N, 2) at which the legs lose a constraint in one working mode: isolated points."""
    return np.array([(x, z) for x, z, radius in mechanism.constraint_places[mode] if radius == 0.0]).reshape(-1, 2)


def free_rectangle(mechanism: PlanarPair, limits: Limits, mode: Signs) -> Rectangle:
    """Largest rectangle below the base, symmetric about x = 0, in which all margins exceed the limits."""
    return largest_rectangle(mechanism, limits, mode)


def _in_line(mechanism: PlanarPair, mode: Signs, side: float, t: Array) -> Locus:
    """Rods in line (psi_I = psi_II + pi): P = (0, -drop) + side sqrt(l1^2 - |v|^2) perp(v)/|v|, v = b0 x - l2 u(t)."""
    b0, drop, l1, l2 = mechanism.loop
    vx, vz = b0 - l2 * np.cos(t), l2 * np.sin(t)
    size = np.hypot(vx, vz)
    with np.errstate(invalid="ignore", divide="ignore"):
        scale = side * np.sqrt(l1 * l1 - size * size) / size
        px, pz = -scale * vz, scale * vx
        # The cranks point from the motors to the elbows, which lie at P -+ l2 u(t).
        arms = ((px + vx, pz + vz), (px - vx, pz - vz))
        sines = [-(ax * np.sin(t) + az * np.cos(t)) for ax, az in arms]
        belongs = (sines[0] * mode[0] > 0.0) & (-sines[1] * mode[1] > 0.0)
    points = np.column_stack((px, pz - drop))
    return Locus("type2", np.where(belongs[:, np.newaxis], points, np.nan))


def _row(mechanism: Mechanism, mode: Signs, first: Array, value: float, others: Sequence[float]) -> tuple[Array, ...]:
    pose = (first, *(np.full_like(first, coordinate) for coordinate in (value, *others)))
    with np.errstate(invalid="ignore", divide="ignore"):
        joints, reach = mechanism.inverse(ARRAYS, pose, mode)
        nearest = np.minimum.reduce(reach)
        reached = nearest >= 0.0
        legs = mechanism.legs(ARRAYS, tuple(np.where(reached, q, np.nan) for q in joints), pose)
        det, cosines = statics.pressure_cosines(ARRAYS, legs.screws, legs.arms)
        type1 = np.minimum.reduce([np.abs(sine) for sine in legs.sines])
        none = np.full_like(first, np.nan)
        constraint = none if legs.constraint is None else legs.constraint
        limb = np.minimum.reduce(legs.limb) if legs.limb else none
        return type1, np.minimum.reduce(cosines), constraint, limb, nearest, np.sign(det)


def _axis(limits: tuple[float, float], nodes: int) -> Array:
    low, high = limits
    if not (isfinite(low) and isfinite(high) and low < high and nodes >= 2):
        raise BadInput(f"a map needs a range low < high and at least 2 nodes, got {low} to {high} with {nodes}")
    return np.linspace(low, high, nodes)
