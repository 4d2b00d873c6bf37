"""C source of `bounds.boxes.by_equations` for one shape: a number of rods, in the plane or in space.

The modules of these bounds run once on numbers that record what is done to them (`branching`). So no equation is
written a second time, except for `least`, which picks a corner by its value, and no operation changes its place: C
gives the same bits as Python. Where a comparison turns out otherwise than on the recorded way, the answer is often
known, because the equations return at once; elsewhere Python has to answer.
"""

from __future__ import annotations

import builtins
import math
from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from itertools import chain, count, islice
from pathlib import Path
from string import Template
from types import SimpleNamespace
from typing import Any, NamedTuple

from irsbot_kinematics.bounds.box_code import FOUND, NOTHING, UNKNOWN
from irsbot_kinematics.machine_code.branching import (
    Branch,
    Comparison,
    Further,
    Number,
    Recorder,
    Trace,
    Undecided,
    all_of,
)
from irsbot_kinematics.machine_code.source import expression, operand
from irsbot_kinematics.machine_code.symbols import Operation, Symbol, stated

ROOT = Path(__file__).parent.parent
PACKAGE = "irsbot_kinematics"
EQUATIONS = ("statics", "bounds.quadratics", "bounds.cubics", "bounds.type2_over_box", "bounds.boxes")
"""Modules that run on recording numbers."""

CODE = Template("""\
#include <math.h>
#include <string.h>

enum { N = $n, CORNERS = 1 << N, NUMBERS = $numbers, POLYNOMIAL = 1 + N + N * (N + 1) / 2 };

static inline double smaller(double a, double b) { return b < a ? b : a; }
static inline double larger(double a, double b) { return b > a ? b : a; }

double least(const double *a)
{
    double size = 0.0, values[CORNERS], bends[CORNERS], less = 0.0, found;
    int place = 1 + 2 * N, corner = 0;
    for (int k = 0; k < NUMBERS; k++)
        size += fabs(a[k]);
    if (!(size < INFINITY))
        return NAN;
    values[0] = a[0];
    for (int k = 1 + N; k < 1 + 2 * N; k++)
        values[0] += a[k];
    for (int k = 0; k < N; k++) {
        double slopes[CORNERS];
        slopes[0] = a[1 + k];
        for (int j = 0; j < k; j++, place++)
            for (int i = 0; i < 1 << j; i++) {
                slopes[(1 << j) + i] = slopes[i] + a[place];
                slopes[i] -= a[place];
            }
        for (int i = 0; i < 1 << k; i++) {
            values[(1 << k) + i] = values[i] + slopes[i];
            values[i] -= slopes[i];
        }
    }
    for (int k = 1; k < CORNERS; k++)
        if (values[k] < values[corner])
            corner = k;
    bends[0] = 0.0;
    for (int j = 0; j < N; j++) {
        double convex = larger(a[1 + N + j], 0.0), rise = values[corner ^ (1 << j)] - values[corner];
        double share = rise < 4.0 * convex ? rise / (4.0 * convex) : 1.0;
        double bend = 2.0 * convex * (corner & (1 << j) ? share : -share);
        for (int i = 0; i < 1 << j; i++) {
            bends[(1 << j) + i] = bends[i] + bend;
            bends[i] -= bend;
        }
        less += convex * (1.0 + share * share);
    }
    found = values[0] + bends[0];
    for (int k = 1; k < CORNERS; k++)
        found = smaller(found, values[k] + bends[k]);
    found -= less;
    for (int k = POLYNOMIAL; k < NUMBERS; k++)
        found -= fabs(a[k]);
    return found;
}

int reached(const double *restrict in, double *restrict out)
{
    double type2 = 0.0;
    $operations
    type2 = $type2;
known:
    out[0] = type2;
    $results
    return $FOUND;
}

const double example[] = { $example };
const double expected[] = { $expected };
const int given = $given, width = $width;

/* 1 if the example gives the same bits on this machine. */
int is_reproduced(void)
{
    double out[$width];
    return reached(example, out) == $FOUND && !memcmp(out, expected, sizeof expected);
}
""")


class Shape(NamedTuple):
    """Of a platform on rods."""

    rods: int
    dims: int  # 2 in the plane, 3 in space
    rows: int  # entries of a screw: one more than `dims` if the platform turns

    @property
    def turns(self) -> bool:
        """True if the platform can turn."""
        return self.rows > self.dims


def c_source(shape: Shape) -> str:
    """C source of `reached`, with an example."""
    trace, found = _traced(shape)
    results = _flat(found)
    guards: dict[int, list[str]] = {}
    for number, guard in enumerate(trace.guards):
        answer = f"if (!({_condition(guard.comparisons)})) {_answer(shape, number, results)};"
        guards.setdefault(guard.place, []).append(answer)
    lines = []
    for place, (name, operation) in enumerate(trace.operations):
        lines += [*guards.get(place, ()), *_statements(shape, name, operation)]
    lines += guards.get(len(trace.operations), ())
    example, expected = _example(shape)
    return CODE.substitute(
        n=shape.rods,
        numbers=len(found.pose[0]),
        operations="\n    ".join(lines),
        type2=operand(stated(found.type2)),
        results="\n    ".join(f"out[{k}] = {operand(stated(one))};" for k, one in enumerate(results) if k),
        given=len(example),
        width=len(results),
        FOUND=FOUND,
        example=", ".join(map(float.hex, example)),
        expected=", ".join(map(float.hex, expected)),
    )


def _flat(found: Any) -> list[Any]:
    """The numbers of a result in the order in which the code writes them."""
    rods = [x for rod in found.rods for quadratic in rod for x in quadratic]
    return [found.type2, *[x for quadratic in found.pose for x in quadratic], *rods, *found.longest]


def _answer(shape: Shape, number: int, results: Sequence[Any]) -> str:
    """What the code does where a guard is not true."""
    try:
        _trace, found = _traced(shape, number)
    except Further:
        return f"return {UNKNOWN}"
    if found is None:
        return f"return {NOTHING}"
    same = list(map(stated, _flat(found)))[1:] == list(map(stated, results))[1:]
    return "goto known" if same and stated(found.type2) == stated(0.0) else f"return {UNKNOWN}"


def _condition(comparisons: Sequence[Comparison]) -> str:
    """In C."""
    return " && ".join([f"{operand(left)} {sign} {operand(right)}" for left, sign, right in comparisons])


def _statements(shape: Shape, name: str, operation: Operation) -> list[str]:
    """What gives a value its name."""
    if operation.name == "room":
        found = f"double {name} = 0.0, {name}_is[{shape.rows}];"
        return [found, *_every_way(shape, name, list(operation.operands), (), 0)]
    if operation.name == "least":
        given = f"const double {name}_of[] = {{{', '.join(map(operand, operation.operands))}}};"
        return [given, f"const double {name} = least({name}_of);"]
    return [f"const double {name} = {expression(operation)};"]


def _every_way(shape: Shape, name: str, given: list[str], answers: tuple[bool, ...], known: int) -> list[str]:
    """`room_within` with all answers to its comparisons but the first, which are told; `known` operations are there."""
    branch = Branch(answers)
    room_within = _Copies(branch).module("bounds.boxes").room_within
    try:
        found = room_within(*_room_arguments(shape, [_given(branch, one) for one in given]))
    except Undecided as undecided:
        lines = [line for one in branch.operations[known:] for line in _statements(shape, *one)]
        place = undecided.guard.place
        yes, no = [_every_way(shape, name, given, (*answers, answer), place) for answer in (True, False)]
        return [*lines, f"if ({_condition(undecided.guard.comparisons)}) {{", *yes, "} else {", *no, "}"]
    lines = [line for one in branch.operations[known:] for line in _statements(shape, *one)]
    if found is None:
        return lines
    results = [f"{name}_is[{k}] = {operand(stated(one))};" for k, one in enumerate(found)]
    return [*lines, f"{name} = 1.0;", *results]


def _given(branch: Branch, text: str) -> Number | float:
    """A value of the program around, or a constant."""
    return branch.input(text) if text == operand(text) else float(text)


def _room_arguments(shape: Shape, numbers: Sequence[Any]) -> tuple[Any, ...]:
    """Arguments of `boxes.room_within` from their numbers in this order."""
    n, m, left = shape.rods, shape.rows, iter(numbers)

    def take(number: int) -> list[Any]:
        return list(islice(left, number))

    shares, sizes = [take(m) for _ in range(m)], [take(n) for _ in range(m)]
    return shares, sizes, take(m), [tuple(take(4)) for _ in range(n)], shape.dims


def _traced(shape: Shape, denied: int | None = None) -> tuple[Trace, Any]:
    """A run of the equations, and its result."""
    trace, places = Trace(denied), count()
    boxes = _Copies(trace).module("bounds.boxes")
    arguments = _arguments(shape, boxes.Rod, lambda: trace.input(f"in[{next(places)}]"))
    return trace, boxes.by_equations(*arguments)


def _example(shape: Shape) -> tuple[list[float], list[float]]:
    """Inputs without symmetry, and the results of Python."""
    boxes = _Copies(Trace()).module("bounds.boxes")
    sines = (math.sin(k * k + 1.0) for k in count())
    at, rods, arm = _arguments(shape, boxes.Rod, lambda: 1e-3 * next(sines))
    legs = [(1.9 * leg, math.cos(3.0 * leg)) for leg in range(shape.rods)]  # rad: the rod, and its arm from there
    at.attachments = tuple([(0.3 * math.cos(a + b), 0.3 * math.sin(a + b)) for a, b in legs][: len(at.attachments)])
    at.screws = tuple([_screw(shape, a, -0.3 * math.sin(b)) for a, b in legs])
    rods = [
        rod._replace(length=1.0 + rod.growth, aside=abs(rod.aside), growth_aside=abs(rod.growth_aside)) for rod in rods
    ]
    found = boxes.by_equations(at, rods, abs(arm))
    return boxes.numbers_of(at, rods, abs(arm)), _flat(found)


def _screw(shape: Shape, angle: float, moment: float) -> tuple[float, ...]:
    """A rod that points outwards, and upwards in space."""
    level = 1.0 if shape.dims == 2 else 0.8 + 0.1 * math.cos(3.0 * angle)
    rise = math.sqrt(1.0 - level * level)
    screw = level * math.cos(angle), level * math.sin(angle), *[rise][: shape.dims - 2]
    return *screw, *[moment * level][: shape.rows - shape.dims]


def _arguments(shape: Shape, rod: Callable[..., Any], given: Callable[[], Any]) -> tuple[Any, list[Any], Any]:
    """Posture, rods and error of the attachments, in the order of `boxes.numbers_of`."""
    screws = tuple([tuple([given() for _ in range(shape.rows)]) for _ in range(shape.rods)])
    attachments = tuple([(given(), given()) for _ in range(shape.rods)]) if shape.turns else ()
    at = SimpleNamespace(screws=screws, attachments=attachments)

    def vector() -> tuple[Any, ...]:
        return tuple([given() for _ in range(shape.dims)])

    rods = [
        rod(given(), vector(), given(), given(), given(), vector(), given(), vector(), given())
        for _ in range(shape.rods)
    ]
    return at, rods, given()


class _Copies:
    """The modules of the equations, executed once more, with functions that also take the numbers of a trace."""

    def __init__(self, trace: Recorder) -> None:
        self._trace = trace
        self._modules: dict[str, SimpleNamespace] = {}
        own = {"min": self._folded("min", "smaller"), "max": self._folded("max", "larger"), "all": all_of}
        self._builtins = {**vars(builtins), **own, "__import__": self._import}
        functions = {name: self._function(name) for name in ("sqrt", "copysign")}
        self._math = SimpleNamespace(**{**vars(math), **functions})

    def module(self, name: str) -> SimpleNamespace:
        """A copy of one of `EQUATIONS`."""
        if name not in self._modules:
            file = ROOT.joinpath(*name.split(".")).with_suffix(".py")
            names: dict[str, Any] = {"__name__": f"recorded.{name}", "__builtins__": self._builtins}
            exec(compile(file.read_text(encoding="utf-8"), file, "exec"), names)
            if name == "bounds.quadratics":
                names["least"] = self._least(names["least"])
            if name == "bounds.boxes" and isinstance(self._trace, Trace):
                names["room_within"] = self._room(names["room_within"])
            self._modules[name] = SimpleNamespace(**names)
        return self._modules[name]

    def _import(
        self,
        name: str,
        given: Mapping[str, object] | None = None,
        local: Mapping[str, object] | None = None,
        wanted: Sequence[str] = (),
        level: int = 0,
    ) -> Any:
        if name == "math":
            return self._math
        if name.startswith(PACKAGE):
            short = name[len(PACKAGE) + 1 :]
            if short in EQUATIONS:
                return self.module(short)
            inner = {one: f"{short}.{one}" if short else one for one in wanted or ()}
            if inner and set(inner.values()) <= set(EQUATIONS):
                return SimpleNamespace(**{one: self.module(path) for one, path in inner.items()})
        return builtins.__import__(name, given, local, wanted, level)

    def _folded(self, name: str, recorded: str) -> Callable[..., Any]:
        """`min` or `max`."""
        usual: Callable[..., Any] = getattr(builtins, name)

        def function(*given: Any) -> Any:
            parts = list(given[0]) if len(given) == 1 else given
            if not any(isinstance(part, Symbol) for part in parts):
                return usual(parts)
            return reduce(lambda one, other: self._trace.value(recorded, one, other), parts)

        return function

    def _function(self, name: str) -> Callable[..., Any]:
        usual: Callable[..., Any] = getattr(math, name)

        def function(*given: Any) -> Any:
            if any(isinstance(part, Symbol) for part in given):
                return self._trace.value(name, *given)
            return usual(*given)

        return function

    def _least(self, usual: Callable[..., float]) -> Callable[..., Any]:
        def function(n: int, a: Sequence[Any]) -> Any:
            if any(isinstance(part, Symbol) for part in a):
                return self._trace.value("least", *a)
            return usual(n, a)

        return function

    def _room(self, usual: Callable[..., list[float] | None]) -> Callable[..., Any]:
        """`room_within`: one operation of the trace, which finds a room or not."""

        def function(shares: Any, sizes: Any, start: Sequence[Any], legs: Any, dims: int) -> Any:
            parts = [*chain(*shares), *chain(*sizes), *start, *chain(*legs)]
            if not any(isinstance(part, Symbol) for part in parts):
                return usual(shares, sizes, start, legs, dims)
            found = self._trace.value("room", *parts)
            return [self._trace.input(f"{found.name}_is[{k}]") for k in range(len(start))] if found > 0.0 else None

        return function
