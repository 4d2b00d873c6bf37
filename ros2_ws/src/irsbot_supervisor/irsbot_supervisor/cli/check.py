"""`check-trajectory`: is a planned motion free of singularities to the configured margins, between its points too?"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.table import Table

from irsbot_kinematics.arithmetic import Array
from irsbot_kinematics.mechanism import Coordinate
from irsbot_supervisor.cli.common import Failed, err, existing, out, print_json
from irsbot_supervisor.core.cartesian import certify_poses
from irsbot_supervisor.core.certify import certify
from irsbot_supervisor.core.motion import peaks_of
from irsbot_supervisor.core.policy import KINDS, WORDS
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.settings_file import read_settings, read_values


def check_trajectory(
    robot: Annotated[str, typer.Argument(help="preset name or YAML file")],
    file: Annotated[Path, typer.Argument(help="CSV: time_s; joints (and NAME_velocity) or task coordinates")],
    settings: Annotated[Path | None, typer.Option(help="YAML file with other limits than the shipped ones")] = None,
    assembly: Annotated[int, typer.Option(help="assembly mode at the start; 0: the configured one")] = 0,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON")] = False,
) -> None:
    """Certify a motion against the stop limits in continuous time, or name the first violation. Exit code 1 then.

    A motion is given by joint positions, or by poses of the platform, straight in between.

    Example: irsbot check-trajectory irsbot2 motion.csv
    """
    from irsbot_supervisor.columns import has_columns, read_motion  # polars takes its time to load

    changes = read_values(existing(settings, "the settings file")) if settings is not None else {}
    limits, machine = read_settings(robot, changes)
    task = [coordinate.name for coordinate in machine.mechanism.task]
    of_platform = has_columns(existing(file, "the motion"), task)
    of_joints = not of_platform or has_columns(file, list(limits.joint_names))
    if of_platform and of_joints:
        err.print(f"{file}: the motion is that of the joints; the columns {', '.join(task)} are not used")
    if not of_joints:
        times, poses, _rates = read_motion(file, task)
        found = certify_poses(machine, limits, times.tolist(), poses.tolist(), assembly)
    else:
        times, positions, velocities = read_motion(file, list(limits.joint_names))
        found = certify(machine, limits, times.tolist(), positions.tolist(), velocities.tolist(), assembly)
        _say_what_is_too_fast(limits, machine.mechanism.joints, times, positions, velocities)
    rows = [
        {"margin": WORDS[kind], "smallest": value, "time_s": time_s}
        for kind, (value, time_s) in zip(KINDS, found.minima, strict=True)
        if value < float("inf")
    ]
    if as_json:
        print_json({"safe": found.safe, "violation": found.violation and found.violation._asdict(), "margins": rows})
    elif rows:
        table = Table("margin", "certified lower bound", "time [s]")
        for row in rows:
            table.add_row(str(row["margin"]), f"{row['smallest']:.6f}", f"{row['time_s']:.4f}")
        out.print(table)
    if found.violation is not None:
        raise Failed(found.violation.text)
    if not as_json:
        out.print(f"certified: {len(times)} points, {float(times[-1] - times[0]):.3f} s")


def _say_what_is_too_fast(
    limits: Settings, joints: tuple[Coordinate, ...], times: Array, positions: Array, velocities: Array
) -> None:
    """No matter of margins, but driven like this the motion leads to warnings."""
    if len(velocities):
        fastest = peaks_of(times, positions, velocities)[0]
    else:
        fastest = tuple(np.abs(np.diff(positions, axis=0) / np.diff(times)[:, None]).max(axis=0, initial=0.0).tolist())
    for name, joint, peak, most in zip(limits.joint_names, joints, fastest, limits.velocity_limit, strict=True):
        if peak > most:
            err.print(f"note: joint '{name}' reaches {peak:.4g} {joint.unit}/s, velocity_limit is {most:g}")
