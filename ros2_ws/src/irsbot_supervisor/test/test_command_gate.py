"""The command gate between two of its moments, with a stand-in for the node: what DDS and threads seldom show."""

from __future__ import annotations

from collections.abc import Iterator
from threading import Event, current_thread
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

from builtin_interfaces.msg import Duration
from gated import PATIENCE_S, Opened, set_clock
from supervised import MS, STEADY_NS, at_ns, feed, joints_of, ready, resting, sample, supervisor_of, tick
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from irsbot_msgs_py.gate_status import GateReason
from irsbot_msgs_py.records import Floats, JointSample, Level
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.nodes import certifier, commands
from irsbot_supervisor.nodes.certifier import Outcome

pytestmark = pytest.mark.ros

NEAR = (0.0, -1.198)
"""A pose beyond the stop limit of Type 1."""


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """The gate's steady clock: `now_ns` is the time of the test."""
    now = SimpleNamespace(now_ns=at_ns(0)[1])
    set_clock(monkeypatch, lambda: now.now_ns)
    return now


@pytest.fixture
def opened(clock: SimpleNamespace) -> Iterator[Opened]:
    """At rest, far from every limit."""
    cell = Opened(ready()[0])
    yield cell
    cell.gate.end()
    assert cell.errors == []
    cell.obeyed()


class Pause:
    """Stops the gate's thread where it puts a motion into a message."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.reached, self.go_on = Event(), Event()
        monkeypatch.setattr(commands, "JointTrajectoryPoint", self._point)

    def _point(self, **fields: Any) -> JointTrajectoryPoint:
        if current_thread().name == "command gate":
            self.reached.set()
            assert self.go_on.wait(PATIENCE_S)
        return JointTrajectoryPoint(**fields)


def near_by(opened: Opened) -> Floats:
    q = joints_of(opened.gate._supervisor, 0.0, -0.85)
    return q[0] + 0.05, q[1]


def test_a_stop_that_comes_while_a_motion_is_put_into_a_message_has_the_last_word(
    opened: Opened, monkeypatch: pytest.MonkeyPatch
):
    supervisor = opened.gate._supervisor
    opened.gate.beat(0)  # it has seen a robot that may move
    pause = Pause(monkeypatch)
    opened.go(near_by(opened))
    assert pause.reached.wait(PATIENCE_S)
    supervisor.step(sample(1, (float("nan"),) * 2))
    opened.gate.beat(0)
    pause.go_on.set()
    opened.until_said(3)
    assert opened.motions == [1, 1, 1]
    opened.until_logged("a stop came")


def test_the_thread_that_certifies_keeps_behind_the_others(opened: Opened, monkeypatch: pytest.MonkeyPatch):
    behind: list[str] = []
    monkeypatch.setattr(certifier, "step_behind", lambda: behind.append(current_thread().name))
    pause = Pause(monkeypatch)
    opened.go(near_by(opened))
    assert pause.reached.wait(PATIENCE_S)
    assert behind == ["command gate"]
    pause.go_on.set()


def test_nothing_follows_the_end_of_an_activation(opened: Opened, monkeypatch: pytest.MonkeyPatch):
    pause = Pause(monkeypatch)
    opened.go(near_by(opened))
    assert pause.reached.wait(PATIENCE_S)
    opened.gate.close()
    pause.go_on.set()
    opened.gate.end()
    assert opened.motions == [1]


def test_the_end_does_not_wait_for_an_endless_certification(opened: Opened, monkeypatch: pytest.MonkeyPatch):
    pause = Pause(monkeypatch)
    opened.go(near_by(opened))
    assert pause.reached.wait(PATIENCE_S)
    opened.go(near_by(opened))
    opened.gate.close()
    opened.gate.end()
    assert opened.gate._certifier._thread.is_alive()
    pause.go_on.set()
    opened.gate._certifier._thread.join(PATIENCE_S)
    assert not opened.gate._certifier._thread.is_alive()
    assert opened.motions == [1]


def test_a_motion_that_takes_longer_than_messages_can_say_is_held(opened: Opened):
    opened.go(near_by(opened), last_s=2_000_000_000)
    opened.until_said(1)
    assert opened.node.stated["command_out"][0].points[-1].time_from_start.sec == 2_000_000_000
    opened.go(near_by(opened), first_ns=2_000_000, last_s=2_000_000_000)  # too fast: slowed down as a whole
    opened.until_said(2)
    assert opened.motions[1] == 1
    opened.until_logged("it takes")


def test_an_error_while_a_motion_is_published_is_reported_and_answered(opened: Opened, monkeypatch: pytest.MonkeyPatch):
    """The thread certifies the next command, and the next heartbeat reports the error."""
    opened.gate.beat(0)
    answers: list[Outcome] = []
    broken, failed = RuntimeError("broken for a test"), Event()

    def fail(*_: Any) -> None:
        failed.set()
        raise broken

    message = JointTrajectory(joint_names=["joint_1", "joint_2"])
    message.points.append(JointTrajectoryPoint(positions=list(near_by(opened)), time_from_start=Duration(sec=1)))
    with monkeypatch.context() as breaking:
        breaking.setattr(opened.gate._out, "motion", fail)
        opened.gate.command(message, answers.append)
        assert failed.wait(PATIENCE_S)
    opened.go(near_by(opened))
    opened.until_said(2)
    assert opened.motions[-1] > 1
    assert answers == []
    opened.gate.beat(0)
    assert opened.errors == [broken]
    opened.errors.clear()
    assert [(outcome.path, outcome.answer.reason) for outcome in answers] == [(None, GateReason.INTERNAL)]
    assert set(opened.motions[2:]) == {1}


HOLD_AFTER_S = 1.0
"""s: a hold is shorter than this, whatever the robot does."""


def is_hold(message: JointTrajectory) -> bool:
    """Whether JointTrajectoryController of Jazzy accepts it and comes to rest by it: points, all joints, later than
    now, at rest in the end."""
    (point,) = message.points
    after_s = point.time_from_start.sec + point.time_from_start.nanosec * 1e-9
    n = len(message.joint_names)
    return (
        sorted(message.joint_names) == ["joint_1", "joint_2"]
        and len(point.positions) == n
        and list(point.velocities) == [0.0] * n
        and 0.0 < after_s < HOLD_AFTER_S
        and (message.header.stamp.sec, message.header.stamp.nanosec) == (0, 0)
    )


def moving(start: Floats, rate: float, begin_ms: int) -> list[JointSample]:
    """100 ms of the first joint at a constant rate."""
    return [sample(begin_ms + ms, (start[0] + 1e-3 * ms * rate, start[1]), (rate, 0.0)) for ms in range(100)]


@pytest.mark.parametrize("way", ["deactivated", "stopped", "refused", "nonsense"])
def test_a_hold_is_a_point_at_rest_ahead_of_the_moving_robot(opened: Opened, clock: SimpleNamespace, way: str):
    supervisor, rate = opened.gate._supervisor, 1.0
    clock.now_ns = at_ns(99)[1]
    start = joints_of(supervisor, 0.0, -0.85)
    *_, last = moving(start, rate, 0)
    feed(supervisor, moving(start, rate, 0))
    opened.gate.beat(0)
    opened.node.stated["command_out"].clear()
    match way:
        case "deactivated":
            opened.gate.close()
        case "stopped":
            supervisor.step(sample(100, (float("nan"),) * 2))
            opened.gate.beat(0)
        case "refused":
            opened.go((start[0] - 0.5, start[1]), first_ns=1)
            opened.until_said(1)
        case "nonsense":
            opened.node.hears["command_in"](JointTrajectory(joint_names=["elbow"], points=[JointTrajectoryPoint()]))
    (stated,) = opened.node.stated["command_out"]
    assert is_hold(stated)
    brake, latency = supervisor.settings.deceleration_limit[0], supervisor.settings.latency_s
    least = rate * rate / (2.0 * brake)
    (point,) = stated.points
    assert last.position[0] + least < point.positions[0] < last.position[0] + least + 3.0 * rate * latency
    assert point.positions[1] == pytest.approx(start[1], abs=1e-3)


def test_the_point_of_a_hold_does_not_depend_on_the_age_of_samples(clock: SimpleNamespace):
    """Positions belong to stamps: samples that take 30 ms to come show where the joints were then."""
    rate, points = 1.0, []
    for age_ms in (0.0, 30.0):
        supervisor = supervisor_of()
        q = joints_of(supervisor, 0.0, -0.85)
        way = [1e-3 * max(ms - age_ms, 0.0) * rate for ms in range(-200, 101)]
        rates = [(rate if moved else 0.0, 0.0) for moved in way]
        steps = zip(range(-200, 101), way, rates, strict=True)
        feed(supervisor, [sample(ms, (q[0] + s, q[1]), v, age_ms=age_ms) for ms, s, v in steps])
        opened = Opened(supervisor)
        clock.now_ns = at_ns(105)[1]
        opened.gate.beat(0)
        points.append(opened.node.stated["command_out"][-1].points[-1].positions[0])
        opened.gate.end()
        assert opened.errors == []
    assert points[1] == pytest.approx(points[0], abs=1e-3)


def test_without_new_samples_a_late_hold_is_the_same_hold(opened: Opened, clock: SimpleNamespace):
    """Where it would be by now if it had gone on is anywhere."""
    supervisor, rate = opened.gate._supervisor, 1.0
    *_, last = moving(joints_of(supervisor, 0.0, -0.85), rate, 0)
    feed(supervisor, moving(joints_of(supervisor, 0.0, -0.85), rate, 0))
    opened.gate.beat(0)
    for late_ms in (5_000, 10_000, 300_000):
        clock.now_ns = at_ns(99 + late_ms)[1]
        supervisor.step(tick(99 + late_ms))
        opened.gate.beat(0)
        opened.node.hears["command_in"](JointTrajectory(joint_names=["elbow"], points=[JointTrajectoryPoint()]))
    _first, *stated = [message.points[0].positions[0] for message in opened.node.stated["command_out"]]
    assert len(stated) == 4
    assert max(stated) - min(stated) == 0.0
    assert stated[0] - last.position[0] < rate * (supervisor.settings.stale_s + 0.1)


def test_a_robot_that_a_stop_has_brought_to_rest_is_held_where_it_stands_once(opened: Opened):
    supervisor = opened.gate._supervisor
    start = joints_of(supervisor, 0.0, -0.85)
    feed(supervisor, moving(start, 1.0, 0))
    opened.gate.beat(0)
    supervisor.step(sample(100, (float("nan"),) * 2))
    opened.gate.beat(0)
    rest = (start[0] + 0.1, start[1])
    feed(supervisor, resting(101, 800, rest))
    for _ in range(3):
        opened.gate.beat(0)
    assert opened.motions == [1, 1, 1]  # of the beginning, of the stop, at rest
    assert list(opened.node.stated["command_out"][-1].points[0].positions) == pytest.approx(rest)


def test_a_robot_that_is_found_moving_is_held(opened: Opened):
    """What runs was let through by a supervisor that is gone."""
    feed(opened.gate._supervisor, moving(joints_of(opened.gate._supervisor, 0.0, -0.85), 1.0, 0))
    opened.gate.beat(0)
    assert [is_hold(message) for message in opened.node.stated["command_out"]] == [True]


@pytest.mark.parametrize("rates", [(0.2, -0.2), (0.0, 0.0)])
def test_the_last_rates_of_a_gate_that_closes_are_zeros(opened: Opened, rates: Floats):
    """forward_command_controller keeps the last ones for ever."""
    assert opened.rates(*rates) == rates
    opened.gate.close()
    stated = [tuple(message.data) for message in opened.node.stated["velocity_out"]]
    assert stated == ([rates, (0.0, 0.0)] if any(rates) else [rates])
    opened.gate.close()
    assert len(opened.node.stated["velocity_out"]) == len(stated)


def test_without_any_sample_no_hold_is_published():
    opened = Opened(supervisor_of())
    opened.go((0.1, 0.2))
    opened.gate.beat(0)
    opened.gate.close()
    opened.gate.end()
    assert opened.motions == []
    assert opened.node.stated["velocity_out"] == []


def test_commands_that_may_have_waited_while_the_supervisor_was_frozen_are_void(opened: Opened, clock: SimpleNamespace):
    """The robot has stood all the while, and its state is known again before the commands are taken."""
    supervisor = opened.gate._supervisor
    timeout_ms = round(1e3 * supervisor.settings.command_timeout_s)
    q = joints_of(supervisor, 0.0, -0.85)
    frozen_ms = timeout_ms + 50

    def awake_at(ms: int) -> None:
        clock.now_ns = at_ns(ms)[1]
        supervisor.step(sample(ms, q))
        assert supervisor.view is not None

    feed(supervisor, resting(0, frozen_ms, q))
    awake_at(frozen_ms)
    assert opened.rates(0.1, -0.1) == (0.0, 0.0)
    opened.go(near_by(opened))
    opened.gate.beat(0)  # a heartbeat may come between commands that have waited
    assert opened.rates(0.1, -0.1) == (0.0, 0.0)
    assert set(opened.motions) == {1}  # holds
    for ms in range(frozen_ms + 1, frozen_ms + timeout_ms + 1):
        awake_at(ms)
        opened.gate.beat(0)
    assert opened.rates(0.1, -0.1) == (0.1, -0.1)


def stopped() -> Supervisor:
    supervisor = supervisor_of()
    feed(supervisor, resting(-300, 0, joints_of(supervisor, *NEAR)))
    supervisor.step(tick(0))
    assert supervisor.view is not None
    assert supervisor.view.judgement.level == Level.STOP
    return supervisor


@pytest.mark.parametrize("when", ["driven", "certified"])
def test_a_way_out_ends_with_unknown(monkeypatch: pytest.MonkeyPatch, when: str):
    """The level rises from STOP to UNKNOWN: a controller must not go on with a way out that it has, nor get one."""
    supervisor = stopped()
    last_ms = (supervisor.view.seen_ns - STEADY_NS) / MS
    set_clock(monkeypatch, lambda: supervisor.view.seen_ns if supervisor.view else at_ns(last_ms + 1e3)[1])
    opened = Opened(supervisor)
    opened.gate.beat(0)
    stated, stops = len(opened.motions), opened.gate.stops
    pause = Pause(monkeypatch) if when == "certified" else None
    begin, away = supervisor.view.at.joints, supervisor.escape.direction
    opened.go(tuple(q + 0.05 * share for q, share in zip(begin, away, strict=True)))
    if pause is None:
        opened.until_said(stated + 1)
        assert opened.motions[-1] > 1, "nothing passed: the test proves nothing"
    else:
        assert pause.reached.wait(PATIENCE_S)
    supervisor.step(tick(last_ms + 1e3))
    opened.gate.beat(0)
    if pause is not None:
        pause.go_on.set()
        opened.until_said(stated + 2)
    opened.gate.end()
    assert opened.errors == []
    assert opened.motions[-1] == 1
    assert len(opened.motions) == stated + 2
    assert opened.gate.stops == stops + 1


def test_commands_before_an_activation_do_not_count_in_it(monkeypatch: pytest.MonkeyPatch):
    """A way out that had begun gives a robot that moves meanwhile no leave to go on."""
    supervisor = stopped()
    set_clock(monkeypatch, lambda: supervisor.view.seen_ns)
    opened = Opened(supervisor)
    away = tuple(0.2 * share for share in supervisor.escape.direction)
    assert any(opened.rates(*away))
    opened.gate.close()
    begin = tuple(q - 0.1 for q in joints_of(supervisor, 0.0, -0.85))
    there, last_ms = supervisor.view.at.joints, round((supervisor.view.seen_ns - STEADY_NS) / MS)
    ways = [(1.0 - ms / 400.0, ms / 400.0) for ms in range(1, 401)]
    path = [tuple(a * p + b * q for p, q in zip(there, begin, strict=True)) for a, b in ways]
    path += [(begin[0] + 6e-4 * ms, begin[1] + 6e-4 * ms) for ms in range(1, 301)]
    feed(supervisor, [sample(last_ms + ms, q, (0.6, 0.6)) for ms, q in enumerate(path, 1)])
    assert supervisor.view.judgement.level == Level.STOP
    opened.gate.open()
    assert not any(opened.rates(0.3, 0.3))
    opened.gate.end()
