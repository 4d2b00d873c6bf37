"""Many bags judged as one fleet, with a folder to keep the results or without one."""

from __future__ import annotations

from collections.abc import Sequence

from irsbot_supervisor.fleet.cluster import HERE, Cluster
from irsbot_supervisor.fleet.dataset import Dataset
from irsbot_supervisor.fleet.judging import BagResult, broken, judge
from irsbot_supervisor.fleet.records import BagJob, BagRow
from irsbot_supervisor.fleet.resuming import Progress, no_progress, rows_of


def judge_fleet(
    jobs: Sequence[BagJob],
    cluster: Cluster = HERE,
    dataset: Dataset | None = None,
    progress: Progress = no_progress,
) -> list[BagRow]:
    """A row per bag, in the order of the jobs; the same whatever the cluster. Bags of the dataset are not judged again.

    Raises BadInput where the cluster cannot be used; what was done by then is in the dataset.
    """

    def keep(job: BagJob, result: BagResult) -> BagRow:
        if dataset is not None:
            dataset.add(job, result)
        return result.row

    known = dataset.known if dataset is not None else lambda _job: None
    found = rows_of(jobs, judge, cluster, known, keep, broken, progress)
    if dataset is not None:
        dataset.finish(jobs, found)
    return found
