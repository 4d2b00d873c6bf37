"""A run of every mechanism as a page in a headless Chromium: it draws everything, in its width, without an error."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import pytest
from browser import PROGRAM, Browser
from command import irsbot

import irsbot_kinematics as irs
from irsbot_supervisor.bag.bag_writer import BagWriter
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.sim.closed_loop import cycles
from irsbot_supervisor.sim.scenario_file import scenario_robots
from irsbot_supervisor.sim.simulation import simulation_from

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(PROGRAM is None, reason="needs Chromium: apt install chromium"),
]

SCENARIOS = ("demo", "type2", "constraint", "workspace_boundary")
MS = 1500
"""Length of a run; it begins at rest and moves towards a singularity."""

DRAWN = """[...document.querySelectorAll('canvas')].map(canvas => {
    const dots = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
    return new Set(new Uint32Array(dots.buffer)).size > 3;
})"""


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with Browser(tmp_path_factory.mktemp("profile")) as one:
        yield one


def recorded(name: str, target: Path) -> Path:
    """A bag of the joint states of a run in a closed loop."""
    settings, robot = read_settings(name)
    values = {
        "robot": name,
        "scenario": next(one for one in SCENARIOS if name in scenario_robots(one)),
        "cycle_s": 0.5,
        "velocity_limit": settings.velocity_limit,
        "deceleration_limit": settings.deceleration_limit,
        "latency_s": settings.latency_s,
    }
    with BagWriter(target) as bag:
        for cycle in islice(cycles(simulation_from(values, robot), robot, settings), MS):
            for sample in cycle.sent:
                bag.add("/joint_states", sample, sample.received_ns)
    return target


@pytest.mark.parametrize("name", irs.robots())
def test_a_run_of_every_mechanism_renders(name: str, browser: Browser, tmp_path: Path) -> None:
    bag, page = recorded(name, tmp_path / "bag"), tmp_path / f"{name}.html"
    said = irsbot("report", bag, "--robot", name, "-o", page)
    assert said.code == 0, said.err
    browser.resize(1400, 900)
    browser.open(page)
    assert browser.errors == []
    assert all(browser.run(DRAWN))
    assert browser.run("Run.data.view.links.length") > 0
    assert browser.run("bars(Run.data, Run.data.posture.t.length - 1).length") > 3
    stated = browser.run("document.getElementById('view-legend').textContent")
    assert ("section at z = " in stated) == (not browser.run("Run.data.view.planar"))
    browser.resize(400, 800)
    browser.settle()
    assert browser.run("document.documentElement.scrollWidth") <= 400
    assert browser.errors == []
