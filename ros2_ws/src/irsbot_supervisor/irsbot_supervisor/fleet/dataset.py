"""The folder of a fleet: one Parquet file of samples per bag, a page per bag, the table of all bags.

Every file appears when it is complete. The name of a file ends with the key of its job, so a bag that is there with the
same content, options and version is not judged again.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import polars as pl

from irsbot_supervisor.fleet.folder import ResultFolder
from irsbot_supervisor.fleet.judging import BagResult, row_in
from irsbot_supervisor.fleet.page import fleet_page
from irsbot_supervisor.fleet.records import BagJob, BagRow

TABLE = "fleet.parquet"
PAGE = "fleet.html"
SAMPLES = "samples"
PAGES = "pages"


class Dataset:
    """The folder of a fleet, a new one or one that a run left behind."""

    def __init__(self, folder: Path) -> None:
        """Raises BadInput for a folder with other files."""
        self.folder = folder
        self._kept = ResultFolder(folder, "fleet", "per bag in samples/ and pages/, of all in fleet.*")

    def known(self, job: BagJob) -> BagRow | None:
        """The row of a bag that is there with everything that the job wants."""
        try:
            whole = not job.page or self.page(job).exists()
            return row_in(self._samples(job)) if whole else None
        except (ValueError, TypeError, KeyError, OSError):
            return None  # not there, or not whole on a disk that lost it: judged again

    def add(self, job: BagJob, found: BagResult) -> None:
        """Keep what a job gave. The samples come last: they say that the bag is done."""
        if found.page is not None:
            self._kept.write(self.page(job), found.page.encode())
        if found.samples is not None:
            self._kept.write(self._samples(job), found.samples)

    def finish(self, jobs: Sequence[BagJob], rows: Sequence[BagRow]) -> None:
        """Write the table and the page of all bags."""
        columns = [{key: value for key, value in row.as_json().items() if key != "checks"} for row in rows]
        table = io.BytesIO()
        pl.DataFrame(columns, schema=_SCHEMA).write_parquet(table)
        self._kept.write(self.folder / TABLE, table.getvalue())
        links = [
            self.page(job).relative_to(self.folder).as_posix() if job.page and not row.error else ""
            for job, row in zip(jobs, rows, strict=True)
        ]
        self._kept.write(self.folder / PAGE, fleet_page(rows, links).encode())

    def page(self, job: BagJob) -> Path:
        """Where the page of a bag stands."""
        return self.folder / PAGES / f"{Path(job.path).stem}-{job.key}.html"

    def _samples(self, job: BagJob) -> Path:
        return self.folder / SAMPLES / f"{Path(job.path).stem}-{job.key}.parquet"


_SCHEMA = {
    name: {"str": pl.String, "int": pl.Int64, "float": pl.Float64}[kind.partition(" ")[0]]
    for name, kind in {
        **{name: str(kind) for name, kind in BagRow.__annotations__.items() if name != "checks"},
        "lost": "int",
        "differences": "int",
        "result": "str",
    }.items()
}
