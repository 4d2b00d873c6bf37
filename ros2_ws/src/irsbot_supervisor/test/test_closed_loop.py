"""Robot and supervisor in simulated time: stopped in time, let go on, and the same every time."""

from __future__ import annotations

from itertools import islice, takewhile
from pathlib import Path

import numpy as np
import pytest

from irsbot_msgs_py.records import Cause, Level
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.bag.bag import Bag
from irsbot_supervisor.configuration.loading import read_settings, shipped_values
from irsbot_supervisor.replay.recording import read_recording
from irsbot_supervisor.sim.closed_loop import BEGIN_NS, Cycle, GuidedRobot, cycles, record
from irsbot_supervisor.sim.simulation import Simulation, simulation_from

RATE_HZ = 500.0
TOWARD = {"workspace_boundary": "irsbot2", "type2": "irsbot2_beta45", "constraint": "irsbot2_csc"}
"""Scenarios that run at a limit, and the robot that each is for."""


def run(robot_name: str, scenario: str, seconds: float, faults: str = "", resets_s=(), **changes) -> list[Cycle]:
    """The cycles of some seconds of a scenario."""
    settings, robot = read_settings(robot_name)
    shipped = {name: shipped_values(robot)[name] for name in ("velocity_limit", "deceleration_limit")}
    values = {"robot": robot_name, "scenario": scenario, "rate_hz": RATE_HZ, **shipped, **changes}
    simulation: Simulation = simulation_from(values, robot)
    steps = cycles(simulation, robot, settings, faults, resets_s)
    return list(takewhile(lambda cycle: cycle.now_ns <= BEGIN_NS + seconds * NS_PER_S, steps))


def spare(robot_name: str, steps: list[Cycle]) -> float:
    """Smallest difference between a margin and its stop limit at the true positions; -1 if not assembled."""
    settings, robot = read_settings(robot_name)
    found = robot.evaluate_many(np.array([cycle.position for cycle in steps]))
    if not (found.status == 0).all():
        return -1.0
    rows = [
        found.type1_margin.min(axis=1) - settings.type1_stop,
        found.type2_margin - settings.type2_stop,
        found.constraint_margin - settings.constraint_stop,
    ]
    return float(np.nanmin(rows))


@pytest.mark.parametrize(("scenario", "robot"), TOWARD.items())
def test_a_robot_that_obeys_stands_before_its_stop_limit_and_one_that_does_not_crosses_it(scenario, robot):
    obedient = run(robot, scenario, 1.5)
    assert obedient[-1].level == Level.STOP
    assert not any(obedient[-1].velocity)
    assert spare(robot, obedient) >= 0.0
    assert spare(robot, run(robot, scenario, 1.5, obey=False)) < 0.0


def test_work_continues_without_a_stop():
    steps = run("irsbot2", "pick_and_place", 3.0)
    levels = [cycle.level for cycle in steps]
    first = levels.index(Level.OK)
    assert first < 0.2 * RATE_HZ
    assert max(levels[first:]) == Level.OK
    assert max(abs(v) for cycle in steps[-300:] for v in cycle.velocity) > 4.0  # rad/s: still at work


def test_the_same_simulation_runs_the_same_twice():
    lines = [run("irsbot2", "pick_and_place", 0.6, "loss:share=0.3; noise:sigma=1e-5", seed=7) for _ in range(2)]
    assert repr(lines[0]) == repr(lines[1])
    assert repr(lines[0]) != repr(run("irsbot2", "pick_and_place", 0.6, "loss:share=0.3; noise:sigma=1e-5", seed=8))


def test_without_samples_the_robot_is_braked_and_with_them_it_goes_on():
    steps = run("irsbot2", "pick_and_place", 1.2, "drop:at=0.4,lasting=0.3")
    levels = {round((cycle.now_ns - BEGIN_NS) / NS_PER_S, 3): cycle for cycle in steps}
    assert not levels[0.45].sent
    assert levels[0.45].level == Level.OK  # 50 ms are borne with
    assert levels[0.47].level == Level.UNKNOWN
    assert not any(levels[0.6].velocity)  # 30 ms of braking
    assert steps[-1].level == Level.OK
    assert any(any(cycle.velocity) for cycle in steps[-100:])


def test_a_latched_stop_ends_with_a_reset_alone():
    jump = "glitch:by=0.5,joint=1,at=0.4,lasting=0.2"
    held = run("irsbot2", "pick_and_place", 1.2, jump)
    assert held[-1].level == Level.UNKNOWN
    freed = run("irsbot2", "pick_and_place", 1.2, jump, resets_s=(0.1, 0.9))
    assert freed[-1].level == Level.OK
    assert [len(cycle.resets) for cycle in freed if cycle.resets] == [1, 1]
    events = [verdict.event for cycle in freed for verdict in cycle.verdicts]
    assert max(events) == 1  # the reset at 0.1 s was not kept for later


def test_a_recording_equals_the_run(tmp_path: Path):
    settings, robot = read_settings("irsbot2")
    values = {**shipped_values(robot), "rate_hz": RATE_HZ}
    known = {key: values[key] for key in ("velocity_limit", "deceleration_limit", "rate_hz")}
    simulation = simulation_from(known, robot)
    target = tmp_path / "run.mcap"
    record(cycles(simulation, robot, settings, "", (0.1,)), 0.5, robot, settings, target)
    steps = list(islice(cycles(simulation, robot, settings, "", (0.1,)), round(0.5 * RATE_HZ)))
    recording = read_recording(target)
    assert [one.position for one in recording.samples] == [one.position for step in steps for one in step.sent]
    stated = [(one.sequence, one.level, one.causes, one.text, one.since_ns) for _log, one in recording.verdicts]
    verdicts = [one for step in steps for one in step.verdicts]
    assert stated == [(one.sequence, one.level, one.causes, one.text, one.since_ns) for one in verdicts]
    assert len(recording.journal) == 2  # the settings and the reset
    with Bag(target) as opened:
        names = {topic.name for topic in opened.topics()}
    assert names == {"/joint_states", "/supervisor/journal", "/supervisor/state", "/supervisor/verdict"}
    assert not recording.loss


# --- guided by hand -----------------------------------------------------------------------------------------------


def guided() -> GuidedRobot:
    settings, robot = read_settings("irsbot2")
    return GuidedRobot(robot, settings, tuple(robot.inverse((0.0, -0.85)).tolist()))


def test_a_guided_robot_moves_as_commanded_and_stops_without_a_command():
    robot = guided()
    for _ in range(20):
        robot.drift()
    assert robot.now.level == Level.OK
    for _ in range(10):
        allowed = robot.beat((0.5, -0.5))
    assert allowed.rates == (0.5, -0.5)
    assert robot.drives.now.velocity == pytest.approx((0.5, -0.5))
    for _ in range(20):
        robot.drift()
    assert not any(robot.drives.now.velocity)


def test_a_robot_that_is_rushed_past_the_gate_is_stopped_and_reset_when_it_was_led_out():
    robot = guided()
    for _ in range(20):
        robot.drift()
    for _ in range(100):
        robot.rush((-6.0, 6.0))
        if robot.now.level == Level.STOP:
            break
    assert robot.now.level == Level.STOP
    assert robot.now.causes & Cause.BRAKING
    for _ in range(10):
        robot.drift()
    assert robot.now.latched
    escape = robot.way_out
    for _ in range(150):
        robot.beat(tuple(12.0 * share for share in escape))
    for _ in range(10):
        robot.beat((0.0, 0.0))
    assert robot.reset() == ""
    robot.drift()
    assert robot.now.level <= Level.WARN
