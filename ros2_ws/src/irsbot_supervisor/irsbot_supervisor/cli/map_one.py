"""One map: margins or leg forces of one robot, as a picture or as numbers."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

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
from irsbot_supervisor.cli.common import numbers, robot_named, sign_text
from irsbot_supervisor.cli.map_forces import draw_forces

FORCE = "force"
"""Quantity that can be mapped in addition to the margins."""

TURN = (-pi, pi)
"""rad: one turn of a crank, the default range of a joint map."""

PICTURES = (".png", ".svg", ".pdf")


@dataclass(frozen=True)
class Wanted:
    """What is mapped, as on the command line."""

    what: str
    mode: str | None
    box: tuple[float, float, float, float] | None
    joint_space: bool
    at: tuple[float, ...]
    load: float
    moment: float
    admissible: float | None
    centre: str | None
    nodes: int


class Drawn(NamedTuple):
    """What a map says in words and figures."""

    facts: dict[str, Any]
    lines: list[str]


def draw_robot(robot: str, wanted: Wanted, target: Path) -> Drawn:
    """Draw or write the map of one robot. Raises BadInput and what else a robot may be refused for."""
    what, box, others = wanted.what, wanted.box, wanted.at
    machine = robot_named(robot)
    mechanism = machine.mechanism
    working_mode = arguments.working_mode(mechanism, wanted.mode)
    if what == FORCE:
        if wanted.joint_space or wanted.admissible is None:
            raise BadInput("--what force wants --admissible N, and maps poses, not --joints")
        ranges = Box(box[:2], box[2:], others) if box is not None else reachable_box(mechanism, others)
        load = Load(wanted.load, wanted.moment, wanted.admissible)
        parts = wanted.centre.split(",") if wanted.centre is not None else []
        pose = numbers(parts, "--centre", len(mechanism.task)) if parts else None
        return Drawn(*draw_forces(machine, working_mode, ranges, (wanted.nodes, wanted.nodes), load, pose, target))
    if wanted.joint_space:
        turns = Box(*((box[:2], box[2:]) if box else (TURN, TURN)), others)
        return _draw_joints(machine, what, turns, wanted.nodes, target)
    ranges = Box(box[:2], box[2:], others) if box is not None else reachable_box(mechanism, others)
    found = workspace_map(mechanism, working_mode, ranges, (wanted.nodes, wanted.nodes))
    _require(found, what, f"{machine.name} in working mode {sign_text(working_mode)}")
    rectangle = None
    crossings: Array = np.empty((0, 2))
    known = mechanism.loci(working_mode)
    if known is None:
        crossings = type2_crossings(found)
    curves = known or ()
    if mechanism.symmetric_extent() and working_mode[0] == -working_mode[1]:
        rectangle = largest_rectangle(mechanism, Limits(0.0, 0.0, 0.0), working_mode)
    outside = rectangle is not None and not _inside(_corners(rectangle), ranges).all()
    places = mechanism.constraint_points(working_mode)
    points = np.array(places or ()).reshape(-1, 2)
    points = points[_inside(points, ranges)]
    if target.suffix == ".npz":
        _save(found, target)
    else:
        from irsbot_supervisor.plots.map import draw_map  # matplotlib takes a second to load

        title = f"{machine.name}, working mode {sign_text(working_mode)}: {what}{_at(mechanism.task[2:], others)}"
        draw_map(found, what, title, curves, points, None if outside else rectangle, target, crossings)
    facts: dict[str, Any] = {"reached_area": found.area, "constraint_points": points}
    counted = f"; constraint singularities: {len(points)}" if places is not None else ""
    lines = [f"reached in mode {sign_text(working_mode)}: {found.area:.4f} m2{counted}"]
    if rectangle is not None:
        facts |= {"free_rectangle": rectangle._asdict(), "free_area": rectangle.area, "free_in_box": not outside}
    elif known is None:
        facts["type2_crossings"] = len(crossings)
    if known is None:
        stated = f"read off the grid at {len(crossings)} places" if len(crossings) else "none between nodes of the grid"
        lines.append(f"Type 2 lines: {stated}")
    if outside:
        lines.append("the largest free rectangle below the base is not within the box and is not drawn")
    elif rectangle is not None:
        size = f"|x| <= {rectangle.half_width:.4f}, {rectangle.z_low:.4f} <= z <= {rectangle.z_high:.4f}"
        lines.append(f"largest free rectangle below the base: {size}, {rectangle.area:.4f} m2")
    return Drawn(facts, lines)


def _corners(rectangle: Rectangle) -> Array:
    """The lowest and the highest one."""
    return np.array([(-rectangle.half_width, rectangle.z_low), (rectangle.half_width, rectangle.z_high)])


def _inside(points: Array, box: Box) -> Array:
    """(N,) True for points within the map."""
    low, high = np.transpose((box.first, box.second))
    return np.asarray(((low <= points) & (points <= high)).all(axis=1))


def _require(found: Map, what: str, which: str) -> None:
    """Raises BadInput where the map would be empty."""
    reached = np.isfinite(found.type1)
    if not reached.any():
        raise BadInput(f"{which} reaches none of the {reached.size} nodes: give another --box, or more --nodes")
    if not np.isfinite(getattr(found, what)[reached]).any():
        raise BadInput(f"{which} has no {what} margin: nothing to map")


def _at(further: tuple[Coordinate, ...], values: tuple[float, ...]) -> str:
    """Values of the coordinates that the map does not show."""
    stated = [f"{one.name} = {value:g} {one.unit}" for one, value in zip(further, values, strict=True)]
    return f" at {', '.join(stated)}" if stated else ""


def _draw_joints(machine: Robot, what: str, ranges: Box, nodes: int, target: Path) -> Drawn:
    assembly = machine.mechanism.usual_assembly_mode
    found = joint_map(machine.mechanism, assembly, ranges, (nodes, nodes))
    _require(found, what, f"{machine.name} in assembly mode {assembly:+d}")
    if target.suffix == ".npz":
        _save(found, target)
    else:
        from irsbot_supervisor.plots.map import draw_map  # matplotlib takes a second to load

        nowhere = np.empty((0, 2))
        further = _at(machine.mechanism.joints[2:], ranges.others)
        title = f"{machine.name}, assembly mode {assembly:+d}: {what}{further}"
        draw_map(found, what, title, (), nowhere, None, target, nowhere)
    share = float(np.isfinite(found.type1).mean())
    facts = {"assembly_mode": assembly, "assembled_share": share}
    return Drawn(facts, [f"assembled in mode {assembly:+d}: {share:.1%} of the map"])


def _save(found: Map, target: Path) -> None:
    columns = ("first", "second", *QUANTITIES, "assembly")
    np.savez_compressed(target, **{name: getattr(found, name) for name in columns})
