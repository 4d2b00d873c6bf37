"""`map --what force`: leg forces under a load of any direction, and the poses at which they are admissible."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from irsbot_kinematics import BadInput, Robot
from irsbot_kinematics.analysis.force_workspace import Load, force_workspace, reaction_map
from irsbot_kinematics.analysis.workspace_maps import Box, area_where
from irsbot_kinematics.mechanism import Signs
from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_supervisor.cli.common import sign_text


def draw_forces(
    robot: Robot,
    mode: Signs,
    box: Box,
    nodes: tuple[int, int],
    load: Load,
    centre: Sequence[float] | None,
    target: Path,
) -> tuple[dict[str, Any], list[str]]:
    """Write the largest leg force over a grid of poses; with a centre also the force workspace around it.

    Returns figures, and the same in words. Raises BadInput.
    """
    mechanism = robot.mechanism
    if len(box.others) != len(mechanism.task) - 2:
        rest = ", ".join(coordinate.name for coordinate in mechanism.task[2:]) or "none"
        raise BadInput(f"a map needs a value for each further coordinate ({rest}), got {len(box.others)}: --at VALUE")
    first, second = np.linspace(*box.first, nodes[0]), np.linspace(*box.second, nodes[1])
    middle = (0.5 * sum(box.first), 0.5 * sum(box.second), *box.others)
    forces = reaction_map(mechanism, middle, mode, load, first_m=first, second_m=second)
    largest = forces.max(axis=2)
    carried = largest <= load.admissible_n
    area = area_where(carried, first, second)
    around = force_workspace(mechanism, centre, mode, load) if centre is not None else None
    if target.suffix == ".npz":
        none: Array = np.empty(0)
        angle, radius = (around.angle_rad, around.radius_m) if around is not None else (none, none)
        np.savez_compressed(target, first=first, second=second, reaction_max=forces, angle=angle, radius=radius)
    else:
        from irsbot_supervisor.plots.map import draw_force_map  # matplotlib takes a second to load

        names = tuple(coordinate.name for coordinate in mechanism.task[:2])
        stated = f"{load.force_n:g} N" + (f", {load.moment_nm:g} N m" if load.moment_nm else "")
        title = f"{robot.name}, working mode {sign_text(mode)}: largest leg force under {stated}"
        draw_force_map((names[0], names[1]), first, second, largest, load.admissible_n, centre, around, title, target)
    facts = {
        "admissible_area_m2": area,
        "smallest_n": float(np.nanmin(largest)) if carried.any() else None,
        "force_workspace_m2": around.area_m2 if around is not None else None,
    }
    lines = [f"largest leg force at most {load.admissible_n:g} N: {area:.4f} m2 of the box"]
    if around is not None:
        shown = ", ".join(f"{value:g}" for value in centre or ())
        radius_m = f"radius {around.radius_m.min():.4f} m or more"
        lines.append(f"force workspace around ({shown}): {around.area_m2:.4f} m2, {radius_m}")
    return facts, lines
