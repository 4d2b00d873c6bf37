"""~/markers of a supervisor over DDS: level, margin, cause, the way out, the mechanism and its loci."""

from __future__ import annotations

import math
import time
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

from cell import GOOD, HIGH, STRICT, Cell, Wire, going
from rclpy.serialization import deserialize_message
from visualization_msgs.msg import Marker, MarkerArray

import irsbot_kinematics as irs
from irsbot_kinematics.conformance.samples import Machine
from irsbot_kinematics.mechanism import Status
from irsbot_msgs_py.records import Cause, Level, Verdict
from irsbot_supervisor.nodes.later import Steps
from irsbot_supervisor.nodes.loci import FIRST, Asked, Loci, drawn, segments
from irsbot_supervisor.nodes.markers import COLUMNS, stated
from irsbot_supervisor.processes.worker import Task, WorkerError
from irsbot_supervisor.report.sections import AGAIN_S, SHIFT, TURN

pytestmark = pytest.mark.ros


def test_markers_show_level_margin_cause_and_the_way_out(wire: Wire):
    cell = Cell(wire, base_frame="cell", frame_prefix="left/")
    drawn: list[dict[int, Marker]] = []
    heard = lambda message: drawn.append({marker.id: marker for marker in message.markers})  # noqa: E731
    cell.node.create_subscription(MarkerArray, "supervisor/markers", heard, 1)
    cell.heard_level(Level.OK)
    wire.until(lambda: drawn and 1 in drawn[-1] and "OK" in drawn[-1][1].text)
    assert {marker.header.frame_id for marker in drawn[-1].values()} == {"left/cell"}
    platform, text, arrow = (drawn[-1][number] for number in range(3))
    place = platform.pose.position
    assert (place.x, place.y, place.z) == pytest.approx((0.0, 0.0, -0.85), abs=1e-9)
    assert platform.color.g > platform.color.r
    assert "stop 0.040" in text.text  # the constraint margin governs here
    assert arrow.action == Marker.DELETE
    cell.say = going(GOOD, HIGH, time.time_ns(), 1.0)
    wire.until(lambda: cell.states[-1].pose[1] > -0.601, "a robot that is high")
    assert cell.set(**STRICT) == (True, "")
    wire.until(lambda: 2 in drawn[-1] and drawn[-1][2].action == Marker.ADD, "the way out")
    platform, text, arrow = (drawn[-1][number] for number in range(3))
    assert platform.color.r > platform.color.g
    level, margin = text.text.splitlines()
    assert level.startswith("STOP (")
    assert "LATCHED" in level
    assert margin.startswith("Type")
    start, tip = arrow.points
    assert start.z - tip.z > 0.5 * math.dist((start.x, start.z), (tip.x, tip.z))  # down, away from folded legs


def test_markers_show_the_mechanism_and_its_loci(wire: Wire):
    """The rods end at the platform, and every locus is where the maths of the posture say it is."""
    cell = Cell(wire)
    drawn: dict[int, Marker] = {}
    heard = lambda message: drawn.update({marker.id: marker for marker in message.markers})  # noqa: E731
    cell.node.create_subscription(MarkerArray, "supervisor/markers", heard, 1)
    wire.until(lambda: {3, FIRST, FIRST + 1} <= drawn.keys(), "the mechanism and its loci")
    robot = irs.make_robot("irsbot2")
    place = drawn[0].pose.position
    ends = [(point.x, point.y, point.z) for point in drawn[3].points]
    assert len(ends) % 2 == 0
    size = robot.mechanism.length_m
    assert min(math.dist(end, (place.x, place.y, place.z)) for end in ends) < 0.2 * size  # held by its two cranks
    poses = [(point.x, point.z) for point in drawn[FIRST].points]
    assert all(point.y == 0.0 for point in drawn[FIRST].points)
    # A chord of Type 1: on one side of it the pose is reached, on the other not.
    reached = 0
    for (x, z), (to_x, to_z) in zip(poses[::2], poses[1::2], strict=True):
        middle, aside = (0.5 * (x + to_x), 0.5 * (z + to_z)), (z - to_z, to_x - x)
        sides = [_reaches(robot, (middle[0] + way * aside[0], middle[1] + way * aside[1])) for way in (1.0, -1.0)]
        reached += sides[0] != sides[1]
    assert reached > 0.2 * len(poses) / 2  # the other parts belong to one leg alone, beyond reach of the other
    assert len(drawn[FIRST + 1].points) > 100
    before = [(point.x, point.z) for point in drawn[3].points]
    cell.say = going(GOOD, (GOOD[0] + 0.05, GOOD[1]), time.time_ns(), 1.0)
    wire.until(lambda: [(point.x, point.z) for point in drawn[3].points] != before, "a mechanism that moves")


def _reaches(robot: irs.Robot, pose: tuple[float, float]) -> bool:
    try:
        robot.inverse(pose, robot.mechanism.usual_working_mode)
    except irs.Unreachable:
        return False
    return True


@pytest.mark.parametrize(("name", "numbers"), [("five_bar", [10, 11]), ("rrr3", [10, 11, 12]), ("ruu4", [10, 11, 12])])
def test_loci_are_those_of_the_plane_and_say_at_which_turn_and_height(name: str, numbers: list[int]) -> None:
    robot = irs.make_robot(name)
    at = next(at for at in Machine(robot, 20, 11).postures if at.status == Status.SOLVED)
    message = drawn(Asked(robot, at.working_mode, at.pose, "base", "here"))
    found = deserialize_message(message, MarkerArray).markers if message else []
    assert [marker.id for marker in found] == numbers
    assert all(len(marker.points) > 10 and len(marker.points) % 2 == 0 for marker in found[:2])
    if name == "rrr3":
        assert found[2].text == f"loci at phi = {at.pose[2]:.2f} rad"
    if name == "ruu4":
        assert found[2].text == f"section of the loci at z = {at.pose[2]:.2f} m, phi = {at.pose[3]:.2f} rad"
        assert {point.z for marker in found[:2] for point in marker.points} == {at.pose[2]}


def test_a_section_without_a_kind_of_locus_deletes_its_marker() -> None:
    robot = irs.make_robot("linear_delta")
    at = next(at for at in Machine(robot, 20, 11).postures if at.status == Status.SOLVED)
    type1, type2, _text = deserialize_message(
        drawn(Asked(robot, at.working_mode, at.pose, "base", "here")), MarkerArray
    ).markers
    assert (type1.action, bool(type1.points)) == (Marker.ADD, True)
    assert (type2.action, bool(type2.points)) == (Marker.DELETE, False)


def test_a_long_reason_stays_beside_the_mechanism() -> None:
    """In Foxglove one line of a reason went right through the picture, and both of its ends were outside."""
    reason = "no usable sample for more than 50 ms; Type 1 margin 0.97 cannot be shown not to vanish before standstill"
    verdict = Verdict(
        stamp_ns=1,
        level=Level.UNKNOWN,
        causes=Cause.STALE | Cause.BRAKING,
        latched=False,
        event=0,
        escape_direction=(),
        text=reason,
        sequence=1,
        config_hash="",
        since_ns=1,
        speed_scale=0.0,
        findings=(),
    )
    state: Any = SimpleNamespace(stop_cause=Cause.NONE, stop_margin=math.nan)
    level, *lines = stated(state, verdict).splitlines()
    assert level.startswith("UNKNOWN")
    assert len(lines) > 1
    assert max(map(len, lines)) <= COLUMNS
    assert " ".join(lines) == reason


def test_a_thinned_curve_keeps_its_ends_and_its_interruption() -> None:
    curve = np.column_stack([np.arange(1000.0), np.zeros(1000)])
    curve[500] = np.nan
    found = list(segments(curve))
    assert 200 <= len(found) <= 450
    joined = [(float(start[0]), float(end[0])) for start, end in found]
    assert {joined[0][0], joined[-1][1]} == {0.0, 999.0}
    assert not any(start < 500.0 < end for start, end in joined)


class Worked:
    """In place of a worker process: keeps what is asked, and answers when it is told to."""

    def __init__(self) -> None:
        self.asked: list[Steps] = []

    def run(self, steps: Steps) -> None:
        assert isinstance(next(steps), Task)
        self.asked.append(steps)


def test_a_section_is_found_again_where_the_platform_has_turned_but_seldom() -> None:
    robot, worked, logged = irs.make_robot("rrr3"), Worked(), []
    logger: Any = SimpleNamespace(warning=logged.append)
    node: Any = SimpleNamespace(get_fully_qualified_name=lambda: "/supervisor", get_logger=lambda: logger)
    later: Any = worked
    loci = Loci(node, later, robot, robot.mechanism.usual_working_mode, "base")
    loci.want((0.0, 0.0, 0.0), 0.0)
    loci.want((0.3, 0.1, 0.5 * TURN), 100.0)  # moved, hardly turned
    loci.want((0.0, 0.0, 2.0 * TURN), 0.5 * AGAIN_S)  # turned, a moment ago
    assert len(worked.asked) == 1
    with pytest.raises(StopIteration):
        worked.asked[0].send(b"found")
    assert loci.message == b"found"
    loci.want((0.0, 0.0, 2.0 * TURN), 2.0 * AGAIN_S)
    assert len(worked.asked) == 2
    delta = irs.make_robot("linear_delta")
    height = SHIFT * delta.mechanism.length_m
    risen = Loci(node, later, delta, delta.mechanism.usual_working_mode, "base")
    for z, time_s, asked in ((0.1, 0.0, 3), (0.1 + 0.5 * height, 100.0, 3), (0.1 + 2.0 * height, 200.0, 4)):
        risen.want((0.0, 0.0, z), time_s)
        assert len(worked.asked) == asked
    with pytest.raises(StopIteration):
        worked.asked[1].throw(WorkerError("no memory"))  # no verdict depends on it
    assert loci.message == b"found"
    assert "no memory" in logged[0]
