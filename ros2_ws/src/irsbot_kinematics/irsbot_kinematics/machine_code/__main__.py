"""Makes the machine code of the bounds (`bounds.box_code`), once for every shape of a platform."""

from __future__ import annotations

import argparse
import os
import sys
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

from irsbot_kinematics.bounds.box_code import SHAPES, library_for
from irsbot_kinematics.errors import NotCompiled
from irsbot_kinematics.machine_code.box_functions import Shape
from irsbot_kinematics.machine_code.box_source import c_source
from irsbot_kinematics.machine_code.compiler import compile_library, compiler

OPTIONS = ("-O1", "-std=gnu11", "-shared", "-fPIC", "-ffp-contract=off")
"""No product is fused with a sum: the bits are those of Python."""


def make(shape: tuple[int, int, int]) -> Path:
    """Make the machine code for one shape, unless it is there. Raises NotCompiled."""
    file = library_for(*shape)
    if not file.is_file():
        command = [*compiler(), *OPTIONS]  # first: without a compiler there is no need for the source
        compile_library(c_source(Shape(*shape)), command, ("-lm",), file)
    return file


def main() -> int:
    """Run the command; its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m irsbot_kinematics.machine_code",
        description="Make the machine code of the certified bounds, unless it is there: 10 to 20 s.",
        epilog="Example: python -m irsbot_kinematics.machine_code --check || echo 'plain Python runs'",
    )
    parser.add_argument("--check", action="store_true", help="make nothing: exit code 1 if some is missing")
    if parser.parse_args().check:
        return 0 if all(library_for(*shape).is_file() for shape in SHAPES) else 1
    try:
        with ProcessPoolExecutor(min(len(SHAPES), len(os.sched_getaffinity(0)))) as pool:
            print(f"[0/{len(SHAPES)}] begun", flush=True)
            making = [pool.submit(make, shape) for shape in reversed(SHAPES)]  # the largest first
            for number, made in enumerate(as_completed(making), 1):
                print(f"[{number}/{len(SHAPES)}] {made.result()}", flush=True)
    except NotCompiled as error:
        print(f"no machine code of the bounds, plain Python runs: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
