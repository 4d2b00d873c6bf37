"""C source of the bounds over boxes for one shape: a number of rods, in the plane or in space.

The modules of these bounds run once on numbers that record what is done to them (`branching`). So no equation is
written a second time, except for `least`, which picks a corner by its value, and no operation changes its place: C
gives the same bits as Python. Where a comparison turns out otherwise than on the recorded way, the answer is often
known, because the equations return at once; elsewhere Python has to answer.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from string import Template
from typing import Any

from irsbot_kinematics.bounds.box_code import FOUND, NOTHING, UNKNOWN, functions
from irsbot_kinematics.machine_code.box_functions import FUNCTIONS, Function, Shape
from irsbot_kinematics.machine_code.branching import Branch, Comparison, Further, Number, Undecided
from irsbot_kinematics.machine_code.copies import Copies
from irsbot_kinematics.machine_code.source import expression, operand
from irsbot_kinematics.machine_code.symbols import Operation, stated

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

$functions
""")

FUNCTION = Template("""\
int $name(const double *restrict in, double *restrict out)
{
    double first = 0.0;
    $operations
    first = $first;
known:
    out[0] = first;
    $results
    return $FOUND;
}

const double ${name}_example[] = { $example };
const double ${name}_expected[] = { $expected };
const int ${name}_given = $given, ${name}_width = $width;

/* 1 if the example gives the same bits on this machine. */
int ${name}_is_reproduced(void)
{
    double out[$width];
    return $name(${name}_example, out) == $FOUND && !memcmp(out, ${name}_expected, sizeof ${name}_expected);
}
""")


def c_source(shape: Shape) -> str:
    """C source of all functions for one shape, each with an example."""
    found = [_function(shape, name, FUNCTIONS[name]) for name in functions(shape.dims, shape.rows)]
    return CODE.substitute(n=shape.rods, numbers=shape.numbers, functions="\n".join(found))


def _function(shape: Shape, name: str, function: Function) -> str:
    trace, found = function.traced(shape)
    results = function.flat(found)
    guards: dict[int, list[str]] = {}
    for number, guard in enumerate(trace.guards):
        answer = f"if (!({_condition(guard.comparisons)})) {_answer(shape, function, number, results)};"
        guards.setdefault(guard.place, []).append(answer)
    lines = []
    for place, (value, operation) in enumerate(trace.operations):
        lines += [*guards.get(place, ()), *_statements(shape, value, operation)]
    lines += guards.get(len(trace.operations), ())
    example, expected = function.run(shape)
    return FUNCTION.substitute(
        name=name,
        operations="\n    ".join(lines),
        first=operand(stated(results[0])),
        results="\n    ".join(f"out[{k}] = {operand(stated(one))};" for k, one in enumerate(results) if k),
        given=len(example),
        width=len(results),
        FOUND=FOUND,
        example=", ".join(map(float.hex, example)),
        expected=", ".join(map(float.hex, expected)),
    )


def _answer(shape: Shape, function: Function, number: int, results: Sequence[Any]) -> str:
    """What the code does where a guard is not true."""
    try:
        _trace, found = function.traced(shape, number)
    except Further:
        return f"return {UNKNOWN}"
    if found is None:
        return f"return {NOTHING}"
    first, *others = map(stated, function.flat(found))
    same = others == list(map(stated, results))[1:]
    return "goto known" if same and first == stated(0.0) else f"return {UNKNOWN}"


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
    room_within = Copies(branch).module("bounds.boxes").room_within
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
