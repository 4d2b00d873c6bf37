"""Machine code of the bounds over boxes, which take most of the time of a supervisor near its limits.

Each function is `by_equations` of its module: `reached` of `boxes`, `levers` of `cranks`, `couples` of `couples`.

`python -m irsbot_kinematics.machine_code` makes it. It gives the same bits as Python, and is used while the equations
are unchanged. The environment variable IRSBOT_PLAIN switches it off.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import platform
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path

from irsbot_kinematics.cache import cache_folder
from irsbot_kinematics.compiled import SWITCH

SHAPES = ((2, 2, 2), (3, 2, 3), (3, 3, 3), (4, 3, 4))
"""Number of rods, dimensions, entries of a screw."""

EQUATIONS = (
    "statics",
    *(f"bounds.{name}" for name in ("boxes", "couples", "cranks", "cubics", "quadratics", "sizes", "type2_over_box")),
)
"""Modules from which machine code is recorded."""

_RECORDER = ("__main__", "box_functions", "box_source", "branching", "copies", "source", "symbols")
SOURCES = (*EQUATIONS, "bounds.box_code", *(f"machine_code.{name}" for name in _RECORDER))
"""Modules whose change makes the machine code outdated."""

FOUND, NOTHING, UNKNOWN = 0, 1, 2
"""What the code returns: bounds, the knowledge that there are none, or nothing at all."""

BoxCode = Callable[[Sequence[float]], "list[float] | None"]
"""From `numbers_of`: the numbers of the result, None if there is none, or nothing where Python has to answer."""


def functions(dims: int, rows: int) -> tuple[str, ...]:
    """What there is machine code of, for one shape."""
    if rows == dims:
        return ("reached",)
    return ("reached", "levers", "couples") if dims == 3 else ("reached", "levers")


@cache
def codes_for(rods: int, dims: int, rows: int) -> Mapping[str, BoxCode]:
    """The machine code for one shape; nothing if there is none of the present equations."""
    if os.environ.get(SWITCH):
        return {}
    try:
        file = library_for(rods, dims, rows)
    except OSError:  # without sources nobody knows whether it is theirs
        return {}
    if not file.is_file():
        return {}
    try:
        library = ctypes.PyDLL(str(file))
        codes = {name: _called(library, name) for name in functions(dims, rows)}
        reproduced = all(library[f"{name}_is_reproduced"]() for name in codes)
    except (OSError, AttributeError, ValueError) as error:
        warnings.warn(f"{file} cannot be used ({error}), plain Python runs: delete it", stacklevel=2)
        return {}
    if not reproduced:
        warnings.warn(f"{file} has other results on this machine, plain Python runs: delete it", stacklevel=2)
        return {}
    return codes


def _called(library: ctypes.PyDLL, name: str) -> BoxCode:
    function = library[name]
    given, width = [ctypes.c_int.in_dll(library, f"{name}_{what}").value for what in ("given", "width")]
    inputs, results = ctypes.c_double * given, ctypes.c_double * width

    def code(values: Sequence[float]) -> list[float] | None:
        if len(values) != given:  # fewer would be taken as zeros
            return []
        out = results()
        status = function(inputs(*values), out)
        if status != FOUND:
            return None if status == NOTHING else []
        found: list[float] = out[:]
        return found

    return code


def source_of(module: str) -> Path:
    """The file of one of `SOURCES`."""
    return Path(__file__).parent.parent.joinpath(*module.split(".")).with_suffix(".py")


@cache
def _digest() -> str:
    """Of the sources, and of the machine."""
    found = hashlib.sha256(platform.machine().encode())
    for name in SOURCES:
        data = source_of(name).read_bytes()
        found.update(f"{name} {len(data)} ".encode() + data)
    return found.hexdigest()[:24]


def library_for(rods: int, dims: int, rows: int) -> Path:
    """Where the machine code for one shape is, if there is any."""
    return cache_folder("machine_code") / f"boxes-{rods}-{dims}-{rows}-{_digest()}.so"
