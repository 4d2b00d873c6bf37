"""The shell around every node, in processes of their own: how it starts, lives through errors, and ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from irsbot_msgs_py.process.fastdds import ONLY_LOCALHOST, PEERS, PROFILES, RANGE, TRANSPORTS
from irsbot_msgs_py.process.run import SWITCH_S

pytest.importorskip("rclpy", reason="needs ROS 2")

from irsbot_supervisor.processes.suite import free_domain

pytestmark = pytest.mark.ros

PROGRAM = """
import ctypes
import sys
from irsbot_msgs_py.process.run import UsageError, run
from rclpy.lifecycle import LifecycleNode

class Stuck:
    def __del__(self):
        print("stuck", flush=True)
        ctypes.PyDLL(None).pause()  # as Fast DDS may: for ever, and with the interpreter's lock held

class Shown(LifecycleNode):
    exit_code = None
    ticks = 0
    def __init__(self):
        super().__init__("shown")
        if WISH == "refuse and be stuck":
            self.part = Stuck(), self.tick  # gone when somebody collects it
        if WISH in ("refuse", "refuse and be stuck"):
            raise UsageError("no such\\nthing")
        if WISH == "type":
            self.declare_parameter("number", 1)
        self.create_timer(0.01, self.tick)
    def tick(self):
        self.ticks += 1
        print("tick", self.ticks, flush=True)
        if WISH == "say how long a thread keeps others waiting":
            print(sys.getswitchinterval(), flush=True)
        if WISH == "fail" and self.ticks < 3:
            raise RuntimeError("a callback failed")
        if WISH == "talk":
            self.get_logger().info(10_000 * "x")
        if WISH in ("leave", "leave and be stuck"):
            self.exit_code = 7
    def close(self):
        print("closed", flush=True)
        if WISH == "owe an answer":
            self.executor.create_task(print, "answered", flush=True)  # as an action server does
    def destroy_node(self):
        if WISH == "leave and be stuck":
            Stuck()
        super().destroy_node()

WISH = sys.argv.pop(1)
sys.exit(run(Shown, log="shown" if WISH == "talk" else ""))
"""


@contextmanager
def shown(wish: str, *args: str, **variables: str) -> Iterator[subprocess.Popen[str]]:
    """A process that prints every tick; killed on the way out if it still lives."""
    ours = TRANSPORTS, PROFILES, RANGE, PEERS, ONLY_LOCALHOST
    inherited = {name: value for name, value in os.environ.items() if name not in ours}
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, wish, *args],
        env={**inherited, "ROS_DOMAIN_ID": str(free_domain()), **variables},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_closes_the_node_and_is_a_success(number: signal.Signals):
    with shown("run") as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "tick 1\n"
        process.send_signal(number)
        out, err = process.communicate(timeout=120)
        assert process.returncode == 0
        assert out.endswith("closed\n")
        assert err == ""


def test_a_thread_of_a_single_node_too_lets_its_callbacks_run_soon():
    with shown("say how long a thread keeps others waiting") as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "tick 1\n"
        assert float(process.stdout.readline()) == pytest.approx(SWITCH_S)


def test_an_answer_that_a_node_owes_at_its_end_is_given():
    with shown("owe an answer") as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "tick 1\n"
        process.send_signal(signal.SIGINT)
        out, _ = process.communicate(timeout=120)
        assert process.returncode == 0
        assert out.endswith("closed\nanswered\n")


def test_the_node_may_end_itself_with_a_code():
    with shown("leave") as process:
        out, _ = process.communicate(timeout=120)
        assert process.returncode == 7
        assert out.endswith("closed\n")


@pytest.mark.parametrize(("wish", "code"), [("refuse and be stuck", 2), ("leave and be stuck", 7)])
def test_a_middleware_that_never_returns_changes_neither_the_end_nor_its_code(wish: str, code: int):
    with shown(wish) as process:
        out, _ = process.communicate(timeout=120)
        assert process.returncode == code
        assert out.endswith("stuck\n")


def test_a_second_signal_gives_the_same_exit_code():
    with shown("run") as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "tick 1\n"
        while process.poll() is None:
            process.send_signal(signal.SIGINT)
        assert process.returncode == 0


def test_an_argument_that_is_not_for_ros_is_refused():
    with shown("run", "--robot", "five_bar") as process:
        out, err = process.communicate(timeout=120)
    assert (process.returncode, out) == (2, "")
    (line,) = err.splitlines()
    assert "'--robot'" in line
    assert "-p NAME:=VALUE" in line


def test_help_says_which_arguments_a_node_takes():
    with shown("run", "--help") as process:
        out, err = process.communicate(timeout=120)
    assert (process.returncode, err) == (0, "")
    assert "--ros-args -p robot:=five_bar" in out


def test_an_error_in_a_callback_is_reported_and_survived():
    with shown("fail") as process:
        assert process.stdout is not None
        assert "tick 5\n" in (process.stdout.readline() for _ in range(5))
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=120)
        assert process.returncode == 0
        assert "RuntimeError: a callback failed" in err


def test_an_unread_log_delays_no_callback_and_is_in_the_file(tmp_path: Path):
    ticks = 200  # 2 MB, more than all pipes hold
    with shown("talk", ROS_LOG_DIR=str(tmp_path)) as process:
        assert process.stdout is not None
        assert f"tick {ticks}\n" in (process.stdout.readline() for _ in range(ticks))
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=120)
        assert process.returncode == 0
        assert 10_000 * "x" in err
    (file,) = tmp_path.glob("*.log")
    assert file.name.startswith(f"shown_{process.pid}_")
    assert "[shown]: xxx" in file.read_text()


@pytest.mark.parametrize(
    ("wish", "args", "words"),
    [
        ("refuse", [], "no such thing"),
        ("type", ["--ros-args", "-p", "number:=word"], "number"),
        ("run", ["--ros-args", "-p", "no assignment"], "no assignment"),
        ("run", ["--ros-args", "-r", "__ns:=/not valid"], "not valid"),
    ],
    ids=["refused by the node", "parameter of another type", "bad argument", "bad namespace"],
)
def test_a_mistake_of_the_user_is_one_line_and_exit_code_2(wish: str, args: list[str], words: str):
    with shown(wish, *args) as process:
        _, err = process.communicate(timeout=120)
        assert process.returncode == 2
        (line,) = (line for line in err.splitlines() if "[rcl]" not in line)  # rcl has its own say before ours
        assert words in line


@pytest.mark.parametrize(
    ("variables", "shared"),
    [
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}, False),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}, False),
        ({"ROS_LOCALHOST_ONLY": "1"}, False),
        ({"FASTDDS_BUILTIN_TRANSPORTS": "DEFAULT"}, True),
    ],
    ids=["in the network", "on this machine", "on this machine, the older way", "where the user has chosen it"],
)
def test_no_memory_is_shared_with_other_processes(variables: dict[str, str], shared: bool):
    with shown("run", **variables) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "tick 1\n"
        mapped = Path(f"/proc/{process.pid}/maps").read_text()
        assert ("/dev/shm/fastrtps_" in mapped) == shared


OLDER = """
import sys
from importlib.abc import MetaPathFinder

class Older(MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name == "rclpy.experimental.events_executor":
            raise ModuleNotFoundError(name=name)

sys.meta_path.insert(0, Older())
from irsbot_msgs_py.process.run import run
sys.exit(run(object))
"""


def test_an_rclpy_that_is_too_old_is_one_sentence():
    done = subprocess.run([sys.executable, "-c", OLDER], capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith("rclpy 7.1.4 or newer is needed, this is ")
