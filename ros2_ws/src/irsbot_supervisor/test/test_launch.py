"""What the launch file makes of its arguments, with a stand-in for `launch` and `launch_ros`, which have no wheels:
nodes are recorded, not started."""

from __future__ import annotations

import runpy
import signal
import subprocess
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from irsbot_supervisor.nodes.launch_arguments import ARGUMENTS, BadArgument, NodeEnded, ended, given

FILE = Path(__file__).parents[1] / "launch" / "supervision.launch.py"


class FakeLaunch:
    """The part of launch and launch_ros that the file uses."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, **told: str) -> None:
        self.nodes: list[dict[str, Any]] = []
        told = {**{name: value for name, value, _text in ARGUMENTS}, **told}

        def configuration(name: str) -> SimpleNamespace:
            return SimpleNamespace(perform=lambda _context: told[name])

        modules: dict[str, dict[str, Any]] = {
            "launch": {"LaunchContext": object, "LaunchDescription": list},
            "launch.actions": {
                "DeclareLaunchArgument": lambda name, default_value, description: name,
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
        make(SimpleNamespace())

    def node(self, name: str) -> dict[str, Any]:
        (found,) = [node for node in self.nodes if node["executable"] == f"{name}_node"]
        return found


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
        assert node["respawn"] is (node["executable"] != "supervisor_node")  # which comes back otherwise
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
    for node in FakeLaunch(monkeypatch).nodes:
        assert node["respawn"] is False
        assert "use_sim_time" not in node["parameters"][-1]


def test_a_node_that_refuses_its_parameters_ends_the_launch_with_an_error(monkeypatch: pytest.MonkeyPatch):
    on_exit = FakeLaunch(monkeypatch).node("supervisor")["on_exit"]
    with pytest.raises(NodeEnded, match="supervisor refused"):
        on_exit(SimpleNamespace(returncode=2), SimpleNamespace(is_shutdown=False))
    on_exit(SimpleNamespace(returncode=2), SimpleNamespace(is_shutdown=True))
    ended("recorder", 0, False)


def test_a_supervisor_that_is_respawned_starts_latched_each_time(monkeypatch: pytest.MonkeyPatch):
    launch = FakeLaunch(monkeypatch, respawn="true", robot="five_bar", params_file=str(FILE))
    node, running = launch.node("supervisor"), SimpleNamespace(is_shutdown=False)
    assert "start_latched" not in node["parameters"][-1]
    for code in (-9, 0, 1):
        (later,) = node["on_exit"](SimpleNamespace(returncode=code), running)
        assert later.period == 1.0
        again = launch.nodes[-1]
        assert again["parameters"][-1] == {"robot": "five_bar", "start_latched": True}
        assert {k: v for k, v in again.items() if k not in ("parameters", "on_exit")} == {
            k: v for k, v in node.items() if k not in ("parameters", "on_exit")
        }
        node = again
    assert node["on_exit"](SimpleNamespace(returncode=0), SimpleNamespace(is_shutdown=True)) == []
    left = FakeLaunch(monkeypatch).node("supervisor")
    assert left["on_exit"](SimpleNamespace(returncode=-9), running) == []


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
    assert done.stderr.splitlines() == [f"the Python library '{library}' is missing: install it, as the README says"]
