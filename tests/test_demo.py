"""The suite as a user runs it: separate processes over real DDS, one demo for all questions about it."""

from __future__ import annotations

import contextlib
import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import psutil
import pytest
import yaml
from command import IRSBOT, PATIENCE_S, irsbot
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from irsbot_msgs_py.records import Level, Reset
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.bag.bag import Bag
from irsbot_supervisor.bag.bag_writer import BagWriter
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.processes.suite import JOINTS
from irsbot_supervisor.replay.recording import read_recording
from irsbot_supervisor.replay.rejudge import judge_again

pytestmark = [pytest.mark.ros, pytest.mark.slow]


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A demo that was stopped in time: its folder and what it printed."""
    folder = tmp_path_factory.mktemp("demo") / "run"
    command = [*IRSBOT, "demo", "--seconds", "2", "--out", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder, done.stdout


def test_the_robot_stops_before_its_margins_are_crossed(demo: tuple[Path, str]) -> None:
    folder, _printed = demo
    states = [state for state in read_recording(folder / "bag").states if state.type2_margin == state.type2_margin]
    assert min(min(state.type1_margin) for state in states) >= 0.15  # the shipped stop limit
    assert min(state.type2_margin for state in states) >= 0.15
    assert states[-1].joint_velocity == (0.0, 0.0)
    assert max(max(map(abs, state.joint_velocity)) for state in states) > 2.0  # it was fast before: the test bites


def test_the_timeline_prints_time_level_cause_and_limit(demo: tuple[Path, str]) -> None:
    _folder, printed = demo
    for words in ("OK", "STOP", "Type 1 margin", "limit 0.1500", "first sample judged STOP -> standstill", "replay"):
        assert words in printed


def test_times_of_the_timeline_are_those_of_the_robot_since_the_first_judged_sample(demo: tuple[Path, str]) -> None:
    folder, printed = demo
    assert "since the first sample that was judged\n" in printed
    recording = read_recording(folder / "bag")
    stop = next(verdict for _log, verdict in recording.verdicts if verdict.level == Level.STOP)
    since_s = (stop.stamp_ns - recording.states[0].stamp_ns) / NS_PER_S
    (line, *_) = [line for line in printed.splitlines() if " s  STOP " in line]
    assert float(line.split()[0]) == pytest.approx(since_s, abs=6e-4)  # three digits


def test_the_picture_is_drawn(demo: tuple[Path, str]) -> None:
    assert (demo[0] / "run.png").read_bytes().startswith(b"\x89PNG")


def test_a_stop_by_late_samples_before_the_work_is_reset(tmp_path: Path) -> None:
    """As on a busy machine, while the nodes start. The supervisor may hear the joints long after their first sample.

    The higher constraint limits stop a resting robot for certain by samples that are so late: on a grid over what it
    can reach the margin falls to 0.117. The work needs no stop even with samples that are 20 ms late.
    """
    scenario, robot, folder = tmp_path / "late.yaml", tmp_path / "robot.yaml", tmp_path / "run"
    shipped = files("irsbot_supervisor")
    scenario.write_text("faults: latency:by=0.045,lasting=2.0\n" + (shipped / "scenarios" / "demo.yaml").read_text())
    settings = yaml.safe_load((shipped / "settings" / "irsbot2.yaml").read_text())
    del settings["robot"]
    settings |= {"constraint_warn": 0.13, "constraint_stop": 0.12}
    geometry = yaml.safe_load((files("irsbot_kinematics") / "presets" / "irsbot2.yaml").read_text())
    robot.write_text(yaml.safe_dump(geometry | {"supervision": settings}))
    command = [*IRSBOT, "demo", "--scenario", str(scenario), "--robot", str(robot), "--seconds", "2"]
    command += ["--out", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode == 0, done.stdout + done.stderr
    recording = read_recording(folder / "bag")
    begun = next(number for number, (_log, verdict) in enumerate(recording.verdicts) if verdict.level < Level.STOP)
    assert any(verdict.latched for _log, verdict in recording.verdicts[:begun]), done.stdout
    assert [entry for entry in recording.journal if isinstance(entry, Reset)], done.stdout
    assert recording.verdicts[-1][1].latched


def test_the_bag_opens_with_public_readers(demo: tuple[Path, str]) -> None:
    bag = demo[0] / "bag"
    with AnyReader([bag]) as reader:
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
        state = next(c for c in reader.connections if c.topic == "/supervisor/state")
        message = next(reader.messages([state]))
        first: Any = reader.deserialize(message[2], state.msgtype)
        assert first.robot == "irsbot2"
    with next(bag.glob("*.mcap")).open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == sum(counts.values())
    assert counts["/joint_states"] > 2000


def test_the_replay_agrees_and_two_replays_are_the_same(demo: tuple[Path, str]) -> None:
    recording = read_recording(demo[0] / "bag")
    first, second = judge_again(recording), judge_again(recording)
    assert first == second
    assert first.levels
    done = subprocess.run([*IRSBOT, "replay", str(demo[0] / "bag")], capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode == 0, done.stdout + done.stderr


def test_an_altered_verdict_is_found_and_its_sample_named(demo: tuple[Path, str], tmp_path: Path) -> None:
    altered, target = None, tmp_path / "altered.mcap"
    with Bag(demo[0] / "bag") as opened, BagWriter(target) as writer:
        for entry in opened.records():
            record: Any = entry.record
            if altered is None and getattr(record, "level", None) == Level.STOP and hasattr(record, "latched"):
                altered = record = record._replace(level=Level.OK)
            writer.add(entry.topic, record, entry.log_ns)
    assert altered is not None
    done = subprocess.run([*IRSBOT, "replay", str(target)], capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode == 1
    assert f"verdict {altered.sequence} at sample stamped {altered.stamp_ns / NS_PER_S:.6f}" in done.stderr


def _nodes_of(process: subprocess.Popen[str]) -> list[psutil.Process]:
    """The processes of a demo, once all its nodes are there: the simulated joints are the last."""
    parent = psutil.Process(process.pid)

    def complete() -> bool:
        with contextlib.suppress(psutil.NoSuchProcess):
            return any(JOINTS in one.cmdline() for one in parent.children())
        return False

    _await(complete)
    return parent.children(recursive=True)


def _await(event: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not event():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def _samples(bag: Path) -> int:
    """Joint states that can be read by now."""
    try:
        return len(read_recording(bag).samples)
    except (BagError, OSError):
        return 0


LASTING = """
from irsbot_supervisor.cli import demo
from irsbot_supervisor.executables import irsbot
demo.GRACE_S = demo.AFTERWARDS_S = 600.0
irsbot()
"""
"""The command `irsbot`, whose demo does not end by itself soon after a stop: on a busy machine late samples stop it."""


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_interrupting_the_demo_leaves_no_process_and_a_closed_bag(tmp_path: Path, how: signal.Signals) -> None:
    folder = tmp_path / "run"
    command = [sys.executable, "-c", LASTING, "demo", "--out", str(folder)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            children = _nodes_of(process)
            _await(lambda: _samples(folder / "bag") > 0)  # on a busy machine the recorder comes last
            process.send_signal(how)
            process.communicate(timeout=PATIENCE_S)
        finally:
            process.kill()
    assert process.returncode == 1
    assert not [child for child in children if child.is_running() and child.status() != psutil.STATUS_ZOMBIE]
    recording = read_recording(folder / "bag")
    assert recording.samples
    assert not recording.loss


EARLY = """
import os, signal, time
from pathlib import Path
from irsbot_supervisor.executables import irsbot
from irsbot_supervisor.processes.suite import JOINTS, Suite
start, bag = Suite.start, Path({bag!r})
def interrupted(suite, node):
    if not {recording} or node.module == JOINTS:
        while {recording} and not bag.is_dir():  # on a busy machine the recorder comes last
            time.sleep(0.05)
        os.kill(os.getpid(), signal.SIGTERM)
    start(suite, node)
Suite.start = interrupted
irsbot()
"""
"""The command `irsbot`, interrupted before it starts a node, or before it starts the joints, when the recorder has
begun."""


@pytest.mark.parametrize(
    ("recording", "found"),
    [(False, "interrupted before anything was recorded"), (True, "interrupted before a joint state was recorded")],
)
def test_interrupting_the_demo_before_a_joint_state_is_recorded_is_reported(
    tmp_path: Path, recording: bool, found: str
) -> None:
    code = EARLY.format(bag=str(tmp_path / "run" / "bag"), recording=recording)
    command = [sys.executable, "-c", code, "demo", "--out", str(tmp_path / "run")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode == 1
    assert done.stderr == f"irsbot: {found}\n"


def test_killing_the_demo_kills_its_nodes(tmp_path: Path) -> None:
    command = [*IRSBOT, "demo", "--out", str(tmp_path / "run")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            children = _nodes_of(process)
        finally:
            process.kill()
    _gone, alive = psutil.wait_procs(children, timeout=PATIENCE_S)
    assert not alive


def test_bad_use_is_refused_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for arguments, words in (
        (["demo", "--scenario", "nonsense"], "nonsense"),
        (["demo", "--robot", "nonsense"], "nonsense"),
        (["demo", "--seconds", "nan"], "must be a positive, finite number, got nan"),
        (["demo", "--seconds", "-3"], "must be a positive, finite number, got -3"),
        (["demo", "--out", "/proc/run"], "/proc/run"),  # where nobody may create anything
        (["up", "--out", "/proc/run"], "/proc/run"),
        (["replay", str(tmp_path / "nothing")], "does not exist"),
        (["ik", "irsbot2", "0.3", "x"], "'x'"),
        (["ik", "irsbot2", "0.3"], "2 numbers"),
        (["ik", "irsbot2", "nan", "0"], "finite"),
        (["dk", "irsbot2", "0", "0", "--assembly", "7"], "assembly mode 7"),
    ):
        done = irsbot(*arguments)
        assert done.code == 2, (arguments, done)
        assert words in done.refusal, (arguments, done)
        assert not done.out
    assert not list(tmp_path.iterdir()), "a refused command left something behind"


def test_inverse_kinematics_from_the_shell() -> None:
    done = irsbot("ik", "irsbot2", "0.3", "-0.75", "--json")
    found = {tuple(s["working_mode"]): s["joints"] for s in json.loads(done.out)["solutions"]}
    assert found[1, -1] == pytest.approx([2.544003124, -0.190028776], abs=1e-9)  # the sheet's W1, printed digits
    assert found[-1, 1] == pytest.approx([-0.196686461, 2.604320414], abs=1e-9)
    assert found[1, 1] == pytest.approx([2.544003124, 2.604320414], abs=1e-9)
    assert found[-1, -1] == pytest.approx([-0.196686461, -0.190028776], abs=1e-9)
    done = irsbot("ik", "irsbot2", "0", "-1.25")
    assert done.code == 1
    assert "unreachable by 50.08 mm" in done.refusal


def test_the_report_is_one_page_with_everything_in_it(tmp_path: Path) -> None:
    bag = Path(__file__).parents[1] / "bags" / "type2"
    page = tmp_path / "run.html"
    done = irsbot("report", bag, "-o", page)
    assert done.code == 0, done.err
    text = page.read_text()
    for words in ('id="data"', "Type 2 margin", "BRAKING", "recorded verdicts: same", "type2_stop"):
        assert words in text
    assert "://" not in text, "the page must not need anything from elsewhere"


def test_a_planned_motion_is_certified_or_its_first_violation_named(tmp_path: Path) -> None:
    motion = tmp_path / "motion.csv"
    motion.write_text("time_s,joint_1,joint_2\n0,3.14,0.0\n1,3.0,0.1\n")
    done = irsbot("check-trajectory", "irsbot2", motion)
    assert done.code == 0, done.err
    motion.write_text("time_s,joint_1,joint_2\n0,3.14,0.0\n1,1.5,1.6\n")
    done = irsbot("check-trajectory", "irsbot2", motion)
    assert done.code == 1
    assert "limit" in done.err
