"""The command gate over DDS: supervisor and simulated joints in processes of their own, commanded through the gate."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
from math import nan
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

from builtin_interfaces.msg import Duration
from cell import NAMES, PATIENCE_S, ROBOT, Cell, Wire
from lifecycle_msgs.msg import Transition
from rclpy.qos import QoSProfile
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from irsbot_msgs_py.records import Floats, Level
from irsbot_supervisor.processes.suite import GATED, JOINTS, Node
from irsbot_supervisor.sim.simulation import STANDING

pytestmark = pytest.mark.ros

RATE_HZ = 200.0
"""Samples per second: few enough for a machine on which much else runs."""

STOP = 0.15
"""The stop limit of the Type 1 margin of irsbot2, as shipped."""

MACHINE = {"velocity_limit": [1.0], "acceleration_limit": [40.0], "deceleration_limit": [40.0]}
LATE = {"stale_s": 0.2, "sample_gap_s": 0.2}
"""Slow drives, and samples that may come as late as on a busy machine: the gate leaves room for both."""

ROOM = 0.35
"""1: what the Type 1 margin changes at most while such drives go on for `sample_gap_s`, judging, `latency_s` and the
lag of the gate, brake, and both legs turn against each other: by less than 1/rad each, 0.24 rad and 0.0125 rad."""


class Station:
    """One gated robot, what is sent to it, and what its gate lets through."""

    def __init__(self, wire: Wire) -> None:
        self.wire = wire
        self.cell = Cell(wire, **MACHINE, **LATE)
        self.cell.say = lambda _ns: None  # the simulated joints speak
        drives = {"robot": "irsbot2", "scenario": STANDING, "gated": True, "rate_hz": RATE_HZ, **MACHINE}
        self.cell.suite.start(Node("simulated_joints", JOINTS, drives, GATED))
        node, deep = self.cell.node, QoSProfile(depth=1000)
        self.velocities: list[Floats] = []
        self.motions: list[JointTrajectory] = []
        node.create_subscription(
            Float64MultiArray, "velocity_out", lambda m: self.velocities.append(tuple(m.data)), deep
        )
        node.create_subscription(JointTrajectory, "command_out", self.motions.append, deep)
        self.velocity = node.create_publisher(Float64MultiArray, "velocity_in", 10)
        self.trajectory = node.create_publisher(JointTrajectory, "command_in", 10)
        self.wanted: Floats | None = None
        node.create_timer(0.02, self._speak)
        for publisher in (self.velocity, self.trajectory):
            wire.until(lambda p=publisher: p.get_subscription_count() > 0, "the gate listens")
        self.cell.heard_level(Level.OK)

    @property
    def joints(self) -> Floats:
        return self.cell.states[-1].joint_position

    @property
    def stands(self) -> bool:
        return all(abs(rate) < 1e-6 for rate in self.cell.states[-1].joint_velocity)

    def until(self, happened: Callable[[], Any], what: str = "") -> None:
        self.wire.until(happened, what)

    def go(self, *goals: Floats, seconds: float = 1.0, names: tuple[str, ...] = NAMES) -> JointTrajectory:
        """Send a trajectory and return what comes out of the gate for it."""
        message = JointTrajectory(joint_names=list(names))
        for number, goal in enumerate(goals, 1):
            after = Duration(sec=int(number * seconds), nanosec=round(number * seconds % 1 * 1e9))
            message.points.append(JointTrajectoryPoint(positions=list(goal), time_from_start=after))
        before = len(self.motions)
        self.trajectory.publish(message)
        self.until(lambda: len(self.motions) > before, "an answer of the gate")
        return self.motions[before]

    def drive(self, goal: Floats, seconds: float = 2.5) -> Floats:
        """Until the robot stands at the end of what the gate makes of a motion, which is returned. A machine that is
        too busy for its samples makes the gate hold; then the motion is commanded again, as an operator would."""
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            begin, motion = self.joints, self.go(goal, seconds=seconds)
            end = tuple(motion.points[-1].positions)
            held = _near(end, begin) and not _near(goal, begin)
            if not held and self._arrived(end):
                return self.joints
            self.cell.heard(lambda verdict: verdict.level <= Level.WARN, "leave to move")
        raise AssertionError(f"the robot did not arrive in {PATIENCE_S:.0f} s")

    def _arrived(self, end: Floats) -> bool:
        """Wait until the robot is at the end of a motion, has been told otherwise, or stands: joints that missed a
        verdict on a busy machine brake and forget what they were told."""
        told, seen = len(self.motions), len(self.cell.states)
        self.until(
            lambda: (
                len(self.motions) > told
                or _near(end, self.joints)
                or (len(self.cell.states) > seen + RATE_HZ and self.stands)
            ),
            "the end of the motion",
        )
        if _near(end, self.joints):
            self.until(lambda: self.stands, "standstill")
        return _near(end, self.joints)

    def _speak(self) -> None:
        if self.wanted is not None:
            self.velocity.publish(Float64MultiArray(data=list(self.wanted)))


def _near(a: Floats, b: Floats) -> bool:
    return max(abs(one - other) for one, other in zip(a, b, strict=True)) < 1e-4


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Station]:
    with Wire(tmp_path_factory.mktemp("gate")) as wire:
        station = Station(wire)
        yield station
        assert "Traceback" not in station.cell.printed
        assert station.cell.suite.stop() == {"supervisor": 0, "simulated_joints": 0}


@pytest.fixture
def station(shared: Station) -> Station:
    """A robot at rest that is OK and has room, whatever it did before."""
    shared.wanted = None
    shared.until(lambda: shared.stands, "standstill")
    if (verdict := shared.cell.verdicts[-1]).latched:  # by samples that were late, on a busy machine
        shared.cell.reset_at_rest(verdict.event)
    shared.drive(tuple(ROBOT.inverse((0.0, -0.85)).tolist()))
    return shared


def test_a_commanded_velocity_moves_the_joints_and_ends_with_the_commands(station: Station):
    start = station.joints
    station.wanted = (0.2, -0.1)
    station.until(lambda: station.joints[0] > start[0] + 0.02, "motion")
    station.wanted = None
    station.until(lambda: station.stands, "standstill after the last command")
    station.until(lambda: station.velocities[-1] == (0.0, 0.0), "zeros after the last command")
    assert (station.joints[1] - start[1]) == pytest.approx(-0.5 * (station.joints[0] - start[0]), rel=0.05)


def test_commanded_at_a_limit_the_robot_comes_to_rest_before_it_and_is_not_stopped(station: Station):
    events = station.cell.verdicts[-1].event
    station.wanted = (1.0, -1.0)
    station.until(lambda: min(station.cell.states[-1].type1_margin) < STOP + ROOM, "nearness of the limit")
    station.until(lambda: max(map(abs, station.cell.states[-1].joint_velocity)) < 0.3, "rest")
    assert station.cell.verdicts[-1].event == events
    assert min(min(state.type1_margin) for state in station.cell.states if state.level < Level.UNKNOWN) >= STOP


@pytest.mark.parametrize("wanted", [(nan, 0.1), (0.1,), ()])
def test_a_velocity_that_is_none_holds_the_robot(station: Station, wanted: Floats):
    before = station.joints
    seen = len(station.velocities)
    station.wanted = wanted
    held = [(0.0, 0.0)] * 5  # what was on its way from the gate before may come first
    station.until(lambda: len(station.velocities) >= seen + 5 and station.velocities[-5:] == held, "zeros of the gate")
    assert station.joints == pytest.approx(before, abs=1e-5)  # the last of the way home may still be told
    assert not station.cell.verdicts[-1].latched


def test_a_safe_trajectory_is_driven_to_its_end(station: Station):
    goal = tuple(ROBOT.inverse((0.1, -0.8)).tolist())
    assert station.drive(goal) == pytest.approx(goal)


def test_a_trajectory_through_a_limit_ends_in_front_of_it(station: Station):
    events = station.cell.verdicts[-1].event
    start = station.joints
    end = station.drive((start[0] + 1.9, start[1] - 1.9), seconds=4.0)
    assert 1.0 < end[0] - start[0] < 1.8  # both legs are straight after 1.76 rad
    assert min(station.cell.states[-1].type1_margin) >= STOP
    assert station.cell.verdicts[-1].event == events


@pytest.mark.parametrize(
    ("goal", "names"), [((nan, 0.0), NAMES), ((0.1, 0.2), ("joint_1", "elbow")), ((0.1,), ("joint_1",))]
)
def test_a_trajectory_that_is_none_means_hold(station: Station, goal: Floats, names: tuple[str, ...]):
    (rest,) = station.go(goal, names=names).points
    assert tuple(rest.positions) == pytest.approx(station.joints, abs=1e-3)
    assert tuple(rest.velocities) == (0.0, 0.0)
    assert not station.cell.verdicts[-1].latched


def test_a_supervisor_that_ends_while_velocities_pass_publishes_zeros_and_a_hold_last(tmp_path: Path):
    """A velocity controller keeps what it heard last, for ever."""
    with Wire(tmp_path) as wire:
        station = Station(wire)
        station.wanted = (0.2, -0.2)

        def silenced_while_moving(silence: Callable[[], Any]) -> None:
            station.until(lambda: station.velocities and station.velocities[-1] == station.wanted, "motion")
            holds = len(station.motions)
            silence()
            station.until(lambda: station.velocities[-1] == (0.0, 0.0), "zeros")
            station.until(lambda: len(station.motions) > holds, "a hold")
            assert len(station.motions[-1].points) == 1

        silenced_while_moving(lambda: station.cell.change(Transition.TRANSITION_DEACTIVATE))
        assert station.cell.change(Transition.TRANSITION_ACTIVATE)
        silenced_while_moving(lambda: station.cell.suite.end("supervisor", signal.SIGTERM))
