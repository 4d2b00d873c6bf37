"""Pages of runs at the edge, in a headless Chromium: no stop, only UNKNOWN, one sample, cut off, long, not ours."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import PROGRAM, Browser
from command import irsbot
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from irsbot_msgs_py.cdr import encode_joint_state
from irsbot_msgs_py.records import JointSample
from irsbot_supervisor.bag.bag_writer import BagWriter
from irsbot_supervisor.bag.topics import JOINT_STATE
from irsbot_supervisor.replay.recording import read_recording

BAGS = Path(__file__).resolve().parents[4] / "bags"
ROBOT = "irsbot2_beta45"
"""Of the bag type2."""


@pytest.fixture(scope="module")
def samples() -> list[JointSample]:
    return read_recording(BAGS / "type2").samples


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with Browser(tmp_path_factory.mktemp("profile")) as one:
        yield one


def alone(target: Path, samples: list[JointSample]) -> Path:
    """A bag of joint states and nothing else."""
    with BagWriter(target) as bag:
        for sample in samples:
            bag.add("/joint_states", sample, sample.seen_ns)
    return target


def in_sqlite(target: Path, samples: list[JointSample]) -> Path:
    with Writer(target, version=9, storage_plugin=StoragePlugin.SQLITE3) as bag:
        connection = bag.add_connection("/joint_states", JOINT_STATE, typestore=get_typestore(Stores.ROS2_JAZZY))
        for sample in samples:
            bag.write(connection, sample.seen_ns, encode_joint_state(sample))
    return target


def without_stop(folder: Path, samples: list[JointSample]) -> Path:
    return BAGS / "pick_and_place"


def unknown_alone(folder: Path, samples: list[JointSample]) -> Path:
    nowhere = [sample._replace(position=(np.nan,) * len(sample.position)) for sample in samples[:50]]
    return alone(folder / "unknown.mcap", nowhere)


def one_sample(folder: Path, samples: list[JointSample]) -> Path:
    return alone(folder / "one.mcap", samples[:1])


def cut_off(folder: Path, samples: list[JointSample]) -> Path:
    whole = (BAGS / "type2" / "type2_0.mcap").read_bytes()
    (folder / "cut.mcap").write_bytes(whole[: int(0.8 * len(whole))])
    return folder / "cut.mcap"


EDGES = {
    without_stop: "nothing ended work",
    unknown_alone: "No posture was known",
    one_sample: "1 joint state",
    cut_off: "The bag is damaged",
}
"""Runs, and what their page says."""


@pytest.mark.skipif(PROGRAM is None, reason="needs Chromium: apt install chromium")
@pytest.mark.parametrize("edge", EDGES, ids=[edge.__name__ for edge in EDGES])
def test_a_run_at_the_edge_has_a_page_that_says_so(
    edge: Callable[[Path, list[JointSample]], Path], samples: list[JointSample], browser: Browser, tmp_path: Path
) -> None:
    bag, page = edge(tmp_path, samples), tmp_path / "run.html"
    robot = ["--robot", ROBOT] if edge in (unknown_alone, one_sample) else []
    said = irsbot("report", bag, *robot, "-o", page)
    assert "Traceback" not in said.err
    for width in (1400, 400):
        browser.resize(width, 900)
        browser.open(page)
        assert browser.errors == []
        assert EDGES[edge].lower() in browser.run("document.body.innerText").lower()
        assert browser.run("document.documentElement.scrollWidth") <= width
    browser.run("document.getElementById('tracks').focus()")
    for key in ("Home", "ArrowRight", "n", "End", "+", "-"):
        browser.press(key)
    assert browser.errors == []


def test_joint_states_in_sqlite_give_the_page_of_their_mcap_twin(samples: list[JointSample], tmp_path: Path) -> None:
    ours, theirs = alone(tmp_path / "run.mcap", samples), in_sqlite(tmp_path / "bag", samples)

    def data(bag: Path) -> dict[str, Any]:
        page = tmp_path / f"{bag.stem}.html"
        assert irsbot("report", bag, "--robot", ROBOT, "-o", page).code == 0
        found: dict[str, Any] = json.loads(
            re.search(r'type="application/json"[^>]*>(.*?)</script>', page.read_text(), re.S)[1]
        )
        return {name: value for name, value in found.items() if name != "title"}

    known = data(ours)
    assert known["summary"]["stops"]
    assert data(theirs) == known
