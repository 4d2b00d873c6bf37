"""simulated_joints_node in a process of its own, over DDS: it obeys, it can be commanded, and it can fail on demand."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import fields

import numpy as np
import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

import rclpy
from irsbot_msgs.msg import Verdict as VerdictMessage
from rcl_interfaces.srv import SetParameters
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from irsbot_msgs_py.cdr import decode_joint_state
from irsbot_msgs_py.records import JointSample, Level
from irsbot_supervisor.nodes.simulation_parameters import declare_simulation
from irsbot_supervisor.processes.asking import Asking
from irsbot_supervisor.processes.suite import free_domain
from irsbot_supervisor.sim.simulation import Simulation

pytestmark = pytest.mark.ros

PATIENCE_S = 120.0
"""Longest wait for anything: far more than it takes, on the slowest machine."""

DECELERATION = 400.0  # rad/s2, what is shipped for irsbot2

Condition = Callable[[list[JointSample]], bool]


class SupervisorSession:
    """The other side of the simulated joints: says what it is told every 10 ms, and keeps what it hears."""

    def __init__(self) -> None:
        self.context, self.domain = rclpy.Context(), free_domain()
        rclpy.init(context=self.context, domain_id=self.domain)
        self.node = rclpy.create_node("supervision", context=self.context)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._verdicts = self.node.create_publisher(VerdictMessage, "supervisor/verdict", latched)
        self._commands = self.node.create_publisher(JointTrajectory, "joint_trajectory", 10)
        self._parameters = self.node.create_client(SetParameters, "simulated_joints/set_parameters")
        self.node.create_subscription(JointState, "joint_states", self._hear, QoSProfile(depth=1000), raw=True)
        self.node.create_timer(0.01, self._speak)
        self._executor = EventsExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._stated: VerdictMessage | None = None
        self._heard: list[JointSample] = []
        self.all_heard: list[JointSample] = []
        self._condition: Condition = lambda heard: False
        self._met = Future()

    def say(self, level: int | None, speed_scale: float = 1.0) -> None:
        """From now on this verdict; None: silence."""
        self._stated = None if level is None else VerdictMessage(level=int(level), speed_scale=speed_scale)

    def command(self, names: list[str], points: list[tuple[float, list[float]]]) -> None:
        """Publish a trajectory once the joints listen."""
        message = JointTrajectory(joint_names=names)
        for due_s, positions in points:
            point = JointTrajectoryPoint(positions=positions)
            point.time_from_start.sec, point.time_from_start.nanosec = divmod(round(due_s * 1e9), 10**9)
            message.points.append(point)
        self.until(lambda heard: self._commands.get_subscription_count() > 0)
        self._commands.publish(message)

    def set_fault(self, line: str) -> tuple[bool, str]:
        """Set the parameter `fault`, once; whether it was accepted, and why not."""
        self.until(lambda heard: self._parameters.service_is_ready())
        empty = Asking(self._parameters, SetParameters.Request())  # answered once the joints know this client
        self.until(lambda heard: empty.answered())
        request = SetParameters.Request(parameters=[Parameter("fault", value=line).to_parameter_msg()])
        answer = self._parameters.call_async(request)
        self._executor.spin_until_future_complete(answer, timeout_sec=PATIENCE_S)
        (result,) = answer.result().results
        return result.successful, result.reason

    def until(self, condition: Condition) -> list[JointSample]:
        """The samples heard until, with the newest, the condition holds."""
        self._heard, self._condition, self._met = [], condition, Future()
        self._executor.spin_until_future_complete(self._met, timeout_sec=PATIENCE_S)
        assert self._met.done(), f"in vain after {len(self._heard)} samples, the last {self._heard[-1:]}"
        return self._heard

    def look(self, seconds: float) -> list[JointSample]:
        """The samples heard within a time."""
        self._heard, self._condition, over = [], lambda heard: False, Future()
        timer = self.node.create_timer(seconds, lambda: over.set_result(None))
        self._executor.spin_until_future_complete(over, timeout_sec=PATIENCE_S)
        self.node.destroy_timer(timer)
        return self._heard

    def listen_again(self) -> None:
        """A second subscription of the joint states."""
        self.node.create_subscription(JointState, "joint_states", lambda data: None, QoSProfile(depth=1000), raw=True)

    def close(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)

    def _hear(self, data: bytes) -> None:
        self._heard.append(decode_joint_state(data, 0, 0))
        self.all_heard.append(self._heard[-1])
        if not self._met.done() and self._condition(self._heard):
            self._met.set_result(None)

    def _speak(self) -> None:
        if self._stated is not None:
            self._verdicts.publish(self._stated)


@contextmanager
def simulated_joints(domain: int, **parameters: object) -> Iterator[subprocess.Popen[str]]:
    """The node as a process; interrupted on the way out, killed if that does not help."""
    arguments = [word for name, value in parameters.items() for word in ("-p", f"{name}:={value}")]
    process = subprocess.Popen(
        [sys.executable, "-m", "irsbot_supervisor.nodes.simulated_joints", "--ros-args", *arguments],
        env={**os.environ, "ROS_DOMAIN_ID": str(domain)},
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.communicate(timeout=PATIENCE_S)
        finally:
            process.kill()


@pytest.fixture(scope="module")
def session() -> Iterator[SupervisorSession]:
    session = SupervisorSession()
    yield session
    session.close()


@pytest.fixture(scope="class")
def patient(session: SupervisorSession) -> Iterator[SupervisorSession]:
    """Joints in endless motion that wait long for a verdict: only its level can stop them."""
    with simulated_joints(session.domain, verdict_timeout_s=PATIENCE_S):
        yield session


def moves(heard: list[JointSample]) -> bool:
    return bool(heard) and max(map(abs, heard[-1].velocity)) > 2.0


def stands(heard: list[JointSample]) -> bool:
    return bool(heard) and not any(heard[-1].velocity)


def stands_for_long(heard: list[JointSample]) -> bool:
    return len(heard) > 300 and all(stands([sample]) for sample in heard[-300:])


def largest_deceleration(heard: list[JointSample]) -> float:
    rates = np.abs([sample.velocity for sample in heard])
    periods = np.diff([sample.stamp_ns for sample in heard]) * 1e-9
    return float((-np.diff(rates, axis=0) / periods[:, None]).max())


class TestJointsInEndlessMotion:
    """One process for all of these: each test starts from whatever the one before has left."""

    @pytest.mark.parametrize("level", [Level.STOP, Level.UNKNOWN, 7])
    def test_the_joints_brake_on_stop_unknown_and_nonsense_and_go_on_when_allowed(self, patient, level):
        patient.say(Level.OK)
        patient.until(moves)
        patient.say(level)
        braking = patient.until(stands_for_long)
        assert max(abs(v) for sample in braking for v in sample.velocity) > 1.0, "they stood before the verdict"
        assert largest_deceleration(braking) < 1.1 * DECELERATION  # stamps tell periods within 0.05 ms at worst
        patient.say(Level.OK)
        patient.until(moves)

    def test_the_joints_slow_down_to_the_speed_scale_of_a_warning(self, patient):
        patient.say(Level.OK)
        patient.until(moves)
        patient.say(Level.WARN, speed_scale=0.2)

        def fastest(heard: list[JointSample]) -> float:
            return max(abs(rate) for sample in heard[-1500:] for rate in sample.velocity)

        heard = patient.until(  # the cycle reaches 4.8 rad/s; it takes longer than these samples
            lambda heard: len(heard) >= 1500 and len(heard) % 100 == 0 and fastest(heard) < 1.2
        )
        assert fastest(heard) > 0.1

    def test_the_stamps_of_samples_are_a_millisecond_apart(self, patient):
        heard = patient.until(lambda heard: len(heard) >= 2000)
        periods = np.diff([sample.stamp_ns for sample in heard])
        assert np.median(periods) == pytest.approx(1e6, rel=0.01)
        # No drift: whatever happened in between, all times are whole periods apart, within the reading of two clocks.
        since = np.cumsum(periods) / 1e6
        assert np.abs(since - np.round(since)).max() < 0.1

    def test_a_fault_strikes_live_and_a_wrong_one_is_refused(self, patient):
        begin = len(patient.all_heard)
        assert patient.set_fault("nan:count=5") == (True, "")
        patient.until(lambda heard: len(heard) >= 1000)
        assert sum(np.isnan(sample.position).all() for sample in patient.all_heard[begin:]) == 5
        assert patient.set_fault("permuted") == (True, "")
        patient.until(lambda heard: bool(heard) and heard[-1].names == ("joint_2", "joint_1"))
        accepted, reason = patient.set_fault("nam")
        assert not accepted
        assert "no fault 'nam'; known are" in reason
        patient.until(lambda heard: bool(heard) and heard[-1].names == ("joint_2", "joint_1"))  # the old one stays
        assert patient.set_fault("") == (True, "")
        patient.until(lambda heard: bool(heard) and heard[-1].names == ("joint_1", "joint_2"))

    def test_a_second_publisher_appears_and_goes(self, patient):
        def publishers(number: int) -> Condition:
            return lambda heard: patient.node.count_publishers("joint_states") == number

        patient.until(publishers(1))
        patient.set_fault("second_publisher")
        patient.until(publishers(2))
        patient.set_fault("")
        patient.until(publishers(1))


def test_the_joints_brake_when_the_supervisor_falls_silent_and_a_disobedient_robot_does_not(session):
    with simulated_joints(session.domain):
        session.say(Level.OK)
        session.until(moves)
        session.say(None)
        braking = session.until(stands_for_long)
        assert max(abs(v) for sample in braking for v in sample.velocity) > 1.0, "they stood before the silence"
        assert largest_deceleration(braking) < 1.1 * DECELERATION
        session.say(Level.OK)
        session.until(moves)
    session.say(Level.STOP)
    with simulated_joints(session.domain, obey="false"):
        session.until(moves)


def test_a_command_waits_for_the_verdict_and_is_then_followed_by_name(session):
    session.say(Level.UNKNOWN)
    with simulated_joints(session.domain, scenario="stand", verdict_timeout_s=round(PATIENCE_S), velocity_limit=20):
        begin = session.until(stands_for_long)[-1].position
        session.command(["joint_2", "joint_1"], [(0.1, [begin[1], begin[0]]), (0.4, [begin[1] - 0.1, begin[0] + 0.2])])
        still = session.until(lambda heard: len(heard) >= 500)
        assert all(sample.position == begin for sample in still)
        session.say(Level.OK)
        there = pytest.approx((begin[0] + 0.2, begin[1] - 0.1), abs=1e-9)
        session.until(lambda heard: bool(heard) and heard[-1].position == there)


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"scenario": "pick"}, "no scenario 'pick'; known are"),
        ({"fault": "nam"}, "no fault 'nam'; known are"),
        ({"velocity_limit": "[1.0, 2.0, 3.0]"}, "velocity_limit has 3 values, must have 2"),
        ({"rate_hz": 0}, "rate_hz is 0.0, must be in 1..20000"),
        ({"speed": ".nan"}, "speed is nan, must be in 0..1"),
        ({"listeners": 101}, "listeners is 101, must be in 0..100"),
    ],
)
def test_a_wrong_parameter_is_one_line_and_exit_code_2(parameters, words):
    with simulated_joints(free_domain(), **parameters) as process:
        _, err = process.communicate(timeout=PATIENCE_S)
        assert process.returncode == 2
        assert len(err.splitlines()) == 1
        assert words in err


def test_every_limit_of_the_simulation_is_in_the_description_of_its_parameter(session: SupervisorSession):
    node = rclpy.create_node("described", context=session.context)
    declare_simulation(node)
    limited = {entry.name: entry.metadata["limits"] for entry in fields(Simulation) if entry.metadata["limits"]}
    assert len(limited) == 5
    for name, limits in limited.items():
        described = node.describe_parameter(name)
        ranges = [*described.floating_point_range, *described.integer_range]
        assert [(found.from_value, found.to_value) for found in ranges] == [limits], name
        assert described.description
        assert described.read_only
    node.destroy_node()


LONELY = """
import irsbot_supervisor.nodes.simulated_joints as module
module.LONELY_S = 0.02
module.LISTENERS_NS = 10**9
module.main()
"""
"""They say after 0.02 s that no verdict comes, and after 1 s that nobody listens."""


def iter_until(lines: Iterable[str], words: str) -> Iterator[str]:
    """Lines, up to the first one with these words."""
    for line in lines:
        yield line
        if words in line:
            return


@pytest.mark.parametrize("simulated", ["false", "true"])  # the simulated clock stands
def test_joints_that_hear_no_supervisor_say_once_where_they_listen(simulated):
    """A supervisor of another name says its verdicts elsewhere."""
    environment = {**os.environ, "ROS_DOMAIN_ID": str(free_domain())}
    pipe = subprocess.PIPE
    given = ["--ros-args", "-p", "listeners:=1", "-p", f"use_sim_time:={simulated}"]
    command = [sys.executable, "-c", LONELY, *given]
    with subprocess.Popen(command, stderr=pipe, text=True, env=environment) as process:
        assert process.stderr is not None
        lines = list(iter_until(process.stderr, "1 are expected"))
        process.send_signal(signal.SIGINT)
        lines += process.stderr
    (stated,) = (line for line in lines if "no verdict" in line)
    assert "no verdict on /supervisor/verdict" in stated
    assert "-r supervisor/verdict:=NAME/verdict" in stated


def test_the_first_sample_waits_for_the_listeners_that_were_announced(session: SupervisorSession):
    begin_ns = time.time_ns()  # what the nodes of other tests have said may still be on its way

    def heard(seconds: float) -> list[JointSample]:
        return [sample for sample in session.look(seconds) if sample.stamp_ns > begin_ns]

    with simulated_joints(session.domain, listeners=2):
        while not session.node.count_publishers("joint_states"):
            assert heard(0.1) == []
        assert heard(1.5) == []  # three times as long as without listeners to wait for
        session.listen_again()
        assert session.until(lambda heard: heard[-1].stamp_ns > begin_ns)
