"""`urdf`: the description of a robot for RViz, robot_state_publisher and MoveIt."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from irsbot_kinematics.description import urdf
from irsbot_supervisor.cli.common import out, robot_named
from irsbot_supervisor.configuration.loading import shipped_values
from irsbot_supervisor.core.settings import UNLIMITED, completed


def write(
    robot: Annotated[str, typer.Argument(help="preset name or YAML file")],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="write it here; printed if left out")] = None,
) -> None:
    """Write a robot as URDF: links, joints with their limits, passive joints, and cylinders for display.

    URDF has no loops: they are cut. The supervisor publishes the positions of the passive joints.

    Example: irsbot urdf irsbot2 -o irsbot2.urdf.
    """
    machine = robot_named(robot)
    text = urdf.urdf(machine)
    if shipped := shipped_values(machine):
        settings = completed({**shipped, "robot": robot}, machine)
        lower, upper = (
            [limit if abs(limit) < UNLIMITED else own for limit, own in zip(limits, ranges, strict=True)]
            for limits, ranges in (
                (settings.position_lower, [joint.lower for joint in machine.mechanism.joints]),
                (settings.position_upper, [joint.upper for joint in machine.mechanism.joints]),
            )
        )
        text = urdf.urdf(machine, settings.joint_names, lower, upper, settings.velocity_limit)
    if output is None:
        out.print(text, end="")
        return
    output.write_text(text, encoding="utf-8")
    out.print(f"written to {output}")
