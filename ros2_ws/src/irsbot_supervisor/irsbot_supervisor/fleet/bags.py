"""Many bags judged as one fleet, with a folder to keep the results or without one."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from irsbot_supervisor.fleet.cluster import HERE, Cluster, JobFailed, run
from irsbot_supervisor.fleet.dataset import Dataset
from irsbot_supervisor.fleet.judging import judge
from irsbot_supervisor.fleet.records import BagJob, BagRow

Progress = Callable[[int, int], None]
"""Called with the number of bags that are done, and of all."""


def judge_fleet(
    jobs: Sequence[BagJob],
    cluster: Cluster = HERE,
    dataset: Dataset | None = None,
    progress: Progress = lambda _done, _all: None,
) -> list[BagRow]:
    """A row per bag, in the order of the jobs; the same whatever the cluster. Bags of the dataset are not judged again.

    Raises BadInput where the cluster cannot be used; what was done by then is in the dataset.
    """
    rows: dict[int, BagRow] = {}
    if dataset is not None:
        rows = {place: row for place, job in enumerate(jobs) if (row := dataset.known(job)) is not None}
    waiting = [place for place in range(len(jobs)) if place not in rows]
    progress(len(rows), len(jobs))
    for answer in run(judge, [jobs[place] for place in waiting], cluster):
        place, result = waiting[answer.place], answer.result
        if isinstance(result, JobFailed):
            rows[place] = BagRow(jobs[place].name, result.text)
        else:
            rows[place] = result.row
            if dataset is not None:
                dataset.add(jobs[place], result)
        progress(len(rows), len(jobs))
    found = [rows[place] for place in range(len(jobs))]
    if dataset is not None:
        dataset.finish(jobs, found)
    return found
