"""Loci of singular poses as markers. Finding them takes up to a second, so a worker process does it: `Later.run`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Point, Vector3
from rclpy.node import Node
from rclpy.serialization import serialize_message
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from irsbot_kinematics import Robot
from irsbot_kinematics.mechanism import Signs
from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_msgs_py.records import Floats
from irsbot_supervisor.nodes.later import Later, Steps
from irsbot_supervisor.processes.worker import Task, WorkerError
from irsbot_supervisor.report.sections import AGAIN_S, elsewhere, stated_place

LIFETIME_S = 3
"""s after which the loci of a silent supervisor disappear."""

MOST = 200
"""Points of one uninterrupted curve: at 1.8 degrees apart a circle is drawn to 1.3e-4 of its radius."""

WIDTH, TEXT = 0.006, 0.05
"""Of lines and letters, in lengths of the mechanism."""

FIRST = 10
"""Number of the first marker; smaller ones belong to the mechanism."""

COLOURS = {"type1": (0.45, 0.6, 0.8), "type2": (0.9, 0.3, 0.2)}
"""Red, green, blue; seen on dark and on light ground."""


class Asked(NamedTuple):
    """What the worker needs. Loci without closed form are those of a section at the remaining coordinates of `pose`."""

    robot: Robot
    mode: Signs
    pose: Floats
    frame: str
    namespace: str


class Loci:
    """The newest message with loci, as CDR; empty until it is known."""

    def __init__(self, node: Node, later: Later, robot: Robot, mode: Signs, frame: str) -> None:
        self.message = b""
        self._node, self._later, self._robot, self._mode, self._frame = node, later, robot, mode, frame
        self._of_all_poses = robot.mechanism.loci(mode) is not None
        self._pose: Floats | None = None  # of the newest section
        self._asked_s = 0.0

    def want(self, pose: Floats, now_s: float) -> None:
        """Compute the loci if these are not known, or if the section belongs to another pose."""
        if self._pose is not None:
            again = elsewhere(self._robot.mechanism, pose, self._pose) and now_s - self._asked_s >= AGAIN_S
            if self._of_all_poses or not again:
                return
        self._pose, self._asked_s = pose, now_s
        self._later.run(self._found(Asked(self._robot, self._mode, pose, self._frame, namespace_of(self._node))))

    def _found(self, asked: Asked) -> Steps:
        try:
            self.message = yield Task(drawn, (asked,))
        except WorkerError as error:  # nothing that a verdict depends on
            self._node.get_logger().warning(f"no loci in ~/markers: {error}")


def namespace_of(node: Node) -> str:
    """Namespace of the markers of a node; numbers are counted in it."""
    return str(node.get_fully_qualified_name())


def drawn(asked: Asked) -> bytes:
    """The message, serialized: the executor has only to publish it."""
    from irsbot_supervisor.report.drawing import loci  # loads matplotlib's contours: not in the node

    mechanism = asked.robot.mechanism
    curves, _note = loci(mechanism, asked.mode, np.array([asked.pose]), asked.pose)
    if not curves:
        return b""
    fixed = {one.name: value for one, value in zip(mechanism.task, asked.pose, strict=True) if one.unit == "m"}
    first, second = (one.name for one in mechanism.task[:2])

    def place(point: Array) -> Point:
        return Point(**{**fixed, first: float(point[0]), second: float(point[1])})

    markers = []
    for number, (kind, colour) in enumerate(COLOURS.items(), FIRST):
        lines = _marker(asked, number, Marker.LINE_LIST, colour)
        lines.scale = Vector3(x=WIDTH * mechanism.length_m)
        lines.points = [place(p) for of, points in curves if of == kind for pair in segments(points) for p in pair]
        if not lines.points:  # an empty list would be a warning in RViz
            lines.action = Marker.DELETE
        markers.append(lines)
    if len(mechanism.task) > 2:
        text = _marker(asked, FIRST + len(COLOURS), Marker.TEXT_VIEW_FACING, COLOURS["type1"])
        text.scale = Vector3(z=TEXT * mechanism.length_m)
        what = "section of the loci" if len(fixed) > 2 else "loci"
        text.text = f"{what} at {stated_place(mechanism, asked.pose, '.2f')}"
        text.pose.position = max(markers[0].points, key=_height, default=Point())
        markers.append(text)
    return bytes(serialize_message(MarkerArray(markers=markers)))


def segments(points: Array) -> Iterator[tuple[Array, Array]]:
    """Pieces of a curve (N, 2), thinned evenly, none across an interruption."""
    known = np.isfinite(points[:, 0]) & np.isfinite(points[:, 1])
    for run in np.split(np.arange(len(points)), np.flatnonzero(np.diff(known)) + 1):
        if len(run) > 1 and known[run[0]]:
            rows = np.unique(np.append(run[:: 1 + len(run) // MOST], run[-1]))
            yield from zip(points[rows[:-1]], points[rows[1:]], strict=True)


def _marker(asked: Asked, number: int, kind: int, colour: tuple[float, float, float]) -> Marker:
    """Without a stamp: it holds at any time."""
    red, green, blue = colour
    marker = Marker(ns=asked.namespace, id=number, type=kind)
    marker.header.frame_id = asked.frame
    marker.pose.orientation.w = 1.0
    marker.color = ColorRGBA(r=red, g=green, b=blue, a=1.0)
    marker.lifetime = Duration(sec=LIFETIME_S)
    return marker


def _height(point: Point) -> float:
    return float(point.y + point.z)
