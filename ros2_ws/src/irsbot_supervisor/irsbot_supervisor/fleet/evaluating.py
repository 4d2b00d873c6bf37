"""Margins of many tables of joint samples: one of them in a worker, or all as a folder of Parquet files."""

from __future__ import annotations

import io
import json
import warnings
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from irsbot_kinematics import KinematicsError, LabelsVary
from irsbot_kinematics.description import json_text
from irsbot_supervisor.bag.columns import read_joint_columns
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.configuration.loading import robot_of
from irsbot_supervisor.fleet.cluster import HERE, Cluster
from irsbot_supervisor.fleet.folder import ResultFolder, key_of, robot_files
from irsbot_supervisor.fleet.inputs import fault_of
from irsbot_supervisor.fleet.resuming import Progress, no_progress, rows_of

ROW = "irsbot"
"""Key of a file's metadata under which the row stands."""


@dataclass(frozen=True)
class Question:
    """What is evaluated, as on the command line of `irsbot evaluate`; a robot's file by its absolute path."""

    robot: str
    assembly: int | None = None
    load: float | None = None
    moment: float = 0.0
    topic: str | None = None


@dataclass(frozen=True)
class InputJob:
    """One table or bag. name: as the user gave it. path: absolute, as every worker sees it."""

    name: str
    path: str
    question: Question

    @cached_property
    def key(self) -> str:
        """A hash of everything that the result depends on. Raises OSError if a file cannot be read."""
        path = Path(self.path)
        files = sorted(file for file in path.iterdir() if file.is_file()) if path.is_dir() else [path]
        return key_of(f"{self.name}\0{json.dumps(asdict(self.question))}", [*files, *robot_files(self.question.robot)])


@dataclass(frozen=True)
class InputRow:
    """One input in one line.

    error: why it could not be evaluated; then nothing below is known.
    assembled: samples that have a pose.
    type2, constraint: smallest margins; None without an assembled sample, or if the mechanism has no such margin.
    warnings: what its reader should know.
    """

    input: str
    error: str = ""
    samples: int = 0
    assembled: int = 0
    type2: float | None = None
    constraint: float | None = None
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Evaluated:
    """What one job gives. columns: of the table. data: the table as a Parquet file."""

    row: InputRow
    data: bytes = b""


def evaluated_columns(job: InputJob) -> tuple[InputRow, dict[str, Any]]:
    """The row, and the columns of the table: time if known, joints, pose, margins, status.

    Raises KinematicsError, BagError, OSError.
    """
    asked = job.question
    machine = robot_of(asked.robot)
    names = [joint.name for joint in machine.mechanism.joints]
    joints, times, damage = read_joint_columns(Path(job.path), names, asked.topic)
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always", LabelsVary)
        found = machine.evaluate_many(joints, asked.assembly, force=asked.load, moment=asked.moment)
    columns: dict[str, Any] = {"time_s": times} if times is not None else {}
    columns |= {name: joints[:, i] for i, name in enumerate(names)}
    columns |= {coordinate.name: found.pose[:, i] for i, coordinate in enumerate(machine.mechanism.task)}
    columns |= {f"type1_margin_{i + 1}": column for i, column in enumerate(found.type1_margin.T)}
    columns |= {"type2_margin": found.type2_margin, "constraint_margin": found.constraint_margin}
    columns |= {f"limb_margin_{i + 1}": column for i, column in enumerate(found.limb_margin.T)}
    columns |= {f"pressure_angle_{i + 1}": column for i, column in enumerate(found.pressure_angle.T)}
    columns |= {f"reaction_max_{i + 1}": column for i, column in enumerate(found.reaction_max.T)}
    columns |= {"reach_m": found.reach, "status": found.status}
    row = InputRow(
        job.name,
        samples=len(joints),
        assembled=int(np.count_nonzero(found.status == 0)),
        type2=_smallest(found.type2_margin),
        constraint=_smallest(found.constraint_margin),
        warnings=(*([f"the bag is damaged: {damage}"] if damage else []), *(str(one.message) for one in warned)),
    )
    return row, columns


def evaluate_input(job: InputJob) -> Evaluated:
    """One input, in a worker. Why it cannot be evaluated stands in the row. The tables of a folder are one table."""
    if fault := fault_of(job.path, "it", "inputs"):
        return Evaluated(_broken(job, fault))
    try:
        row, columns = evaluated_columns(job)
    except (KinematicsError, BagError, OSError) as error:
        return Evaluated(_broken(job, str(error).replace(job.path, job.name)))
    times = columns.pop("time_s", None)
    frame = pl.DataFrame(
        {
            "input": [job.name] * row.samples,
            "time_s": times if times is not None else pl.Series([None] * row.samples, dtype=pl.Float64),
            **columns,
        }
    )
    data = io.BytesIO()
    frame.write_parquet(data, metadata={ROW: json.dumps(asdict(row))})
    return Evaluated(row, data.getvalue())


def evaluate_inputs(
    jobs: Sequence[InputJob], folder: Path, cluster: Cluster = HERE, progress: Progress = no_progress
) -> list[InputRow]:
    """A row per input, in the order of the jobs, and a Parquet file of each in the folder; the same whatever the
    cluster. An input that is there is not evaluated again.

    Raises BadInput, OSError; what was done by then is in the folder.
    """
    kept = ResultFolder(folder, "evaluation", "margins of joint samples, a table per input")

    def known(job: InputJob) -> InputRow | None:
        try:
            stated = json_text.parsed(pl.read_parquet_metadata(_file(folder, job))[ROW])
            return InputRow(**{**stated, "warnings": tuple(stated["warnings"])})
        except (ValueError, TypeError, KeyError, OSError, pl.exceptions.PolarsError):
            return None  # not there, or not whole on a disk that lost it

    def keep(job: InputJob, result: Evaluated) -> InputRow:
        if not result.row.error:
            kept.write(_file(folder, job), result.data)
        return result.row

    return rows_of(jobs, evaluate_input, cluster, known, keep, _broken, progress)


def _broken(job: InputJob, why: str) -> InputRow:
    return InputRow(job.name, why)


def _file(folder: Path, job: InputJob) -> Path:
    return folder / f"{Path(job.path).stem}-{job.key}.parquet"


def _smallest(margins: np.ndarray[Any, Any]) -> float | None:
    known = margins[np.isfinite(margins)]
    return float(known.min()) if len(known) else None
