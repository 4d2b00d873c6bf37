"""Tables of samples: joint columns from CSV or a bag."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import NamedTuple

import numpy as np
import polars as pl

from irsbot_kinematics import BadInput
from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_msgs_py.records import JointSample
from irsbot_supervisor.bag.bag import Bag
from irsbot_supervisor.bag.bag_files import is_bag
from irsbot_supervisor.bag.column_reader import Columns
from irsbot_supervisor.bag.joint_columns import JointColumns, JointSamples, columns_of
from irsbot_supervisor.bag.topics import choose_joint_topic

LARGEST = 1e10
"""rad, m, s and similar: a larger number is an error of units; seconds since the epoch are far below it."""


class JointTable(NamedTuple):
    """Joint positions over time. damage: what a bag has lost; empty if it is whole, and for a CSV table."""

    positions: Array  # (N, n)
    times: Array | None  # (N,) s; None: the source has none
    damage: str


def read_joint_columns(path: Path, names: list[str], topic: str | None = None) -> JointTable:
    """Joint positions in the order of `names`, with their times.

    topic: of the joint states, in a bag with several. Raises BadInput for a file without these columns, without rows,
    or with cells that are not numbers, and BagError for a bag that cannot be read.
    """
    if is_bag(path):
        return _from_bag(path, names, topic)
    frame = _table(path)
    if missing := [name for name in names if name not in frame.columns]:
        raise BadInput(f"{path}: no column '{missing[0]}'; it has {', '.join(frame.columns)}")
    times = _numbers(path, frame, ["time_s"])[:, 0] if "time_s" in frame.columns else None
    return JointTable(_numbers(path, frame, names), times, "")


def read_motion(path: Path, names: list[str]) -> tuple[Array, Array, Array]:
    """Times (N,) in s, positions (N, n), and velocities (N, n) or (0, n), from a CSV table or a bag; of a bag, (0, n).

    Raises BadInput, also for times that do not increase, for values that are not finite, for velocities of a part of
    the joints, and for a damaged bag, whose motion is not known as a whole; BagError for a bag that cannot be read.
    """
    positions, times, damage = read_joint_columns(path, names)
    if damage:
        raise BadInput(f"{path}: the bag is damaged, a part of its motion is not known: {damage}")
    if times is None:
        raise BadInput(f"{path}: no column 'time_s'")
    _finite(path, ["time_s"], times[:, np.newaxis])
    if len(late := np.flatnonzero(np.diff(times) <= 0.0)):
        row = int(late[0]) + 1
        fault = f"is {times[row]:g}, must be above {times[row - 1]:g} in the row before"
        raise BadInput(f"{path}: {_cell(row, 'time_s')} {fault}")
    rates = rate_names(names)
    velocities: Array = np.empty((0, len(names)))
    if not is_bag(path) and not set(rates).isdisjoint(column_names(path)):
        velocities = _finite(path, rates, read_joint_columns(path, rates).positions)
    return times, _finite(path, names, positions), velocities


def rate_names(names: list[str]) -> list[str]:
    """The columns with the velocities of joints."""
    return [f"{name}_velocity" for name in names]


def column_names(path: Path) -> list[str]:
    """Names of a CSV table's columns. Raises BadInput."""
    return _table(path, 1).columns


def _table(path: Path, rows: int | None = None) -> pl.DataFrame:
    """The first rows of a CSV table, or all of them, as texts."""
    try:
        with path.open(encoding="utf-8") as file:
            header = file.readline()
        for sign in (";", "\t"):
            if sign in header and "," not in header:
                raise BadInput(f"{path}: columns are separated by {sign!r}, must be by ','")
        return pl.read_csv(path, n_rows=rows, infer_schema=False, glob=False)
    except OSError as error:
        raise BadInput(f"{path}: {error.strerror or 'cannot be read'}") from None
    except (pl.exceptions.PolarsError, UnicodeDecodeError) as error:
        raise BadInput(f"{path}: not a CSV table: {str(error).splitlines()[0]}") from None


def _numbers(path: Path, frame: pl.DataFrame, names: list[str]) -> Array:
    """Columns (N, n) of a table, NaN where it says so. Raises BadInput that names the first cell without a number."""
    if frame.is_empty():
        raise BadInput(f"{path}: it has no rows below its header")
    texts = frame.select(pl.col(name).str.strip_chars() for name in names)
    values = texts.select(pl.all().cast(pl.Float64, strict=False))
    for row, column in np.argwhere(values.select(pl.all().is_null()).to_numpy())[:1].tolist():
        stated = texts[row, column]
        fault = f"'{stated}' is no number" if stated else "the cell is empty"
        raise BadInput(f"{path}: {_cell(row, names[column])}: {fault}")
    numbers = values.to_numpy()
    for row, column in np.argwhere(np.isfinite(numbers) & (np.abs(numbers) > LARGEST))[:1].tolist():
        fault = f"{numbers[row, column]:g} is no joint position, pose, velocity or time: at most {LARGEST:g}"
        raise BadInput(f"{path}: {_cell(row, names[column])}: {fault}")
    return numbers


def _finite(path: Path, names: list[str], values: Array) -> Array:
    for row, column in np.argwhere(~np.isfinite(values))[:1].tolist():
        raise BadInput(f"{path}: {_cell(row, names[column])} is {values[row, column]}, must be finite")
    return values


def _cell(row: int, column: str) -> str:
    """A place in a table: row and column as a reader counts them."""
    return f"row {row + 1} below the header, column '{column}'"


def _from_bag(path: Path, names: list[str], wanted: str | None) -> JointTable:
    samples: dict[str, JointSamples] = defaultdict(JointSamples)
    with Bag(path) as opened:
        for entry in opened.columns():
            if isinstance(entry, Columns):
                samples[entry.topic].append(entry.joints)
            elif isinstance(entry.record, JointSample):
                samples[entry.topic].extend([entry.record])
        damage = str(opened.loss) if opened.loss else ""
    rows, times = [], []
    others: set[str] = set()
    chosen = samples[choose_joint_topic(path, samples, wanted)]
    chosen.compact()
    for part in chosen.parts:
        for columns in [part] if isinstance(part, JointColumns) else [columns_of([one]) for one in part]:
            if columns.position.shape[1] != len(columns.names) or not set(names) <= set(columns.names):
                others.update(columns.names)
                continue
            rows.append(columns.position[:, [columns.names.index(name) for name in names]])
            times.append(columns.stamp_ns * 1e-9)
    if not rows:
        raise BadInput(f"{path}: no joint states with {', '.join(names)}; it has {', '.join(sorted(others)) or 'none'}")
    return JointTable(np.concatenate(rows), np.concatenate(times), damage)
