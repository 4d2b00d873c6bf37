"""Many designs at once: a grid or Latin hypercubes over the design parameters, judged chunk by chunk."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import prod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from irsbot_kinematics.arguments import check_fields, checked, instance
from irsbot_kinematics.design import proximal
from irsbot_kinematics.design.proximal import QUESTIONS, ZONES
from irsbot_kinematics.errors import BadInput
from irsbot_kinematics.mechanisms.irsbot2_space import distal
from irsbot_kinematics.mechanisms.irsbot2_space.designs import PARAMETERS, Designs, Flags
from irsbot_kinematics.numerics.arithmetic import Array

CHUNK = 50_000
"""Number of designs computed together: some tens of megabytes; larger chunks are no faster."""
COUNTS = tuple(f"n_{kind.value}" for kind in distal.Kind)
Column = NDArray[Any]
Columns = dict[str, Column]


@dataclass(frozen=True)
class Range:
    """Values of one parameter, m or rad. low = high keeps it fixed."""

    low: float
    high: float
    steps: int = 1
    """Values on a grid, ends included; not used by a hypercube."""

    def __post_init__(self) -> None:
        check_fields(self)
        if not (np.isfinite(self.low) and np.isfinite(self.high) and self.low <= self.high):
            raise BadInput(f"a range must satisfy low <= high, got {self.low:.9g} against {self.high:.9g}")
        if not self.steps >= 1:
            raise BadInput(f"a range must satisfy steps >= 1, got {self.steps}")


@dataclass(frozen=True)
class Plan:
    """The designs to judge."""

    ranges: Mapping[str, Range]
    """One for each of PARAMETERS."""
    samples: int | None = None
    """Number of random designs; None: the full grid."""
    seed: int = 0

    def __post_init__(self) -> None:
        check_fields(self)
        if set(self.ranges) != set(PARAMETERS):
            raise BadInput(f"a sweep needs ranges of {', '.join(PARAMETERS)}, got {', '.join(map(str, self.ranges))}")
        for name, values in self.ranges.items():
            instance(values, name, Range, "a Range")
        if self.samples is not None and not self.samples >= 1:
            raise BadInput(f"a sweep must satisfy samples >= 1, got {self.samples}")

    def __len__(self) -> int:
        return prod(r.steps for r in self.ranges.values()) if self.samples is None else self.samples


class Chunk(NamedTuple):
    """Designs of a plan that are computed together, known without those before them."""

    plan: Plan
    number: int
    """Place among the chunks of the plan."""
    size: int = CHUNK
    """Designs in every chunk but the last."""


def chunks(plan: Plan, size: int = CHUNK) -> Iterator[Chunk]:
    """All designs of a plan, in order, so that memory is bounded by the size of a chunk."""
    return (Chunk(plan, number, size) for number in range(-(-len(plan) // size)))


def designs(chunk: Chunk) -> Designs:
    """The designs of a chunk. Random ones are stratified: every chunk is a Latin hypercube of its own."""
    plan = chunk.plan
    ranges = [plan.ranges[name] for name in PARAMETERS]
    start = chunk.number * chunk.size
    count = min(chunk.size, len(plan) - start)
    if plan.samples is None:
        columns = _grid(ranges, start, count)
    else:
        generator = np.random.default_rng([plan.seed, chunk.number])
        strata = generator.permuted(np.tile(np.arange(count), (len(ranges), 1)), axis=1)
        unit = (strata + generator.random(strata.shape)) / count
        columns = [r.low + (r.high - r.low) * u for r, u in zip(ranges, unit, strict=True)]
    return Designs.columns(dict(zip(PARAMETERS, columns, strict=True)))


def _grid(ranges: Sequence[Range], start: int, count: int) -> list[Array]:
    places = np.unravel_index(np.arange(start, start + count), [r.steps for r in ranges])
    return [np.linspace(r.low, r.high, r.steps)[place] for r, place in zip(ranges, places, strict=True)]


@checked
def judge(d: Designs) -> Columns:
    """The table of a sweep: parameters, validity, b0, posture counts, slack of every question, zones.

    Designs that no machine can have (`valid` false) have counts 0, slacks NaN, and are in no zone. Slacks in metres:
    positive where the question is answered yes, infinite where the distal loop cannot take the posture.
    """
    valid = d.valid
    chosen = d.where(valid)
    found = proximal.evaluate_questions(chosen)
    table: Columns = {name: getattr(d, name) for name in PARAMETERS}
    table["valid"] = valid
    table["b0"] = _spread(valid, chosen.b0, np.nan)
    for name, number in zip(COUNTS, distal.counts(chosen), strict=True):
        table[name] = _spread(valid, number.astype(np.int8), 0)
    table["distal_free"] = _spread(valid, distal.distal_free(chosen), False)
    for name in QUESTIONS:
        table[f"slack_{name}"] = _spread(valid, found[name].slack, np.nan)
    for zone in ZONES:
        table[f"zone_{zone}"] = _spread(valid, proximal.in_zone(zone, found), False)
    return table


def judge_chunk(chunk: Chunk) -> Columns:
    """The designs of a chunk, judged."""
    return judge(designs(chunk))


@checked
def sweep(plan: Plan, chunk: int = CHUNK) -> Iterator[Columns]:
    """The judged designs of a plan, chunk by chunk, in order."""
    return map(judge_chunk, chunks(plan, chunk))


def _spread(valid: Flags, values: Column, missing: float) -> Column:
    column: Column = np.full(valid.shape, missing, dtype=values.dtype)
    column[valid] = values
    return column
