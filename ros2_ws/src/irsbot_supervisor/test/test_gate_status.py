"""~/gate over DDS: every reason that a command may meet is reached and heard, in words and as constants."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

import rclpy
from builtin_interfaces.msg import Duration
from cell import NAMES, PATIENCE_S
from gated import set_clock
from irsbot_msgs.msg import GateStatus as GateStatusMsg
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Float64MultiArray
from supervised import at_ns, feed, joints_of, ready, sample, tick
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from irsbot_msgs_py.convert import gate_status_record
from irsbot_msgs_py.gate_status import GateCommand, GateOutcome, GateReason, GateStatus
from irsbot_msgs_py.records import Cause, Floats, Level
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.nodes.gate import CommandGate
from irsbot_supervisor.processes.suite import free_domain

pytestmark = [
    pytest.mark.ros,
    # rclpy reads .idl files with a version of lark that still imports this module
    pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning"),
]

MIDDLE = (0.0, -0.85)
BOUNDARY = (1.04, -0.49)
"""m: leg 1 of irsbot2 is 0.6 rad from straight, and gets nearer while its joint falls."""


class Client:
    """Sends commands to the gate of a supervised robot over DDS, and hears what it says of them."""

    def __init__(self, context: rclpy.Context, supervisor: Supervisor) -> None:
        self.supervisor = supervisor
        self.statuses: list[GateStatus] = []
        self.errors: list[Exception] = []
        self._nodes = [rclpy.create_node(name, context=context) for name in ("supervisor", "client")]
        served: Any = self._nodes[0]
        self.gate = CommandGate(served, supervisor.settings, supervisor.robot, supervisor, self.errors.append)
        self.gate.open()
        self.node = node = self._nodes[1]
        self.listen(self.statuses)
        self._velocity = node.create_publisher(Float64MultiArray, "velocity_in", 10)
        self._trajectory = node.create_publisher(JointTrajectory, "command_in", 10)
        self._executor = SingleThreadedExecutor(context=context)
        for one in self._nodes:
            self._executor.add_node(one)
        self.until(lambda: self._velocity.get_subscription_count() and self._trajectory.get_subscription_count())
        self.heard(GateReason.NO_COMMAND)  # who comes late hears of the opening
        self.statuses.clear()

    def listen(self, statuses: list[GateStatus]) -> None:
        """Collect what the gate says from now on, and what it keeps for those who come late."""
        lasting = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.node.create_subscription(
            GateStatusMsg, "supervisor/gate", lambda m: statuses.append(gate_status_record(m)), lasting
        )

    def until(self, happened: Callable[[], Any]) -> None:
        deadline = time.monotonic() + PATIENCE_S
        while not happened():
            assert time.monotonic() < deadline, f"in vain: {self.statuses[-3:]}"
            self._executor.spin_once(timeout_sec=0.05)

    def heard(self, reason: GateReason) -> GateStatus:
        self.until(lambda: any(status.reason == reason for status in self.statuses))
        return next(status for status in self.statuses if status.reason == reason)

    def velocity(self, *rates: float) -> None:
        self._velocity.publish(Float64MultiArray(data=rates))

    def trajectory(self, goal: Floats, seconds: float = 1.0, names: tuple[str, ...] = NAMES) -> None:
        message = JointTrajectory(joint_names=list(names))
        after = Duration(sec=int(seconds), nanosec=round(seconds % 1 * 1e9))
        message.points.append(JointTrajectoryPoint(positions=list(goal), time_from_start=after))
        self._trajectory.publish(message)

    def close(self) -> None:
        self.gate.end()
        self._executor.shutdown()
        for node in self._nodes:
            node.destroy_node()
        assert self.errors == []


@pytest.fixture(scope="module")
def context() -> Iterator[rclpy.Context]:
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=free_domain())
    yield context
    rclpy.shutdown(context=context)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """The gate's steady clock: `now_ns` is the time of the test."""
    now = SimpleNamespace(now_ns=at_ns(0)[1])
    set_clock(monkeypatch, lambda: now.now_ns)
    return now


def standing(context: rclpy.Context, pose: Floats = MIDDLE, **changes: Any) -> Client:
    return Client(context, ready(pose=pose, **changes)[0])


def near_by(client: Client, way: float = 0.05) -> Floats:
    first, second = joints_of(client.supervisor, *MIDDLE)
    return first + way, second


def meet_none(client: Client, _clock: SimpleNamespace) -> None:
    client.velocity(0.1, -0.1)


def meet_inactive(client: Client, _clock: SimpleNamespace) -> None:
    client.gate.close()


def meet_no_command(client: Client, clock: SimpleNamespace) -> None:
    client.velocity(0.1, -0.1)
    client.heard(GateReason.NONE)
    client.statuses.clear()
    clock.now_ns += round(1.01e9 * client.supervisor.settings.command_timeout_s)
    client.gate.beat(clock.now_ns)


def meet_cancelled(client: Client, _clock: SimpleNamespace) -> None:
    client.gate.halt(GateReason.CANCELLED)


def meet_invalid(client: Client, _clock: SimpleNamespace) -> None:
    client.trajectory((0.1, 0.2), names=("joint_1", "elbow"))


def meet_unknown(client: Client, _clock: SimpleNamespace) -> None:
    client.supervisor.step(tick(5000.0))
    client.trajectory(near_by(client))


def meet_stop(client: Client, clock: SimpleNamespace) -> None:
    """The robot still moves when it is commanded."""
    q = joints_of(client.supervisor, *BOUNDARY)
    for ms in range(1, 75):
        client.supervisor.step(sample(ms, (q[0] - 6e-3 * ms, q[1]), (-6.0, 0.0)))
        if client.supervisor.view is not None and client.supervisor.view.judgement.level == Level.STOP:
            break
    clock.now_ns = client.supervisor.view.seen_ns
    client.velocity(0.1, 0.1)


def meet_speed(client: Client, _clock: SimpleNamespace) -> None:
    client.velocity(0.0, 1e6)


def meet_limit(client: Client, clock: SimpleNamespace) -> None:
    """The robot is held until a heartbeat has found what passes."""
    client.velocity(-6.0, 0.0)
    assert client.heard(GateReason.LIMIT).outcome == GateOutcome.HELD
    client.statuses.clear()
    for _ in range(10):
        client.gate.beat(clock.now_ns)


def meet_stopping(client: Client, _clock: SimpleNamespace) -> None:
    """To where a slow motion may just end, as fast as the drives can."""
    q = joints_of(client.supervisor, *MIDDLE)
    passed: list[JointTrajectory] = []
    client.node.create_subscription(JointTrajectory, "command_out", passed.append, 10)
    client.trajectory((q[0] + 1.9, q[1] - 1.9), seconds=4.0)
    client.heard(GateReason.LIMIT)
    client.until(lambda: passed)
    client.trajectory(tuple(passed[-1].points[-1].positions), seconds=0.3)


def meet_joining(client: Client, clock: SimpleNamespace) -> None:
    q = joints_of(client.supervisor, *MIDDLE)
    feed(client.supervisor, [sample(ms, (q[0] + 1e-3 * ms, q[1]), (1.0, 0.0)) for ms in range(100)])
    clock.now_ns = at_ns(99)[1]
    client.trajectory((q[0] - 0.5, q[1]), seconds=0.001)


def meet_internal(client: Client, _clock: SimpleNamespace) -> None:
    def fail(*_: Any) -> None:
        raise RuntimeError("broken for a test")

    client.gate._certifier.motions = SimpleNamespace(motion=fail)
    client.trajectory(near_by(client))


HELD, LIMITED = GateOutcome.HELD, GateOutcome.LIMITED
NONE, VELOCITY, TRAJECTORY = GateCommand.NONE, GateCommand.VELOCITY, GateCommand.TRAJECTORY
MEETINGS = [
    (GateReason.NONE, meet_none, MIDDLE, VELOCITY, GateOutcome.PASSED),
    (GateReason.INACTIVE, meet_inactive, MIDDLE, NONE, HELD),
    (GateReason.NO_COMMAND, meet_no_command, MIDDLE, VELOCITY, HELD),
    (GateReason.CANCELLED, meet_cancelled, MIDDLE, TRAJECTORY, HELD),
    (GateReason.INVALID, meet_invalid, MIDDLE, TRAJECTORY, HELD),
    (GateReason.UNKNOWN, meet_unknown, MIDDLE, TRAJECTORY, HELD),
    (GateReason.STOP, meet_stop, BOUNDARY, VELOCITY, HELD),
    (GateReason.SPEED, meet_speed, MIDDLE, VELOCITY, GateOutcome.SLOWED),
    (GateReason.LIMIT, meet_limit, BOUNDARY, VELOCITY, LIMITED),
    (GateReason.STOPPING, meet_stopping, MIDDLE, TRAJECTORY, GateOutcome.SLOWED),
    (GateReason.JOINING, meet_joining, MIDDLE, TRAJECTORY, HELD),
    (GateReason.INTERNAL, meet_internal, MIDDLE, TRAJECTORY, HELD),
]


def test_no_reason_is_left_out():
    assert [reason for reason, *_ in MEETINGS] == list(GateReason)


@pytest.mark.parametrize(("reason", "meet", "pose", "command", "outcome"), MEETINGS, ids=[m[0].name for m in MEETINGS])
def test_a_client_learns_why(reason, meet, pose, command, outcome, context, clock):
    client = standing(context, pose)
    try:
        meet(client, clock)
        status = client.heard(reason)
    finally:
        client.close()
    assert (status.command, status.outcome) == (command, outcome)
    assert status.cause == (Cause.TYPE1 if reason == GateReason.LIMIT else Cause.NONE)
    assert bool(status.text) == (outcome != GateOutcome.PASSED)
    if outcome == HELD:
        assert status.share == 0.0
    elif outcome == GateOutcome.PASSED:
        assert status.share == 1.0
    else:
        assert 0.0 < status.share < 1.0


def test_velocities_are_answered_when_the_answer_changes_and_trajectories_each_time(context, clock):
    client = standing(context)
    try:
        for rates in ((0.1, 0.0), (0.1, 0.0), (0.2, 0.0), (np.nan, 0.0), (0.1, 0.0)):
            client.gate._on_velocity(Float64MultiArray(data=rates))
        client.until(lambda: len(client.statuses) >= 3)
        assert [status.reason for status in client.statuses] == [GateReason.NONE, GateReason.INVALID, GateReason.NONE]
        client.statuses.clear()
        for _ in range(2):
            client.trajectory((0.1,), names=("joint_1",))
        client.until(lambda: len(client.statuses) >= 2)
        assert {status.reason for status in client.statuses} == {GateReason.INVALID}
    finally:
        client.close()


def test_who_comes_late_learns_of_the_newest_command_alone(context, clock):
    client, late = standing(context), list[GateStatus]()
    try:
        client.velocity(0.1, 0.0)
        client.heard(GateReason.NONE)
        client.listen(late)
        client.until(lambda: late)
        client.velocity(np.nan, 0.0)
        client.until(lambda: late[-1].reason == GateReason.INVALID)
        assert [status.reason for status in late] == [GateReason.NONE, GateReason.INVALID]
    finally:
        client.close()


def test_a_range_of_a_joint_is_named_as_the_limit(context, clock):
    q = joints_of(ready(pose=MIDDLE)[0], *MIDDLE)
    ranges = {"position_lower": [a - 0.2 for a in q], "position_upper": [a + 0.2 for a in q]}
    client = standing(context, **ranges)
    try:
        client.velocity(6.0, 0.0)
        assert client.heard(GateReason.LIMIT).cause == Cause.POSITION
        client.statuses.clear()
        client.trajectory(near_by(client, 0.5))
        status = client.heard(GateReason.LIMIT)
        assert (status.cause, status.outcome) == (Cause.POSITION, GateOutcome.SHORTENED)
    finally:
        client.close()


def test_a_stop_is_reported_to_the_last_commander(context, clock):
    client = standing(context)
    try:
        client.gate.beat(0)
        client.trajectory(near_by(client))
        client.heard(GateReason.NONE)
        client.supervisor.step(tick(5000.0))
        client.gate.beat(0)
        status = client.heard(GateReason.UNKNOWN)
        assert (status.command, status.outcome) == (TRAJECTORY, HELD)
    finally:
        client.close()
