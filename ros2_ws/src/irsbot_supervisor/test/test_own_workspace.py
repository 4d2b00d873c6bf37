"""Robots that no scenario names: they stand and work in their own workspace, and are never stopped there."""

from __future__ import annotations

from itertools import islice, pairwise
from pathlib import Path

import numpy as np
import pytest
from command import irsbot

import irsbot_kinematics as irs
from irsbot_msgs_py.records import Level
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.sim.closed_loop import cycles
from irsbot_supervisor.sim.errors import BadScenario, BadSetting
from irsbot_supervisor.sim.own_workspace import cycle_of, is_shipped, start_of
from irsbot_supervisor.sim.scenario_file import read_scenario
from irsbot_supervisor.sim.simulation import STANDING, build, simulation_from

PRR3 = Path(__file__).parents[4] / "docs" / "examples" / "prr3" / "prr3.yaml"

PRINTED = "mechanism: five_bar\ngeometry: {l1: 0.25, l2: 0.40, b: 0.10}\n"
"""The lengths that docs/reference/mechanisms.md prints for a machine of one's own."""


@pytest.fixture
def mine(tmp_path: Path) -> str:
    file = tmp_path / "mine.yaml"
    file.write_text(PRINTED)
    return str(file)


@pytest.mark.parametrize("name", irs.robots())
def test_every_robot_has_a_start_and_a_cycle_that_keep_its_stop_limits(name: str) -> None:
    """The margins are asked of the robot at poses of the cycle, in between too."""
    settings, robot = read_settings(name)
    start, (there, _back) = cycle_of(robot)
    corners = np.array(start) + np.cumsum([np.zeros(len(start)), *there.points], axis=0)
    assert np.ptp(corners, axis=0).max() >= 0.01 * robot.mechanism.length_m
    for a, b in pairwise(corners):
        for pose in np.linspace(a, b, 50):
            found = robot.mechanism.at(tuple(robot.inverse(pose)), tuple(pose), 0, (0.0, 0.0))
            assert min(found.type1) > settings.type1_stop
            assert found.type2 > settings.type2_stop
            assert not found.constraint <= settings.constraint_stop  # NaN where there is none
    robot.inverse(start_of(robot))


def of_own(name: str, scenario: str) -> tuple[list[Level], float]:
    settings, robot = read_settings(name)
    values = {"velocity_limit": settings.velocity_limit, "deceleration_limit": settings.deceleration_limit}
    simulation = simulation_from({**values, "scenario": scenario, "latency_s": settings.latency_s}, robot)
    done = list(islice(cycles(simulation, robot, settings), 1500))
    return [one.level for one in done[500:]], max(max(map(abs, one.velocity)) for one in done)


@pytest.mark.parametrize("which", ["printed five-bar", "prr3 of the documentation"])
def test_a_robot_of_ones_own_works_and_is_not_stopped(which: str, mine: str) -> None:
    name = mine if which.startswith("printed") else str(PRR3)
    levels, speed = of_own(name, "pick_and_place")
    assert set(levels) <= {Level.OK, Level.WARN}
    assert speed > 0.0
    levels, speed = of_own(name, STANDING)
    assert set(levels) == {Level.OK}
    assert speed == 0.0


def test_only_the_shipped_robot_of_a_name_takes_the_numbers_of_a_scenario(tmp_path: Path) -> None:
    file = tmp_path / "five_bar.yaml"
    file.write_text(PRINTED)
    other, shipped = irs.load_robot(file), irs.make_robot("five_bar")
    assert (is_shipped(shipped), is_shipped(other)) == (True, False)
    assert read_scenario("pick_and_place", shipped).start == (-0.1525, -0.85)
    assert read_scenario("pick_and_place", other).start == cycle_of(other)[0]


def test_a_robot_without_a_good_posture_is_refused_in_one_sentence(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(PRINTED + "supervision: {type1_stop: 1.0, type1_warn: 1.0}\n")
    with pytest.raises(BadScenario, match="mine: no posture keeps the stop limits"):
        start_of(irs.load_robot(file))


def test_gated_joints_take_any_scenario_that_only_waits(tmp_path: Path) -> None:
    robot = irs.make_robot("irsbot2")
    waiting = tmp_path / "waiting.yaml"
    waiting.write_text("expect: {stop: false}\nrobots: {irsbot2: {start: [0.1, -0.8]}}\nrun: [{wait: 1.0}]\n")
    drives = {"velocity_limit": [1.0], "deceleration_limit": [1.0], "gated": True}
    machine, _ = build(simulation_from({**drives, "scenario": str(waiting)}, robot), robot)
    assert machine.drives.now.position == pytest.approx(robot.inverse((0.1, -0.8)).tolist())
    with pytest.raises(BadSetting, match="gated joints move by command alone"):
        build(simulation_from({**drives, "scenario": "pick_and_place"}, robot), robot)
    refused = irsbot("up", "--gate", "--scenario", "pick_and_place")
    assert (refused.code, refused.refusal.startswith("irsbot: with --gate the joints move by command alone")) == (
        2,
        True,
    )
