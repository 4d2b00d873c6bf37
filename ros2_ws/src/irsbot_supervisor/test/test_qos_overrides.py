"""qos_overrides: what parameters say of publishers and subscriptions is what the graph shows; nonsense is refused."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

from cell import Cell, Wire
from rcl_interfaces.srv import ListParameters
from rclpy.qos import ReliabilityPolicy

from irsbot_msgs_py.records import Level
from irsbot_supervisor.processes.suite import SUPERVISOR, free_domain

pytestmark = pytest.mark.ros

CHANGED = {
    "/command_in": "subscription",
    "/command_out": "publisher",
    "/diagnostics": "publisher",
    "/joint_states": "subscription",
    "/supervisor/gate": "publisher",
    "/supervisor/journal": "publisher",
    "/supervisor/markers": "publisher",
    "/supervisor/passive_joint_states": "publisher",
    "/supervisor/state": "publisher",
    "/supervisor/summary": "publisher",
    "/velocity_in": "subscription",
    "/velocity_out": "publisher",
}
"""Every topic of the supervisor but verdict and safe."""


def test_reliability_follows_its_override_and_the_promises_stay(tmp_path: Path):
    told = {f"qos_overrides.{topic}.{end}.reliability": "best_effort" for topic, end in CHANGED.items()}
    with Wire(tmp_path) as wire:
        cell = Cell(wire, **told)
        cell.heard(lambda verdict: verdict.level == Level.OK)  # states are not heard by who asks for reliable ones
        offered = cell.call(ListParameters, "supervisor/list_parameters", ListParameters.Request()).result.names
        overrides = {name for name in offered if name.startswith("qos_overrides.")}
        assert {name.split(".")[1] for name in overrides} == set(CHANGED)
        for topic, end in {**CHANGED, "/supervisor/verdict": "publisher", "/supervisor/safe": "publisher"}.items():
            ends = getattr(cell.node, f"get_{end}s_info_by_topic")(topic)
            (found,) = [one for one in ends if one.node_name == "supervisor"]
            best_effort = found.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
            assert best_effort == (topic in CHANGED), topic


def test_an_override_that_means_nothing_is_refused_in_a_sentence():
    stated = "qos_overrides./command_in.subscription.reliability:=perhaps"
    command = [sys.executable, "-m", SUPERVISOR, "--ros-args", "-p", stated, "-r", "__ns:=/"]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=120, env={**os.environ, "ROS_DOMAIN_ID": str(free_domain())}
    )
    assert done.returncode == 2
    (line,) = [line for line in done.stderr.splitlines() if "[rcl]" not in line]
    assert "qos_overrides of command_in" in line
    assert "perhaps" in line
