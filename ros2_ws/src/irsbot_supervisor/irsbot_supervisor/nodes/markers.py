"""~/markers for RViz and Foxglove: the mechanism, the platform coloured by level, the governing margin, the cause, the
way out, and the loci."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from math import hypot, isfinite
from operator import mul, neg
from textwrap import fill

from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Point, Vector3
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from irsbot_kinematics import Mechanism, Posture, Robot, statics
from irsbot_kinematics.skeleton import BASE, Bar, bars
from irsbot_msgs_py.records import Cause, Level, SingularityState, Verdict, cause_names
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.nodes.endpoints import publisher
from irsbot_supervisor.nodes.guard import Fail, guarded
from irsbot_supervisor.nodes.later import Later
from irsbot_supervisor.nodes.loci import Loci, namespace_of

PERIOD_S = 0.1
"""s between marker messages."""

LOCI_EVERY = 10
"""Every so many messages one holds the loci instead: they are larger, and change seldom or never."""

LIFETIME_NS = 500_000_000
"""ns: markers of a silent supervisor disappear after this time."""

SIZE = 0.06
"""Diameter of the platform's marker, in lengths of the mechanism; the arrow is five times as long."""

WIDTH = 0.02
"""Of links, likewise."""

COLUMNS = 48
"""Characters of a line of text: about as wide as the mechanism. A verdict may have several hundred."""

LINK, RAIL = (0.55, 0.6, 0.68), (0.4, 0.4, 0.4)
"""Red, green, blue of links, and of the base with what stands out from it."""

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

    def __init__(
        self,
        node: LifecycleNode,
        robot: Robot,
        settings: Settings,
        supervisor: Supervisor,
        later: Later,
        frame: str,
        fail: Fail,
    ) -> None:
        """later: where the loci are computed. frame: of the base."""
        self.state: SingularityState | None = None
        self.verdict: Verdict | None = None
        self._node, self._mechanism, self._supervisor, self._frame = node, robot.mechanism, supervisor, frame
        self._skeleton = robot.mechanism.skeleton()
        self._loci = Loci(node, later, robot, settings.working_mode, frame)
        self._place = (0.0, 0.0, 0.0)
        self._count = 0  # messages until now
        self._publisher = publisher(node, MarkerArray, "~/markers", 1)
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # simulated time may stand still
        node.create_timer(PERIOD_S, guarded(self._draw, fail), clock=steady)

    def _draw(self) -> None:
        state, verdict = self.state, self.verdict
        if state is None or verdict is None or not self._publisher.get_subscription_count():
            return
        self._count += 1
        if self._count % LOCI_EVERY == 0 and self._loci.message:
            self._publisher.publish(self._loci.message)
            return
        if known := all(map(isfinite, (*state.joint_position, *state.pose))):
            self._place = in_space(self._mechanism, state.pose)
            self._loci.want(state.pose, time.monotonic())
        markers = [self._platform(verdict.level), self._text(state, verdict), self._arrow(verdict)]
        if known and self._skeleton is not None:
            drives = dict(zip(self._skeleton.drives, state.joint_position, strict=True))
            found = bars(self._skeleton, {**drives, **self._skeleton.closing(state.joint_position, state.pose)})
            markers.append(self._lines(3, LINK, (bar for bar in found if bar.link != BASE)))
            markers.append(self._lines(4, RAIL, (bar for bar in found if bar.link == BASE)))
        self._publisher.publish(MarkerArray(markers=markers))

    def _platform(self, level: Level) -> Marker:
        marker = self._marker(0, Marker.SPHERE, COLOURS[level])
        x, y, z = self._place
        marker.pose.position = Point(x=x, y=y, z=z)
        marker.scale = Vector3(x=self._size, y=self._size, z=self._size)
        return marker

    def _text(self, state: SingularityState, verdict: Verdict) -> Marker:
        marker = self._marker(1, Marker.TEXT_VIEW_FACING, COLOURS[verdict.level])
        x, y, z = self._place
        marker.pose.position = Point(x=x, y=y, z=z + 2.0 * self._size)
        marker.scale = Vector3(z=self._size)
        marker.text = stated(state, verdict)
        return marker

    def _arrow(self, verdict: Verdict) -> Marker:
        marker = self._marker(2, Marker.ARROW, COLOURS[Level.OK])
        view = self._supervisor.view
        way = way_out(self._mechanism, view.at, verdict.escape_direction) if view else ()
        if way:
            ends = self._place, [start + 5.0 * self._size * part for start, part in zip(self._place, way, strict=True)]
            marker.points = [Point(x=x, y=y, z=z) for x, y, z in ends]
            marker.scale = Vector3(x=0.2 * self._size, y=0.4 * self._size)
        else:
            marker.action = Marker.DELETE
        return marker

    def _lines(self, number: int, colour: tuple[float, float, float], found: Iterable[Bar]) -> Marker:
        """Links; an empty list would stay what it was, and be a warning in RViz."""
        marker = self._marker(number, Marker.LINE_LIST, colour)
        marker.scale = Vector3(x=WIDTH * self._mechanism.length_m)
        marker.points = [Point(x=x, y=y, z=z) for bar in found for x, y, z in (bar.start, bar.end)]
        if not marker.points:
            marker.action = Marker.DELETE
        return marker

    @property
    def _size(self) -> float:
        return SIZE * self._mechanism.length_m

    def _marker(self, number: int, kind: int, colour: tuple[float, float, float]) -> Marker:
        red, green, blue = colour
        marker = Marker(ns=namespace_of(self._node), id=number, type=kind)
        marker.header.frame_id = self._frame
        marker.header.stamp = self._node.get_clock().now().to_msg()
        marker.pose.orientation.w = 1.0
        marker.color = ColorRGBA(r=red, g=green, b=blue, a=1.0)
        marker.lifetime = Duration(nanosec=LIFETIME_NS)
        return marker


def stated(state: SingularityState, verdict: Verdict) -> str:
    """The level with its causes, and the governing margin or the reason why it is not known."""
    causes = cause_names(verdict.causes)
    level = f"{verdict.level.name} ({causes})" if causes else verdict.level.name
    margin = MARGINS.get(Cause(state.stop_cause))
    if margin is None or not isfinite(state.stop_margin):
        return f"{level}\n{fill(verdict.text, COLUMNS)}".strip()
    return f"{level}\n{margin} {state.stop_margin:.3f}, stop {state.stop_limit:.3f}"


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
