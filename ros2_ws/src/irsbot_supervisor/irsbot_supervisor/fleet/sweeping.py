"""Sweeps of designs on a cluster: chunks are judged as jobs, and kept in one file or in a folder with a file each."""

from __future__ import annotations

import io
import json
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import NamedTuple

import polars as pl

from irsbot_kinematics.description import json_text
from irsbot_kinematics.design import ZONES, Plan
from irsbot_kinematics.design.sweep import CHUNK, Chunk, Columns, chunks, judge_chunk
from irsbot_supervisor.bag.column_stream import write_chunks
from irsbot_supervisor.fleet.cluster import HERE, Cluster, mapping
from irsbot_supervisor.fleet.folder import ResultFolder, key_of
from irsbot_supervisor.fleet.resuming import Progress, no_progress

FEW_CHUNKS = 400
"""Chunks of which the start of processes and the way of the tables take longer than the judging: 20 million designs."""

COUNTED = ("valid", "distal_free", *(f"zone_{zone}" for zone in ZONES))
"""Columns of which is told how often they are true."""

SUMS = "irsbot"
"""Key of a file's metadata under which the sums of its rows stand."""


class Sums(dict[str, int]):
    """How many designs were judged, and for how many of them each of COUNTED is true."""

    def __init__(self, plan: Plan, progress: Progress) -> None:
        super().__init__({"designs": 0, **dict.fromkeys(COUNTED, 0)})
        self._plan, self._progress = plan, progress

    def add(self, more: dict[str, int]) -> None:
        for name in self:
            self[name] += more[name]
        self._progress(self["designs"], len(self._plan))


def sweep_to_file(
    plan: Plan, file: Path, cluster: Cluster = HERE, progress: Progress = no_progress, size: int = CHUNK
) -> dict[str, int]:
    """Judge the designs of a plan; write one table, the same to the bit whatever the cluster, .parquet or .csv.

    Returns the sums. The file appears when it is complete. Raises BadInput, OSError.
    """
    sums = Sums(plan, progress)

    def counted(judged: Iterable[Columns]) -> Iterator[Columns]:
        for columns in judged:
            yield columns
            sums.add(_sums(columns))

    with mapping(cluster, len(plan) <= FEW_CHUNKS * size) as spread:
        write_chunks(file, counted(spread(judge_chunk, chunks(plan, size))))
    return sums


def sweep_to_folder(
    plan: Plan, folder: Path, cluster: Cluster = HERE, progress: Progress = no_progress, size: int = CHUNK
) -> dict[str, int]:
    """Likewise, with a Parquet file per chunk; a chunk that is there is not judged again. The names of the files sort
    as their chunks do.

    Returns the sums. Raises BadInput, OSError; what was judged by then is in the folder.
    """
    kept, sums = ResultFolder(folder, "sweep", "designs, a table in parts"), Sums(plan, progress)
    key, missing = key_of(f"{json.dumps(asdict(plan))}\0{size}"), []
    for chunk in chunks(plan, size):
        if (known := _known(folder / _name(chunk, key))) is None:
            missing.append(chunk)
        else:
            sums.add(known)
    if missing:
        with mapping(cluster, len(missing) <= FEW_CHUNKS) as spread:
            for chunk, part, more in spread(_judge_part, missing):
                kept.write(folder / _name(chunk, key), part)
                sums.add(more)
    return sums


class _Part(NamedTuple):
    """A chunk, judged: a Parquet file and its sums."""

    chunk: Chunk
    data: bytes
    sums: dict[str, int]


def _judge_part(chunk: Chunk) -> _Part:
    columns = judge_chunk(chunk)
    sums, data = _sums(columns), io.BytesIO()
    pl.DataFrame(columns).write_parquet(data, metadata={SUMS: json.dumps(sums)})
    return _Part(chunk, data.getvalue(), sums)


def _sums(columns: Columns) -> dict[str, int]:
    return {"designs": len(columns["valid"]), **{name: int(columns[name].sum()) for name in COUNTED}}


def _name(chunk: Chunk, key: str) -> str:
    return f"designs-{key}-{chunk.number:08d}.parquet"


def _known(file: Path) -> dict[str, int] | None:
    """The sums of a file that is there and whole."""
    try:
        stated = json_text.parsed(pl.read_parquet_metadata(file)[SUMS])
        return {name: int(stated[name]) for name in ("designs", *COUNTED)}
    except (ValueError, TypeError, KeyError, OSError, pl.exceptions.PolarsError):
        return None
