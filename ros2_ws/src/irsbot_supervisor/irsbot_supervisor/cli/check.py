"""`check-trajectory`: is a planned motion free of singularities to the configured margins, between its points too?"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from irsbot_supervisor.cli.common import Failed, existing, out, print_json
from irsbot_supervisor.core.cartesian import certify_poses
from irsbot_supervisor.core.certify import certify
from irsbot_supervisor.core.policy import KINDS, WORDS
from irsbot_supervisor.settings_file import read_settings, read_values


def check_trajectory(
    robot: Annotated[str, typer.Argument(help="preset name or YAML file")],
    file: Annotated[Path, typer.Argument(help="CSV: time_s; joints (and NAME_velocity) or task coordinates")],
    settings: Annotated[Path | None, typer.Option(help="YAML file with other limits than the shipped ones")] = None,
    assembly: Annotated[int, typer.Option(help="assembly mode at the start; 0: the usual one")] = 0,
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
    if has_columns(existing(file, "the motion"), task) and not has_columns(file, list(limits.joint_names)):
        times, poses, _rates = read_motion(file, task)
        found = certify_poses(machine, limits, times.tolist(), poses.tolist(), assembly)
    else:
        times, positions, velocities = read_motion(file, list(limits.joint_names))
        found = certify(machine, limits, times.tolist(), positions.tolist(), velocities.tolist(), assembly)
    rows = [
        {"margin": WORDS[kind], "smallest": value, "time_s": time_s}
        for kind, (value, time_s) in zip(KINDS, found.minima, strict=True)
        if value < float("inf")
    ]
    if as_json:
        print_json({"safe": found.safe, "violation": found.violation and found.violation._asdict(), "margins": rows})
    else:
        table = Table("margin", "smallest certified value", "time [s]")
        for row in rows:
            table.add_row(str(row["margin"]), f"{row['smallest']:.6f}", f"{row['time_s']:.4f}")
        out.print(table)
    if found.violation is not None:
        raise Failed(found.violation.text)
    if not as_json:
        out.print(f"certified: {len(times)} points, {float(times[-1] - times[0]):.3f} s")
