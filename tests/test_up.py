"""`up` as a user runs it: which nodes may die, and what is refused before any of them starts."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psutil
import pytest
from command import IRSBOT, PATIENCE_S

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

from irsbot_msgs.srv import EvaluateJoints
from rcl_interfaces.srv import GetParameters, ListParameters

from irsbot_supervisor.cli.app import main
from irsbot_supervisor.cli.up import _parameters
from irsbot_supervisor.configuration.ros_parameter_file import OF_EVERY_NODE, QOS_OVERRIDES, read_parameters
from irsbot_supervisor.nodes.suite import wanted
from irsbot_supervisor.processes.asking import Asking
from irsbot_supervisor.processes.listener import Watch
from irsbot_supervisor.processes.suite import JOINTS, KINEMATICS, RECORDER, SUPERVISOR, TOGETHER, free_domain

pytestmark = [pytest.mark.ros, pytest.mark.slow]


class Up:
    """A running suite and a look at its verdicts."""

    def __init__(self, process: subprocess.Popen[str], watch: Watch) -> None:
        self.process, self._watch = process, watch
        self.levels: list[int] = []

    def node(self, module: str) -> psutil.Process:
        """The process of a node."""
        (found,) = [p for p in psutil.Process(self.process.pid).children() if module in p.cmdline()]
        return found

    def line(self) -> str:
        """The next line on stderr."""
        assert self.process.stderr is not None
        return self.process.stderr.readline()

    def speaks(self) -> None:
        """Wait for twenty more verdicts."""
        wanted = len(self.levels) + 20
        while len(self.levels) < wanted:
            assert self.process.poll() is None, "the suite has ended"
            self._watch.look(1.0)

    def ask(self, kind: Any, name: str, request: Any) -> Any:
        """The answer of a service."""
        asking = Asking(self.client(kind, name), request)
        self.until(asking.answered)
        return asking.answer

    def client(self, kind: Any, name: str) -> Any:
        """A client of a service that is there."""
        client = self._watch.node.create_client(kind, name)
        assert client.wait_for_service(PATIENCE_S), name
        return client

    def until(self, happened: Callable[[], bool]) -> None:
        """Serve callbacks until something has happened."""
        deadline = time.monotonic() + PATIENCE_S
        while not happened():
            assert time.monotonic() < deadline
            self._watch.look(1.0)


@contextmanager
def running(folder: Path, *options: str) -> Iterator[Up]:
    """`up` on a domain of its own, from the moment in which its supervisor speaks."""
    domain = free_domain()
    command = [*IRSBOT, "up", "--domain", str(domain), "--out", str(folder), *options]
    pipe = subprocess.PIPE
    with (
        subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True) as process,
        Watch(domain, lambda verdict: up.levels.append(verdict.level)) as watch,
    ):
        up = Up(process, watch)
        try:
            up.speaks()
            yield up
        finally:
            process.kill()


def test_a_dead_bystander_is_reported_and_supervision_goes_on(tmp_path: Path) -> None:
    with running(tmp_path / "run") as up:
        for module, name in ((RECORDER, "recorder"), (KINEMATICS, "kinematics")):
            up.node(module).kill()
            line = up.line()
            assert f"the node {name} ended with exit code -9" in line
            assert "the others go on" in line
            up.speaks()
        up.process.send_signal(signal.SIGINT)
        _out, printed = up.process.communicate(timeout=PATIENCE_S)
        assert up.process.returncode == 1
        assert printed.splitlines() == ["irsbot: the last part of the run was without recorder and kinematics"]


@pytest.mark.parametrize(("module", "name"), [(SUPERVISOR, "supervisor"), (JOINTS, "simulated_joints")])
def test_the_death_of_any_other_node_ends_the_suite(tmp_path: Path, module: str, name: str) -> None:
    with running(tmp_path / "run") as up:
        others = psutil.Process(up.process.pid).children()
        up.node(module).kill()
        _out, printed = up.process.communicate(timeout=PATIENCE_S)
        assert up.process.returncode == 1
        assert f"the node {name} ended with exit code -9" in printed
        assert not [process for process in others if process.is_running()]


WRONG = {
    "supervisor: {ros__parameters: {no_such: 0.9}}": "has no parameter 'no_such'; known are",
    "/**: {ros__parameters: {type9_stop: 0.9}}": "has no parameter 'type9_stop'",
    "recorder: {ros__parameters: {type2_stop: 0.2}}": "'/recorder' has no parameter 'type2_stop'",
    "recorder: {ros__parameters: {topics: {joints: a}}}": "'/recorder' has no parameter 'topics.joints'",
    "simulated_joints: {ros__parameters: {pace: 0.9}}": "'/simulated_joints' has no parameter 'pace'",
    "kinematics: {ros__parameters: {type2_stop: 0.2}}": "'/kinematics' has no parameter 'type2_stop'; known are robot",
    "supervisr: {ros__parameters: {type2_stop: 0.2}}": "'/supervisr' is none of the nodes /recorder, /kinematics,",
    "left: {supervisor: {ros__parameters: {type2_stop: 0.2}}}": "has parameters for none of the nodes /recorder",
    "supervisor: {ros__parameters: {type2_stop: 2.0}}": "type2_stop is 2.0, must be in",
    "supervisor: {ros__parameters: {type2_stop: 0.3}}": "type2_warn (0.25) must be at least type2_stop (0.3)",
    "type2_stop: 0.2": "'/type2_stop' must hold parameters",
    "supervisor: {ros__parameters: 7}": "'/supervisor' must hold parameters",
    "supervisor: {}": "'/supervisor' must hold parameters",
    "": "expected a mapping",
    "a: [": "not YAML",
}
"""Parameter files, and what is said of them."""


@pytest.mark.parametrize("text", WRONG)
def test_a_file_of_parameters_that_no_node_knows_is_refused(
    tmp_path: Path, text: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    parameters = tmp_path / "mine.yaml"
    parameters.write_text(text)
    assert WRONG[text] in refusal(["--params", str(parameters)], tmp_path, capsys, monkeypatch)


@pytest.mark.parametrize(
    ("text", "options", "words"),
    [
        ("/**: {ros__parameters: {robot: five_bar}}", ["--robot", "irsbot2"], "robot is 'five_bar' for /kinematics"),
        ("supervisor: {ros__parameters: {robot: five_bar}}", ["--robot", "irsbot2"], "'five_bar' for /supervisor"),
        (
            "/**: {ros__parameters: {robot: five_bar}}\nsupervisor: {ros__parameters: {robot: irsbot2}}",
            [],
            "the robot is 'five_bar' for",
        ),
        ("/**: {ros__parameters: {robot: nonsense}}", [], "nonsense"),
        ("/**: {ros__parameters: {robot: 7}}", [], "robot is 7 for /recorder, must be a text"),
        ("simulated_joints: {ros__parameters: {gated: true}}", [], "gated is True for /simulated_joints"),
        ("simulated_joints: {ros__parameters: {scenario: nonsense}}", [], "no scenario 'nonsense'"),
        ("recorder: {ros__parameters: {output: here}}", [], "output is 'here' for /recorder"),
    ],
)
def test_a_file_that_contradicts_the_command_line_or_itself_is_refused(
    tmp_path: Path,
    text: str,
    options: list[str],
    words: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    parameters = tmp_path / "mine.yaml"
    parameters.write_text(text)
    assert words in refusal(["--params", str(parameters), *options], tmp_path, capsys, monkeypatch)


@pytest.mark.parametrize("options", [[], ["--single-process"]])
def test_every_node_gets_the_robot_of_a_limit_proposal(tmp_path: Path, options: list[str]) -> None:
    parameters = tmp_path / "mine.yaml"
    propose = [*IRSBOT, "limits", "five_bar", "-o", str(parameters)]
    assert subprocess.run(propose, capture_output=True, timeout=PATIENCE_S).returncode == 0
    with running(tmp_path / "run", "--params", str(parameters), *options) as up:
        for node in ("supervisor", "kinematics", "simulated_joints"):
            answer = up.ask(GetParameters, f"{node}/get_parameters", GetParameters.Request(names=["robot"]))
            assert [value.string_value for value in answer.values] == ["five_bar"], node


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--domain", "-1"], "must be in 0..232, got -1"),
        (["--domain", "233"], "must be in 0..232, got 233"),
        (["--namespace", "a b"], "got 'a b'"),
        (["--namespace", "a//b"], "got 'a//b'"),
        (["--namespace", "7a"], "got '7a'"),
        (["--scenario", "nonsense"], "no scenario 'nonsense'"),
        (["--robot", "nonsense"], "nonsense"),
    ],
)
def test_parameters_with_which_no_node_could_start_are_refused(
    tmp_path: Path,
    options: list[str],
    words: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert words in refusal(options, tmp_path, capsys, monkeypatch)


def test_a_folder_with_a_bag_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "bag").mkdir()
    for command in ("up", "demo"):
        monkeypatch.setattr(sys, "argv", ["irsbot", command, "--out", str(tmp_path)])
        with pytest.raises(SystemExit) as ended:
            main()
        assert ended.value.code == 2
        stated = capsys.readouterr()
        assert stated.err == f"irsbot: '{tmp_path}/bag' exists already: a run needs a folder without a bag\n"
        assert not stated.out


def refusal(
    options: list[str], folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> str:
    """The one line with which `up` refuses, before anything has been started."""
    monkeypatch.setattr(sys, "argv", ["irsbot", "up", "--out", str(folder / "run"), *options])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    stated = capsys.readouterr().err
    assert stated.count("\n") == 1
    assert not (folder / "run").exists()
    return stated


def test_a_file_of_parameters_may_be_for_several_robots_and_reaches_its_own(tmp_path: Path) -> None:
    parameters = tmp_path / "mine.yaml"
    parameters.write_text(
        "/**: {ros__parameters: {type1_warn: 0.31}}\n"
        "left: {supervisor: {ros__parameters: {type2_warn: 0.32, use_sim_time: false}}}\n"
        "/right/supervisor: {ros__parameters: {type2_warn: 0.33}}\n"
    )
    nodes = {"/left/supervisor": ["type1_warn", "type2_warn"], "/left/recorder": ["mode"]}
    assert read_parameters(parameters, nodes) == {
        "/left/supervisor": {"type1_warn": 0.31, "type2_warn": 0.32},
        "/left/recorder": {},
    }


def started_nodes() -> dict[str, list[str]]:
    """The nodes that `up` starts without --web and --foxglove, and their parameters."""
    return {node: known for node, known in _parameters("").items() if node not in ("/live_page", "/foxglove")}


def test_the_parameters_that_up_knows_are_those_of_the_nodes(tmp_path: Path) -> None:
    with running(tmp_path / "run") as up:
        for node, known in started_nodes().items():
            found = up.ask(ListParameters, f"{node}/list_parameters", ListParameters.Request()).result.names
            ours = {name for name in found if not name.startswith(QOS_OVERRIDES)} - set(OF_EVERY_NODE)
            assert ours == set(known), node


def test_in_one_process_the_suite_is_the_same(tmp_path: Path) -> None:
    with running(tmp_path / "run", "--single-process") as up:
        (child,) = psutil.Process(up.process.pid).children()
        assert TOGETHER in child.cmdline()
        for node, known in started_nodes().items():
            found = up.ask(ListParameters, f"{node}/list_parameters", ListParameters.Request()).result.names
            assert {name for name in found if not name.startswith(QOS_OVERRIDES)} - set(OF_EVERY_NODE) == set(known)
        postures = EvaluateJoints.Request(joints=[q for k in range(1000) for q in (2.5 + 1e-5 * k, 0.2)])
        before = len(up.levels)
        while len(up.levels) - before <= 10:  # the supervisor goes on beside the kinematics
            assert len(up.ask(EvaluateJoints, "kinematics/evaluate", postures).states) == 1000
        up.process.send_signal(signal.SIGINT)
        _out, printed = up.process.communicate(timeout=PATIENCE_S)
        assert (up.process.returncode, printed) == (0, "")
    assert (tmp_path / "run" / "bag" / "metadata.yaml").exists()
    assert "Traceback" not in (tmp_path / "run" / "logs" / "suite.log").read_text()


def test_in_one_process_a_node_that_refuses_ends_them_all(tmp_path: Path) -> None:
    parameters = tmp_path / "mine.yaml"
    parameters.write_text("/**/recorder: {ros__parameters: {reserve_mib: 1000000}}")
    command = [*IRSBOT, "up", "--single-process", "--domain", str(free_domain()), "--out", str(tmp_path / "run")]
    done = subprocess.run([*command, "--params", parameters], capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode == 1
    assert "the node suite ended with exit code 2: " in done.stderr
    assert "less than the reserve" in done.stderr


def test_the_executable_takes_names_of_nodes() -> None:
    assert wanted(["supervisor", "recorder"]) == ["recorder", "supervisor"]
    assert wanted([]) == ["recorder", "kinematics", "supervisor", "simulated_joints"]
    done = subprocess.run(
        [sys.executable, "-m", TOGETHER, "nobody"], capture_output=True, text=True, timeout=PATIENCE_S
    )
    assert done.returncode == 2
    assert done.stderr.splitlines() == [
        "no node 'nobody'; there are recorder, kinematics, supervisor, simulated_joints"
    ]


def test_a_recorder_that_cannot_start_ends_the_suite(tmp_path: Path) -> None:
    parameters = tmp_path / "mine.yaml"
    parameters.write_text("/**/recorder: {ros__parameters: {reserve_mib: 1000000}}")
    command = [*IRSBOT, "up", "--domain", str(free_domain()), "--out", str(tmp_path / "run")]
    done = subprocess.run([*command, "--params", parameters], capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode == 1
    assert "less than the reserve" in done.stderr
