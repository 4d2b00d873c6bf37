"""Tables too large for memory: written chunk by chunk, as CSV or Parquet."""

from __future__ import annotations

import errno
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import Any

import polars as pl
from polars.io.plugins import register_io_source

from irsbot_kinematics import BadInput
from irsbot_supervisor.bag.whole_file import whole_file


def write_chunks(path: Path, chunks: Iterable[Mapping[str, Any]]) -> None:
    """Write chunks with the same columns, at least one, as one table. The file appears when it is complete.

    Raises BadInput for a suffix other than .csv and .parquet, OSError if it cannot be written.
    """
    if path.suffix not in (".csv", ".parquet"):
        raise BadInput(f"cannot write '{path}': the suffix must be .csv or .parquet")
    with table_file(path) as draft:
        frames = (pl.DataFrame(dict(chunk)) for chunk in chunks)
        (_write_csv if path.suffix == ".csv" else _write_parquet)(draft, frames)


@contextmanager
def table_file(path: Path) -> Iterator[Path]:
    """`whole_file` of a table that polars writes. Raises OSError also where polars reports one in words alone."""
    try:
        with whole_file(path) as draft:
            yield draft
    except (pl.exceptions.ComputeError, OSError) as error:
        text = str(error).partition("\n")[0]
        stated = bool(error.strerror) if isinstance(error, OSError) else "os error" not in text
        if stated:
            raise
        raise OSError(errno.EIO, f"cannot be written: {text}", str(path)) from None


def _write_csv(path: Path, frames: Iterator[pl.DataFrame]) -> None:
    with path.open("wb") as file:
        for number, frame in enumerate(frames):
            frame.write_csv(file, include_header=number == 0)


def _write_parquet(path: Path, frames: Iterator[pl.DataFrame]) -> None:
    first = next(frames)

    def source(*_: object) -> Iterator[pl.DataFrame]:
        yield from chain([first], frames)

    register_io_source(source, schema=first.schema).sink_parquet(path)
