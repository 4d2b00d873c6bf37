"""An open command gate with a stand-in for the node: what is published is kept, what is sent is handed over."""

from __future__ import annotations

from collections.abc import Callable
from threading import Condition
from types import SimpleNamespace
from typing import Any

import pytest
from builtin_interfaces.msg import Duration
from controllers import FakeTrajectoryController, FakeVelocityController
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from irsbot_msgs_py.records import Floats
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.nodes import gate, gate_output
from irsbot_supervisor.nodes.gate import CommandGate

PATIENCE_S = 120.0


def set_clock(monkeypatch: pytest.MonkeyPatch, now_ns: Callable[[], int]) -> None:
    """Give the gate another steady clock, ns."""
    for module in (gate, gate_output):
        monkeypatch.setattr(module, "time", SimpleNamespace(monotonic_ns=now_ns))


class FakeNode:
    """Keeps what is published by topic, hands over what is sent."""

    def __init__(self) -> None:
        self.stated: dict[str, list[Any]] = {}
        self.hears: dict[str, Any] = {}
        self.log: list[str] = []
        self.spoke = Condition()

    def create_publisher(self, _kind: Any, topic: str, _qos: Any, **_more: Any) -> Any:
        stated = self.stated.setdefault(topic, [])

        def publish(message: Any) -> None:
            with self.spoke:
                stated.append(message)
                self.spoke.notify_all()

        return SimpleNamespace(publish=publish, wait_for_all_acked=lambda _span: True)

    def create_subscription(self, _kind: Any, topic: str, callback: Any, _qos: Any, **_more: Any) -> None:
        self.hears[topic] = callback

    def get_logger(self) -> Any:
        def tell(text: str, **_more: Any) -> None:
            with self.spoke:
                self.log.append(text)
                self.spoke.notify_all()

        return SimpleNamespace(info=tell, warning=tell)

    def get_clock(self) -> Any:
        return SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=0))


class Opened:
    """An open gate of a supervised robot."""

    def __init__(self, supervisor: Supervisor) -> None:
        self.node, self.errors = FakeNode(), []
        node: Any = self.node
        self.gate = CommandGate(node, supervisor.settings, supervisor.robot, supervisor, self.errors.append)
        self.gate.open()

    @property
    def motions(self) -> list[int]:
        """Numbers of points of what was published; one, at rest, is a hold."""
        return [len(message.points) for message in self.node.stated["command_out"]]

    def rates(self, *wanted: float) -> Floats:
        self.node.hears["velocity_in"](Float64MultiArray(data=wanted))
        return tuple(self.node.stated["velocity_out"][-1].data)

    def go(self, goal: Floats, first_ns: int = 10**9, last_s: int = 2) -> None:
        """To the goal until `first_ns`, and stay there."""
        message = JointTrajectory(joint_names=["joint_1", "joint_2"])
        for after in (Duration(nanosec=first_ns), Duration(sec=last_s)):
            message.points.append(JointTrajectoryPoint(positions=list(goal), time_from_start=after))
        self.node.hears["command_in"](message)

    def obeyed(self) -> tuple[JointTrajectory | None, Floats]:
        """What controllers that heard all of it do now: follow a trajectory, move at rates. They refused nothing."""
        joints = ("joint_1", "joint_2")
        trajectories, velocities = FakeTrajectoryController(joints), FakeVelocityController(len(joints))
        for message in self.node.stated["command_out"]:
            trajectories.hear(message)
        for message in self.node.stated["velocity_out"]:
            velocities.hear(message)
        assert trajectories.refused + velocities.refused == []
        return trajectories.follows, velocities.command

    def until_said(self, number: int) -> None:
        """Until so many trajectories are published, and the gate is done with the last of them."""
        self._until(lambda: len(self.motions) >= number)
        with self.gate._out.lock:
            pass

    def until_logged(self, words: str) -> None:
        self._until(lambda: any(words in text for text in self.node.log))

    def _until(self, seen: Callable[[], bool]) -> None:
        with self.node.spoke:
            heard = self.node.spoke.wait_for(seen, PATIENCE_S)
        assert heard, f"{self.motions}, {self.node.log}, {self.errors}"
