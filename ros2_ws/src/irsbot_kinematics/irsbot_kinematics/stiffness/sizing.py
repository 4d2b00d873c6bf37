"""Tubes of least mass under a deflection limit: the optimisation (22) of [S1] for any robot of the two families.

    minimise    mass of all tubes
    over        outer diameter and wall of each kind of tube, and lengths of the geometry if wanted
    subject to  deflection along y0 under 100 N: largest and mean over a set of poses below their limits

The paper solved it by trial and error. Here: differential evolution (scipy), repeatable by its seed, then SLSQP from
what it found, with one constraint per pose so that the largest deflection has a gradient.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from irsbot_kinematics.arguments import check_fields, checked, count, interval
from irsbot_kinematics.batch import inverse_many
from irsbot_kinematics.description.topologies import built
from irsbot_kinematics.errors import BadInput, KinematicsError
from irsbot_kinematics.mechanism import Mechanism, Status
from irsbot_kinematics.mechanisms import Topology
from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_kinematics.stiffness.comparison import POSES, SIDEWAYS_N, Statistics, some_poses, statistics
from irsbot_kinematics.stiffness.response import compliances
from irsbot_kinematics.stiffness.structure import Structure

ACTIVE = 1e-3
"""1: a constraint within this share of its limit, or a variable within this share of its range from an end, is active.
Far above the tolerance of the search, far below what a tube is made to."""

POLISH_TOL = 1e-6
"""1: share of the limits by which SLSQP has to stay below them, because it satisfies constraints only to its
tolerance."""

Range = tuple[float, float]


@dataclass(frozen=True)
class Task:
    """A sizing problem. Lengths in m, angles in rad."""

    start: Structure
    """Design that provides everything that is not varied."""
    largest_m: float
    """Limit of the largest deflection along y0 under 100 N."""
    mean_m: float = np.inf
    """Limit of the mean."""
    outer: Range = (0.02, 0.12)
    """Outer diameters."""
    wall: Range = (0.001, 0.01)
    """Range of wall thicknesses that can be bought and welded."""
    tubes: tuple[str, ...] = ()
    """Kinds of tubes to size; empty: all."""
    lengths: Mapping[str, Range] = field(default_factory=dict)
    """Numbers of the geometry to vary as well, such as a1 or spacing."""
    poses: Array = field(default_factory=lambda: POSES)
    """(N, 2) m, at least one."""
    seed: int = 0
    """Of the search, from 0."""
    generations: int = 120
    population: int = 8
    """Candidates per variable."""

    def __post_init__(self) -> None:
        check_fields(self)
        object.__setattr__(self, "poses", some_poses(self.poses))
        count(self.seed, "seed", 0)
        for name in ("largest_m", "mean_m"):
            if not getattr(self, name) > 0.0:
                raise BadInput(f"{name} must be a deflection > 0 m, got {getattr(self, name)!r}")
        for name, ends in {"outer": self.outer, "wall": self.wall, **self.lengths}.items():
            interval(ends, f"range of {name}")
        if not 0.0 < 2.0 * self.wall[1] <= self.outer[0]:
            raise BadInput(f"twice the wall {self.wall[1]:g} m must fit into the outer diameter {self.outer[0]:g} m")
        if not self.wall[0] > 0.0:
            raise BadInput(f"a wall must be > 0 m, got {self.wall[0]:g}")
        for kind in self.tubes:
            if kind not in self.start.sections:
                raise BadInput(f"no tube '{kind}'; there are {', '.join(self.start.sections)}")
        geometry = [*vars(self.start.mechanism.geometry), *(("parallelogram", "spacing") if self._has_bars else ())]
        for name in self.lengths:
            if name not in geometry:
                raise BadInput(f"no length '{name}' to vary; there are {', '.join(geometry)}")
        if self.generations < 1 or self.population < 1:
            raise BadInput(f"generations and population must be > 0, got {self.generations} and {self.population}")

    @property
    def _has_bars(self) -> bool:
        return hasattr(self.start, "parallelogram")

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of tubes that are sized."""
        return self.tubes or tuple(self.start.sections)

    @property
    def ranges(self) -> dict[str, Range]:
        """Every variable with its range."""
        found: dict[str, Range] = {}
        for kind in self.kinds:
            found |= {f"{kind} outer": self.outer, f"{kind} wall": self.wall}
        return found | dict(self.lengths)


class Active(NamedTuple):
    """An active constraint, or an active end of a range."""

    name: str
    value: float
    limit: float


@dataclass(frozen=True)
class Sized:
    """The design found, and its active constraints."""

    design: Structure
    statistics: Statistics
    before: Statistics | None
    """Values of the initial design; None if a pose is out of its reach."""
    active: tuple[Active, ...]
    evaluations: int


class NoSize(KinematicsError):
    """No tubes within the ranges meet the limits; the message has the least deflection found."""


@checked
def size(task: Task, progress: Callable[[int, float], None] | None = None) -> Sized:
    """The lightest design found. progress: called with the generation and the least mass so far.

    Raises NoSize if no design meets the limits, BadInput if a pose is out of reach and no length is varied.
    """
    from scipy.optimize import NonlinearConstraint, differential_evolution  # takes half a second to load

    before: Statistics | None = None
    try:
        before = statistics(task.start, task.poses)
    except BadInput:
        if not task.lengths:  # no tube brings a pose into reach
            raise
    names, bounds = list(task.ranges), list(task.ranges.values())
    judge = _Judge(task, names)
    low, high = (np.array(side) for side in zip(*bounds, strict=True))
    generation = 0

    def watched(intermediate_result: Any) -> None:
        nonlocal generation
        generation += 1
        if progress is not None:
            progress(generation, float(intermediate_result.fun))

    found = differential_evolution(
        lambda t: judge.mass(low + t * (high - low)),
        [(0.0, 1.0)] * len(names),
        constraints=(NonlinearConstraint(lambda t: judge.excess(low + t * (high - low)), -np.inf, 0.0),),
        rng=np.random.default_rng(task.seed),
        maxiter=task.generations,
        popsize=task.population,
        polish=False,
        callback=watched,
        tol=1e-5,
    )
    best = low + np.clip(found.x, 0.0, 1.0) * (high - low)
    if not (judge.excess(best) <= 0.0).all():
        moved = judge.moved(best)
        raise NoSize(
            f"no tubes within the ranges meet the limits; the nearest has {1e3 * moved.max():.4g} mm at most "
            f"and {1e3 * moved.mean():.4g} mm on average"
        )
    best = judge.polished(best, low, high)
    design = judge.design(best)
    return Sized(design, statistics(design, task.poses), before, judge.active(best), judge.evaluations)


class _Judge:
    """Mass and constraints of one candidate; an invalid candidate has infinite mass and deflection."""

    def __init__(self, task: Task, names: list[str]) -> None:
        self.task, self.names, self.evaluations = task, names, 0
        self.limits = np.array([task.largest_m, task.mean_m])
        self._last: tuple[bytes, Structure | None, Array] | None = None
        self._mechanism: Mechanism | None = None
        self._joints: Array = np.empty((0, 2))
        self._reached = np.empty(0, bool)

    def design(self, values: Array) -> Structure:
        """The candidate. Raises InvalidDesign or InvalidGeometry."""
        numbers = dict(zip(self.names, (float(value) for value in values), strict=True))
        start, sections = self.task.start, dict(self.task.start.sections)
        for kind in self.task.kinds:
            outer, wall = numbers.pop(f"{kind} outer"), numbers.pop(f"{kind} wall")
            source = f"sized: seed {self.task.seed}"
            inner = outer - 2.0 * wall
            sections[kind] = replace(sections[kind], outer=outer, inner=inner, source=source, assumed=False)
        geometry = start.mechanism.geometry
        rigid = {name: value for name, value in numbers.items() if hasattr(geometry, name)}
        changes: dict[str, Any] = {name: value for name, value in numbers.items() if name not in rigid}
        if rigid:
            made = Topology(type(geometry), type(start.mechanism))
            changes["mechanism"] = built(made, vars(geometry) | rigid)
        description = f"sized from {start.name}: at most {1e3 * self.task.largest_m:.4g} mm under 100 N along y0"
        return replace(start, description=description, sections=sections, **changes)

    def _answer(self, values: Array) -> tuple[Structure | None, Array]:
        key = values.tobytes()
        if self._last is None or self._last[0] != key:
            self.evaluations += 1
            try:
                design = self.design(values)
                moved = self._sideways(design)
            except KinematicsError:
                design, moved = None, np.full(len(self.task.poses), np.inf)
            self._last = key, design, moved
        return self._last[1], self._last[2]

    def _sideways(self, design: Structure) -> Array:
        """`comparison.sideways`, infinite if there is no result. Joints are reused if only tubes change."""
        poses = self.task.poses
        if design.mechanism is not self._mechanism:
            self._joints, status, _ = inverse_many(design.mechanism, poses, design.working_mode)
            self._mechanism, self._reached = design.mechanism, status == Status.SOLVED
        with np.errstate(invalid="ignore", divide="ignore"):
            legs = design.legs(self._joints, poses)
            (_, ok_p), (lateral, ok_l) = compliances(design, legs.planar.sum(axis=-1), legs.lateral.sum(axis=-1))
        good = self._reached & ~legs.singular & ok_p & ok_l
        moved: Array = np.where(good, SIDEWAYS_N * lateral[0, 0], np.inf)
        return moved

    def mass(self, values: Array) -> float:
        design, _ = self._answer(values)
        return np.inf if design is None else design.mass

    def moved(self, values: Array) -> Array:
        return self._answer(values)[1]

    def excess(self, values: Array) -> Array:
        """(2,) largest and mean deflection over their limits, minus 1; not positive if the limits are met."""
        moved = self.moved(values)
        found: Array = np.minimum(np.array([moved.max(), moved.mean()]), 1e3) / self.limits - 1.0
        return found

    def polished(self, values: Array, low: Array, high: Array) -> Array:
        """The nearest local minimum of the mass, if SLSQP finds one that is lighter and meets the limits."""
        from scipy.optimize import minimize

        span = high - low

        def room(t: Array) -> Array:
            moved = np.minimum(self.moved(low + t * span), 1e3)
            return 1.0 - POLISH_TOL - np.append(moved / self.task.largest_m, moved.mean() / self.task.mean_m)

        found = minimize(
            lambda t: self.mass(low + t * span),
            (values - low) / span,
            method="SLSQP",
            bounds=[(0.0, 1.0)] * len(values),
            constraints={"type": "ineq", "fun": room},
            options={"maxiter": 200, "ftol": 0.1 * POLISH_TOL},
        )
        lighter: Array = low + np.clip(found.x, 0.0, 1.0) * span
        good = self.mass(lighter) < self.mass(values) and (self.excess(lighter) <= 0.0).all()
        return lighter if good else values

    def active(self, values: Array) -> tuple[Active, ...]:
        found = []
        excess = self.excess(values)
        for name, limit, over in zip(("largest deflection", "mean deflection"), self.limits, excess, strict=True):
            if over > -ACTIVE:
                found.append(Active(f"{name} [m]", float(limit * (1.0 + over)), float(limit)))
        for name, value, (low, high) in zip(self.names, values, self.task.ranges.values(), strict=True):
            ends = [end for end in (low, high) if abs(value - end) <= ACTIVE * (high - low)]
            found += [Active(name, float(value), end) for end in ends]
        return tuple(found)
