"""Boxes of a 3-D parameter space with certified numbers of solutions: interval bounds exclude walls.

If no wall passes through a box, the number of solutions is constant in it and equals the number at its centre. Boxes
that a wall may cross are halved in each direction down to a given depth; the rest stays undecided.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from irsbot_kinematics import arguments
from irsbot_kinematics.algebra import solving
from irsbot_kinematics.algebra.charts import axis
from irsbot_kinematics.algebra.model.engine import AlgebraError, TooLarge
from irsbot_kinematics.algebra.model.exact import exact
from irsbot_kinematics.algebra.model.polynomial import Polynomial, public
from irsbot_kinematics.algebra.model.system import System
from irsbot_kinematics.algebra.singular import complete, project
from irsbot_kinematics.algebra.store import Progress
from irsbot_kinematics.arguments import checked

Floats = NDArray[np.float64]

ROUNDING = 64.0 * np.finfo(float).eps
"""1: share of the sum of the sizes of all terms by which floating point may be off; a few hundred operations each."""

MOST_DEPTH = 7
"""1: 2^21 boxes; a larger depth needs allow_large."""


@dataclass(frozen=True)
class Octree:
    """Boxes (N, 3, 2) without a wall and the number of solutions in each; `open` (M, 3, 2): undecided."""

    names: tuple[str, ...]
    boxes: Floats
    counts: NDArray[np.int64]
    open: Floats
    walls: tuple[Polynomial, ...]

    def volumes(self) -> dict[int, float]:
        """Number of solutions -> volume that certainly has this number: a lower bound."""
        size = np.prod(self.boxes[:, :, 1] - self.boxes[:, :, 0], axis=1)
        return {int(n): float(size[self.counts == n].sum()) for n in np.unique(self.counts)}

    @property
    def undecided(self) -> float:
        """Volume of the boxes that a wall may cross."""
        return float(np.prod(self.open[:, :, 1] - self.open[:, :, 0], axis=1).sum())


@checked
def octree(
    system: System,
    names: Sequence[str],
    box: Sequence[Sequence[Any]],
    depth: int = 5,
    *,
    progress: Progress | None = None,
    allow_large: bool = False,
) -> Octree:
    """Boxes of all three joints or all three pose variables (no angles) with certified numbers of real solutions.

    names: all variables of the space, in any order. box: (low, high) of each. depth: number of halvings, from 0. Raises
    BadInput, AlgebraError, and TooLarge beyond depth 7 unless allow_large.
    """
    complete(system, "an octree")
    space = next((s for s, v in (("joint", system.joints), ("pose", system.pose)) if sorted(names) == sorted(v)), None)
    if space is None or len(names) != 3 or len(box) != 3:
        raise AlgebraError(
            f"an octree covers a space of three variables, with a range of each; {system.name} has the joints "
            f"{', '.join(system.joints)} and the pose variables {', '.join(system.pose)}; take slices of larger spaces"
        )
    turned = [name for name in names if name in system.angles]
    if turned:
        raise AlgebraError(f"{', '.join(turned)} is an angle: an octree needs lengths; take slices")
    arguments.count(depth, "depth", 0)
    if depth > MOST_DEPTH and not allow_large:
        raise TooLarge(f"depth {depth} makes up to {8**depth} boxes; say allow_large=True, or depth <= {MOST_DEPTH}")
    ends = []
    for name, pair in zip(names, box, strict=True):
        chart = axis(name, pair, False, False)
        ends.append((float(chart.low), float(chart.high)))
    found = walls_in_space(system, space, names)
    bounds = [_compiled(wall, names) for wall in found]
    unknown = (*(system.pose if space == "joint" else system.joints), *system.passive)
    boxes = np.array([ends])
    decided: list[Floats] = []
    stated = progress or (lambda _what, _done, _total: None)
    for level in range(depth + 1):
        free = np.ones(len(boxes), dtype=bool)
        for low_high in bounds:
            free &= low_high(boxes)
        decided.append(boxes[free])
        boxes = boxes[~free]
        stated("octree", level + 1, depth + 1)
        if level < depth:
            boxes = _halved(boxes)
    whole = np.concatenate(decided)
    counts = _counted(system, names, unknown, whole)
    return Octree(tuple(names), whole, counts, boxes, tuple(found))


def walls_in_space(system: System, space: str, names: Sequence[str]) -> list[Polynomial]:
    """Discriminant variety over three names: projected singularities and limits. Exact."""
    from irsbot_kinematics.algebra.elimination import eliminate
    from irsbot_kinematics.algebra.model.polynomial import context, moved, primitive
    from irsbot_kinematics.algebra.singular import linked

    found = {str(p): p for p in project(system, "parallel" if space == "joint" else "serial", space)}
    others = list(system.pose if space == "joint" else system.joints) + list(system.passive)
    ring = context(system.gens([*names, *others]))
    for bound in system.positive():
        equations, drop = linked(system, moved(bound, ring), {}, others, ring)
        polys = eliminate(equations, tuple(names), drop) if drop else [primitive(moved(bound, ring), tuple(names))]
        for poly in polys:
            found[str(public(poly))] = public(poly)
    return list(found.values())


def _halved(boxes: Floats) -> Floats:
    middle = boxes.mean(axis=2)
    parts = []
    for corner in np.ndindex(2, 2, 2):
        part = boxes.copy()
        for i, upper in enumerate(corner):
            part[:, i, 1 - upper] = middle[:, i]
        parts.append(part)
    return np.concatenate(parts)


def _compiled(wall: Polynomial, names: Sequence[str]) -> Callable[[Floats], NDArray[np.bool_]]:
    """A test of boxes that a wall certainly misses: Taylor form about the centre, rounding included.

    |p(c + h) - p(c)| <= sum over terms of the expansion about the centre of |coefficient| radius^power.
    """
    place = [names.index(name) for name in wall.names]
    scale = max(map(abs, wall.coefficients.values()))
    powers = np.zeros((wall.terms, 3), dtype=int)
    for row, term in enumerate(wall.coefficients):
        powers[row, place] = term
    coefficients = np.array([float(Fraction(c, scale)) for c in wall.coefficients.values()])
    shifts = _derivatives(powers, coefficients)

    def misses(boxes: Floats) -> NDArray[np.bool_]:
        centre, radius = boxes.mean(axis=2), 0.5 * (boxes[:, :, 1] - boxes[:, :, 0])
        table = _powers(centre, powers.max(axis=0))
        spread, size = np.zeros(len(boxes)), np.zeros(len(boxes))
        value = np.zeros(len(boxes))
        for order, rows, weights in shifts:
            terms = weights * np.prod([table[i][:, rows[:, i]] for i in range(3)], axis=0)
            sizes = np.abs(terms).sum(axis=1) * np.prod(radius ** np.array(order), axis=1)
            size += sizes
            if not any(order):
                value = terms.sum(axis=1)
            else:
                spread += np.abs(terms.sum(axis=1)) * np.prod(radius ** np.array(order), axis=1)
        return np.asarray(np.abs(value) > spread + ROUNDING * (1.0 + len(coefficients)) * size)

    return misses


def _derivatives(powers: NDArray[Any], coefficients: Floats) -> list[tuple[tuple[int, ...], NDArray[Any], Floats]]:
    """Taylor coefficients of every order: the order, the powers that are left, the weights."""
    from math import comb

    found = []
    for order in np.ndindex(*(powers.max(axis=0) + 1)):
        there = (powers >= np.array(order)).all(axis=1)
        if there.any():
            rows = powers[there]
            factor = np.array(
                [float(np.prod([comb(int(p), int(k)) for p, k in zip(row, order, strict=True)])) for row in rows]
            )
            found.append((tuple(int(k) for k in order), rows - np.array(order), coefficients[there] * factor))
    return found


def _powers(centre: Floats, most: NDArray[Any]) -> list[Floats]:
    return [np.stack([centre[:, i] ** k for k in range(most[i] + 1)], axis=1) for i in range(3)]


def _counted(system: System, names: Sequence[str], unknown: Sequence[str], boxes: Floats) -> NDArray[np.int64]:
    """Numbers of solutions at the centres; connected boxes that share faces are counted once."""
    centres = boxes.mean(axis=2)
    group = _components(boxes)
    known: dict[int, int] = {}
    counts = np.zeros(len(boxes), dtype=np.int64)
    for i in np.argsort(-np.prod(boxes[:, :, 1] - boxes[:, :, 0], axis=1)):
        key = int(group[i])
        if key not in known:
            values: dict[str, Fraction] = {n: Fraction(float(c)) for n, c in zip(names, centres[i], strict=True)}
            known[key] = solving.count(system, values, unknown)
        counts[i] = known[key]
    return counts


def _components(boxes: Floats) -> NDArray[np.int64]:
    """Connected components of boxes that share a piece of a face; the number of solutions is the same in each."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    n = len(boxes)
    if n == 0:
        return np.zeros(0, dtype=np.int64)
    pairs: list[tuple[int, int]] = []
    for i in range(3):
        upper: dict[float, list[int]] = {}
        for k in range(n):
            upper.setdefault(float(boxes[k, i, 1]), []).append(k)
        others = [j for j in range(3) if j != i]
        lower: dict[float, list[int]] = {}
        for k in range(n):
            lower.setdefault(float(boxes[k, i, 0]), []).append(k)
        for height, under in upper.items():
            over = np.array(lower.get(height, []), dtype=int)
            if not len(over):
                continue
            for k in under:
                touch = np.ones(len(over), dtype=bool)
                for j in others:
                    touch &= (boxes[over, j, 0] < boxes[k, j, 1]) & (boxes[over, j, 1] > boxes[k, j, 0])
                pairs += [(k, int(m)) for m in over[touch]]
    if not pairs:
        return np.arange(n)
    a, b = np.array(pairs).T
    graph = coo_matrix((np.ones(len(a)), (a, b)), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def volume_slices(
    system: System, names: Sequence[str], box: Sequence[Sequence[Any]], count: int
) -> list[Mapping[int, float]]:
    """Areas by number of solutions in `count` exact slices across the third name, at the middles of equal layers."""
    from irsbot_kinematics.algebra.decompose import decompose

    low, high = (exact(v, names[2]) for v in box[2])
    step = (high - low) / count
    return [
        decompose(system, names[:2], box[:2], {names[2]: low + step * (2 * i + 1) / 2}).areas() for i in range(count)
    ]
