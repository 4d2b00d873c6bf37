"""Rows of the fault campaign on the workers of a cluster."""

from __future__ import annotations

import os
from pathlib import Path
from threading import Thread

import psutil
import pytest
from command import PATIENCE_S
from dask_processes import dask_cluster, kill_worker
from rows_for_tests import break_down, end, not_met, tell_and_wait

from irsbot_kinematics import BadInput
from irsbot_supervisor.fleet.cluster import Cluster
from irsbot_supervisor.validation.harness.rows import Entry, Row
from irsbot_supervisor.validation.registry import ENTRIES
from irsbot_supervisor.validation.runner import Order, run_rows, run_rows_on

pytestmark = pytest.mark.slow


def test_rows_do_not_depend_on_where_they_run_or_on_a_worker_that_is_killed() -> None:
    known = {entry.name: entry for entry in ENTRIES}
    orders = [
        Order(known["stamps"], 24, 5),
        Order(known["approach"], 2, 5, ("irsbot2",)),
        Order(known["delivery"], 5, 5),
    ]
    here = {row.name: row for row in run_rows(orders, 1, lambda _name, _cases: None)}
    with dask_cluster() as (address, _scheduler, nanny):
        rows = run_rows_on(orders, Cluster(address))
        first = next(rows)
        kill_worker(nanny)
        assert {row.name: row for row in (first, *rows)} == here
    assert all(row.ok for row in here.values())


def test_a_row_that_breaks_down_on_a_worker_is_not_met_and_is_not_tried_again() -> None:
    runs = (break_down, end, not_met)
    orders = [Order(Entry(run.__name__, "", 3, 3, run), 3, 1) for run in runs]
    with dask_cluster() as (address, _scheduler, _nanny):
        found = {row.name: row for row in run_rows_on(orders, Cluster(address))}
    assert found["break_down"].note == "ValueError: out of luck"
    assert found["end"].note == "the process of the row ended with exit code 3"
    assert (found["bad"].amount, found["bad"].unsafe) == (3, 1)
    assert not any(row.ok for row in found.values())


def test_the_process_of_a_row_ends_with_its_worker(tmp_path: Path) -> None:
    """Else a row that is begun again would run twice, with its nodes."""
    told = tmp_path / "process"
    os.mkfifo(told)
    with dask_cluster() as (address, _scheduler, nanny):
        rows = run_rows_on([Order(Entry("sleeper", "", 1, 1, tell_and_wait), 1, 1, (str(told),))], Cluster(address))
        found: list[Row] = []
        taker = Thread(target=lambda: found.extend(rows), daemon=True)
        taker.start()
        first = psutil.Process(int(told.read_text()))
        kill_worker(nanny)
        _gone, left = psutil.wait_procs([first], PATIENCE_S)
        for process in (*left, psutil.Process(int(told.read_text()))):
            process.kill()
        taker.join(PATIENCE_S)
    assert not left
    assert [row.note for row in found] == ["the process of the row ended with exit code -9"]


def test_a_scheduler_that_goes_away_is_one_sentence() -> None:
    with dask_cluster() as (address, scheduler, _nanny):
        rows = run_rows_on([Order(ENTRIES[0], 2, 5, ("irsbot2",))] * 3, Cluster(address))
        next(rows)
        scheduler.kill()
        with pytest.raises(BadInput, match=f"{address} went away"):
            list(rows)


@pytest.mark.ros
def test_a_row_with_nodes_is_met_on_a_worker() -> None:
    pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")
    entry = next(entry for entry in ENTRIES if entry.name == "lifecycle")
    assert entry.needs_ros
    with dask_cluster() as (address, _scheduler, _nanny):
        (row,) = run_rows_on([Order(entry, 10, 3)], Cluster(address))
    assert row.ok, row
    assert row.amount == 10
