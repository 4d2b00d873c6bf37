"""The supervisor's end of a bond, heard by a stand-in for a lifecycle manager that keeps the contract of bond_core."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

from std_msgs.msg import Header

from irsbot_supervisor.nodes import bond as module
from irsbot_supervisor.nodes.bond import Bond

pytestmark = pytest.mark.ros


class FakeStatus(SimpleNamespace):
    """bond/Status, which has no wheels."""

    def __init__(self, **fields: Any) -> None:
        super().__init__(header=Header(), **fields)


class FakeManager:
    """The other end: alive from the first life sign on, dead with a sign that says so."""

    def __init__(self, name: str) -> None:
        self.name, self.state = name, "waiting"
        self.instances: list[str] = []

    def hear(self, status: FakeStatus) -> None:
        if status.id != self.name:
            return
        if status.instance_id not in self.instances:
            self.instances.append(status.instance_id)
            self.state = "waiting"
        if self.state != "dead":
            self.state = "alive" if status.active else "dead"
        assert 0.0 < status.heartbeat_period < status.heartbeat_timeout


class FakeNode:
    def __init__(self, manager: FakeManager) -> None:
        self._manager, self.topics = manager, list[str]()

    def get_name(self) -> str:
        return "supervisor"

    def create_publisher(self, _kind: Any, topic: str, _qos: Any, **_more: Any) -> Any:
        self.topics.append(topic)
        return SimpleNamespace(publish=self._manager.hear)

    def create_timer(self, _period: float, callback: Any, **_more: Any) -> None:
        self.beat = callback

    def get_clock(self) -> Any:
        return SimpleNamespace(now=lambda: SimpleNamespace(to_msg=lambda: Header().stamp))


def raised(error: Exception) -> None:
    raise error


def test_a_bond_lives_from_activation_to_its_end_and_anew(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(module, "status_type", lambda: FakeStatus)
    manager = FakeManager("supervisor")
    node: Any = FakeNode(manager)
    bond = Bond(node, raised)
    assert node.topics == ["bond"]
    node.beat()
    assert manager.state == "waiting"
    for number in (1, 2):
        bond.form()
        node.beat()
        assert manager.state == "alive"
        assert len(manager.instances) == number
        bond.end()
        assert manager.state == "dead"
        bond.end()
        node.beat()
        assert manager.state == "dead"


def test_without_the_package_there_is_no_bond(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(module, "status_type", lambda: None)
    node: Any = FakeNode(FakeManager("supervisor"))
    bond = Bond(node, raised)
    bond.form()
    bond.end()
    assert node.topics == []
    assert not hasattr(node, "beat")
