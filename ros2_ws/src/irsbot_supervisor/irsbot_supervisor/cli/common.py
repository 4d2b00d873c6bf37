"""Parts that all commands share: output, refusals, reading of numbers and robots."""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

import typer
from rich.console import Console
from rich.table import Column, Table

from irsbot_kinematics import BadInput, KinematicsError, Robot
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.configuration.loading import robot_of
from irsbot_supervisor.core.settings import InvalidSettings
from irsbot_supervisor.report.json_values import plain
from irsbot_supervisor.sim.errors import SimulationError
from irsbot_supervisor.trajectory.joint_path import BadTrajectory


class _Output(Console):
    """Console that leaves a closed pipe to `main`."""

    def on_broken_pipe(self) -> None:
        raise BrokenPipeError


out = _Output(highlight=False, soft_wrap=True, markup=False)
"""For results."""

err = Console(stderr=True, highlight=False, soft_wrap=True, markup=False)
"""For progress and refusals."""

NUMBERS = {"ignore_unknown_options": True}
"""Context settings of commands whose arguments may be negative numbers."""


BAD_INPUT = (InvalidSettings, BadTrajectory, BagError, SimulationError, KinematicsError)
"""Errors that a user can cause; each has one sentence that says what is wrong and what would be right."""


class Failed(Exception):
    """A check failed: exit code 1, the message on stderr."""


def refuse(text: str) -> NoReturn:
    """End with exit code 2 and one line that says what is wrong and what would be right."""
    err.print(f"irsbot: {text}")
    raise typer.Exit(2)


def numbers(values: Sequence[str], what: str, count: int) -> tuple[float, ...]:
    """Floats from the command line. Raises BadInput."""
    if len(values) != count:
        raise BadInput(f"{what} must be {count} numbers, got {len(values)}")
    try:
        parsed = tuple(float(value) for value in values)
    except ValueError:
        wrong = next(value for value in values if not _is_number(value))
        raise BadInput(f"{what} must be numbers, got '{wrong}'") from None
    if not all(map(math.isfinite, parsed)):
        raise BadInput(f"{what} must be finite, got {' '.join(values)}")
    return parsed


def measure(name: str, text: str) -> float:
    """A length in m, or for beta an angle in rad or, with the suffix, deg. Raises BadInput."""
    if name == "beta" and text.endswith("deg"):
        return math.radians(numbers([text[:-3]], name, 1)[0])
    return numbers([text], name, 1)[0]


def sign_text(mode: Sequence[int]) -> str:
    """A working mode as text such as "+-"."""
    return "".join("+" if sign > 0 else "-" if sign < 0 else "0" for sign in mode)


def robot_named(name: str) -> Robot:
    """A preset or YAML file. Raises UnknownRobot, BadInput, InvalidGeometry."""
    return robot_of(name)


def without_shared_folder(paths: Sequence[str]) -> tuple[str, list[str]]:
    """The folder that all paths share, and each path below it; empty, and the paths as given, if they share none."""
    if len({Path(path).is_absolute() for path in paths}) > 1:
        return "", list(paths)
    shared = os.path.commonpath([Path(path).parent for path in paths])
    return shared, [os.path.relpath(path, shared or ".") for path in paths]


def folding_table(*headings: str) -> Table:
    """A table whose cells fold where there is little room: names and numbers are not cut."""
    return Table(*(Column(heading, overflow="fold") for heading in headings))


def print_json(value: Any) -> None:
    """JSON on stdout; NaN and infinite numbers become null, because JSON does not have them."""
    out.print(json.dumps(plain(value), indent=2, allow_nan=False))


def namespace_from(text: str) -> str:
    """A ROS namespace without leading and trailing slash. Raises BadInput."""
    place = text.strip("/")
    if place and not re.fullmatch(r"[A-Za-z_]\w*(/[A-Za-z_]\w*)*", place, re.ASCII):
        raise BadInput(f"the namespace must be names of letters, digits and _ with / between them, got '{text}'")
    return place


def existing(path: Path, what: str) -> Path:
    """A path that must exist. Raises BadInput."""
    if not path.exists():
        raise BadInput(f"{what} '{path}' does not exist")
    return path


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
