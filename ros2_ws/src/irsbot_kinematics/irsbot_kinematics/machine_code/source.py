"""The equations of a mechanism in C: one loop over samples that a compiler turns into vector instructions.

The work of `batch.evaluate_many` for one assembly mode, without a load, with the same decisions: what is not SOLVED is
NaN. A block of samples is computed without any decision, column by column; then decisions and results are written to
the arrays of the caller.
"""

from __future__ import annotations

from functools import reduce
from math import inf, isinf, isnan, tau
from string import Template
from typing import Any

from irsbot_kinematics import statics
from irsbot_kinematics.errors import NotCompiled
from irsbot_kinematics.machine_code.symbols import NoClosedForm, Operation, Program, Symbol
from irsbot_kinematics.mechanism import Mechanism, Status
from irsbot_kinematics.numerics.tolerances import (
    ASSEMBLY_TOL_M,
    CLOSURE_TOL_M,
    COINCIDENT_TOL_M,
    FARTHEST,
    SIGN_DEAD_BAND,
)

RESULTS = (
    "pose",
    "type1_margin",
    "type2_margin",
    "constraint_margin",
    "limb_margin",
    "pressure_angle",
    "reach",
    "closure_residual",
)
"""Fields of `batch.Evaluations` that are NaN if a sample is not SOLVED."""

ARRAYS = ("status", "working_mode", *RESULTS)
"""All fields that `evaluate` fills, in the order of its arguments."""

Row = tuple[Symbol | float, ...]

BLOCK = 128
"""Samples of a block: its columns stay in the first cache, 32 kB."""

TURN = float.fromhex("0x1.921fb58p+2")
"""rad: a turn to 28 bits, so that its product with the number of turns of any joint is exact."""

CODE = Template("""\
#include <math.h>
#include <stdint.h>

#if defined(__x86_64__) && defined(__GLIBC__) && !defined(__clang__)
#define VECTOR _Pragma("omp declare simd notinbranch")
#define EVERY_PROCESSOR __attribute__((target_clones("default", "arch=x86-64-v3", "arch=x86-64-v4")))
#else
#define VECTOR
#define EVERY_PROCESSOR
#endif
VECTOR __attribute__((const)) double sin(double);
VECTOR __attribute__((const)) double cos(double);
VECTOR __attribute__((const)) double acos(double);
VECTOR __attribute__((const)) double atan2(double, double);

static inline double minimum(double a, double b) { double least = a < b ? a : b; return a != a ? a : least; }
static inline double maximum(double a, double b) { double most = a > b ? a : b; return a != a ? a : most; }
static inline double safe_sqrt(double value) { return sqrt(maximum(value, 0.0)); }
static inline double ratio(double part, double whole)
{
    double share = part / whole, least = share > 1.0 ? 1.0 : share, none = 0.0 * whole;
    return whole > 0.0 ? least : none;
}
static inline double quotient(double above, double below)
{
    double share = above / below, none = below == 0.0 ? INFINITY : NAN;
    return below > 0.0 ? share : none;
}
static inline double wrap(double angle)
{
    double turns = nearbyint(angle * $per_turn);
    return (angle - turns * $turn) - turns * $turn_rest;
}

EVERY_PROCESSOR
void evaluate(int64_t number, const double *restrict joints, uint8_t *restrict status, int8_t *restrict working_mode,
              $arguments)
{
    for (int64_t start = 0; start < number; start += $block) {
        const int count = number - start < $block ? (int)(number - start) : $block;
        int64_t solved[$block];
        double $columns;
        for (int i = 0; i < $block; i++) {
            const int64_t row = start + (i < count ? i : count - 1);
            $inputs
        }
        _Pragma("omp simd")
        for (int i = 0; i < $block; i++) {
            $operations
        }
        for (int i = 0; i < $block; i++) {
            const int finite = $finite;
            const int assembled = gap0[i] >= $assembly_tol, single = gap1[i] > $coincident_tol;
            solved[i] = finite & assembled & single & (closure_residual0[i] <= $closure_tol);
            if (i < count)
                status[start + i] = solved[i] ? $SOLVED : !finite ? $INVALID
                    : !assembled ? $UNREACHABLE : !single ? $SINGULAR : $INVALID;
        }
        for (int i = 0; i < count; i++) {
            const int64_t row = start + i;
            $modes
        }
        $outputs
    }
}
""")


def c_source(mechanism: Mechanism, assembly: int) -> str:
    """C source of `evaluate` for one assembly mode. Raises NoClosedForm if the equations need the values of their
    numbers, NotCompiled if they are not what the mechanism states."""
    program = Program()
    k: Any = program.arithmetic
    joints = [program.input(f"q{j}[i]") for j in range(len(mechanism.joints))]
    try:
        pose, gaps = mechanism.direct(k, joints, assembly)
        legs = mechanism.legs(k, joints, pose)
        _, cosines = statics.pressure_cosines(k, legs.screws, legs.attachments)
        results: dict[str, Row] = {
            "pose": tuple(pose),
            "type1_margin": tuple(map(k.abs, legs.normalised_levers)),
            "type2_margin": (reduce(k.minimum, cosines),),
            "constraint_margin": () if legs.constraint is None else (legs.constraint,),
            "limb_margin": tuple(legs.limb),
            "pressure_angle": tuple(map(k.acos, cosines)),
            "reach": (reduce(k.minimum, legs.reach),),
            "closure_residual": (reduce(k.maximum, map(k.abs, legs.closure)),),
        }
        decisive = {"sine": tuple(legs.normalised_levers), "gap": tuple(gaps[:2])}
    except (TypeError, AttributeError) as error:  # also of numpy, for which a symbol is no number
        raise NoClosedForm(str(error)) from error
    _check_widths(mechanism, {**results, **decisive})
    return c_text(len(joints), program, results, decisive)


def _check_widths(mechanism: Mechanism, rows: dict[str, Row]) -> None:
    """The arrays of the caller are as wide as the mechanism states; C would write beyond them. Raises NotCompiled."""
    joints, stated = len(mechanism.joints), {"pose": len(mechanism.task), "limb_margin": mechanism.limb_count, "gap": 2}
    for name in ("type1_margin", "pressure_angle", "sine"):
        stated[name] = joints
    for name, width in stated.items():
        if len(rows[name]) != width:
            raise NotCompiled(f"{name} of {mechanism.kind} has {len(rows[name])} numbers, {width} are stated")


def c_text(n: int, program: Program, results: dict[str, Row], decisive: dict[str, Row]) -> str:
    """C source of `evaluate` for n joints q0[i], q1[i]... results: a row of each of `RESULTS`. decisive: `sine`, the
    signed Type 1 measures, and `gap`, the assembly clearances."""
    columns = [
        (f"{name}{j}", _stated(one)) for name, row in {**results, **decisive}.items() for j, one in enumerate(row)
    ]
    operations = [f"const double {name} = {expression(operation)};" for name, operation in program.operations]
    modes = [
        f"working_mode[row * {n} + {j}] = solved[i] ? (sine{j}[i] > {SIGN_DEAD_BAND!r}) - "
        f"(sine{j}[i] < {-SIGN_DEAD_BAND!r}) : 0;"
        for j in range(n)
    ]
    outputs = []
    for name in RESULTS:
        width = len(results[name])
        written = [f"{name}[row * {width} + {j}] = solved[i] ? {name}{j}[i] : NAN;" for j in range(width)]
        outputs += ["for (int i = 0; i < count; i++) {", "const int64_t row = start + i;", *written, "}"]
    return CODE.substitute(
        {status.name: int(status) for status in Status},
        per_turn=repr(1.0 / tau),
        turn=repr(TURN),
        turn_rest=repr(tau - TURN),
        block=BLOCK,
        arguments=", ".join(f"double *restrict {name}" for name in RESULTS),
        columns=", ".join(
            f"{name}[{BLOCK}]" for name in [*(f"q{j}" for j in range(n)), *(name for name, _ in columns)]
        ),
        inputs="\n".join(f"q{j}[i] = joints[row * {n} + {j}];" for j in range(n)),
        operations="\n".join([*operations, *(f"{name}[i] = {value};" for name, value in columns)]),
        finite=" & ".join(f"(fabs(q{j}[i]) <= {FARTHEST!r})" for j in range(n)),
        assembly_tol=repr(-ASSEMBLY_TOL_M),
        coincident_tol=repr(COINCIDENT_TOL_M),
        closure_tol=repr(CLOSURE_TOL_M),
        modes="\n".join(modes),
        outputs="\n".join(outputs),
    )


def expression(operation: Operation) -> str:
    """An operation in C."""
    name, operands = operation.name, [operand(one) for one in operation.operands]
    if name in ("+", "-", "*", "/"):
        return f" {name} ".join(operands) if len(operands) == 2 else f"-{operands[0]}"
    return f"{'fabs' if name == 'abs' else name}({', '.join(operands)})"


def _stated(value: Symbol | float) -> str:
    """A result, which may be the same for all samples."""
    return value.name if isinstance(value, Symbol) else operand(repr(float(value)))


def operand(text: str) -> str:
    """A value by its name, or a constant as C writes it."""
    try:
        constant = float(text)
    except ValueError:
        return text
    if isnan(constant):
        return "NAN"
    if isinf(constant):
        return "INFINITY" if constant == inf else "(-INFINITY)"
    return f"({text})"
