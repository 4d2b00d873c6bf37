"""Jobs on processes: how many are submitted, in which order results come, what a process that ends changes."""

from __future__ import annotations

import os
from collections.abc import Iterator
from operator import neg
from pathlib import Path
from threading import Thread

import pytest
from dask_processes import dask_cluster, kill_family, kill_worker
from rows_for_tests import write_and_wait

from irsbot_kinematics import BadInput
from irsbot_supervisor.fleet import cluster as fleet_cluster
from irsbot_supervisor.fleet.cluster import AHEAD, Cluster, JobFailed, Workers, mapping, run, workers_of

MANY = 10**8
"""Jobs of a large sweep."""


PROCESS = "__import__('os').getpid()"
"""Of the one that evaluates it."""


class Counted:
    """Jobs, and how many of them were taken."""

    def __init__(self, number: int) -> None:
        self.taken, self._number = 0, number

    def __iter__(self) -> Iterator[int]:
        for job in range(self._number):
            self.taken += 1
            yield job


@pytest.fixture(scope="module")
def two() -> Iterator[Workers]:
    with workers_of(Cluster(workers=2)) as workers:
        yield workers


def test_a_bounded_number_of_jobs_is_submitted_however_many_there_are(two: Workers) -> None:
    jobs = Counted(MANY)
    answers = two.answers(neg, jobs)
    for done in range(1, 30):
        answer = next(answers)
        assert answer.result == -answer.place
        assert jobs.taken <= 2 * AHEAD + done - 1
    jobs = Counted(MANY)
    results = two.in_order(neg, jobs)
    for done in range(30):
        assert next(results) == -done
        assert jobs.taken <= 2 * AHEAD + done
    assert jobs.taken > 2 * AHEAD


def test_every_job_is_answered_once(two: Workers) -> None:
    found = sorted(two.answers(neg, iter(range(50))))
    assert found == [(place, -place) for place in range(50)]
    assert list(two.in_order(neg, iter(range(50)))) == [-job for job in range(50)]
    assert two.spread(neg, range(50)) == [-job for job in range(50)]
    assert two.spread(neg, []) == []


def test_a_job_that_fails_fails_alone_and_ends_what_needs_all(two: Workers) -> None:
    first, second, third = two.in_order(int, ["1", "two", "3"])
    assert (first, third) == (1, 3)
    assert isinstance(second, JobFailed)
    with pytest.raises(BadInput, match="invalid literal"):
        two.spread(int, ["1", "two"])


def test_no_cluster_is_asked_without_a_job() -> None:
    assert list(run(neg, iter([]), Cluster("tcp://127.0.0.1:1"))) == []


def test_few_jobs_are_done_here_unless_somebody_asked_for_a_cluster() -> None:
    with mapping(Cluster(), few=True) as spread:
        assert set(spread(eval, [PROCESS, PROCESS])) == {os.getpid()}
    with mapping(Cluster(workers=1), few=True) as spread:
        assert os.getpid() not in spread(eval, [PROCESS, PROCESS])


def test_results_in_order_outlive_a_worker_that_is_killed() -> None:
    with dask_cluster() as (address, _scheduler, nanny), workers_of(Cluster(address)) as workers:
        results = workers.in_order(neg, range(200))
        found = [next(results) for _ in range(20)]
        kill_worker(nanny)
        assert [*found, *results] == [-job for job in range(200)]


def test_results_in_order_end_with_one_sentence_where_the_scheduler_goes_away() -> None:
    with dask_cluster() as (address, scheduler, _nanny), mapping(Cluster(address), few=False) as spread:
        results = iter(spread(neg, range(MANY)))
        assert next(results) == 0
        scheduler.kill()
        with pytest.raises(BadInput, match=f"{address} went away"):
            list(results)


def test_a_run_without_any_worker_left_ends_with_one_sentence(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(fleet_cluster, "ANSWER_S", 5.0)
    begun = tmp_path / "begun"
    os.mkfifo(begun)
    with dask_cluster() as (address, _scheduler, nanny), workers_of(Cluster(address)) as workers:
        monkeypatch.setattr(fleet_cluster, "ANSWER_S", 0.2)
        # As soon as the job has begun; where none begins, the test has failed and must not wait for it.
        killer = Thread(target=lambda: (begun.read_text(), kill_family(nanny)), daemon=True)
        killer.start()
        for call, job in ((workers.answers, begun), (workers.in_order, tmp_path / "another")):
            with pytest.raises(BadInput, match=f"{address} has no workers any more"):
                list(call(write_and_wait, [job]))
        killer.join()


def test_there_are_no_more_processes_than_jobs() -> None:
    assert Cluster(workers=8).at_most(2) == Cluster(workers=2)
    assert Cluster(workers=2).at_most(8) == Cluster(workers=2)
    assert Cluster().at_most(1) == Cluster(workers=1)
    assert Cluster("tcp://host:1").at_most(1) == Cluster("tcp://host:1")


def test_a_thread_that_starts_late_stops_no_cluster(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a busy machine distributed waits too short a time for an event loop of its own."""
    monkeypatch.setattr("distributed.utils._CollectErrorThread", lambda **_thread: None)
    assert [answer.result for answer in run(neg, [1], Cluster(workers=1))] == [-1]
