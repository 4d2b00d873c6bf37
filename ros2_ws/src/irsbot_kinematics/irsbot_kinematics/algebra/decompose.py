"""Slices of the joint or pose space decomposed by the number of solutions (CellDecompositionPlus of [S4])."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

from irsbot_kinematics.algebra import solving
from irsbot_kinematics.algebra.cells import Cell, Cells
from irsbot_kinematics.algebra.charts import Axis, axis
from irsbot_kinematics.algebra.elimination import eliminate
from irsbot_kinematics.algebra.model.engine import AlgebraError
from irsbot_kinematics.algebra.model.polynomial import (
    context,
    irreducible,
    is_even,
    moved,
    primitive,
    renamed,
    ring_of,
    univariate,
)
from irsbot_kinematics.algebra.model.roots import isolate, squarefree_part
from irsbot_kinematics.algebra.model.system import System
from irsbot_kinematics.algebra.plane import Plane, Said
from irsbot_kinematics.algebra.singular import complete, linked, one_of, project, slice_values
from irsbot_kinematics.algebra.sizes import refuse_large_walls
from irsbot_kinematics.algebra.store import Progress, stored_result
from irsbot_kinematics.algebra.tangents import with_tangents, without_circles
from irsbot_kinematics.arguments import checked, count, shown

MOST_DIGITS = 100
"""1: largest number of digits after the point."""

CELL_DIGITS = 6
"""1: digits after the point to which lengths are rounded for a decomposition; long rationals take hours."""


@checked
def decompose(
    system: System,
    names: Sequence[str],
    box: Sequence[Sequence[Any]],
    fixed: Mapping[str, Any] | None = None,
    *,
    digits: int | None = CELL_DIGITS,
    progress: Progress | None = None,
    cache: bool = True,
    allow_large: bool = False,
) -> Cells:
    """Cells of a rectangle of two joints or two pose variables with constant number of real solutions.

    names: the two parameters, the first one is that of the columns. box: their ranges, rad for angles. fixed: the
    remaining variables of that space. Solutions are direct ones over joints, inverse ones over the pose, those that
    keep the inequalities. digits: parameters with more digits are rounded to so many (`Cells.rounded` says which);
    None keeps them. progress(what, done, total) is called during the work. Exact but for the areas.
    allow_large: work on walls of degree beyond 40 too, which takes hours; TooLarge says how large they are.
    Raises AlgebraError for empty boxes, unknown names and variables that are left free.
    """
    complete(system, "a decomposition")
    space = _space(system, names)
    variables = system.joints if space == "joint" else system.pose
    known = slice_values(system, variables, fixed)
    left = [n for n in variables if n not in names and n not in (fixed or {})]
    if left:
        raise AlgebraError(f"{', '.join(left)}: give a value in fixed, only {names[0]} and {names[1]} vary")
    if len(box) != 2:
        raise AlgebraError(f"the box must be two pairs, ((low, high), (low, high)), got {shown(box)}")
    for name, ends in zip(names, box, strict=True):
        axis(name, ends, name in system.angles, False)
    rounded = rounded_parameters(system, None if digits is None else count(digits, "digits", 0, MOST_DIGITS))
    if rounded:
        system = replace(system, parameters={**system.parameters, **rounded}, check=False)
    key = ("decompose", tuple(names), [[str(end) for end in ends] for ends in box], sorted(known.items()))
    return stored_result(
        system,
        key,
        Cells,
        lambda: _decomposed(system, space, names, box, known, fixed or {}, rounded, progress, allow_large),
        cache,
    )


def rounded_parameters(system: System, digits: int | None) -> dict[str, Fraction]:
    """Lengths with more digits after the point, rounded to this number."""
    if digits is None:
        return {}
    scale = 10**digits
    return {
        name: Fraction(round(value * scale), scale)
        for name, value in system.values.items()
        if isinstance(value, Fraction) and (value * scale).denominator != 1 and value.denominator > scale
    }


def walls(
    system: System, space: str, names: Sequence[str], fixed: Mapping[str, Any], known: Mapping[str, Fraction]
) -> list[tuple[Any, str]]:
    """Discriminant variety of a slice: irreducible polynomials of Z[names], angles as t_name, and their kinds.

    'singular': projected singularities; 'limit': boundaries of the inequalities.
    """
    keep = [f"t_{name}" if name in system.angles else name for name in names]
    kind = "parallel" if space == "joint" else "serial"
    found = {
        str(ring_of(poly, keep)): (ring_of(poly, keep), "singular") for poly in project(system, kind, space, fixed)
    }
    others = [n for n in (*system.pose, *system.joints, *system.passive) if n not in (*system.joints, *system.pose)]
    others += list(system.pose if space == "joint" else system.joints)
    ring = context(system.gens([*names, *others]))
    for bound in system.positive(known):
        if bound.is_constant():
            continue
        equations, drop = linked(system, moved(bound, ring), known, others, ring)
        turned = [name for name in names if name in system.angles]
        if drop:
            polys = eliminate([with_tangents(p, turned) for p in equations], keep, drop)
        else:
            polys = [primitive(with_tangents(moved(bound, ring), turned), keep)]
        for poly in polys:
            for part, _ in irreducible(without_circles(poly)):
                found.setdefault(str(part), (part, "limit"))
    return sorted(found.values(), key=lambda w: (int(w[0].total_degree()), len(w[0]), str(w[0])))


def meets_box(wall: Any, axes: Sequence[Axis]) -> bool:
    """False for walls across one axis alone that lie outside its range: they would only add columns."""
    for i, chart in enumerate(axes):
        if wall.degrees()[1 - i] == 0:
            roots = isolate(squarefree_part(univariate(wall, chart.gen)))
            return any(r.compare(chart.low) > 0 and r.compare(chart.high) < 0 for r in roots)
    return True


def _space(system: System, names: Sequence[str]) -> str:
    if isinstance(names, str) or len(names) != 2 or names[0] == names[1]:
        raise AlgebraError(f"give two different names, such as ('{system.joints[0]}', ...), got {names!r}")
    for space, variables in (("joint", system.joints), ("pose", system.pose)):
        if all(name in variables for name in names):
            return space
    raise AlgebraError(
        f"{names[0]} and {names[1]} must be two of the joints {', '.join(system.joints)} "
        f"or two of the pose variables {', '.join(system.pose)}"
    )


def _decomposed(
    system: System,
    space: str,
    names: Sequence[str],
    box: Sequence[Sequence[Any]],
    known: Mapping[str, Fraction],
    fixed: Mapping[str, Any],
    rounded: Mapping[str, Fraction],
    progress: Progress | None,
    allow_large: bool,
) -> Cells:
    one_of(space, ("joint", "pose"), "space")
    stated: Said = progress or (lambda _what, _done, _total: None)
    stated("walls", 0, 1)
    found = walls(system, space, names, fixed, known)
    if not allow_large:
        refuse_large_walls([wall for wall, _ in found])
    plain = [axis(name, ends, name in system.angles, False) for name, ends in zip(names, box, strict=True)]
    found = [(wall, kind) for wall, kind in found if meets_box(wall, plain)]
    axes: list[Axis] = []
    for name, ends in zip(names, box, strict=True):
        even = all(is_even(wall, name) for wall, _ in found) if name not in system.angles else False
        chart = axis(name, ends, name in system.angles, even)
        if chart.kind == "square":
            found = [(renamed(wall, name, name, 2), kind) for wall, kind in found]
        axes.append(chart)
    split = {str(part): (part, kind) for wall, kind in found for part, _ in irreducible(wall)}
    plane = Plane([wall for wall, _ in split.values()], axes[0], axes[1], stated)
    unknown = (*(system.pose if space == "joint" else system.joints), *system.passive)
    cells: list[Cell] = []
    total = sum(plane.rows(k) for k in range(len(plane.columns)))
    for column in range(len(plane.columns)):
        for row in range(plane.rows(column)):
            point = plane.sample(column, row)
            values = {**known, **axes[0].values(point[0]), **axes[1].values(point[1])}
            number = solving.count(system, values, unknown)
            users = tuple(a.exact_user(p) for a, p in zip(axes, point, strict=True))
            cells.append(Cell(len(cells), column, row, (users[0], users[1]), point, number))
            stated("numbers of solutions", len(cells), total)
    kinds = [kind for _, kind in split.values()]
    return Cells.built(system.name, space, plane, kinds, cells, {n: str(v) for n, v in fixed.items()}, rounded, stated)
