"""~/markers for RViz and Foxglove: the platform coloured by level, the governing margin, and the way out."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, isfinite
from operator import mul, neg

from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Point, Vector3
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from irsbot_kinematics import Mechanism, Posture, Robot, statics
from irsbot_msgs_py.records import Cause, Level, SingularityState, Verdict
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.nodes.endpoints import publisher
from irsbot_supervisor.nodes.guard import Fail, guarded

PERIOD_S = 0.1
"""s between marker messages."""

LIFETIME_NS = 500_000_000
"""ns: markers of a silent supervisor disappear after this time."""

SIZE = 0.06
"""Diameter of the platform's marker, in lengths of the mechanism; the arrow is five times as long."""

COLOURS = {
    Level.OK: (0.1, 0.7, 0.2),
    Level.WARN: (1.0, 0.75, 0.0),
    Level.STOP: (0.85, 0.1, 0.1),
    Level.UNKNOWN: (0.5, 0.2, 0.7),
}
"""Red, green, blue."""

MARGINS = {
    Cause.TYPE1: "Type 1",
    Cause.TYPE2: "Type 2",
    Cause.CONSTRAINT: "constraint",
    Cause.LIMB: "limb",
}


class MarkersPublisher:
    """Keeps the newest state and verdict and draws them while there is a subscriber."""

    def __init__(self, node: LifecycleNode, robot: Robot, supervisor: Supervisor, frame: str, fail: Fail) -> None:
        self.state: SingularityState | None = None
        self.verdict: Verdict | None = None
        self._node, self._mechanism, self._supervisor, self._frame = node, robot.mechanism, supervisor, frame
        self._place = (0.0, 0.0, 0.0)
        self._publisher = publisher(node, MarkerArray, "~/markers", 1)
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # simulated time may stand still
        node.create_timer(PERIOD_S, guarded(self._draw, fail), clock=steady)

    def _draw(self) -> None:
        state, verdict = self.state, self.verdict
        if state is None or verdict is None or not self._publisher.get_subscription_count():
            return
        if all(map(isfinite, state.pose)):
            self._place = in_space(self._mechanism, state.pose)
        size = SIZE * self._mechanism.length_m
        x, y, z = self._place
        platform = self._marker(0, Marker.SPHERE, verdict.level)
        platform.pose.position = Point(x=x, y=y, z=z)
        platform.scale = Vector3(x=size, y=size, z=size)
        text = self._marker(1, Marker.TEXT_VIEW_FACING, verdict.level)
        text.pose.position = Point(x=x, y=y, z=z + 2.0 * size)
        text.scale = Vector3(z=size)
        text.text = stated(state, verdict)
        arrow = self._marker(2, Marker.ARROW, Level.OK)
        view = self._supervisor.view
        way = way_out(self._mechanism, view.at, verdict.escape_direction) if view else ()
        if way:
            tip = [start + 5.0 * size * part for start, part in zip(self._place, way, strict=True)]
            arrow.points = [Point(x=x, y=y, z=z), Point(x=tip[0], y=tip[1], z=tip[2])]
            arrow.scale = Vector3(x=0.2 * size, y=0.4 * size)
        else:
            arrow.action = Marker.DELETE
        self._publisher.publish(MarkerArray(markers=[platform, text, arrow]))

    def _marker(self, number: int, kind: int, level: Level) -> Marker:
        red, green, blue = COLOURS[level]
        marker = Marker(ns=self._node.get_fully_qualified_name(), id=number, type=kind)
        marker.header.frame_id = self._frame
        marker.header.stamp = self._node.get_clock().now().to_msg()
        marker.pose.orientation.w = 1.0
        marker.color = ColorRGBA(r=red, g=green, b=blue, a=1.0)
        marker.lifetime = Duration(nanosec=LIFETIME_NS)
        return marker


def stated(state: SingularityState, verdict: Verdict) -> str:
    """The level, and the governing margin or the reason why it is not known."""
    margin = MARGINS.get(Cause(state.stop_cause))
    if margin is None or not isfinite(state.stop_margin):
        return f"{verdict.level.name} {verdict.text}".strip()
    return f"{verdict.level.name} {margin} {state.stop_margin:.3f}, stop {state.stop_limit:.3f}"


def way_out(mechanism: Mechanism, at: Posture, escape: Sequence[float]) -> tuple[float, ...]:
    """Motion of the platform if the joints move along the escape direction: a unit vector in space, or empty."""
    if not escape or not at.det:
        return ()
    motion = in_space(mechanism, statics.twist(at.screws, tuple(map(neg, map(mul, at.levers, escape)))))
    size = hypot(*motion)
    return tuple(part / size for part in motion) if size > 0.0 and isfinite(size) else ()


def in_space(mechanism: Mechanism, values: Sequence[float]) -> tuple[float, float, float]:
    """Task coordinates, or their rates, as x, y, z of the base frame; coordinates that a planar robot does not have are
    0."""
    parts = dict(zip((coordinate.name for coordinate in mechanism.task), values, strict=True))
    return parts.get("x", 0.0), parts.get("y", 0.0), parts.get("z", 0.0)
