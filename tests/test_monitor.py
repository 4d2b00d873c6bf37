"""`irsbot monitor` beside a running suite: once, as data, and live until Ctrl-C."""

from __future__ import annotations

import json
import os
import pty
import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

from irsbot_supervisor.processes.operating import Operator
from irsbot_supervisor.processes.suite import JOINTS, SUPERVISOR, Node, Suite, free_domain

pytestmark = [pytest.mark.ros, pytest.mark.slow]

IRSBOT = [sys.executable, "-m", "irsbot_supervisor", "monitor"]
PATIENCE_S = 120.0
"""s a test waits for an event on a busy machine."""


@pytest.fixture(scope="module")
def domain(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """A robot that stands; a busy machine may stop it."""
    number = free_domain()
    with Suite(tmp_path_factory.mktemp("logs"), number) as suite:
        suite.start(Node("supervisor", SUPERVISOR, {"robot": "irsbot2"}))
        suite.start(Node("simulated_joints", JOINTS, {"robot": "irsbot2", "scenario": "stand", "listeners": 1}))
        with Operator(number, patience_s=PATIENCE_S) as operator:
            operator.verdict()
        yield number


def test_one_look_shows_level_margins_limits_and_rates(domain: int) -> None:
    command = [*IRSBOT, "--json", "--domain", str(domain), "--wait", str(PATIENCE_S)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=2.0 * PATIENCE_S)
    assert done.returncode == 0, done.stderr
    stated = json.loads(done.stdout)
    assert stated["level"] in ("OK", "WARN", "STOP", "UNKNOWN")
    assert stated["state"]["robot"] == "irsbot2"
    assert stated["limits"]["type2_stop"] > 0.0
    assert stated["state_hz"] > 0.0
    assert stated["verdict_hz"] > 0.0


def test_it_shows_and_ends_cleanly_on_ctrl_c(domain: int) -> None:
    """In a terminal of its own; Ctrl-C is sent once there is something to see."""
    ours, theirs = pty.openpty()
    command = [*IRSBOT, "--domain", str(domain)]
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "80", "LINES": "24"}
    process = subprocess.Popen(
        command, stdin=theirs, stdout=theirs, stderr=subprocess.PIPE, env=environment, start_new_session=True
    )
    os.close(theirs)
    try:
        text = b""
        while b"Type 2 margin" not in text:
            text += os.read(ours, 1 << 16)  # raises OSError when the command ends before
        process.send_signal(signal.SIGINT)
        while True:
            try:
                if not os.read(ours, 1 << 16):
                    break
            except OSError:  # what Linux says at the end of a terminal
                break
        _, errors = process.communicate(timeout=PATIENCE_S)
    finally:
        process.kill()
        process.wait()
        os.close(ours)
    assert process.returncode == 0, errors.decode()
    assert b"Traceback" not in errors


def test_without_a_supervisor_one_look_fails_in_one_line() -> None:
    command = [*IRSBOT, "--once", "--domain", str(free_domain()), "--wait", "0.5"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode == 1
    (line,) = done.stderr.strip().splitlines()
    assert "no verdict" in line
    assert "no verdict" in done.stdout
