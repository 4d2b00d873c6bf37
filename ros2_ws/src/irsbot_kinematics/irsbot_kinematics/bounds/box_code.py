"""Machine code of `boxes.by_equations`, which takes most of the time of a supervisor near its limits.

`python -m irsbot_kinematics.machine_code` makes it. It gives the same bits as Python, and is used while the equations
are unchanged. The environment variable IRSBOT_PLAIN switches it off.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import platform
import warnings
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

from irsbot_kinematics.cache import cache_folder
from irsbot_kinematics.compiled import SWITCH

SHAPES = ((2, 2, 2), (3, 2, 3), (3, 3, 3), (4, 3, 4))
"""Number of rods, dimensions, entries of a screw."""

SOURCES = (
    "statics.py",
    *(f"bounds/{name}.py" for name in ("box_code", "boxes", "cubics", "quadratics", "type2_over_box")),
    *(f"machine_code/{name}.py" for name in ("__main__", "box_source", "branching", "source", "symbols")),
)
"""Modules whose change makes the machine code outdated."""

FOUND, NOTHING, UNKNOWN = 0, 1, 2
"""What the code returns: bounds, the knowledge that there are none, or nothing at all."""

BoxCode = Callable[[Sequence[float]], "list[float] | None"]
"""From `boxes.numbers_of`: the numbers of the result, None if there is none, or nothing where Python has to answer."""


@cache
def code_for(rods: int, dims: int, rows: int) -> BoxCode | None:
    """The machine code for one shape; None if there is none of the present equations."""
    if os.environ.get(SWITCH):
        return None
    try:
        file = library_for(rods, dims, rows)
    except OSError:  # without sources nobody knows whether it is theirs
        return None
    if not file.is_file():
        return None
    try:
        library = ctypes.PyDLL(str(file))
        reproduced, code = library.is_reproduced(), _called(library)
    except (OSError, AttributeError, ValueError) as error:
        warnings.warn(f"{file} cannot be used ({error}), plain Python runs: delete it", stacklevel=2)
        return None
    if not reproduced:
        warnings.warn(f"{file} has other results on this machine, plain Python runs: delete it", stacklevel=2)
        return None
    return code


def _called(library: ctypes.PyDLL) -> BoxCode:
    reached = library.reached
    given, width = [ctypes.c_int.in_dll(library, name).value for name in ("given", "width")]
    inputs, results = ctypes.c_double * given, ctypes.c_double * width

    def code(values: Sequence[float]) -> list[float] | None:
        if len(values) != given:  # fewer would be taken as zeros
            return []
        out = results()
        status = reached(inputs(*values), out)
        if status != FOUND:
            return None if status == NOTHING else []
        found: list[float] = out[:]
        return found

    return code


@cache
def _digest() -> str:
    """Of the sources, and of the machine."""
    found = hashlib.sha256(platform.machine().encode())
    for name in SOURCES:
        data = (Path(__file__).parent.parent / name).read_bytes()
        found.update(f"{name} {len(data)} ".encode() + data)
    return found.hexdigest()[:24]


def library_for(rods: int, dims: int, rows: int) -> Path:
    """Where the machine code for one shape is, if there is any."""
    return cache_folder("machine_code") / f"boxes-{rods}-{dims}-{rows}-{_digest()}.so"
