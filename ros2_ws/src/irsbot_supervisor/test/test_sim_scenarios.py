"""Shipped scenarios lead where they say, for every robot they name; wrong ones are refused with a sentence."""

from __future__ import annotations

import contextlib
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from irsbot_kinematics import NotAssembled, Robot, make_robot
from irsbot_msgs_py.records import Cause, JointSample, Level
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.sim.errors import BadScenario, BadSetting
from irsbot_supervisor.sim.scenario_file import read_scenario, scenario_names, scenario_robots
from irsbot_supervisor.sim.scenarios import Wait, plan
from irsbot_supervisor.sim.simulation import Simulation, build, simulation_from
from irsbot_supervisor.sim.stop_response import StopResponse
from irsbot_supervisor.trajectory.joint_path import JointLimits

MS = 1_000_000
BEGIN_NS = 10**15
SHIPPED = [(name, robot) for name in scenario_names() for robot in scenario_robots(name)]
CYCLE_S = 0.8
IRSBOT2 = make_robot("irsbot2")
LIMITS = JointLimits((12.0, 12.0), (400.0, 400.0), (400.0, 400.0))


def shipped(name: str, robot: str):
    """Settings, robot, simulation, machine and scenario as the node makes them."""
    settings, machine_robot = read_settings(robot)
    values = {
        "robot": robot,
        "scenario": name,
        "cycle_s": CYCLE_S,
        "velocity_limit": settings.velocity_limit,
        "deceleration_limit": settings.deceleration_limit,
    }
    simulation = simulation_from(values, machine_robot)
    machine, scenario = build(simulation, machine_robot)
    return settings, machine_robot, simulation, machine, scenario


def periods(simulation, robot, scenario) -> int:
    """Milliseconds until the motion is over."""
    limits = JointLimits(simulation.velocity_limit, simulation.acceleration_limit, simulation.deceleration_limit)
    return round(plan(scenario, robot.mechanism, limits, seconds=CYCLE_S).duration_s * 1e3) + 10


def smallest_margins(robot, joints: np.ndarray) -> np.ndarray:
    """The smallest margin of each posture, over its stop limit's kind: Type 1, Type 2, constraint (N, 3). The branch of
    the first posture is followed where labels do not hold."""
    if not robot.mechanism.label_is_invariant:
        at, rows = robot.posture(joints[0]), []
        for q in joints.tolist():
            at = robot.mechanism.track(tuple(q), at)
            solved = at.status == 0
            constraint = np.inf if np.isnan(at.constraint) else at.constraint
            rows.append((min(at.type1), at.type2, constraint) if solved else (0.0, 0.0, 0.0))
        return np.array(rows)
    found = robot.evaluate_many(joints)
    constraint = np.where(np.isnan(found.constraint_margin), np.inf, found.constraint_margin)
    margins = np.column_stack([found.type1_margin.min(axis=1), found.type2_margin, constraint])
    return np.where(found.status[:, None] == 0, margins, 0.0)


def limits(settings, which: str) -> np.ndarray:
    return np.array([getattr(settings, f"{kind}_{which}") for kind in ("type1", "type2", "constraint")])


# --- what is shipped --------------------------------------------------------------------------------------------


def test_the_scenarios_that_the_documentation_names_are_shipped():
    assert {"pick_and_place", "workspace_boundary", "type2", "constraint", "demo"} <= set(scenario_names())


@pytest.mark.parametrize(("name", "robot"), SHIPPED)
def test_without_supervision_a_scenario_reaches_its_singularity(name, robot):
    settings, machine_robot, simulation, machine, scenario = shipped(name, robot)
    readings = [machine.step(simulation.period_s, 1.0) for _ in range(periods(simulation, machine_robot, scenario))]
    margins = smallest_margins(machine_robot, np.array([reading.position for reading in readings]))
    rates = np.array([reading.velocity for reading in readings])
    speeds = np.abs(rates).max(axis=1)
    if scenario.expect.stop:
        crossed = (margins < limits(settings, "stop")).any(axis=1)
        assert crossed.any(), "nothing would have to be stopped"
        assert speeds[int(np.argmax(crossed))] > 0.3 * max(settings.velocity_limit), "the approach is not at speed"
        assert (margins[0] > limits(settings, "warn")).all(), "it begins too close"
    else:
        assert (margins > limits(settings, "warn")).all()
        effort = np.abs(np.diff(rates, axis=0)).max() / simulation.period_s / max(simulation.acceleration_limit)
        assert max(speeds.max() / max(settings.velocity_limit), effort) > 0.3 or name == "stand"


@pytest.mark.parametrize(
    ("name", "robot"), [(name, robot) for name in scenario_names() for robot in scenario_robots(name)[:5]]
)
def test_supervised_a_scenario_ends_as_it_must(name, robot):
    """Joints and supervisor in a loop: the verdict of a sample is obeyed in the next period."""
    settings, machine_robot, simulation, machine, scenario = shipped(name, robot)
    supervisor, stop_response = Supervisor(settings, machine_robot), StopResponse(simulation.verdict_timeout_s)
    joints, stop = [], None
    for k in range(periods(simulation, machine_robot, scenario) + 500):
        now = BEGIN_NS + k * MS
        reading = machine.step(simulation.period_s, stop_response.allowed(now))
        joints.append(machine.drives.now.position)
        verdict = supervisor.step(JointSample(now, now, now, simulation.joint_names, *reading)).verdict
        if verdict is None:
            continue
        stop_response.hear(verdict.level, verdict.speed_scale, now)
        moved = np.ptp(np.array(joints), axis=0).max() > 0.1
        if verdict.level >= Level.STOP and moved:
            stop = stop or verdict
            if machine.drives.stands:
                break
    assert np.ptp(np.array(joints), axis=0).max() > 0.1 or name == "stand", "the joints never moved"
    assert (smallest_margins(machine_robot, np.array(joints)) >= limits(settings, "stop")).all()
    if scenario.expect.stop:
        assert stop is not None
        assert stop.causes & scenario.expect.causes
        assert machine.drives.stands
    else:
        assert stop is None


@pytest.mark.parametrize("name", scenario_names())
def test_a_shipped_scenario_can_be_read_by_people(name):
    scenario = read_scenario(name)
    assert 10 < len(scenario.description) < 100
    assert scenario.robot == scenario_robots(name)[0]


def test_the_pick_and_place_cycle_is_25_305_25_mm():
    motion = plan(read_scenario("pick_and_place"), IRSBOT2.mechanism, LIMITS, seconds=1.0)
    times = np.linspace(0.0, motion.duration_s, 4000)
    poses = IRSBOT2.evaluate_many(np.array([motion.at(t).position for t in times])).pose
    assert np.ptp(poses, axis=0) == pytest.approx([0.305, 0.025], abs=1e-5)


def test_a_cycle_is_repeated_as_often_as_fits_and_at_least_once():
    scenario = read_scenario("pick_and_place")
    once, many = (plan(scenario, IRSBOT2.mechanism, LIMITS, seconds=seconds) for seconds in (0.01, 10.0))
    assert many.duration_s == pytest.approx(round(many.duration_s / once.duration_s) * once.duration_s)
    assert 10.0 - once.duration_s < many.duration_s <= 10.0
    assert plan(scenario, IRSBOT2.mechanism, LIMITS).duration_s == float("inf")


def test_slower_is_longer():
    scenario = read_scenario("type2")
    robot = make_robot(scenario.robot)
    fast, slow = (plan(scenario, robot.mechanism, LIMITS, speed=speed).duration_s for speed in (1.0, 0.1))
    assert slow - 0.2 == pytest.approx(10.0 * (fast - 0.2))  # 0.2 s of standing do not scale


# --- what is refused --------------------------------------------------------------------------------------------

GOOD = {
    "description": "d",
    "expect": {"stop": False},
    "robots": {"irsbot2": {"start": [0.0, -0.8]}},
    "cycle": [{"by": [[0.1, 0.0]]}, {"to": [[0.0, -0.8]]}],
}


def written(folder: Path, **changes) -> str:
    path = folder / "mine.yaml"
    path.write_text(yaml.safe_dump({**GOOD, **changes}), encoding="utf-8")
    return str(path)


def test_a_user_s_scenario_file_is_driven(tmp_path):
    scenario = read_scenario(written(tmp_path, faults="nan:count=1"))
    assert scenario.name == "mine"
    assert scenario.faults == "nan:count=1"
    motion = plan(scenario, IRSBOT2.mechanism, LIMITS, seconds=0.1)
    assert motion.duration_s > 0.0


def test_a_robot_in_space_is_driven_like_one_in_a_plane(tmp_path):
    up_over_down = [{"by": [[0.0, 0.0, 0.025], [0.305, 0.0, 0.0], [0.0, 0.0, -0.025]], "rounding_m": 0.02}]
    back = [{"to": [[-0.15, 0.1, 0.2]]}]
    path = written(tmp_path, robots={"orthoglide": {"start": [-0.15, 0.1, 0.2]}}, cycle=up_over_down + back)
    robot = make_robot("orthoglide")
    slides = JointLimits((3.0,) * 3, (30.0,) * 3, (30.0,) * 3)
    motion = plan(read_scenario(path), robot.mechanism, slides, seconds=0.1)
    joints = np.array([motion.at(t).position for t in np.linspace(0.0, motion.duration_s, 2000)])
    poses = robot.evaluate_many(joints).pose
    assert np.ptp(poses, axis=0) == pytest.approx([0.305, 0.0, 0.025], abs=1e-5)
    assert poses[-1] == pytest.approx([-0.15, 0.1, 0.2])


def test_motion_beyond_the_range_of_a_joint_is_refused(tmp_path):
    path = written(
        tmp_path, robots={"orthoglide": {"start": [0.0, 0.0, 0.0]}}, cycle=[{"to": [[-1.2, 1.2, 1.2]]}], run=None
    )
    robot = make_robot("orthoglide")
    with pytest.raises(BadScenario, match=r"cycle\[0\]: slide_\d moves over .* m, it is free in 0..4"):
        plan(read_scenario(path), robot.mechanism, JointLimits((3.0,) * 3, (30.0,) * 3, (30.0,) * 3))


def test_a_robot_may_have_its_own_pieces_and_expectation(tmp_path):
    own = {
        "start": [0.1, -0.7],
        "expect": {"stop": True, "causes": ["TYPE1"], "unknown": False},
        "cycle": [{"wait": 1.0}],
    }
    scenario = read_scenario(written(tmp_path, robots={"irsbot2": own}))
    assert scenario.expect.stop
    assert scenario.expect.causes == Cause.TYPE1
    assert scenario.expect.unknown is False
    assert len(scenario.cycle) == 1


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"expext": 1}, "unknown key 'expext'; known are"),
        ({"robots": {}}, "robots must name"),
        ({"robots": {"irsbot2": {"strat": [0.0, 0.0]}}}, "unknown key 'strat'"),
        ({"robots": {"irsbot2": {}}}, "needs start"),
        ({"cycle": None}, "needs start, and cycle or run"),
        ({"expect": {"stop": "yes"}}, "expect.stop must be true or false, got 'yes'"),
        ({"expect": None}, "expected a mapping with the keys causes, stop, unknown"),
        ({"expect": {"stop": False, "unknown": "no"}}, "expect.unknown must be true or false, got 'no'"),
        ({"expect": {"stop": True, "causes": ["TYPE3"]}}, "no cause 'TYPE3'; known are NONE, TYPE1"),
        ({"cycle": [{"by": [[0.1, 0.0]], "to": [[0.0, 0.0]]}]}, r"cycle\[0\]: a piece has exactly one of by, to"),
        ({"expect": {"stop": True, "causes": "TYPE2"}}, r"expect.causes must be a list of names .*, got 'TYPE2'"),
        ({"expect": {"stop": True, "causes": 5}}, "expect.causes must be a list"),
        ({"expect": {"stop": True, "causes": [["TYPE2"]]}}, "expect.causes must be a list"),
        ({"robots": {2: {"start": [0.0, -0.8]}}}, "robots must name"),
        ({"cycle": [{"by": [[0.1, 0.0]], "sped": 1.0}]}, "unknown key 'sped'"),
        ({"cycle": [{"by": [[0.1, "x"]]}]}, r"by\[0\]: expected a number, got 'x'"),
        ({"cycle": [{"wait": -1.0}]}, "wait: expected a positive number, got -1.0"),
        ({"cycle": {"wait": 1.0}}, "expected a list of pieces"),
        ({"seconds": float("nan")}, "seconds: expected a positive number, got nan"),
        ({"run": [{"swing_to": [0.0, -0.8], "working_mode": [1, 2]}]}, "list of 1 and -1"),
        ({"faults": "nam"}, "faults: no fault 'nam'"),
    ],
)
def test_a_scenario_that_cannot_be_read_is_refused(tmp_path, changes, reason):
    with pytest.raises(BadScenario, match=reason):
        read_scenario(written(tmp_path, **changes))


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"cycle": [{"wait": 0.0}]}, "the cycle takes no time"),
        ({"cycle": [{"by": [[0.1, 0.0]]}]}, r"the cycle ends .* from where it begins"),
        ({"cycle": [{"by": [[0.1, 0.0, 0.0]]}]}, r"cycle\[0\]: a pose is x \[m\], z \[m\]"),
        ({"run": [{"to": [[0.0, -1.25]]}]}, r"run\[0\]: the path leaves the workspace"),
        ({"run": [{"swing_to": [0.0, -1.25]}]}, r"run\[0\]: pose \(0.0, -1.25\) is unreachable by 50.1 mm"),
        ({"run": [{"swing_to": [0.0, -0.8], "working_mode": [1, 1, 1]}]}, "working mode"),
        ({"run": [{"to": [[0.1, -0.8]], "speed": 1.5}]}, r"speed must be in \(0, 1\], got 1.5"),
        ({"robots": {"irsbot2": {"start": [0.0, -2.0]}}}, "start: pose .* is unreachable"),
    ],
)
def test_a_scenario_that_cannot_be_driven_is_refused(tmp_path, changes, reason):
    scenario = read_scenario(written(tmp_path, **changes))
    with pytest.raises(BadScenario, match=reason):
        plan(scenario, IRSBOT2.mechanism, LIMITS)


def test_an_unknown_scenario_robot_or_file_is_refused_with_the_known_names(tmp_path):
    with pytest.raises(BadScenario, match=r"no scenario 'pick'; known are .*pick_and_place"):
        read_scenario("pick")
    with pytest.raises(BadScenario, match="has no robot 'five_bar'; it has irsbot2_beta45"):
        read_scenario("type2", make_robot("five_bar"))
    with pytest.raises(BadScenario, match="No such file"):
        read_scenario(str(tmp_path / "none.yaml"))
    (tmp_path / "bad.yaml").write_text("a: [", encoding="utf-8")
    with pytest.raises(BadScenario, match="not YAML"):
        read_scenario(str(tmp_path / "bad.yaml"))


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"robto": "x"}, "no setting 'robto'; known are"),
        ({"velocity_limit": (1.0, 2.0, 3.0)}, "velocity_limit has 3 values, must have 2"),
        ({"velocity_limit": ()}, "velocity_limit has 0 values"),
        ({"joint_names": ("a", "a")}, "2 different names"),
        ({"rate_hz": 0.0}, "rate_hz is 0.0, must be in 1..20000"),
        ({"rate_hz": float("nan")}, "rate_hz is nan"),
        ({"speed": 2.0}, "speed is 2.0"),
        ({"listeners": -1}, "listeners is -1"),
        ({"start_delay_s": float("inf")}, "start_delay_s"),
    ],
)
def test_a_simulation_that_cannot_be_is_refused(values, reason):
    with pytest.raises(BadSetting, match=reason):
        simulation_from({"velocity_limit": (12.0,), "deceleration_limit": (400.0,), **values}, IRSBOT2)


def test_one_limit_serves_all_joints_and_acceleration_is_that_of_the_brakes():
    simulation = simulation_from({"velocity_limit": (12.0,), "deceleration_limit": (400.0,)}, IRSBOT2)
    assert simulation.velocity_limit == (12.0, 12.0)
    assert simulation.acceleration_limit == (400.0, 400.0)
    assert simulation.joint_names == ("joint_1", "joint_2")
    assert isinstance(simulation, Simulation)


@pytest.mark.parametrize("name", ["irsbot2", "rrr3_base", "triaglide"])
def test_a_start_in_another_assembly_mode_than_the_configured_one_is_refused(name: str) -> None:
    """The supervisor would take the robot for somewhere else and let it drive through Type 2."""
    robot = make_robot(name)
    shipped = read_scenario("pick_and_place", robot)
    plan(shipped, robot.mechanism, _limits_of(robot), seconds=0.1)
    joints = robot.inverse(shipped.start)
    others = {}
    for mode in robot.mechanism.assembly_modes:
        with contextlib.suppress(NotAssembled):
            if mode != robot.mechanism.usual_assembly_mode:
                others[mode] = robot.evaluate(joints, mode)
    assert others, "one assembly mode: the fixture proves nothing"
    for mode, other in others.items():
        moved = replace(shipped, start=other.pose, working_mode=other.working_mode, cycle=(), run=(Wait(0.0),))
        with pytest.raises(
            BadScenario, match=rf"start: the pose .* is in assembly mode {re.escape(f'{mode:+d}')}, the robot"
        ):
            plan(moved, robot.mechanism, _limits_of(robot))


def _limits_of(robot: Robot) -> JointLimits:
    n = len(robot.mechanism.joints)
    return JointLimits((3.0,) * n, (30.0,) * n, (30.0,) * n)
