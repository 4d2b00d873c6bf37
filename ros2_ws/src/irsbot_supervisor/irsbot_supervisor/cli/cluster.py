"""Parts of the commands that run on many processes: options, and the cluster that they mean."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from irsbot_kinematics import BadInput
from irsbot_supervisor.fleet.cluster import Cluster, check_address

SchedulerOption = Annotated[
    str | None, typer.Option(help="a Dask scheduler for many jobs, tcp://host:8786; this machine if left out")
]
WorkersOption = Annotated[
    int | None, typer.Option(help="processes of this machine for many jobs; one per core if left out", min=1)
]


def cluster_of(scheduler: str | None, workers: int | None) -> Cluster:
    """Where the jobs of a command are done. Raises BadInput for options that do not go together, and for an address at
    which no scheduler can be."""
    if scheduler is not None and workers is not None:
        raise BadInput("--workers is for this machine; the workers of --scheduler are those that were started for it")
    if scheduler is not None:
        check_address(scheduler)
    return Cluster(scheduler, workers)


def everywhere(robot: str) -> str:
    """A robot as workers find it, whose folder is another one: a preset, or a file by its absolute path."""
    return str(Path(robot).resolve()) if Path(robot).is_file() else robot
