"""What may be imported from `irsbot_supervisor`: names, docstrings, no ROS, nothing loaded before it is asked for."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import json
import subprocess
import sys
from pathlib import Path

import pytest

import irsbot_supervisor
from irsbot_kinematics import BadInput, InvalidGeometry, UnknownRobot, make_robot
from irsbot_supervisor import (
    Bag,
    BagError,
    BagJudgement,
    InvalidSettings,
    JointSample,
    Level,
    Supervisor,
    certify_poses,
    judge_bag,
    read_settings,
)
from irsbot_supervisor.cli.app import main

ROOT = Path(__file__).parents[4]
FIXED = {
    "Supervisor", "read_settings", "settings_from", "JointSample", "Tick", "Reset", "Configure", "Level", "Cause",
    "certify", "certify_poses", "judge_bag",
}  # fmt: skip
"""Names that may not go."""
BAG = ROOT / "bags" / "type2"

needs_bags = pytest.mark.skipif(not BAG.is_dir(), reason="installed without the bags beside it")


def fresh(code: str) -> list[str]:
    """The names of all modules that a fresh interpreter has loaded after some code."""
    done = subprocess.run(
        [sys.executable, "-c", f"import json, sys\n{code}\nprint(json.dumps(sorted(sys.modules)))"],
        capture_output=True, text=True, env={"PYTHONPATH": ":".join(filter(None, sys.path))}, check=True,
    )  # fmt: skip
    return list(json.loads(done.stdout.splitlines()[-1]))


def test_the_fixed_names_are_there_and_every_name_has_a_docstring() -> None:
    names = irsbot_supervisor.__all__
    assert set(names) >= FIXED
    assert len(names) == len(set(names))
    for name in names:
        thing = getattr(irsbot_supervisor, name)
        assert name in dir(irsbot_supervisor)
        doc = inspect.getdoc(thing)
        assert doc, name
        assert not doc.startswith(f"{name}("), name  # what dataclass or NamedTuple write by themselves
    with pytest.raises(AttributeError, match="nonsense"):
        irsbot_supervisor.nonsense  # noqa: B018


def test_type_checkers_and_the_interpreter_are_told_the_same() -> None:
    tree = ast.parse(Path(irsbot_supervisor.__file__).read_text(encoding="utf-8"))
    block = next(node for node in tree.body if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test))
    told = {
        node.module: {alias.name for alias in node.names} for node in block.body if isinstance(node, ast.ImportFrom)
    }
    assert told == {module: set(names) for module, names in irsbot_supervisor._MODULES.items()}
    assert sorted(name for names in told.values() for name in names) == sorted(irsbot_supervisor.__all__)


def test_the_import_alone_loads_nothing_and_no_name_needs_ros() -> None:
    alone = fresh("import irsbot_supervisor")
    assert {name.split(".")[0] for name in alone} & {"numpy", "scipy", "yaml", "irsbot_kinematics"} == set()
    assert [name for name in alone if name.startswith("irsbot_supervisor.")] == []
    every = fresh("from irsbot_supervisor import *")
    assert "irsbot_supervisor.replay.judgement" in every
    ros = ("rclpy", "rcl_interfaces", "sensor_msgs", "irsbot_msgs", "ament_index_python", "launch")
    assert [name for name in every if name.split(".")[0] in ros] == []
    samples = fresh("from irsbot_supervisor import JointSample, Tick")
    assert "numpy" not in samples


def test_settings_take_keywords_over_a_mapping_over_the_shipped_ones() -> None:
    shipped, robot = read_settings("irsbot2")
    found, _ = read_settings("irsbot2", latency_s=0.004)
    assert (found.latency_s, found.type1_stop) == (0.004, shipped.type1_stop)
    assert shipped.latency_s != 0.004
    both, _ = read_settings("irsbot2", {"latency_s": 0.003, "age_limit_s": 0.05}, latency_s=0.004)
    assert (both.latency_s, both.age_limit_s) == (0.004, 0.05)
    of_robot, same = read_settings(robot, latency_s=0.004)
    assert of_robot == found
    assert same is robot
    with pytest.raises(InvalidSettings, match="latency"):
        read_settings("irsbot2", latency_s=-1.0)
    with pytest.raises(InvalidSettings, match="nonsense"):
        read_settings("irsbot2", nonsense=1.0)
    for wrong in (3, None, b"irsbot2"):
        with pytest.raises((BadInput, UnknownRobot, InvalidGeometry)):
            read_settings(wrong)


def test_a_sample_and_a_plan_are_judged_by_public_names_alone() -> None:
    settings, robot = read_settings("irsbot2")
    q = tuple(robot.inverse((0.3, -0.75)).tolist())
    step = Supervisor(settings, robot).step(JointSample(1, 1, 1, settings.joint_names, q))
    assert step.state is not None
    assert step.state.type2_margin == pytest.approx(robot.evaluate(q).type2_margin)
    assert certify_poses(robot, settings, [0.0, 1.0], [(0.3, -0.75), (-0.3, -0.75)]).safe


@needs_bags
def test_a_bag_is_judged_as_the_command_prints_it(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    run = judge_bag(BAG)
    expected = json.loads((BAG / "expected.json").read_text())
    assert run.differences == ()
    assert [interval.level for interval in run.levels if interval.level == Level.STOP]
    assert [interval.event for interval in run.events] == [1]
    assert run.events[0].level == Level.STOP
    assert expected  # the story counts among the checks
    assert "expected story" in {check.name for check in run.checks}
    monkeypatch.setattr(sys, "argv", ["irsbot", "replay", str(BAG), "--json"])
    main()
    printed = json.loads(capsys.readouterr().out)
    plain = json.loads(json.dumps(run.as_json()).replace("NaN", "null"))
    assert printed == plain


@needs_bags
def test_the_smallest_margins_are_those_of_the_recorded_states() -> None:
    """Independent of the replay: read from the states in the bag."""
    run = judge_bag(str(BAG))
    with Bag(BAG) as opened:
        states = [entry.record for entry in opened.records("supervisor/state")]
    first = {margin.margin: margin.value for margin in run.margins}
    known = [state for state in states if state.type2_margin == state.type2_margin]
    assert len(known) > 100
    assert first["type2"] == pytest.approx(min(state.type2_margin for state in known), abs=1e-12)
    assert first["type1"] == pytest.approx(min(min(state.type1_margin) for state in known), abs=1e-12)
    assert first["constraint"] == pytest.approx(min(state.constraint_margin for state in known), abs=1e-12)
    assert "limb" not in first


@needs_bags
def test_robot_and_settings_are_for_bags_that_do_not_say_them(tmp_path: Path) -> None:
    with pytest.raises(BagError, match="joint states alone"):
        judge_bag(BAG, "irsbot2")
    with pytest.raises(BadInput, match="does not exist"):
        judge_bag(tmp_path / "none")
    for wrong in (3, None):
        with pytest.raises(BadInput, match="path"):
            judge_bag(wrong)
    with pytest.raises(BadInput, match="settings"):
        judge_bag(BAG, "irsbot2", 3)


def test_a_judgement_is_a_record() -> None:
    fields = {field.name for field in dataclasses.fields(BagJudgement)}
    assert {"levels", "margins", "measures", "checks", "errors"} <= fields
    assert make_robot("irsbot2").name == "irsbot2"
