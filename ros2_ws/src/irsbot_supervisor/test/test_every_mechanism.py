"""Every robot in a closed loop: stopped in front of a singularity, and UNKNOWN where its data cannot be believed."""

from __future__ import annotations

from functools import cache
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

import irsbot_kinematics as irs
from irsbot_kinematics import Status
from irsbot_msgs_py.records import Cause, Level
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.core.margins import margins_of
from irsbot_supervisor.core.stopping import limits_of
from irsbot_supervisor.sim.closed_loop import Cycle, cycles
from irsbot_supervisor.sim.scenario_file import read_scenario, scenario_names, scenario_robots
from irsbot_supervisor.sim.simulation import simulation_from

EXAMPLE = Path(__file__).parents[4] / "docs" / "examples" / "prr3"
OWN = str(EXAMPLE / "prr3.yaml")
"""A mechanism that no package knows."""
FIRST = ("demo", "type2", "constraint", "workspace_boundary")
CYCLE_S, MOST_MS, STANDING_MS = 0.5, 8000, 200
every_robot = pytest.mark.parametrize("name", [*irs.robots(), OWN], ids=[*irs.robots(), "prr3 of the documentation"])


def scenario_of(name: str) -> str:
    """One that leads the robot at a singularity."""
    if name == OWN:
        return str(EXAMPLE / "approach.yaml")
    return next(one for one in FIRST if name in scenario_robots(one))


@cache
def machine(name: str):
    settings, robot = read_settings(name)
    values = {
        "robot": name,
        "scenario": scenario_of(name),
        "cycle_s": CYCLE_S,
        "velocity_limit": settings.velocity_limit,
        "deceleration_limit": settings.deceleration_limit,
        "latency_s": settings.latency_s,
    }
    return settings, robot, simulation_from(values, robot)


def run(name: str, faults: str | None = None) -> list[Cycle]:
    """Until the robot has been at rest for a while after work has begun, or for MOST_MS."""
    settings, robot, simulation = machine(name)
    done: list[Cycle] = []
    rest = 0
    for cycle in islice(cycles(simulation, robot, settings, faults), MOST_MS):
        done.append(cycle)
        halted = any(one.level < Level.STOP for one in done[:200]) and cycle.level >= Level.STOP
        rest = rest + 1 if halted and not any(cycle.velocity) and len(done) > 200 else 0
        if rest > STANDING_MS:
            break
    return done


def test_every_shipped_scenario_at_a_singularity_is_covered():
    assert set(FIRST) == {one for one in scenario_names() if read_scenario(one).expect.stop}


@every_robot
def test_a_run_at_a_singularity_is_stopped_in_time(name):
    settings, robot, _simulation = machine(name)
    done = run(name)
    assert done[-1].level == Level.STOP
    assert not any(done[-1].velocity)
    fastest = max(max(map(abs, cycle.velocity)) / settings.velocity_limit[0] for cycle in done)
    assert fastest > 0.3, "it never moved: the test proves nothing"
    mechanism, stop = robot.mechanism, np.array(limits_of(settings, "stop"))
    at = mechanism.posture(done[0].position, mechanism.usual_assembly_mode)
    for cycle in done:
        at = mechanism.track(cycle.position, at)
        assert at.status == Status.SOLVED
        assert (np.array(margins_of(at)) >= stop).all()
    limbs = mechanism.limb_count
    states = [state for cycle in done for state in cycle.states]
    assert {len(state.limb_margin) for state in states} == {limbs}
    assert not limbs or all(0.0 < min(state.limb_margin) <= 1.0 for state in states)
    assert not limbs or settings.limb_stop > 0.0
    causes = 0
    for cycle in done:
        for verdict in cycle.verdicts:
            causes |= int(verdict.causes) if verdict.latched else 0
    assert causes & (Cause.TYPE1 | Cause.TYPE2 | Cause.CONSTRAINT | Cause.LIMB)


@every_robot
@pytest.mark.parametrize("fault", ["nan", "freeze"])
def test_false_data_end_in_unknown_and_a_standing_robot(name, fault):
    done = run(name, f"{fault}:at=0.4")  # all move by then; a reading frozen at rest cannot be told from a rest
    before = [cycle.level for cycle in done[200:395]]
    assert set(before) <= {Level.OK, Level.WARN}, "work has not begun: the test proves nothing"
    assert done[-1].level == Level.UNKNOWN
    assert not any(done[-1].velocity)
    settings, robot, _simulation = machine(name)
    known = next(i for i, cycle in enumerate(done[400:]) if cycle.level == Level.UNKNOWN)
    assert known <= 60 if fault == "nan" else known <= 200, f"UNKNOWN only {known} ms after the fault"
    at = robot.mechanism.posture(done[0].position, robot.mechanism.usual_assembly_mode)
    for cycle in done:
        at = robot.mechanism.track(cycle.position, at)
    assert (np.array(margins_of(at)) >= np.array(limits_of(settings, "stop"))).all()
    judged = [state for cycle in done[405:] for state in cycle.states]
    if fault == "nan":
        assert {state.level for state in judged} == {Level.UNKNOWN}


def test_the_robots_with_limb_margins_are_those_of_the_paper_and_those_whose_legs_fold_or_shrink():
    with_limbs = {n for n in irs.robots() if irs.make_robot(n).mechanism.limb_count}
    assert with_limbs == {"orthoglide", "ruu4", "rrr3", "rpr3", "rails2"}
