"""One bag judged, in a worker: the row of the fleet's table, the table of samples, the page."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl

from irsbot_kinematics import KinematicsError
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.core.margins import MARGIN_NAMES
from irsbot_supervisor.core.settings import InvalidSettings
from irsbot_supervisor.fleet.inputs import fault_of
from irsbot_supervisor.fleet.records import SHOWN_FAULTS, BagCheck, BagJob, BagRow, row_from_text
from irsbot_supervisor.replay.judgement import BagJudgement, judge_bag

ROW = "irsbot"
"""Key of a file's metadata under which the row stands."""


@dataclass(frozen=True)
class BagResult:
    """What one job gives. samples: a Parquet file with the row in its metadata. page: HTML. None: not wanted."""

    row: BagRow
    samples: bytes | None = None
    page: str | None = None


def judge(job: BagJob) -> BagResult:
    """Judge one bag. Why it cannot be judged stands in the row."""
    options = job.options
    if fault := fault_of(job.path, f"'{job.path}'", "bags"):
        return BagResult(broken(job, fault))
    try:
        found = judge_bag(
            job.path,
            options.robot,
            options.settings,
            namespace=options.namespace,
            topic=options.topic,
            mechanisms=options.mechanisms,
        )
        row = row_of(job, found)
        samples = _parquet(job, row, found) if job.samples else None
        return BagResult(row, samples, _page(found) if job.page else None)
    except (KinematicsError, BagError, InvalidSettings, OSError) as error:
        return BagResult(broken(job, str(error).replace(job.path, job.name)))


def broken(job: BagJob, why: str) -> BagRow:
    """The line of a bag that could not be judged."""
    return BagRow(job.name, why)


def row_of(job: BagJob, found: BagJudgement) -> BagRow:
    """The line of the table."""
    summary = found.summary
    margins = summary["smallest_margins"]
    worst = min(margins, key=lambda one: one["value"] - one["stop_limit"], default=None)
    return BagRow(
        bag=job.name,
        robot=found.robot,
        samples=len(found.judged.levels),
        seconds=summary["seconds"],
        worst=summary["verdict"]["worst_at_work"] or "",
        margin=worst["margin"] if worst else "",
        value=worst["value"] if worst else None,
        stop_limit=worst["stop_limit"] if worst else None,
        margin_time_s=worst["time_s"] if worst else None,
        stops=len(summary["stops"]),
        false_stops=int(found.measures["false_stops"]) if found.expectation is not None else None,
        unseen=summary["unseen"],
        missing=summary["missing"],
        damage=found.recording.loss,
        checks=tuple(BagCheck(one.name, len(one.faults), one.faults[:SHOWN_FAULTS]) for one in found.checks),
    )


def _parquet(job: BagJob, row: BagRow, found: BagJudgement) -> bytes:
    """The judged samples as columns, the same for every robot, so that the files of a fleet are one table."""
    series = found.series
    frame = pl.DataFrame(
        {
            "bag": [job.name] * series.count,
            "time_s": series.times,
            "level": series["level"][:, 0].astype(np.uint8),
            "causes": series["causes"][:, 0].astype(np.uint32),
            **{f"{name}_margin": column for name, column in zip(MARGIN_NAMES, series["margin"].T, strict=True)},
            "stop_margin": series["until rest"][:, 0],
            "sample_age_s": series["age"][:, 0],
            **{name: pl.Series(series[kind]).arr.to_list() for name, kind in LISTS.items()},
        }
    )
    written = io.BytesIO()
    frame.write_parquet(written, metadata={ROW: row.to_text()})
    return written.getvalue()


LISTS = {"joint_position": "joint", "joint_velocity": "joint rate", "pose": "pose"}
"""Columns with one number per joint or coordinate -> kind of the series."""


def _page(found: BagJudgement) -> str:
    from irsbot_supervisor.report.page import page, page_data

    return page(page_data(found))


def row_in(samples: Path) -> BagRow:
    """The row in the metadata of a Parquet file. Raises ValueError, TypeError, KeyError, OSError if there is none."""
    try:
        return row_from_text(pl.read_parquet_metadata(samples)[ROW])
    except pl.exceptions.PolarsError as error:
        raise ValueError(str(error)) from None
