"""Publishers and subscribers of the topics of the supervisor, and the compatibility of their QoS."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node
from rclpy.qos import QoSCompatibility, QoSProfile, qos_check_compatible
from rclpy.topic_endpoint_info import TopicEndpointInfo

OUTPUTS, INPUTS = ("~/safe", "~/state", "command_out", "velocity_out"), ("command_in", "velocity_in")
"""Topics of which only a mismatch is reported."""


class GraphFault(NamedTuple):
    """One diagnostic status: its name, a level of DiagnosticStatus, and a sentence."""

    name: str
    level: bytes
    text: str


class GraphMonitor:
    """Examines the graph; logs changes."""

    def __init__(self, node: Node, counts: Counter[str]) -> None:
        """counts: of observed faults, for /diagnostics."""
        self._node, self._counts = node, counts
        self._before: list[GraphFault] = []
        self._known: set[bytes] = set()  # publishers of joint states at the last look, by the middleware's number

    def look(self) -> list[GraphFault]:
        """Findings on joint states, on verdicts, and on the other topics."""
        samples, verdicts = map(self._node.resolve_topic_name, ("joint_states", "~/verdict"))
        publishers, subscribers = self._node.get_publishers_info_by_topic, self._node.get_subscriptions_info_by_topic
        asked, offered = self._ours(subscribers(samples)), self._ours(publishers(verdicts))
        ends = publishers(samples)
        now = {bytes(end.endpoint_gid) for end in ends}
        if len(now) > 1:
            self._counts["second publishers of joint states"] += len(now - self._known) - (not self._known)
        self._known = now
        found = [_of_publishers(ends, asked), _of_subscribers(subscribers(verdicts), offered), self._others()]
        for finding in found:
            if finding.level != DiagnosticStatus.OK and finding not in self._before:
                self._node.get_logger().warning(f"{finding.name}: {finding.text}")
        self._before = found
        return found

    def _others(self) -> GraphFault:
        publishers, subscribers = self._node.get_publishers_info_by_topic, self._node.get_subscriptions_info_by_topic
        unfit = []
        for topic in map(self._node.resolve_topic_name, OUTPUTS):
            unfit += [f"{topic}: {end}" for end in _deaf(subscribers(topic), self._ours(publishers(topic)))]
        for topic in map(self._node.resolve_topic_name, INPUTS):
            unfit += [f"{topic}: {end}" for end in _mute(publishers(topic), self._ours(subscribers(topic)))]
        if unfit:
            return GraphFault("other topics", DiagnosticStatus.ERROR, f"do not fit: {'; '.join(unfit)}")
        return GraphFault("other topics", DiagnosticStatus.OK, "every quality of service fits")

    def _ours(self, ends: list[TopicEndpointInfo]) -> list[QoSProfile]:
        """The QoS profile as the middleware completes it, not as it was requested."""
        us = self._node.get_fully_qualified_name()
        return [end.qos_profile for end in ends if _name(end) == us]


def _of_publishers(publishers: list[TopicEndpointInfo], asked: list[QoSProfile]) -> GraphFault:
    name = "joint states publishers"
    if mute := _mute(publishers, asked):
        return GraphFault(name, DiagnosticStatus.ERROR, f"not heard: {'; '.join(mute)}")
    if len(publishers) > 1:
        who = ", ".join(sorted(f"{_name(end)} ({bytes(end.endpoint_gid).hex()})" for end in publishers))
        return GraphFault(name, DiagnosticStatus.WARN, f"{len(publishers)} publishers, one is expected: {who}")
    if not publishers:
        return GraphFault(name, DiagnosticStatus.WARN, "there is no publisher of joint states")
    return GraphFault(name, DiagnosticStatus.OK, _name(publishers[0]))


def _of_subscribers(subscribers: list[TopicEndpointInfo], offered: list[QoSProfile]) -> GraphFault:
    name = "verdict subscribers"
    if deaf := _deaf(subscribers, offered):
        return GraphFault(name, DiagnosticStatus.ERROR, f"do not receive the verdict: {'; '.join(deaf)}")
    return GraphFault(name, DiagnosticStatus.OK, ", ".join(sorted(map(_name, subscribers))) or "none")


def _mute(publishers: list[TopicEndpointInfo], asked: list[QoSProfile]) -> list[str]:
    """Publishers that we do not hear, and why."""
    return [text for end in publishers for qos in asked if (text := _mismatch(end, end.qos_profile, qos))]


def _deaf(subscribers: list[TopicEndpointInfo], offered: list[QoSProfile]) -> list[str]:
    """Subscribers that do not hear us, and why."""
    return [text for end in subscribers for qos in offered if (text := _mismatch(end, qos, end.qos_profile))]


def _mismatch(end: TopicEndpointInfo, offered: QoSProfile, asked: QoSProfile) -> str:
    """The other end, and its incompatible policies; empty if all are compatible."""
    fits, why = qos_check_compatible(offered, asked)
    return f"{_name(end)} ({why.replace('ERROR: ', '').rstrip('; ')})" if fits == QoSCompatibility.ERROR else ""


def _name(end: TopicEndpointInfo) -> str:
    return f"{end.node_namespace.rstrip('/')}/{end.node_name}"
