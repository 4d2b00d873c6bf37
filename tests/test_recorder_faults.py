"""The campaign of recorder faults, short."""

from __future__ import annotations

import random
import sys
from pathlib import Path
from types import ModuleType

import pytest

CAMPAIGNS = Path(__file__).parent / "campaigns"


@pytest.fixture(scope="module")
def campaign() -> ModuleType:
    sys.path.insert(0, str(CAMPAIGNS))
    try:
        import recorder_faults
    finally:
        sys.path.remove(str(CAMPAIGNS))
    return recorder_faults


@pytest.fixture(scope="module")
def bag(campaign: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list]:
    path = tmp_path_factory.mktemp("bag") / "whole.mcap"
    return path, campaign.make_bag(path, 300)


def test_a_file_cut_anywhere_gives_back_every_chunk_before_the_cut(campaign, bag, tmp_path: Path):
    path, pieces = bag
    size, rng = path.stat().st_size, random.Random(11)
    edges = [pieces[3].end, pieces[3].end - 1, pieces[3].start, size - 1, size, pieces[-1].end, 7, 0]
    report = campaign.cut(path, pieces, edges + [rng.randrange(size) for _ in range(6)], tmp_path)
    assert report.faults == []
    assert 0 < report.recovered < report.messages  # cuts that cost nothing would prove nothing


@pytest.mark.parametrize("closed", [True, False], ids=["closed", "killed"])
def test_a_flipped_bit_costs_the_chunk_that_holds_it_and_is_counted(campaign, bag, tmp_path: Path, closed: bool):
    path, pieces = bag
    rng = random.Random(12)
    places = [(rng.randrange(path.stat().st_size), rng.randrange(8)) for _ in range(10)]
    parts = {"opcode": 0, "length": 1, "high length": 8, "raw size": 25, "checksum": 33, "compression": 37, "data": 99}
    framing = [(pieces[5].start + offset, 0) for offset in parts.values()]
    report = campaign.flip(path, pieces, places + framing, tmp_path, closed)
    assert report.faults == []
    assert 0 < report.recovered < report.messages


@pytest.mark.ros
@pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning")
def test_a_killed_recorder_loses_less_than_a_second_and_its_bag_can_be_saved(campaign, tmp_path: Path):
    pytest.importorskip("rclpy", reason="needs ROS 2")
    from irsbot_supervisor.suite import free_domain

    report = campaign.kill(2, tmp_path, random.Random(13), free_domain())
    assert report.faults == []
    assert report.longest_loss_s <= campaign.ALLOWED_LOSS_S
