"""The short version of the campaign with everything on."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")
pytest.importorskip("foxglove", reason="needs foxglove-sdk")

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.serialization import serialize_message

from irsbot_msgs_py.records import JointSample
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.bag.bag_writer import BagWriter
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.processes.suite import FOXGLOVE, JOINTS, KINEMATICS, LIVE_PAGE, RECORDER, SUPERVISOR

SCRIPT = Path(__file__).parent / "campaigns" / "everything_on.py"
PERIOD_NS = 1_000_000
LATE_NS = 250_000
"""ns from the stamp of a sample to its arrival."""

pytestmark = [pytest.mark.ros, pytest.mark.slow]


def campaign() -> Any:
    wanted = importlib.util.spec_from_file_location("everything_on", SCRIPT)
    assert wanted is not None
    assert wanted.loader is not None
    module = importlib.util.module_from_spec(wanted)
    wanted.loader.exec_module(module)
    return module


def test_losses_and_latency_are_counted(tmp_path: Path) -> None:
    settings, robot = read_settings("irsbot2")
    middle = robot.inverse((0.0, -0.85), settings.working_mode)
    supervisor, begin_ns = Supervisor(settings, robot), 1_700_000_000 * NS_PER_S
    with BagWriter(tmp_path / "bag") as bag:
        for number in range(100):
            if number in (20, 21, 50):  # was not sent
                continue
            stamp_ns = begin_ns + number * PERIOD_NS
            sample = JointSample(
                stamp_ns=stamp_ns,
                received_ns=stamp_ns + LATE_NS,
                seen_ns=stamp_ns + LATE_NS,
                names=settings.joint_names,
                position=tuple(middle),
                velocity=(0.0, 0.0),
            )
            bag.add("/joint_states", sample, sample.received_ns)
            state = supervisor.step(sample).state
            assert state is not None
            if number not in (30, 70, *range(80, 88)):  # 80 to 83 were old when 88 was judged, the others were lost
                bag.add("/supervisor/state", state._replace(compute_time=0.0), sample.received_ns)
    found = campaign().judgement(tmp_path / "bag")
    assert (found.samples, found.unjudged, found.lost, found.unsent, found.skipped) == (97, 10, 6, 3, 0)
    assert found.latency_ms == pytest.approx(1e-6 * LATE_NS)


def test_a_short_run_shows_memory_latency_and_loss(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, str(SCRIPT), "--minutes", "0.1", "--out", str(tmp_path / "run")],
        capture_output=True,
        text=True,
        timeout=240,
    )
    assert done.returncode in (0, 1), done.stdout + done.stderr  # 1: on a busy machine samples are late
    nodes = re.findall(r"^(\w+) +[\d.]+ -> +[\d.]+ MB +[\d.]+ % of a core$", done.stdout, re.MULTILINE)
    modules = (FOXGLOVE, JOINTS, KINEMATICS, LIVE_PAGE, RECORDER, SUPERVISOR)
    assert nodes == sorted(module.rpartition(".")[2] for module in modules), done.stdout + done.stderr
    (received,) = re.findall(r"received ([\d,]+) messages", done.stdout)
    assert int(received.replace(",", "")) > 0
    (samples,) = re.findall(r"^([\d,]+) joint states", done.stdout, re.MULTILINE)
    assert int(samples.replace(",", "")) > 1000
    assert re.search(r"^\d+ were lost; the others were older than 5 ms", done.stdout, re.MULTILINE)
    assert [path.name for path in (tmp_path / "run").iterdir()] == ["logs"]


def test_skipped_samples_are_those_that_the_supervisor_counted() -> None:
    values = [KeyValue(key="samples [1/s]", value="998.2"), KeyValue(key="skipped", value="7")]
    told = DiagnosticArray(status=[DiagnosticStatus(), DiagnosticStatus(values=values)])
    assert campaign().skipped_in(serialize_message(told)) == 7
    assert campaign().skipped_in(serialize_message(DiagnosticArray(status=[DiagnosticStatus()]))) is None
