"""Jobs of which some may have been done by an earlier run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

from irsbot_supervisor.fleet.cluster import Cluster, JobFailed, run

Job = TypeVar("Job")
Result = TypeVar("Result")
Row = TypeVar("Row")

Progress = Callable[[int, int], None]
"""Called with the number of jobs that are done, and of all."""


def no_progress(_done: int, _all: int) -> None:
    """Nobody looks."""


def rows_of(
    jobs: Sequence[Job],
    function: Callable[[Job], Result],
    cluster: Cluster,
    known: Callable[[Job], Row | None],
    keep: Callable[[Job, Result], Row],
    broken: Callable[[Job, str], Row],
    progress: Progress = no_progress,
) -> list[Row]:
    """A row per job, in the order of the jobs; the same whatever the cluster.

    known: the row of a job that is done, None for one that is not. keep: called here with every result as it comes.
    broken: the row of a job without a result, from the reason.

    Raises BadInput where the cluster cannot be used; what was done by then is kept.
    """
    rows = {place: row for place, job in enumerate(jobs) if (row := known(job)) is not None}
    waiting = [place for place in range(len(jobs)) if place not in rows]
    progress(len(rows), len(jobs))
    for answer in run(function, (jobs[place] for place in waiting), cluster.at_most(len(waiting))):
        place = waiting[answer.place]
        job, result = jobs[place], answer.result
        rows[place] = broken(job, result.text) if isinstance(result, JobFailed) else keep(job, result)
        progress(len(rows), len(jobs))
    return [rows[place] for place in range(len(jobs))]
