"""Passive joints and frames as the supervisor tells them: against forward kinematics of the written description."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

from supervised import ready, sample

from irsbot_kinematics.description.urdf import urdf
from irsbot_supervisor.nodes import posture as module
from irsbot_supervisor.nodes.posture import PosturePublisher

pytestmark = pytest.mark.ros


class FakeFrames(SimpleNamespace):
    """tf2_msgs/TFMessage, which has no wheels: a list of transforms."""


class FakeNode:
    """Keeps what is published, and the callback of the timer."""

    def __init__(self, listeners: int = 1) -> None:
        self.stated: dict[str, list[Any]] = {}
        self.listeners = listeners

    def create_publisher(self, _kind: Any, topic: str, _qos: Any, **_more: Any) -> Any:
        stated = self.stated.setdefault(topic, [])
        return SimpleNamespace(publish=stated.append, get_subscription_count=lambda: self.listeners)

    def create_timer(self, _period: float, callback: Any, **_more: Any) -> None:
        self.beat = callback


def matrix(rotation: Any) -> np.ndarray:
    x, y, z, w = rotation.x, rotation.y, rotation.z, rotation.w
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def told(monkeypatch: pytest.MonkeyPatch, listeners: int = 1) -> tuple[FakeNode, PosturePublisher, Any]:
    supervisor, q = ready()
    state = supervisor.step(sample(1, q)).state
    monkeypatch.setattr(module, "frames_type", lambda: FakeFrames)
    node: Any = FakeNode(listeners)
    publisher = PosturePublisher(node, supervisor.robot, "left/", _raise)
    publisher.state = state
    return node, publisher, state


def _raise(error: Exception) -> None:
    raise error


def test_frames_and_driven_joints_lead_to_where_the_platform_is(monkeypatch: pytest.MonkeyPatch):
    node, _publisher, state = told(monkeypatch)
    node.beat()
    (frames,) = node.stated["/tf"]
    root = ElementTree.fromstring(urdf(ready()[0].robot))
    by_child = {frame.child_frame_id: frame for frame in frames.transforms}
    assert all(frame.header.frame_id.startswith("left/") for frame in frames.transforms)
    driven = dict(zip(("joint_1", "joint_2"), state.joint_position, strict=True))
    where = {"base": (np.eye(3), np.zeros(3))}
    for joint in root.findall("joint"):  # what robot_state_publisher does with joint states and fixed joints
        parent, child = joint.find("parent").get("link"), joint.find("child").get("link")
        turn, place = where[parent]
        if (frame := by_child.get(f"left/{child}")) is not None:
            t = frame.transform.translation
            assert frame.header.frame_id == f"left/{parent}"
            where[child] = turn @ matrix(frame.transform.rotation), place + turn @ [t.x, t.y, t.z]
            continue
        place = place + turn @ np.array([float(x) for x in joint.find("origin").get("xyz").split()])
        if joint.get("type") != "fixed":
            angle = driven[joint.get("name")]  # about y
            c, s = np.cos(angle), np.sin(angle)
            turn = turn @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        where[child] = turn, place
    np.testing.assert_allclose(where["platform"][1], [state.pose[0], 0.0, state.pose[1]], atol=1e-9)
    np.testing.assert_allclose(where["platform"][0], np.eye(3), atol=1e-9)


def test_each_state_is_published_once_and_only_to_subscribers(monkeypatch: pytest.MonkeyPatch):
    node, publisher, state = told(monkeypatch)
    node.beat()
    node.beat()
    (message,) = node.stated["~/passive_joint_states"]
    assert len(message.name) == len(set(message.name)) == len(message.position) == 12
    assert not {"joint_1", "joint_2"} & set(message.name)
    assert message.header.stamp.sec == state.stamp_ns // 10**9
    publisher.state = state._replace(sequence=state.sequence + 1, pose=(float("nan"),) * 2)
    node.beat()
    assert len(node.stated["~/passive_joint_states"]) == 1
    silent, _publisher, _state = told(monkeypatch, listeners=0)
    silent.beat()
    assert silent.stated == {"~/passive_joint_states": [], "/tf": []}
