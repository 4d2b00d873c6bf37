"""Margins of many tables of joint samples: a file each, the same on any cluster, gone on with after an interruption."""

from __future__ import annotations

import json
from pathlib import Path

import polars as pl
import pytest
from command import irsbot
from dask_processes import dask_cluster, kill_worker, once

from irsbot_kinematics import BadInput, make_robot
from irsbot_supervisor.fleet.cluster import Cluster
from irsbot_supervisor.fleet.evaluating import ROW, InputJob, InputRow, Question, evaluate_input, evaluate_inputs

BAGS = Path(__file__).parents[4] / "bags"
NUMBER = 12
"""Tables."""


@pytest.fixture(scope="module")
def jobs(tmp_path_factory: pytest.TempPathFactory) -> list[InputJob]:
    """Tables of different lengths, one that is none, and one that is not there."""
    folder = tmp_path_factory.mktemp("inputs")
    for number in range(NUMBER):
        rows = [f"{2.5 + 0.01 * row},{-0.17 - 0.01 * number}" for row in range(5 + number)]
        (folder / f"joints_{number:02d}.csv").write_text("\n".join(["joint_1,joint_2", *rows]))
    (folder / "other.csv").write_text("a,b\n1,2\n")
    files = [*sorted(folder.iterdir()), folder / "none.csv"]
    return [InputJob(file.name, str(file), Question("irsbot2")) for file in files]


@pytest.fixture(scope="module")
def rows(jobs: list[InputJob]) -> list[InputRow]:
    """Without any cluster."""
    return [evaluate_input(job).row for job in jobs]


def tables(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.glob("*.parquet")}


def test_a_row_and_a_table_say_what_the_library_says(
    jobs: list[InputJob], rows: list[InputRow], tmp_path: Path
) -> None:
    assert evaluate_inputs(jobs[:2], tmp_path / "kept", Cluster(workers=1)) == rows[:2]
    table = pl.read_parquet(tmp_path / "kept" / "*.parquet")
    assert table["input"].unique().sort().to_list() == [job.name for job in jobs[:2]]
    robot = make_robot("irsbot2")
    for joints, margin in zip(table.select("joint_1", "joint_2").iter_rows(), table["type2_margin"], strict=True):
        assert margin == pytest.approx(robot.evaluate(joints).type2_margin, abs=1e-12)
    for job, row in zip(jobs[:2], rows, strict=False):
        assert row.type2 == table.filter(pl.col("input") == job.name)["type2_margin"].min()
    assert "no column 'joint_1'" in rows[-2].error
    assert "under the same path" in rows[-1].error


def test_tables_do_not_depend_on_the_number_of_workers_or_on_one_that_is_killed(
    jobs: list[InputJob], rows: list[InputRow], tmp_path: Path
) -> None:
    for workers in (1, 2):
        assert evaluate_inputs(jobs, tmp_path / str(workers), Cluster(workers=workers)) == rows
    with dask_cluster() as (address, _scheduler, nanny):
        kill = once(lambda: kill_worker(nanny), 3)
        assert evaluate_inputs(jobs, tmp_path / "killed", Cluster(address), kill) == rows
    assert len(tables(tmp_path / "1")) == NUMBER
    assert tables(tmp_path / "1") == tables(tmp_path / "2") == tables(tmp_path / "killed")


def test_a_scheduler_that_goes_away_leaves_whole_tables_and_the_next_run_goes_on(
    jobs: list[InputJob], rows: list[InputRow], tmp_path: Path
) -> None:
    folder = tmp_path / "kept"
    with dask_cluster() as (address, scheduler, _nanny), pytest.raises(BadInput, match=f"{address} went away"):
        evaluate_inputs(jobs, folder, Cluster(address), once(scheduler.kill, 2))
    done = {file: file.stat().st_mtime_ns for file in folder.glob("*.parquet")}
    assert 2 <= len(done) < NUMBER
    assert {file.suffix for file in folder.iterdir()} == {".parquet", ".txt"}
    assert evaluate_inputs(jobs, folder, Cluster(workers=1)) == rows
    assert {file: file.stat().st_mtime_ns for file in done} == done
    assert evaluate_inputs(jobs[:NUMBER], folder, Cluster("tcp://127.0.0.1:1")) == rows[:NUMBER], "no cluster was asked"


@pytest.mark.parametrize("row", ["", "[]", "{}", pytest.param("[" * 100_000, id="deep")])
def test_a_table_whose_row_is_spoilt_is_written_again(
    jobs: list[InputJob], rows: list[InputRow], tmp_path: Path, row: str
) -> None:
    evaluate_inputs(jobs[:1], tmp_path, Cluster(workers=1))
    (file,) = tmp_path.glob("*.parquet")
    whole = file.read_bytes()
    pl.read_parquet(file).write_parquet(file, metadata={ROW: row})
    assert evaluate_inputs(jobs[:1], tmp_path, Cluster(workers=1)) == rows[:1]
    assert file.read_bytes() == whole


def test_the_key_changes_with_everything_that_the_result_depends_on(tmp_path: Path) -> None:
    file, robot = tmp_path / "joints.csv", tmp_path / "mine.yaml"
    file.write_text("joint_1,joint_2\n2.9,-0.17\n")
    robot.write_text("mechanism: irsbot2\n")

    def key(**question: object) -> str:
        return InputJob("joints.csv", str(file), Question(**{"robot": str(robot), **question})).key

    keys = [key(), key(assembly=1), key(load=10.0), key(robot="irsbot2")]
    robot.write_text("mechanism: irsbot2\ndescription: another\n")
    keys.append(key())
    file.write_text("joint_1,joint_2\n2.8,-0.17\n")
    keys.append(key())
    assert len(set(keys)) == 6


@pytest.mark.skipif(not BAGS.is_dir(), reason="installed without the bags beside it")
def test_the_command_takes_tables_and_bags_in_both_ways(jobs: list[InputJob], tmp_path: Path) -> None:
    kept, inputs = tmp_path / "kept", [Path(job.path) for job in jobs]
    words = ("evaluate", "irsbot2", inputs[0], "--input", inputs[1], "--input", BAGS / "type2", "-o", kept)
    done = irsbot(*words, "--workers", 1)
    assert done.code == 0, done.err
    assert "3 inputs, 0 not evaluated" in done.out
    done = irsbot(*words, "--input", inputs[NUMBER], "--workers", 1, "--json")
    assert (done.code, "1 of 4 inputs could not be evaluated" in done.refusal) == (2, True)
    stated = json.loads(done.out)
    assert stated["total"]["not_evaluated"] == 1
    assert [row["samples"] > 0 for row in stated["inputs"]] == [True, True, True, False]
    for more, why in (
        ((inputs[0], inputs[1], "-o", tmp_path / "x.csv"), "need a folder"),
        (("-o", tmp_path / "x.csv"), "there is no input"),
        ((inputs[0], "-o", tmp_path / "y", "--scheduler", "here"), "tcp://host"),
    ):
        refused = irsbot("evaluate", "irsbot2", *more)
        assert refused.code == 2
        assert why in refused.refusal
    done = irsbot("evaluate", "irsbot2", inputs[NUMBER], inputs[NUMBER], "-o", tmp_path / "none", "--workers", 1)
    assert done.code == 2
    assert "written to" not in done.out, "nothing was"
    assert [file.name for file in tmp_path.iterdir()] == ["kept"]
