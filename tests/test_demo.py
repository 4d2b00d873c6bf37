"""The suite as a user runs it: separate processes over real DDS, one demo for all questions about it."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from irsbot_msgs_py.records import Level
from irsbot_supervisor.core.intake import S
from irsbot_supervisor.replay import judge_again, read_recording
from irsbot_supervisor.tape import Tape, TapeWriter

pytestmark = [pytest.mark.ros, pytest.mark.slow]

IRSBOT = [sys.executable, "-m", "irsbot_supervisor"]
PATIENCE_S = 120.0
"""s a test waits for an event on a busy machine."""


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
    assert max(max(map(abs, state.joint_velocity)) for state in states) > 5.0  # it was fast before: the test bites


def test_the_timeline_tells_time_level_cause_and_limit(demo: tuple[Path, str]) -> None:
    _folder, printed = demo
    for words in ("OK", "STOP", "Type 1 margin", "limit 0.1500", "limit crossed -> standstill", "replay"):
        assert words in printed


def test_times_of_the_timeline_are_those_of_the_robot_since_the_first_judged_sample(demo: tuple[Path, str]) -> None:
    folder, printed = demo
    assert "since the first sample that was judged\n" in printed
    recording = read_recording(folder / "bag")
    stop = next(verdict for _log, verdict in recording.verdicts if verdict.level == Level.STOP)
    since_s = (stop.stamp_ns - recording.states[0].stamp_ns) / S
    (line, *_) = [line for line in printed.splitlines() if " s  STOP " in line]
    assert float(line.split()[0]) == pytest.approx(since_s, abs=6e-4)  # three digits


def test_the_picture_is_drawn(demo: tuple[Path, str]) -> None:
    assert (demo[0] / "run.png").read_bytes().startswith(b"\x89PNG")


def test_the_bag_opens_with_public_readers(demo: tuple[Path, str]) -> None:
    bag = demo[0] / "bag"
    with AnyReader([bag]) as reader:
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
        state = next(c for c in reader.connections if c.topic == "/supervisor/state")
        message = next(reader.messages([state]))
        assert reader.deserialize(message[2], state.msgtype).robot == "irsbot2"
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
    with Tape(demo[0] / "bag") as tape, TapeWriter(target) as writer:
        for entry in tape.records():
            record = entry.record
            if altered is None and getattr(record, "level", None) == Level.STOP and hasattr(record, "latched"):
                altered = record = record._replace(level=Level.OK)
            writer.add(entry.topic, record, entry.log_ns)
    assert altered is not None
    done = subprocess.run([*IRSBOT, "replay", str(target)], capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode == 1
    assert f"verdict {altered.sequence} at sample stamped {altered.stamp_ns / S:.6f}" in done.stderr


def _working_demo(process: subprocess.Popen[str]) -> list[psutil.Process]:
    """The nodes of a demo, once its supervisor has said OK."""
    assert process.stdout is not None
    for line in process.stdout:
        if " OK " in line:
            break
    children = psutil.Process(process.pid).children(recursive=True)
    assert len(children) >= 4, "the nodes are not up: the test proves nothing"
    return children


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_interrupting_the_demo_leaves_no_process_and_a_closed_bag(tmp_path: Path, how: signal.Signals) -> None:
    folder = tmp_path / "run"
    with subprocess.Popen([*IRSBOT, "demo", "--out", str(folder)], stdout=subprocess.PIPE, text=True) as process:
        try:
            children = _working_demo(process)
            deadline = time.monotonic() + PATIENCE_S
            while not list((folder / "bag").glob("*.mcap")):  # on a busy machine the recorder comes last
                assert time.monotonic() < deadline
                time.sleep(0.05)
            process.send_signal(how)
            process.communicate(timeout=PATIENCE_S)
        finally:
            process.kill()
    assert process.returncode == 1
    assert not [child for child in children if child.is_running() and child.status() != psutil.STATUS_ZOMBIE]
    recording = read_recording(folder / "bag")
    assert recording.samples
    assert not recording.loss


def test_killing_the_demo_kills_its_nodes(tmp_path: Path) -> None:
    command = [*IRSBOT, "demo", "--out", str(tmp_path / "run")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            children = _working_demo(process)
        finally:
            process.kill()
    _gone, alive = psutil.wait_procs(children, timeout=PATIENCE_S)
    assert not alive


def test_bad_use_is_refused_in_one_line(tmp_path: Path) -> None:
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
        done = subprocess.run([*IRSBOT, *arguments], capture_output=True, text=True, timeout=PATIENCE_S, cwd=tmp_path)
        assert done.returncode == 2, (arguments, done)
        assert words in done.stderr, (arguments, done.stderr)
        assert len(done.stderr.strip().splitlines()) == 1, done.stderr
        assert "Traceback" not in done.stderr
        assert not done.stdout
    assert not list(tmp_path.iterdir()), "a refused command left something behind"


def test_inverse_kinematics_from_the_shell() -> None:
    done = subprocess.run(
        [*IRSBOT, "ik", "irsbot2", "0.3", "-0.75", "--json"], capture_output=True, text=True, timeout=120
    )
    found = {tuple(s["working_mode"]): s["joints"] for s in json.loads(done.stdout)["solutions"]}
    assert found[1, -1] == pytest.approx([2.544003124, -0.190028776], abs=1e-9)  # the sheet's W1, printed digits
    assert found[-1, 1] == pytest.approx([-0.196686461, 2.604320414], abs=1e-9)
    assert found[1, 1] == pytest.approx([2.544003124, 2.604320414], abs=1e-9)
    assert found[-1, -1] == pytest.approx([-0.196686461, -0.190028776], abs=1e-9)
    done = subprocess.run([*IRSBOT, "ik", "irsbot2", "0", "-1.25"], capture_output=True, text=True, timeout=120)
    assert done.returncode == 1
    assert "unreachable by 50.08 mm" in done.stderr


def test_the_report_is_one_page_with_everything_in_it(tmp_path: Path) -> None:
    bag = Path(__file__).parents[1] / "bags" / "type2"
    page = tmp_path / "run.html"
    command = [*IRSBOT, "report", str(bag), "-o", str(page)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode == 0, done.stderr
    text = page.read_text()
    for words in ("data:image/png;base64,", "Type 2 margin", "BRAKING", "recorded verdicts: same", "type2_stop"):
        assert words in text
    assert "http" not in text, "the page must not need anything from elsewhere"


def test_a_planned_motion_is_certified_or_its_first_violation_named(tmp_path: Path) -> None:
    motion = tmp_path / "motion.csv"
    motion.write_text("time_s,joint_1,joint_2\n0,3.14,0.0\n1,3.0,0.1\n")
    command = [*IRSBOT, "check-trajectory", "irsbot2", str(motion)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode == 0, done.stderr
    motion.write_text("time_s,joint_1,joint_2\n0,3.14,0.0\n1,1.5,1.6\n")
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode == 1
    assert "limit" in done.stderr
