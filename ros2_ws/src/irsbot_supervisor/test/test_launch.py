"""What the launch file makes of its arguments, with a stand-in for `launch` and `launch_ros`, which have no wheels:
nodes are recorded, not started."""

from __future__ import annotations

import re
import runpy
import signal
import subprocess
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from irsbot_supervisor.core.settings import InvalidSettings
from irsbot_supervisor.nodes.launch_arguments import ARGUMENTS, BadArgument, NodeEnded, given

ROBOTS = ("kinematics", "supervisor", "simulated_joints")
"""Nodes with the parameter `robot`."""

FILE = Path(__file__).parents[1] / "launch" / "supervision.launch.py"


class FakeLaunch:
    """The part of launch and launch_ros that the file uses."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, around: str = "", **told: str) -> None:
        """around: namespace in which the file is included. told: arguments."""
        self.nodes: list[dict[str, Any]] = []
        told = {**{name: value for name, value, _text in ARGUMENTS}, **told}

        def configuration(name: str) -> SimpleNamespace:
            return SimpleNamespace(perform=lambda _context: told[name])

        modules: dict[str, dict[str, Any]] = {
            "launch": {"LaunchContext": object, "LaunchDescription": list},
            "launch.actions": {
                "DeclareLaunchArgument": lambda name, default_value, description: name,
                "LogInfo": SimpleNamespace,
                "OpaqueFunction": lambda function: function,
                "TimerAction": SimpleNamespace,
            },
            "launch.substitutions": {"LaunchConfiguration": configuration},
            "launch_ros": {},
            "launch_ros.actions": {"Node": lambda **fields: self.nodes.append(fields)},
        }
        for name, members in modules.items():
            module = ModuleType(name)
            module.__dict__.update(members)
            monkeypatch.setitem(sys.modules, name, module)
        *self.declared, make = runpy.run_path(str(FILE))["generate_launch_description"]()
        make(SimpleNamespace(launch_configurations={"ros_namespace": around} if around else {}))

    def node(self, name: str) -> dict[str, Any]:
        (found,) = [node for node in self.nodes if node["executable"] == f"{name}_node"]
        return found

    def parameters(self, name: str) -> dict[str, Any]:
        """What the launch file sets beside the file of parameters."""
        set_here = [given for given in self.node(name)["parameters"] if not isinstance(given, str)]
        assert {} not in set_here  # which would be a file without parameters
        return dict(*set_here)


def names(launch: FakeLaunch) -> list[str]:
    return sorted(node["executable"].removesuffix("_node") for node in launch.nodes)


@pytest.mark.parametrize("word", ["true", "True", "TRUE", "yes", "on", "1"])
def test_every_word_for_true_gates_the_joints(monkeypatch: pytest.MonkeyPatch, word: str):
    joints = FakeLaunch(monkeypatch, gate=word).node("simulated_joints")
    assert ("joint_velocity", "velocity_out") in joints["remappings"]
    assert ("joint_trajectory", "command_out") in joints["remappings"]
    assert joints["parameters"][-1]["gated"] is True
    assert joints["parameters"][-1]["scenario"] == "stand"  # gated joints move by command alone


@pytest.mark.parametrize("word", ["false", "False", "no", "off", "0"])
def test_every_word_for_false_leaves_them_free_and_leaves_nodes_out(monkeypatch: pytest.MonkeyPatch, word: str):
    joints = FakeLaunch(monkeypatch, gate=word).node("simulated_joints")
    assert joints["remappings"] == []
    assert joints["parameters"][-1]["gated"] is False
    assert names(FakeLaunch(monkeypatch, simulate=word, record=word)) == ["kinematics", "supervisor"]


def test_every_node_gets_the_given_arguments(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    file = tmp_path / "mine.yaml"
    file.write_text("/**: {ros__parameters: {type2_stop: 0.2}}\n")
    told = {
        "params_file": str(file),
        "use_sim_time": "yes",
        "log_level": "DEBUG",
        "respawn": "true",
        "namespace": "left",
    }
    launch = FakeLaunch(monkeypatch, robot="five_bar", **told)
    assert names(launch) == ["kinematics", "recorder", "simulated_joints", "supervisor"]
    for node in launch.nodes:
        assert node["parameters"][0] == str(file)
        assert node["parameters"][-1]["use_sim_time"] is True
        assert node["ros_arguments"] == ["--log-level", "debug"]
        assert node["namespace"] == "left"
    assert launch.node("supervisor")["parameters"][-1]["robot"] == "five_bar"
    assert {"params_file", "use_sim_time", "log_level", "respawn"} <= set(launch.declared)


def test_topics_of_controllers_can_be_named(monkeypatch: pytest.MonkeyPatch):
    told = {"command_out": "/jtc/joint_trajectory", "joint_states": "/joint_states", "gate": "true"}
    launch = FakeLaunch(monkeypatch, **told)
    named = [("joint_states", "/joint_states"), ("command_out", "/jtc/joint_trajectory")]
    assert launch.node("supervisor")["remappings"] == named
    assert set(named) <= set(launch.node("recorder")["remappings"])
    assert ("joint_trajectory", "/jtc/joint_trajectory") in launch.node("simulated_joints")["remappings"]
    assert FakeLaunch(monkeypatch).node("supervisor")["remappings"] == []


def test_by_default_nothing_is_respawned_and_the_file_of_parameters_keeps_its_time(monkeypatch: pytest.MonkeyPatch):
    launch = FakeLaunch(monkeypatch)
    for node in launch.nodes:
        name = node["executable"].removesuffix("_node")
        assert "use_sim_time" not in launch.parameters(name)
        assert not [action for action in ends(node, -9) if hasattr(action, "period")]


def test_a_node_that_refuses_its_parameters_ends_the_launch_with_an_error(monkeypatch: pytest.MonkeyPatch):
    on_exit = FakeLaunch(monkeypatch).node("supervisor")["on_exit"]
    with pytest.raises(NodeEnded, match="supervisor refused"):
        on_exit(SimpleNamespace(returncode=2), SimpleNamespace(is_shutdown=False))
    on_exit(SimpleNamespace(returncode=2), SimpleNamespace(is_shutdown=True))


def ends(node: dict[str, Any], code: int, asked: bool = False) -> list[SimpleNamespace]:
    """The actions that follow the end of a node."""
    return node["on_exit"](SimpleNamespace(returncode=code), SimpleNamespace(is_shutdown=asked))


@pytest.mark.parametrize("name", ["recorder", "kinematics"])
@pytest.mark.parametrize("respawn", ["true", "false"])
def test_supervision_goes_on_without_a_bystander_that_cannot_start(
    monkeypatch: pytest.MonkeyPatch, name: str, respawn: str
):
    (told,) = ends(FakeLaunch(monkeypatch, respawn=respawn).node(name), 2)
    assert f"{name} ended with exit code 2" in told.msg


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("supervisor", {"start_latched": True}),
        ("recorder", {"numbered": True, "output": "run"}),
        ("kinematics", {}),
        ("simulated_joints", {"gated": False}),
    ],
)
def test_a_node_that_is_respawned_starts_as_before_but_latched_and_with_a_bag_of_its_own(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, name: str, changes: dict[str, Any]
):
    launch = FakeLaunch(monkeypatch, respawn="true", robot="five_bar", params_file=five_bar(tmp_path), output="run")
    node = launch.node(name)
    assert not {"start_latched", "numbered"} & set(launch.parameters(name))
    robot = {} if name == "recorder" else {"robot": "five_bar"}
    for code in (-9, 0, 1):
        (later,) = ends(node, code)
        assert later.period == 1.0
        again = launch.nodes[-1]
        assert again["parameters"][-1] == {**robot, **changes}
        assert {k: v for k, v in again.items() if k not in ("parameters", "on_exit")} == {
            k: v for k, v in node.items() if k not in ("parameters", "on_exit")
        }
        node = again
    assert ends(node, 0, asked=True) == []
    assert not [action for action in ends(FakeLaunch(monkeypatch).node(name), -9) if hasattr(action, "period")]


def five_bar(folder: Path, more: str = "") -> str:
    """A file as `irsbot limits five_bar` writes it, and other sections."""
    file = folder / "mine.yaml"
    file.write_text(f"/**:\n  ros__parameters:\n    robot: five_bar\n    type2_stop: 0.2\n{more}")
    return str(file)


def test_without_an_argument_every_node_gets_the_robot_that_the_file_names_for_one(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    launch = FakeLaunch(monkeypatch, params_file=five_bar(tmp_path))
    assert {launch.parameters(name)["robot"] for name in ROBOTS} == {"five_bar"}
    for section, arguments in (
        ("supervisor", {}),
        ("left: {supervisor", {"namespace": "left"}),
        ("cell: {left: {supervisor", {"namespace": "left", "around": "/cell"}),
        ("left: {supervisor", {"namespace": "/left", "around": "/cell"}),
    ):
        file = tmp_path / "one.yaml"
        file.write_text(f"{section}: {{ros__parameters: {{robot: five_bar}}}}" + "}" * section.count("{"))
        launch = FakeLaunch(monkeypatch, params_file=str(file), **arguments)
        assert {launch.parameters(name)["robot"] for name in ROBOTS} == {"five_bar"}, section
    for name in ROBOTS:
        assert "robot" not in FakeLaunch(monkeypatch).parameters(name)  # every node has the same default


@pytest.mark.parametrize(
    ("more", "arguments", "words"),
    [
        ("", {"robot": "irsbot2"}, ["robot", "'five_bar'", "'irsbot2'"]),
        ("supervisor: {ros__parameters: {robot: irsbot2}}", {}, ["robot", "'five_bar'", "'irsbot2'"]),
        ("supervisor: {ros__parameters: {start_latched: false}}", {"respawn": "true"}, ["start_latched", "False"]),
        ("supervisor: {ros__parameters: {use_sim_time: false}}", {"use_sim_time": "true"}, ["use_sim_time", "False"]),
        ("/**/recorder: {ros__parameters: {output: a}}", {"output": "b"}, ["output", "'a'", "'b'"]),
        ("simulated_joints: {ros__parameters: {gated: true}}", {}, ["gated", "True", "False"]),
        ("simulated_joints: {ros__parameters: {scenario: demo}}", {"gate": "true"}, ["scenario", "'demo'", "'stand'"]),
    ],
)
def test_a_file_that_contradicts_an_argument_or_itself_is_refused(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, more: str, arguments: dict[str, str], words: list[str]
):
    """ROS has no rule for this: a section of one node can win over what the command line sets for all."""
    with pytest.raises(InvalidSettings) as refused:
        FakeLaunch(monkeypatch, params_file=five_bar(tmp_path, more), **arguments)
    assert all(word in str(refused.value) for word in words)


def test_sections_of_other_nodes_are_theirs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    more = "right: {supervisor: {ros__parameters: {robot: irsbot2}}}\ncontroller_manager: {ros__parameters: {robot: 7}}"
    launch = FakeLaunch(monkeypatch, params_file=five_bar(tmp_path, more), robot="five_bar", namespace="left")
    assert launch.parameters("supervisor") == {"robot": "five_bar"}


@pytest.mark.parametrize(
    ("told", "stated"),
    [
        ({"gate": "maybe"}, "gate:=maybe must be true or false"),
        ({"log_level": "loud"}, "log_level:=loud must be one of debug"),
        ({"params_file": "/nowhere.yaml"}, "params_file:=/nowhere.yaml is no file"),
    ],
)
def test_an_argument_that_means_nothing_is_refused(told: dict[str, str], stated: str):
    defaults = {name: value for name, value, _text in ARGUMENTS}
    with pytest.raises(BadArgument, match=stated):
        given({**defaults, **told})


LOADING = """
import sys
from importlib.abc import MetaPathFinder

class Slow(MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name == "{library}":
            {then}

sys.meta_path.insert(0, Slow())
from irsbot_supervisor.executables import recorder
recorder()
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_executable_that_is_asked_to_end_while_it_loads_does_so_quietly(number: signal.Signals):
    then = "print(flush=True); sys.stdin.read()"
    program = LOADING.format(library="rclpy", then=then)
    pipe = subprocess.PIPE
    with subprocess.Popen([sys.executable, "-c", program], stdin=pipe, stdout=pipe, stderr=pipe) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.readline()
        process.send_signal(number)
        assert process.wait(30) == 0
        assert process.stderr.read() == b""


@pytest.mark.parametrize("library", ["mcap", "zstandard"])
def test_an_executable_without_one_of_its_libraries_names_it_in_one_line(library: str):
    then = f"raise ModuleNotFoundError(name='{library}')"
    done = subprocess.run(
        [sys.executable, "-c", LOADING.format(library=library, then=then)], capture_output=True, text=True, timeout=30
    )
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert f"the Python library '{library}' is missing" in line
    (page,) = re.findall(r"docs/\S+\.md", line)
    assert library in (FILE.parents[4] / page).read_text()
