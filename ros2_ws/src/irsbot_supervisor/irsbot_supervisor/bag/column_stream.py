"""Tables too large for memory: written chunk by chunk, as CSV or Parquet."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import chain
from pathlib import Path
from typing import Any

import polars as pl
from polars.io.plugins import register_io_source

from irsbot_kinematics import BadInput


def write_chunks(path: Path, chunks: Iterable[Mapping[str, Any]]) -> None:
    """Write chunks with the same columns, at least one, as one table. The file appears when it is complete.

    Raises BadInput for a suffix other than .csv and .parquet, OSError if it cannot be written.
    """
    if path.suffix not in (".csv", ".parquet"):
        raise BadInput(f"cannot write '{path}': the suffix must be .csv or .parquet")
    part = path.with_name(path.name + ".part")
    with part.open("wb"):  # refuse before the work begins
        pass
    try:
        frames = (pl.DataFrame(dict(chunk)) for chunk in chunks)
        (_write_csv if path.suffix == ".csv" else _write_parquet)(part, frames)
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def _write_csv(path: Path, frames: Iterator[pl.DataFrame]) -> None:
    with path.open("wb") as file:
        for number, frame in enumerate(frames):
            frame.write_csv(file, include_header=number == 0)


def _write_parquet(path: Path, frames: Iterator[pl.DataFrame]) -> None:
    first = next(frames)

    def source(*_: object) -> Iterator[pl.DataFrame]:
        yield from chain([first], frames)

    register_io_source(source, schema=first.schema).sink_parquet(path)
