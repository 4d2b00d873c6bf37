"""`ik`, `dk`, `robots`: the library from the shell."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Any

import typer
from rich.table import Table

from irsbot_kinematics import NotAssembled, Robot, Unreachable, make_robot, robots
from irsbot_kinematics.arguments import working_mode
from irsbot_kinematics.mechanism import Coordinate
from irsbot_supervisor.cli.common import Failed, numbers, out, print_json, robot_named, sign_text

RobotName = Annotated[str, typer.Argument(help="preset name (see `irsbot robots`) or YAML file")]
MOST_COLUMNS = 10_000
"""Wider than every table."""

AsJson = Annotated[bool, typer.Option("--json", help="print JSON")]


def list_robots(as_json: AsJson = False) -> None:
    """The shipped robots. Cuspidal: the assembly mode can change without a singularity; --json gives the reason.

    Example: irsbot robots
    """
    rows = []
    for name in robots():
        machine = make_robot(name)
        stated = machine.cuspidal
        rows.append(
            {
                "name": name,
                "description": machine.description,
                "cuspidal": stated.answer,
                "cuspidal_reason": stated.reason,
            }
        )
    if as_json:
        print_json(rows)
        return
    table = Table("robot", "cuspidal", "description")
    for row in rows:
        table.add_row(row["name"], row["cuspidal"], row["description"])
    out.print(table)


def inverse(
    robot: RobotName,
    pose: Annotated[list[str], typer.Argument(help="task coordinates, m and rad")],
    mode: Annotated[str | None, typer.Option(help="working mode, one sign per leg; all modes if left out")] = None,
    as_json: AsJson = False,
) -> None:
    """Joint positions of a pose: in one working mode, or in all.

    Example: irsbot ik irsbot2 0.3 -0.75 --mode +-
    """
    machine = robot_named(robot)
    x = numbers(pose, "the pose", len(machine.mechanism.task))
    mechanism = machine.mechanism
    modes = mechanism.working_modes if mode is None else (working_mode(mechanism, mode),)
    solutions, refusals = [], []
    for one in modes:
        try:
            q = machine.inverse(x, one)
        except Unreachable as error:
            refusals.append(error)
        else:
            solutions.append({"working_mode": list(one), "joints": q.tolist()})
    if as_json:
        reach = max((error.reach_m for error in refusals), default=None)
        print_json({"robot": machine.name, "pose": x, "solutions": solutions, "reach_m": reach})
    if not solutions:
        raise Failed(str(max(refusals, key=lambda error: error.reach_m)))
    if not as_json:
        _print_solutions(machine.mechanism.joints, solutions)


def direct(
    robot: RobotName,
    joints: Annotated[list[str], typer.Argument(help="joint positions, rad or m")],
    assembly: Annotated[int | None, typer.Option(help="assembly mode; all modes if left out")] = None,
    as_json: AsJson = False,
) -> None:
    """Poses of joint positions: in one assembly mode, or in all, with their margins.

    Example: irsbot dk irsbot2 2.544 -0.19 --assembly -1
    """
    machine = robot_named(robot)
    q = numbers(joints, "the joints", len(machine.mechanism.joints))
    modes = [assembly] if assembly is not None else list(machine.mechanism.assembly_modes)
    found, refusals = [], []
    for assembly_mode in modes:
        try:
            found.append(asdict(machine.evaluate(q, assembly_mode)))
        except NotAssembled as error:
            refusals.append(error)
    if as_json:
        print_json({"robot": machine.name, "joints": q, "solutions": found})
    if not found:
        raise Failed(str(refusals[0]))
    if not as_json:
        _print_evaluations(machine, found)


def _print_solutions(joints: tuple[Coordinate, ...], solutions: list[dict[str, Any]]) -> None:
    table = Table("working mode", *[f"{joint.name} [{joint.unit}]" for joint in joints])
    table.columns[0].justify = "center"
    for solution in solutions:
        table.add_row(sign_text(solution["working_mode"]), *[f"{value:.9f}" for value in solution["joints"]])
    out.print(table)


def _print_evaluations(machine: Robot, found: list[dict[str, Any]]) -> None:
    """Print as many assembly modes side by side as fit into the terminal."""
    beside = len(found)
    unbounded = out.options.update(width=MOST_COLUMNS)
    while beside > 1 and any(
        out.measure(table, options=unbounded).maximum > out.width for table in _tables(machine, found, beside)
    ):
        beside -= 1
    for table in _tables(machine, found, beside):
        out.print(table)


def _tables(machine: Robot, found: list[dict[str, Any]], beside: int) -> list[Table]:
    return [_evaluations(machine, found[first : first + beside]) for first in range(0, len(found), beside)]


def _evaluations(machine: Robot, found: list[dict[str, Any]]) -> Table:
    table = Table("", *[f"assembly mode {entry['assembly_mode']:+d}" for entry in found])
    for i, coordinate in enumerate(machine.mechanism.task):
        table.add_row(f"{coordinate.name} [{coordinate.unit}]", *[f"{entry['pose'][i]:.9f}" for entry in found])
    table.add_row("working mode", *[sign_text(entry["working_mode"]) for entry in found])
    for name in ("type1_margin", "type2_margin", "constraint_margin", "limb_margin", "clearance", "pressure_angle"):
        table.add_row(name.replace("_", " "), *[_short(entry[name]) for entry in found])
    return table


def _short(value: Any) -> str:
    return ", ".join(f"{v:.5g}" for v in value) if isinstance(value, tuple) else f"{value:.5g}"
