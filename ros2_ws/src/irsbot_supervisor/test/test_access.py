"""The shipped SROS2 policies against the interfaces that the nodes have, and against the form that SROS2 reads."""

from __future__ import annotations

import subprocess
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
from command import IRSBOT

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

pytestmark = pytest.mark.ros

POLICIES = Path(__file__).parents[1] / "policies"
NODES = ("consumer", "kinematics", "operator", "recorder", "simulated_joints", "supervisor")


def allowed(name: str, kind: str) -> set[str]:
    """Names that a policy allows to publish, subscribe, reply or request."""
    root = ElementTree.parse(POLICIES / f"{name}.policy.xml").getroot()
    return {entry.text or "" for part in root.iter() if part.get(kind) == "ALLOW" for entry in part}


@pytest.mark.parametrize("name", NODES)
def test_the_shipped_policy_allows_exactly_the_names_of_the_node(name: str):
    """Made anew from a running node, in a process of its own."""
    command = [*IRSBOT, "policy", name]
    made = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert (made.returncode, made.stderr) == (0, "")
    assert made.stdout == (POLICIES / f"{name}.policy.xml").read_text()


def test_who_may_do_what():
    publishers = {name for name in NODES if "/joint_states" in allowed(name, "publish")}
    assert publishers == {"simulated_joints"}
    assert {name for name in NODES if "/supervisor/verdict" in allowed(name, "publish")} == {"supervisor"}
    for call in ("reset", "bypass"):
        assert {name for name in NODES if f"/supervisor/{call}" in allowed(name, "request")} == {"operator"}
        assert f"/supervisor/{call}" in allowed("supervisor", "reply")
    for name in NODES:  # of others' parameters and transitions
        assert not any("set_parameters" in one or "change_state" in one for one in allowed(name, "request"))
    assert allowed("recorder", "subscribe") >= {"/joint_states", "/supervisor/verdict", "/command_in"}
    assert "/supervisor/markers" in allowed("recorder", "subscribe"), "recorded on request"
    assert allowed("consumer", "subscribe") >= {"/supervisor/verdict", "/supervisor/safe"}
    assert not {name for name in allowed("consumer", "publish") if name.startswith("/supervisor")}


@pytest.mark.parametrize("name", NODES)
def test_a_node_of_rclpy_can_start_with_every_policy(name: str):
    """Its constructor makes these, and raises if one of them is denied."""
    services = "describe_parameters get_parameter_types get_parameters list_parameters set_parameters"
    services += " set_parameters_atomically get_type_description"
    assert allowed(name, "publish") >= {"/rosout", "/parameter_events"}
    assert allowed(name, "reply") >= {f"/{name}/{service}" for service in services.split()}


@pytest.mark.parametrize("name", NODES)
def test_a_policy_allows_and_never_denies_because_the_rest_is_denied(name: str):
    root = ElementTree.parse(POLICIES / f"{name}.policy.xml").getroot()
    assert root.tag == "policy"
    (profile,) = root.findall("enclaves/enclave/profiles/profile")
    assert (profile.get("ns"), profile.get("node")) == ("/", name)
    for part in profile:
        assert part.tag in ("topics", "services")
        assert set(part.attrib.values()) == {"ALLOW"}
        assert all(entry.tag == part.tag.rstrip("s") and (entry.text or "").startswith("/") for entry in part)
        assert not any("*" in (entry.text or "") for entry in part)


def test_an_unknown_node_is_refused_in_one_line():
    command = [*IRSBOT, "policy", "nobody"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert "no node 'nobody'; there are" in line
