"""A row of the fault campaign that starts nodes, on a worker of a cluster."""

from __future__ import annotations

import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

from dask_processes import dask_cluster

from irsbot_supervisor.fleet.cluster import Cluster
from irsbot_supervisor.validation.registry import ENTRIES
from irsbot_supervisor.validation.runner import Order, run_rows_on

pytestmark = pytest.mark.ros


def test_a_row_with_nodes_is_met_on_a_worker() -> None:
    entry = next(entry for entry in ENTRIES if entry.name == "lifecycle")
    assert entry.needs_ros
    with dask_cluster() as (address, _scheduler, _nanny):
        (row,) = run_rows_on([Order(entry, 10, 3)], Cluster(address))
    assert row.ok, row
    assert row.amount == 10
