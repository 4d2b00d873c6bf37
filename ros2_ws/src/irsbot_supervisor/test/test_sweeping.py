"""Sweeps on clusters: the same table whatever the number of workers, also where one of them ends in the middle."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
import pytest
from command import irsbot
from dask_processes import dask_cluster, kill_worker, once

from irsbot_kinematics import BadInput
from irsbot_kinematics.design import Plan, Range, Task, search, sweep
from irsbot_supervisor.fleet.cluster import Cluster, short_mapping
from irsbot_supervisor.fleet.sweeping import SUMS, sweep_to_file, sweep_to_folder

SIZE = 500
"""Designs of a chunk here: forty chunks."""

PLAN = Plan(
    {
        "l1": Range(0.05, 0.5),
        "l2eq": Range(0.1, 1.0),
        "b": Range(0.05, 0.6),
        "p": Range(0.005, 0.1),
        "a1": Range(0.11, 0.4),
        "a2": Range(0.02, 0.1),
        "beta": Range(0.1, 1.4),
    },
    samples=40 * SIZE - 7,
    seed=3,
)


def quiet(_done: int, _all: int) -> None:
    pass


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The table, written without a cluster."""
    file = tmp_path_factory.mktemp("alone") / "designs.parquet"
    sweep_to_file(PLAN, file, size=SIZE)
    return file


def test_the_table_holds_what_the_library_says_and_the_sums_are_those_of_its_columns(tmp_path: Path) -> None:
    file = tmp_path / "designs.parquet"
    told: list[int] = []
    sums = sweep_to_file(PLAN, file, progress=lambda done, _all: told.append(done), size=SIZE)
    chunks = list(sweep(PLAN, SIZE))
    table = pl.read_parquet(file)
    for name in chunks[0]:
        np.testing.assert_array_equal(table[name].to_numpy(), np.concatenate([chunk[name] for chunk in chunks]))
    assert sums.pop("designs") == len(table) == len(PLAN) == told[-1]
    assert sums == {name: table[name].sum() for name in sums}
    assert sums["zone_a"] > 0


@pytest.mark.parametrize("suffix", [".parquet", ".csv"])
def test_the_file_does_not_depend_on_the_number_of_workers(suffix: str, tmp_path: Path) -> None:
    files = [tmp_path / f"{workers}{suffix}" for workers in ("alone", 1, 2)]
    for file, cluster in zip(files, (Cluster(), Cluster(workers=1), Cluster(workers=2)), strict=True):
        sweep_to_file(PLAN, file, cluster, size=SIZE)
    assert len({file.read_bytes() for file in files}) == 1


def test_a_worker_that_is_killed_changes_nothing(alone: Path, tmp_path: Path) -> None:
    file = tmp_path / "designs.parquet"
    with dask_cluster() as (address, _scheduler, nanny):
        sweep_to_file(PLAN, file, Cluster(address), once(lambda: kill_worker(nanny), 5 * SIZE), SIZE)
    assert file.read_bytes() == alone.read_bytes()


def test_a_scheduler_that_goes_away_leaves_no_part_of_a_file(tmp_path: Path) -> None:
    with dask_cluster() as (address, scheduler, _nanny), pytest.raises(BadInput, match=f"{address} went away"):
        sweep_to_file(PLAN, tmp_path / "designs.parquet", Cluster(address), once(scheduler.kill, 5 * SIZE), SIZE)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_is_gone_on_with_where_a_run_ended(alone: Path, tmp_path: Path) -> None:
    folder = tmp_path / "designs"
    with dask_cluster() as (address, scheduler, _nanny), pytest.raises(BadInput, match=f"{address} went away"):
        sweep_to_folder(PLAN, folder, Cluster(address), once(scheduler.kill, 5 * SIZE), SIZE)
    done = {file: file.stat().st_mtime_ns for file in folder.glob("*.parquet")}
    assert 5 <= len(done) < 40
    assert [file for file in folder.iterdir() if file.suffix == ".part"] == []
    broken = sorted(done)[:5]
    broken[0].write_bytes(broken[0].read_bytes()[:-20])
    for file, spoilt in zip(broken[1:], ("", "[]", "{}", "[" * 100_000), strict=True):
        pl.read_parquet(file).write_parquet(file, metadata={SUMS: spoilt})
    sums = sweep_to_folder(PLAN, folder, size=SIZE)
    again = {file: file.stat().st_mtime_ns for file in folder.glob("*.parquet")}
    assert len(again) == 40
    assert sorted(file for file in done if again[file] != done[file]) == broken
    table = pl.read_parquet(folder / "*.parquet")
    assert table.equals(pl.read_parquet(alone), null_equal=True)
    assert sums["zone_a"] == table["zone_a"].sum()
    assert sweep_to_folder(PLAN, folder, Cluster("tcp://127.0.0.1:1"), size=SIZE) == sums, "no cluster was asked"


def test_the_command_spreads_a_sweep_and_refuses_what_it_cannot_do(tmp_path: Path) -> None:
    words = ("design", "sweep", "--vary", "l1=0.1:0.5:300", "--vary", "b=0.05:0.6:300", "--json")
    outputs = [irsbot(*words, "-o", tmp_path / name, *more) for name, more in NAMED.items()]
    assert [said.code for said in outputs] == [0, 0], outputs[1].err
    one, folder = (tmp_path / name for name in NAMED)
    assert pl.read_parquet(one).equals(pl.read_parquet(folder / "*.parquet"), null_equal=True)
    assert len(list(folder.glob("*.parquet"))) == 2
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "mine.txt").write_text("mine")
    for more, why in (
        (("-o", tmp_path / "mine"), "holds other files"),
        (("-o", tmp_path / "x.parquet", "--scheduler", "here"), "tcp://host"),
        (("-o", tmp_path / "x.parquet", "--scheduler", "tcp://a:1", "--workers", 2), "--workers is for this machine"),
        (("-o", one), "--force replaces it"),
    ):
        done = irsbot(*words, *more)
        assert done.code == 2
        assert why in done.refusal
    assert sorted(file.name for file in tmp_path.iterdir()) == sorted(["mine", *NAMED])


NAMED: dict[str, tuple[str, ...]] = {"designs.parquet": ("--workers", "1"), "designs": ()}
"""Outputs of one sweep, and their options."""


def test_a_search_finds_the_same_design_whatever_the_number_of_workers(tmp_path: Path) -> None:
    words = ("design", "search", "--generations", 3, "--population", 3, "--slack", 0.01, "--json")
    found = [irsbot(*words, *more) for more in ((), ("--workers", 1), ("--workers", 2))]
    assert [said.code for said in found] == [0, 0, 0], found[1].err
    assert len({said.out for said in found}) == 1


def test_a_search_outlives_a_worker_that_is_killed_and_tells_of_a_scheduler_that_goes_away() -> None:
    task = Task(population=3, generations=3, slack=0.01)
    with dask_cluster() as (address, scheduler, nanny), short_mapping(Cluster(address), few=False) as spread:
        acts = {1: lambda: kill_worker(nanny)}
        assert search(task, lambda at, _best: acts.pop(at, int)(), spread) == search(task)
        assert not acts
        with pytest.raises(BadInput, match=f"{address} went away"):
            search(task, lambda _at, _best: scheduler.kill(), spread)
