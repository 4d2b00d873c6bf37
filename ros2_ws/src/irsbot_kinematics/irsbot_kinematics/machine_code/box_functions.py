"""What there is machine code of: for each function of `bounds.box_code`, its inputs, an example, and its results."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import count
from types import SimpleNamespace
from typing import Any, NamedTuple

from irsbot_kinematics.bounds.quadratics import numbers
from irsbot_kinematics.machine_code.branching import Trace
from irsbot_kinematics.machine_code.copies import Copies

Given = Callable[[], Any]
"""The next input."""


class Shape(NamedTuple):
    """Of a platform on rods."""

    rods: int
    dims: int  # 2 in the plane, 3 in space
    rows: int  # entries of a screw: one more than `dims` if the platform turns

    @property
    def turns(self) -> bool:
        """True if the platform can turn."""
        return self.rows > self.dims

    @property
    def numbers(self) -> int:
        """Of a quantity over the box."""
        return numbers(self.rods, self.rows)


class Function(NamedTuple):
    """`by_equations` of a module, with `numbers_of`, which has its inputs in the order of `arguments`."""

    module: str
    arguments: Callable[[Shape, SimpleNamespace, Given], tuple[Any, ...]]
    example: Callable[[Shape, SimpleNamespace], tuple[Any, ...]]
    flat: Callable[[Any], list[Any]]
    """Its results in the order in which the code writes them. The first may be known to be 0 before the others are."""

    def traced(self, shape: Shape, denied: int | None = None) -> tuple[Trace, Any]:
        """A run of the equations, and its result."""
        trace, places = Trace(denied), count()
        module = Copies(trace).module(self.module)
        return trace, module.by_equations(*self.arguments(shape, module, lambda: trace.input(f"in[{next(places)}]")))

    def run(self, shape: Shape) -> tuple[list[float], list[float]]:
        """Inputs without symmetry, and the results of Python."""
        module = Copies(Trace()).module(self.module)
        example = self.example(shape, module)
        return module.numbers_of(*example), self.flat(module.by_equations(*example))


# --- boxes -----------------------------------------------------------------------------------------------------------


def _box(shape: Shape, boxes: SimpleNamespace, given: Given) -> tuple[Any, ...]:
    """Posture, rods and error of the attachments."""
    screws = tuple([tuple([given() for _ in range(shape.rows)]) for _ in range(shape.rods)])
    attachments = tuple([(given(), given()) for _ in range(shape.rods)]) if shape.turns else ()
    at = SimpleNamespace(screws=screws, attachments=attachments)

    def vector() -> tuple[Any, ...]:
        return tuple([given() for _ in range(shape.dims)])

    rods = [
        boxes.Rod(given(), vector(), given(), given(), given(), vector(), given(), vector(), given())
        for _ in range(shape.rods)
    ]
    return at, rods, given()


def _a_box(shape: Shape, boxes: SimpleNamespace) -> tuple[Any, ...]:
    sines = (math.sin(k * k + 1.0) for k in count())
    at, rods, arm = _box(shape, boxes, lambda: 1e-3 * next(sines))
    legs = [(1.9 * leg, math.cos(3.0 * leg)) for leg in range(shape.rods)]  # rad: the rod, and its arm from there
    at.attachments = tuple([(0.3 * math.cos(a + b), 0.3 * math.sin(a + b)) for a, b in legs][: len(at.attachments)])
    at.screws = tuple([_screw(shape, a, -0.3 * math.sin(b)) for a, b in legs])
    rods = [
        rod._replace(length=1.0 + rod.growth, aside=abs(rod.aside), growth_aside=abs(rod.growth_aside)) for rod in rods
    ]
    return at, rods, abs(arm)


def _screw(shape: Shape, angle: float, moment: float) -> tuple[float, ...]:
    """A rod that points outwards, and upwards in space."""
    level = 1.0 if shape.dims == 2 else 0.8 + 0.1 * math.cos(3.0 * angle)
    rise = math.sqrt(1.0 - level * level)
    screw = level * math.cos(angle), level * math.sin(angle), *[rise][: shape.dims - 2]
    return *screw, *[moment * level][: shape.rows - shape.dims]


def _reached(found: Any) -> list[Any]:
    rods = [x for rod in found.rods for quadratic in rod for x in quadratic]
    return [found.type2, *[x for quadratic in found.pose for x in quadratic], *rods, *found.longest]


# --- cranks and couples ----------------------------------------------------------------------------------------------


def _level(shape: Shape, given: Given) -> list[Any]:
    """The horizontal coordinates of a rod."""
    return [[given() for _ in range(shape.numbers)] for _ in range(2)]


def _rods(shape: Shape) -> Sequence[Any]:
    """Of an example."""
    boxes = Copies(Trace()).module("bounds.boxes")
    found: Sequence[Any] = boxes.by_equations(*_a_box(shape, boxes)).rods
    return found


def _cranks(shape: Shape, cranks: SimpleNamespace, given: Given) -> tuple[Any, ...]:
    legs = [(_level(shape, given), cranks.Crank(given(), given(), given(), given())) for _ in range(shape.rods)]
    rods, turning = zip(*legs, strict=True)
    return rods, turning


def _a_crank(shape: Shape, cranks: SimpleNamespace) -> tuple[Any, ...]:
    turning = [cranks.Crank(math.cos(k), math.sin(k), 0.02 + 0.01 * k, (-1.0) ** k) for k in range(shape.rods)]
    return _rods(shape), turning


FUNCTIONS = {
    "reached": Function("bounds.boxes", _box, _a_box, _reached),
    "levers": Function("bounds.cranks", _cranks, _a_crank, list),
    "couples": Function(
        "bounds.couples",
        lambda shape, _couples, given: ([_level(shape, given) for _ in range(shape.rods)],),
        lambda shape, _couples: (_rods(shape),),
        lambda found: [found],
    ),
}
"""By its name in `bounds.box_code`."""
