"""The rows of the fault campaign about recordings, short."""

from __future__ import annotations

import os
import random
from dataclasses import replace
from pathlib import Path

import pytest

from irsbot_supervisor.bag.salvage import Salvaged, salvage
from irsbot_supervisor.processes.suite import SuiteError
from irsbot_supervisor.validation.harness.rows import Job, Tally
from irsbot_supervisor.validation.with_nodes import recorder, recorder_death
from irsbot_supervisor.validation.with_nodes.recorder import BACK, OF, Piece, cut, flip, make_bag

JOB = Job(0, 0, lambda number: None)


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Piece]]:
    path = tmp_path_factory.mktemp("bag") / "whole.mcap"
    return path, make_bag(path, 300)


def test_a_file_cut_anywhere_gives_back_every_chunk_before_the_cut(bag, tmp_path: Path):
    path, pieces = bag
    size, rng = path.stat().st_size, random.Random(11)
    edges = [pieces[3].end, pieces[3].end - 1, pieces[3].start, size - 1, size, pieces[-1].end, 7, 0]
    tally = Tally("cut", JOB)
    cut(tally, path, pieces, edges + [rng.randrange(size) for _ in range(6)], tmp_path)
    row = tally.row()
    assert row.ok, row.note
    assert 0 < row.figures[BACK] < row.figures[OF]  # cuts that cost nothing would prove nothing


@pytest.mark.parametrize(
    "hidden",
    [{"cut": False}, {"places": 0, "bytes": 0}, {"messages": 0, "places": 0, "bytes": 0, "cut": False}],
    ids=["that the file was not closed", "that a chunk is cut", "anything"],
)
def test_a_salvage_that_does_not_say_what_is_lost_fails_the_row(
    bag, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, hidden: dict[str, int]
):
    path, pieces = bag

    def quiet(source: Path, target: Path) -> Salvaged:
        saved = salvage(source, target)
        return saved._replace(loss=replace(saved.loss, **hidden))

    monkeypatch.setattr(recorder, "salvage", quiet)
    tally = Tally("cut", JOB)
    cut(tally, path, pieces, [(pieces[3].start + pieces[3].end) // 2], tmp_path)
    assert tally.row().failed == 1


@pytest.mark.parametrize("closed", [True, False], ids=["closed", "killed"])
def test_a_flipped_bit_costs_the_chunk_that_holds_it_and_is_counted(bag, tmp_path: Path, closed: bool):
    path, pieces = bag
    rng = random.Random(12)
    places = [(rng.randrange(path.stat().st_size), rng.randrange(8)) for _ in range(10)]
    parts = {"opcode": 0, "length": 1, "high length": 8, "raw size": 25, "checksum": 33, "compression": 37, "data": 99}
    framing = [(pieces[5].start + offset, 0) for offset in parts.values()]
    tally = Tally("flip", JOB)
    flip(tally, path, pieces, places + framing, tmp_path, closed)
    row = tally.row()
    assert row.ok, row.note
    assert 0 < row.figures[BACK] < row.figures[OF]


def test_a_recorder_that_does_not_end_is_ended_and_said_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "asleep.py").write_text("import signal\nsignal.pause()\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    monkeypatch.setattr(recorder_death, "RECORDER", "asleep")
    monkeypatch.setattr(recorder_death, "PATIENCE_S", 0.1)
    with pytest.raises(SuiteError, match="does not end"):
        recorder_death._read_only(1)


@pytest.mark.ros
@pytest.mark.parametrize("name", ["run_kill", "run_lack"])
def test_a_recorder_that_dies_or_cannot_write_leaves_a_bag_that_can_be_read(name: str):
    pytest.importorskip("rclpy", reason="needs ROS 2")
    row = getattr(recorder_death, name)(Job(2, 13, lambda number: None))
    assert row.ok, row.note
    assert row.amount == 2
