"""`map` of several robots: a folder with a file and its figures each, made by workers."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from irsbot_kinematics import BadInput, KinematicsError
from irsbot_kinematics.description import json_text
from irsbot_supervisor.cli.cluster import everywhere
from irsbot_supervisor.cli.common import out, print_json
from irsbot_supervisor.cli.map_one import Wanted, draw_robot
from irsbot_supervisor.cli.progress import progress_bar
from irsbot_supervisor.fleet.cluster import Cluster
from irsbot_supervisor.fleet.folder import ResultFolder, key_of, robot_files
from irsbot_supervisor.fleet.resuming import rows_of
from irsbot_supervisor.report.json_values import plain

Row = dict[str, Any]
"""Figures of a map: robot, file and lines; or robot and error."""


@dataclass(frozen=True)
class MapJob:
    """One map. name: the robot as the user gave it. robot: as every worker finds it. suffix: of the file."""

    name: str
    robot: str
    wanted: Wanted
    suffix: str

    @cached_property
    def file(self) -> str:
        """Name of the file, with a hash of everything that the map depends on. Raises OSError."""
        key = key_of(json.dumps([self.name, asdict(self.wanted), self.suffix]), robot_files(self.robot))
        return f"{Path(self.name).stem}-{key}{self.suffix}"


class Made(NamedTuple):
    """What one job gives. error: why there is no map."""

    row: Row
    data: bytes = b""
    error: str = ""


def draw_elsewhere(job: MapJob) -> Made:
    """One map, in a worker."""
    with TemporaryDirectory() as folder:
        target = Path(folder) / f"map{job.suffix}"
        try:
            drawn = draw_robot(job.robot, job.wanted, target)
        except (KinematicsError, OSError) as error:
            return Made({}, error=str(error))
        return Made(
            plain({"robot": job.name, "file": job.file, **drawn.facts, "lines": drawn.lines}), target.read_bytes()
        )


def draw_many(
    robots: Sequence[str], wanted: Wanted, suffix: str, folder: Path, cluster: Cluster, as_json: bool
) -> None:
    """Draw the maps that are not in the folder, and tell of all.

    Raises BadInput, also at the end if a robot has no such map.
    """
    jobs = [MapJob(robot, everywhere(robot), wanted, suffix) for robot in dict.fromkeys(robots)]
    kept = ResultFolder(folder, "maps", "maps of robots, figures beside them")

    def known(job: MapJob) -> Row | None:
        try:
            figures: Row = json_text.parsed((folder / job.file).with_suffix(".json").read_bytes())
            whole = figures["robot"] == job.name and isinstance(figures["lines"], list)
            return figures if whole and (folder / job.file).exists() else None
        except (ValueError, TypeError, KeyError, OSError):
            return None  # not there, or not whole on a disk that lost it

    def broken(job: MapJob, why: str) -> Row:
        return {"robot": job.name, "error": why}

    def keep(job: MapJob, made: Made) -> Row:
        if made.error:
            return broken(job, made.error)
        kept.write(folder / job.file, made.data)
        figures = json.dumps(made.row, indent=2)
        kept.write((folder / job.file).with_suffix(".json"), figures.encode())  # the last one: says that both are there
        return made.row

    with progress_bar() as bar:
        task = bar.add_task("drawing maps", total=len(jobs))

        def shown(done: int, _all: int) -> None:
            bar.update(task, completed=done)

        rows = rows_of(jobs, draw_elsewhere, cluster, known, keep, broken, shown)
    if as_json:
        print_json({"maps": rows, "folder": folder})
    else:
        for row in rows:
            out.print(f"{row['robot']}: {row.get('error') or '; '.join(row['lines'])}")
        out.print(f"{sum('error' not in row for row in rows)} of {len(rows)} maps are in {folder}")
    if lacking := [row for row in rows if "error" in row]:
        raise BadInput(f"{len(lacking)} of {len(rows)} maps could not be drawn, the first: {lacking[0]['error']}")
