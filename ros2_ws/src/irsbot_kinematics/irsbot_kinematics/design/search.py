"""Search for a design that is free of parallel singularities in all modes and has the largest useful rectangle."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import radians
from typing import Any

import numpy as np

from irsbot_kinematics.analysis.rectangle import Limits, Rectangle, largest_rectangle
from irsbot_kinematics.arguments import check_fields, checked, count
from irsbot_kinematics.design import proximal
from irsbot_kinematics.errors import BadInput, KinematicsError
from irsbot_kinematics.mechanisms.irsbot2 import Irsbot2
from irsbot_kinematics.mechanisms.irsbot2_space.designs import PARAMETERS, Designs
from irsbot_kinematics.mechanisms.irsbot2_space.geometry import Irsbot2Geometry
from irsbot_kinematics.numerics.arithmetic import Array

VARIABLES = ("l1", "b", "p", "a1", "a2", "beta")
"""Variables of the search; l2eq is the rest of the size after l1."""
RANGES: Mapping[str, tuple[float, float]] = {
    "l1": (0.05, 0.45),
    "b": (0.05, 0.60),
    "p": (0.03, 0.10),
    "a1": (0.05, 0.25),
    "a2": (0.02, 0.10),
    "beta": (radians(10.0), radians(60.0)),
}
"""Default bounds: lengths per metre of size, beta in rad. They keep the platform, the elbows and the base feasible;
without them the search prefers ever longer elbows."""
LARGEST_SEED = 2**32 - 1
"""Of scipy's random numbers."""
_COARSE, _FINE = (40, 120), (400, 800)
"""Grid cells of the rectangle while searching, and for the result. The coarse grid hides differences of a few per
cent, and so do different seeds."""


Spread = Callable[[Callable[[Any], Any], Sequence[Any]], Iterable[Any]]
"""What `map` does with one function of this module and one sequence, in the same order: here, or on other processes."""


class NoDesign(KinematicsError):
    """A search without result."""


@dataclass(frozen=True)
class Task:
    """A search problem."""

    size: float = 1.0
    """m: l1 + l2eq, the length of a stretched leg."""
    slack: float = 0.002
    """m by which every inequality of the zone has to hold: reserve for tolerances of the lengths."""
    zone: str = "strict"
    limits: Limits = field(default_factory=Limits)
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=lambda: dict(RANGES))
    """Bounds of VARIABLES, lengths as parts of `size`."""
    seed: int = 0
    population: int = 15
    """Designs per variable and generation."""
    generations: int = 80

    def __post_init__(self) -> None:
        check_fields(self)
        if set(self.ranges) != set(VARIABLES):
            raise BadInput(f"a search needs ranges of {', '.join(VARIABLES)}, got {', '.join(self.ranges)}")
        if not self.size > 0.0:
            raise BadInput(f"a search must satisfy size > 0, got {self.size:.9g}")
        for name, (low, high) in self.ranges.items():
            if not 0.0 < low < high:
                raise BadInput(f"a search must satisfy 0 < low < high for {name}, got {low:.9g} against {high:.9g}")
        if self.zone not in proximal.ZONES:
            raise BadInput(f"no zone '{self.zone}'; zones are {', '.join(proximal.ZONES)}")
        if not self.slack >= 0.0:
            raise BadInput(f"a search must satisfy slack >= 0, got {self.slack:.9g}: with less no zone is kept")
        for name, value in self.limits._asdict().items():
            if not 0.0 <= value <= 1.0:
                raise BadInput(f"the smallest {name} margin of a useful pose must be in 0..1, got {value:.9g}")
        count(self.seed, "seed", 0, LARGEST_SEED)
        count(self.generations, "generations", 1)
        count(self.population, "population", 1)


@dataclass(frozen=True)
class Found:
    """The best design of a search."""

    geometry: Irsbot2Geometry
    rectangle: Rectangle
    """On the fine grid."""
    slack: float
    """m: smallest slack of the zone's inequalities."""


@checked
def search(task: Task, progress: Callable[[int, float], None] | None = None, spread: Spread = map) -> Found:
    """Differential evolution over VARIABLES, scipy's: a heuristic, the same for the same seed.

    The useful rectangle is `largest_rectangle` of the usual mode. progress(generation, best area so far in m^2) is
    called after each generation. spread calls a function for all designs of a generation, which take the most time; the
    result does not depend on it, and what it raises ends the search. Raises NoDesign if none of the ranges has a useful
    pose in the zone with that slack.
    """
    from scipy.optimize import differential_evolution

    bounds = [task.ranges[name] for name in VARIABLES]
    generation = 0
    best = 0.0
    faults: list[ValueError] = []  # scipy raises another error in their place

    def cost(X: Array) -> Array:
        nonlocal best
        try:
            costs = _costs(task, X, spread)
        except ValueError as fault:
            faults.append(fault)
            raise
        best = max(best, -float(costs.min()) * task.size**2)
        return costs

    def after(*_: object) -> None:
        nonlocal generation
        generation += 1
        if progress:
            progress(generation, best)

    try:
        result = differential_evolution(
            cost,
            bounds,
            maxiter=task.generations,
            popsize=task.population,
            tol=0.0,
            seed=task.seed,
            polish=False,
            updating="deferred",
            vectorized=True,
            callback=after,
        )
    except RuntimeError:
        if faults:
            raise faults[0] from None
        raise
    if not result.fun < 0.0:
        where = f"in zone '{task.zone}' with {task.slack:.6g} m of slack"
        raise NoDesign(f"no design of these ranges was found that is {where} and has a useful pose")
    return judge(_geometry(task, result.x), task)


def judge(geometry: Irsbot2Geometry, task: Task) -> Found:
    """Result of a search for a given design: rectangle on the fine grid, and slack in the zone."""
    rectangle = largest_rectangle(Irsbot2(geometry), task.limits, cells=_FINE)
    slack = proximal.slack(task.zone, proximal.evaluate_questions(Designs.of(geometry)))
    return Found(geometry, rectangle, float(slack[0]))


def _costs(task: Task, X: Array, spread: Spread) -> Array:
    """Minus the area per size^2 of the designs inside the zone; outside, how far outside. X: (6, number)."""
    columns = _lengths(task, X)
    d = Designs.columns(columns)
    valid = d.valid
    slack = np.full(valid.shape, -1.0)
    slack[valid] = proximal.slack(task.zone, proximal.evaluate_questions(d.where(valid)))
    cost = (task.slack - slack) / task.size
    inside = np.flatnonzero(slack >= task.slack)
    areas = spread(_coarse_area, [(_geometry(task, X[:, i]), task.limits) for i in inside])
    cost[inside] = [-area / task.size**2 for area in areas]
    return np.minimum(cost, 1.0 + task.size)


def _coarse_area(stated: tuple[Irsbot2Geometry, Limits]) -> float:
    """m^2: useful rectangle of a design on the coarse grid."""
    geometry, limits = stated
    return largest_rectangle(Irsbot2(geometry), limits, cells=_COARSE).area


def _lengths(task: Task, X: Array) -> dict[str, Array]:
    columns = {
        name: values if name == "beta" else values * task.size for name, values in zip(VARIABLES, X, strict=True)
    }
    return {**columns, "l2eq": task.size - columns["l1"]}


def _geometry(task: Task, x: Array) -> Irsbot2Geometry:
    lengths = {name: float(value) for name, value in _lengths(task, x).items()}
    return Irsbot2Geometry(**{name: lengths[name] for name in PARAMETERS})
