"""`map`: margins over the workspace, as numbers and as a picture."""

from __future__ import annotations

from math import pi
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from irsbot_kinematics import BadInput, Robot, arguments
from irsbot_kinematics.analysis.force_workspace import Load
from irsbot_kinematics.analysis.rectangle import Limits, Rectangle, largest_rectangle
from irsbot_kinematics.analysis.workspace_maps import (
    QUANTITIES,
    Box,
    Map,
    joint_map,
    reachable_box,
    type2_crossings,
    workspace_map,
)
from irsbot_kinematics.mechanism import Coordinate
from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_supervisor.cli.common import numbers, out, print_json, robot_named, sign_text
from irsbot_supervisor.cli.map_forces import draw_forces

FORCE = "force"
"""Quantity that can be mapped in addition to the margins."""

TURN = (-pi, pi)
"""rad: one turn of a crank, the default range of a joint map."""

PICTURES = (".png", ".svg", ".pdf")


def draw(
    robot: Annotated[str, typer.Argument(help="preset name or YAML file")],
    what: Annotated[str, typer.Option(help=f"one of {', '.join((*QUANTITIES, FORCE))}")] = "type2",
    target: Annotated[
        Path, typer.Option("-o", "--output", help=".png, .svg or .pdf for a picture, .npz for the numbers")
    ] = Path("map.png"),
    mode: Annotated[str | None, typer.Option(help="working mode; the usual one if left out")] = None,
    box: Annotated[
        tuple[float, float, float, float] | None,
        typer.Option(metavar="LOW HIGH LOW HIGH", help="ranges of the first two coordinates, m"),
    ] = None,
    joint_space: Annotated[
        bool, typer.Option("--joints", help="over the first two joints, usual assembly mode")
    ] = False,
    at: Annotated[list[float] | None, typer.Option(help="value of a further coordinate; once for each")] = None,
    load: Annotated[float, typer.Option(help="of --what force: N, of any direction")] = 10.0,
    moment: Annotated[float, typer.Option(help="likewise: N m, of either sign")] = 0.0,
    admissible: Annotated[float | None, typer.Option(help="likewise: N that a leg may carry")] = None,
    centre: Annotated[
        str | None, typer.Option(help="likewise: pose, as 0,-0.8, around which the force workspace is found")
    ] = None,
    nodes: Annotated[int, typer.Option(help="nodes of the grid along each axis", min=2, max=4000)] = 400,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON")] = False,
) -> None:
    """Map a margin over the workspace of one working mode, with loci, constraint points and the free rectangle.

    With --what force: the largest leg force under a load of any direction, and where it stays admissible.

    Example: irsbot map irsbot2_beta45 --what type2 -o map.png
    """
    if what not in (*QUANTITIES, FORCE):
        raise BadInput(f"--what is '{what}', must be one of {', '.join((*QUANTITIES, FORCE))}")
    if what != FORCE and (admissible is not None or centre is not None):
        raise BadInput("--admissible and --centre belong to --what force")
    if target.suffix not in (*PICTURES, ".npz"):
        raise BadInput(f"cannot write '{target}': the suffix must be {', '.join(PICTURES)} or .npz")
    machine = robot_named(robot)
    mechanism = machine.mechanism
    working_mode = arguments.working_mode(mechanism, mode)
    others = tuple(at or ())
    if what == FORCE:
        if joint_space or admissible is None:
            raise BadInput("--what force wants --admissible N, and maps poses, not --joints")
        ranges = Box(box[:2], box[2:], others) if box is not None else reachable_box(mechanism, others)
        wanted = Load(load, moment, admissible)
        parts = centre.split(",") if centre is not None else []
        pose = numbers(parts, "--centre", len(mechanism.task)) if parts else None
        draw_forces(machine, working_mode, ranges, (nodes, nodes), wanted, pose, target, as_json)
        return
    if joint_space:
        _draw_joints(machine, what, Box(*((box[:2], box[2:]) if box else (TURN, TURN)), others), nodes, target, as_json)
        return
    ranges = Box(box[:2], box[2:], others) if box is not None else reachable_box(mechanism, others)
    found = workspace_map(mechanism, working_mode, ranges, (nodes, nodes))
    rectangle = None
    crossings: Array = np.empty((0, 2))
    known = mechanism.loci(working_mode)
    if known is None:
        crossings = type2_crossings(found)
    curves = known or ()
    if mechanism.symmetric_extent() and working_mode[0] == -working_mode[1]:
        rectangle = largest_rectangle(mechanism, Limits(0.0, 0.0, 0.0), working_mode)
    outside = rectangle is not None and not _within(rectangle, ranges)
    places = mechanism.constraint_points(working_mode)
    points = np.array(places or ()).reshape(-1, 2)
    if target.suffix == ".npz":
        _save(found, target)
    else:
        from irsbot_supervisor.plots.map import draw_map  # matplotlib takes a second to load

        title = f"{machine.name}, working mode {sign_text(working_mode)}: {what}{_at(mechanism.task[2:], others)}"
        draw_map(found, what, title, curves, points, None if outside else rectangle, target, crossings)
    area = f"{found.area:.4f} m2"
    if as_json:
        rows: dict[str, Any] = {"reached_area": found.area, "constraint_points": points, "file": target}
        if rectangle is not None:
            rows |= {"free_rectangle": rectangle._asdict(), "free_area": rectangle.area, "free_in_box": not outside}
        elif known is None:
            rows |= {"type2_crossings": len(crossings)}
        print_json(rows)
        return
    counted = f"; constraint singularities: {len(points)}" if places is not None else ""
    out.print(f"reached in mode {sign_text(working_mode)}: {area}{counted}")
    if known is None:
        lines = f"read off the grid at {len(crossings)} places" if len(crossings) else "none between nodes of the grid"
        out.print(f"Type 2 lines: {lines}")
    if outside:
        out.print("the largest free rectangle below the base is not within the box and is not drawn")
    elif rectangle is not None:
        size = f"|x| <= {rectangle.half_width:.4f}, {rectangle.z_low:.4f} <= z <= {rectangle.z_high:.4f}"
        out.print(f"largest free rectangle below the base: {size}, {rectangle.area:.4f} m2")
    out.print(f"written to {target}")


def _within(rectangle: Rectangle, box: Box) -> bool:
    wide = box.first[0] <= -rectangle.half_width and rectangle.half_width <= box.first[1]
    return wide and box.second[0] <= rectangle.z_low and rectangle.z_high <= box.second[1]


def _at(further: tuple[Coordinate, ...], values: tuple[float, ...]) -> str:
    """Values of the coordinates that the map does not show."""
    stated = [f"{one.name} = {value:g} {one.unit}" for one, value in zip(further, values, strict=True)]
    return f" at {', '.join(stated)}" if stated else ""


def _draw_joints(machine: Robot, what: str, ranges: Box, nodes: int, target: Path, as_json: bool) -> None:
    assembly = machine.mechanism.usual_assembly_mode
    found = joint_map(machine.mechanism, assembly, ranges, (nodes, nodes))
    if target.suffix == ".npz":
        _save(found, target)
    else:
        from irsbot_supervisor.plots.map import draw_map  # matplotlib takes a second to load

        nowhere = np.empty((0, 2))
        further = _at(machine.mechanism.joints[2:], ranges.others)
        title = f"{machine.name}, assembly mode {assembly:+d}: {what}{further}"
        draw_map(found, what, title, (), nowhere, None, target, nowhere)
    share = float(np.isfinite(found.type1).mean())
    if as_json:
        print_json({"assembly_mode": assembly, "assembled_share": share, "file": target})
        return
    out.print(f"assembled in mode {assembly:+d}: {share:.1%} of the map")
    out.print(f"written to {target}")


def _save(found: Map, target: Path) -> None:
    columns = ("first", "second", *QUANTITIES, "assembly")
    np.savez_compressed(target, **{name: getattr(found, name) for name in columns})
