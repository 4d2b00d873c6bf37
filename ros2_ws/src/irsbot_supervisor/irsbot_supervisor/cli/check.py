"""`check-trajectory`: checks that a planned motion keeps the configured margins, also between its points."""

from __future__ import annotations

from math import inf
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import typer
from rich.table import Table

from irsbot_kinematics.mechanism import Coordinate
from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_supervisor.bag.bag_files import is_bag
from irsbot_supervisor.cli.common import Failed, err, existing, out, print_json
from irsbot_supervisor.configuration.loading import read_settings, read_values
from irsbot_supervisor.core.margins import MARGIN_CAUSES, MARGIN_TEXTS
from irsbot_supervisor.trajectory.survey import Run, Survey, survey
from irsbot_supervisor.trajectory.task_space import survey_poses


class _Checked(NamedTuple):
    """A survey for the table; rows are counted from 1 below the header."""

    times: Array
    task: tuple[Coordinate, ...]
    found: Survey

    def row(self, time_s: float) -> int:
        """The row at, or before, a time."""
        return max(int(np.searchsorted(self.times, time_s, side="right")), 1)

    def as_values(self, run: Run) -> dict[str, Any]:
        names = [coordinate.name for coordinate in self.task]
        return {
            **run.first._asdict(),
            "pose": dict(zip(names, run.first.pose, strict=False)),
            "row": self.row(run.first.time_s),
            "until_s": run.until_s,
            "smallest": run.worst.value,
            "smallest_time_s": run.worst.time_s,
            "smallest_row": self.row(run.worst.time_s),
        }

    def as_text(self, run: Run) -> str:
        pose = ", ".join(
            f"{coordinate.name} {round(value, 9) + 0.0:.4g} {coordinate.unit}"
            for coordinate, value in zip(self.task, run.first.pose, strict=False)
        )
        return f"row {self.row(run.first.time_s)}: {run.first.text}" + (f" (pose {pose})" if pose else "")


def check_trajectory(
    robot: Annotated[str, typer.Argument(help="preset name or YAML file")],
    file: Annotated[Path, typer.Argument(help="CSV: time_s; joints (and NAME_velocity) or task coordinates")],
    settings: Annotated[Path | None, typer.Option(help="YAML file with other limits than the shipped ones")] = None,
    assembly: Annotated[int, typer.Option(help="assembly mode at the start; 0: the configured one")] = 0,
    every: Annotated[bool, typer.Option("--all", help="list every violation, not the first alone")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON")] = False,
) -> None:
    """Certify a motion against stop limits and velocity_limit, or name the violations. Exit code 1 for a violation.

    The motion has joint positions, or poses of the platform with straight lines between them. Margins are certified in
    continuous time. Rows are counted from 1 below the header.

    Example: irsbot check-trajectory irsbot2 motion.csv.
    """
    from irsbot_supervisor.bag.columns import column_names, rate_names, read_motion  # polars loads slowly

    changes = read_values(existing(settings, "the settings file")) if settings is not None else {}
    limits, machine = read_settings(robot, changes, settings or "")
    task = [coordinate.name for coordinate in machine.mechanism.task]
    columns = [] if is_bag(existing(file, "the motion")) else column_names(file)
    of_joints = set(limits.joint_names) <= set(columns) or not set(task) <= set(columns)
    names = list(limits.joint_names) if of_joints else task
    used = {"time_s", *names, *(rate_names(names) if of_joints else ())}
    if unused := [name for name in columns if name not in used]:
        whose = "joints" if of_joints else "platform"
        err.print(f"{file}: the motion is that of the {whose}; the columns {', '.join(unused)} are not used")
    times, places, velocities = read_motion(file, names)
    if of_joints:
        found = survey(machine, limits, times.tolist(), places.tolist(), velocities.tolist(), assembly)
    else:
        found = survey_poses(machine, limits, times.tolist(), places.tolist(), assembly)
    checked = _Checked(times, machine.mechanism.task, found)
    too_fast = [
        {"joint": name, "speed": speed, "unit": f"{joint.unit}/s", "limit": most, "row": checked.row(time_s)}
        for name, joint, (speed, time_s), most in zip(
            limits.joint_names, machine.mechanism.joints, found.speeds, limits.velocity_limit, strict=True
        )
        if not speed <= most
    ]
    faults = [checked.as_text(run) for run in found.runs[: None if every else 1]]
    for one in too_fast:
        speed = f"joint '{one['joint']}' reaches {one['speed']:.4g} {one['unit']}"
        faults.append(f"row {one['row']}: {speed}, velocity_limit is {one['limit']:g}")
    if as_json:
        stated = {"safe": not faults, "too_fast": too_fast, "margins": _margins(checked)}
        stated["violation"] = checked.as_values(found.runs[0]) if found.runs else None
        print_json({**stated, **({"violations": [checked.as_values(run) for run in found.runs]} if every else {})})
    else:
        _print_margins(checked)
        for run in found.runs if every else ():
            lowest = f"smallest {run.worst.value:.4f} at {run.worst.time_s:.4f} s"
            out.print(f"{run.first.time_s:.4f} s to {run.until_s:.4f} s, {lowest}: {checked.as_text(run)}")
    if faults:
        raise Failed(faults[0] if every and found.runs else "; ".join(faults))
    if not as_json:
        between = "cubics" if of_joints and len(velocities) else "straight lines"
        out.print(f"certified: {len(times)} points, {float(times[-1] - times[0]):.3f} s, {between} between them")


def _margins(checked: _Checked) -> list[dict[str, Any]]:
    found = checked.found
    return [
        {
            "margin": MARGIN_TEXTS[kind],
            "before_violation": before if before < inf else None,
            "whole": whole,
            "time_s": time_s,
            "row": checked.row(time_s),
        }
        for kind, (before, _at), (whole, time_s) in zip(MARGIN_CAUSES, found.before, found.whole, strict=True)
        if whole < inf
    ]


def _print_margins(checked: _Checked) -> None:
    """Certified lower bounds of the whole motion, and of its part before the first violation if it has one."""
    both = not checked.found.safe
    table = Table("certified lower bound", *(["before violation"] if both else []), "whole", "row", "time [s]")
    for row in _margins(checked):
        before = "-" if row["before_violation"] is None else f"{row['before_violation']:.6f}"
        place = (f"{row['whole']:.6f}", str(row["row"]), f"{row['time_s']:.4f}")
        table.add_row(row["margin"], *([before] if both else []), *place)
    out.print(table)
