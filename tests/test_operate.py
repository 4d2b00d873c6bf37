"""An operator's commands against a running suite, and what they refuse before they ask anybody."""

from __future__ import annotations

import io
import json
import re
import subprocess
import time
from collections.abc import Iterator
from contextlib import redirect_stdout
from pathlib import Path

import pytest
from command import IRSBOT, PATIENCE_S

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

from irsbot_msgs_py.records import Cause
from irsbot_supervisor.processes.operating import NobodyThere, Operator
from irsbot_supervisor.processes.suite import GATED, JOINTS, SUPERVISOR, Node, Suite, free_domain

pytestmark = [pytest.mark.ros, pytest.mark.slow]

PAGE = Path(__file__).parents[1] / "docs" / "how_to" / "operating.md"


@pytest.fixture(scope="module")
def domain(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """A gated robot that stands; a busy machine may stop it, and every test says what it needs."""
    number = free_domain()
    with Suite(tmp_path_factory.mktemp("logs"), number) as suite:
        suite.start(Node("supervisor", SUPERVISOR, {"robot": "irsbot2"}))
        drives = {"robot": "irsbot2", "scenario": "stand", "gated": True, "listeners": 1}
        suite.start(Node("simulated_joints", JOINTS, drives, GATED))
        with Operator(number, patience_s=PATIENCE_S) as operator:
            operator.verdict()
        yield number


def irsbot(domain: int, *words: object) -> subprocess.CompletedProcess[str]:
    command = [*IRSBOT, *map(str, words), "--domain", str(domain), "--wait", str(PATIENCE_S)]
    return subprocess.run(command, capture_output=True, text=True, timeout=2.0 * PATIENCE_S)


def test_the_verdict_is_printed_with_its_exit_code(domain: int) -> None:
    done = irsbot(domain, "verdict", "--json")
    stated = json.loads(done.stdout)
    assert done.returncode == (1 if stated["level"] in ("STOP", "UNKNOWN") else 0)
    assert stated["config_hash"]


def test_a_reset_of_another_stop_is_refused_with_the_reason(domain: int) -> None:
    done = irsbot(domain, "reset", 4711, "--by", "Ann", "--because", "looked at it")
    assert done.returncode == 1
    assert done.stderr.startswith("irsbot: refused: ")


def test_settings_change_all_or_none(domain: int) -> None:
    assert irsbot(domain, "set", "type2_warn", 0.31, "type1_warn", 0.32).returncode == 0
    done = irsbot(domain, "set", "type1_warn", 0.4, "type2_warn", 0.05)
    assert done.returncode == 1
    assert "type2_warn (0.05) must be at least type2_stop" in done.stderr
    with Operator(domain, patience_s=PATIENCE_S) as operator:
        hashed = operator.verdict().config_hash
        operator.set({"type1_warn": 0.32})  # as it is: nothing of the refused call was taken
        assert operator.verdict().config_hash == hashed


def test_commands_pass_the_gate_or_the_hold_is_reported(domain: int) -> None:
    done = irsbot(domain, "send", "velocity", 0.05, -0.05, "--seconds", 0.3)
    assert (done.returncode, "passed" in done.stdout) in ((0, True), (1, False))
    assert done.returncode == 0 or "held: " in done.stderr


def test_where_nothing_stops_the_robot_there_is_no_way_out(domain: int) -> None:
    done = irsbot(domain, "send", "escape", "--seconds", 0.1)
    assert done.returncode == 1
    assert re.match("irsbot: the verdict, .*, has no escape direction", done.stderr)


def test_a_stopped_robot_is_led_out_along_its_escape_direction_and_reset(tmp_path: Path) -> None:
    """A limit above the margin of a robot that stands stops it."""
    number = free_domain()
    with Suite(tmp_path, number) as suite, Operator(number, patience_s=PATIENCE_S) as operator:
        slow = {"robot": "irsbot2", "acceleration_limit": [10.0]}  # late samples on a busy machine cost it little room
        suite.start(Node("supervisor", SUPERVISOR, slow))
        drives = {**slow, "scenario": "stand", "gated": True, "listeners": 1}
        suite.start(Node("simulated_joints", JOINTS, drives, GATED))
        operator.verdict()
        assert operator.set({"constraint_warn": 0.22, "constraint_stop": 0.2}).accepted
        end_s = time.monotonic() + PATIENCE_S
        while not (stop := operator.verdict()).escape_direction:
            assert time.monotonic() < end_s, stop
        end_s = time.monotonic() + PATIENCE_S
        assert stop.escape_cause & Cause.CONSTRAINT
        led = []
        # On a busy machine samples are late: a command may end early, also with the robot out already.
        while not (answer := operator.reset(operator.verdict().event, "test: led out")).accepted:
            assert time.monotonic() < end_s, (answer.message, led)
            led.append(irsbot(number, "send", "escape", "--seconds", 20))
        assert any(re.match(r"passed, at most: -?0\.\d+ ", done.stdout) for done in led)


def test_a_domain_without_a_supervisor_is_reported_in_one_line() -> None:
    number = free_domain()
    done = subprocess.run(
        [*IRSBOT, "verdict", "--domain", str(number), "--wait", "0.5"], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 1
    assert done.stderr == f"irsbot: no verdict on supervisor/verdict in 0.5 s (DDS domain {number})\n"
    with Operator(number, patience_s=0.1) as operator, pytest.raises(NobodyThere, match="no service supervisor/reset"):
        operator.reset(1, "nobody")


def test_the_example_of_the_page_runs(domain: int) -> None:
    (source,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert len(source.splitlines()) <= 20
    printed = io.StringIO()
    with redirect_stdout(printed):
        exec(compile(source.replace("domain=0", f"domain={domain}, patience_s={PATIENCE_S}"), str(PAGE), "exec"), {})
    assert "set" in printed.getvalue()
