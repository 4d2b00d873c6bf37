"""Tables of samples: joint columns from CSV or MCAP, columns to CSV or Parquet."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from irsbot_kinematics import BadInput
from irsbot_kinematics.arithmetic import Array
from irsbot_msgs_py.records import JointSample
from irsbot_supervisor.tape import Tape


def read_joint_columns(path: Path, names: list[str]) -> tuple[Array, Array | None]:
    """Joint positions (N, n) in the order of `names`, and times (N,) in s where the source has them.

    Raises BadInput for a file without those columns or with something else than numbers in them.
    """
    if path.is_dir() or path.suffix == ".mcap":
        return _from_bag(path, names)
    frame = _table(path)
    if missing := [name for name in names if name not in frame.columns]:
        raise BadInput(f"{path}: no column '{missing[0]}'; it has {', '.join(frame.columns)}")
    if words := [name for name in names if not frame.schema[name].is_numeric()]:
        raise BadInput(f"{path}: column '{words[0]}' holds something else than numbers")
    times = frame["time_s"].to_numpy().astype(float) if "time_s" in frame.columns else None
    return frame.select(names).cast(pl.Float64).to_numpy(), times


def read_motion(path: Path, names: list[str]) -> tuple[Array, Array, Array]:
    """Times (N,) in s, positions (N, n), and velocities (N, n) or (0, n), from a CSV table. Raises BadInput."""
    positions, times = read_joint_columns(path, names)
    if times is None:
        raise BadInput(f"{path}: no column 'time_s'")
    rates = [f"{name}_velocity" for name in names]
    if has_columns(path, rates[:1]):
        return times, positions, read_joint_columns(path, rates)[0]
    return times, positions, np.empty((0, len(names)))


def has_columns(path: Path, names: list[str]) -> bool:
    """Whether a CSV table has columns of these names. Raises BadInput for a file that is no table."""
    return path.suffix == ".csv" and set(names) <= set(_table(path, 1).columns)


def _table(path: Path, rows: int | None = None) -> pl.DataFrame:
    """The first rows of a CSV table, or all of them."""
    try:
        return pl.read_csv(path, n_rows=rows)
    except (pl.exceptions.PolarsError, UnicodeDecodeError) as error:
        raise BadInput(f"{path}: not a CSV table: {str(error).splitlines()[0]}") from None


def write_columns(path: Path, columns: dict[str, Any]) -> None:
    """One column per entry, as CSV or Parquet by the suffix. Raises BadInput for another suffix."""
    frame = pl.DataFrame(columns)
    if path.suffix == ".parquet":
        frame.write_parquet(path)
    elif path.suffix == ".csv":
        frame.write_csv(path)
    else:
        raise BadInput(f"cannot write '{path}': the suffix must be .csv or .parquet")


def _from_bag(path: Path, names: list[str]) -> tuple[Array, Array]:
    rows, times = [], []
    with Tape(path) as tape:
        for entry in tape.records("joint_states"):
            sample = entry.record
            if not isinstance(sample, JointSample) or len(sample.position) != len(sample.names):
                continue
            if all(name in sample.names for name in names):
                rows.append([sample.position[sample.names.index(name)] for name in names])
                times.append(sample.stamp_ns * 1e-9)
    if not rows:
        raise BadInput(f"{path}: no joint states with {', '.join(names)}")
    return np.array(rows), np.array(times)
