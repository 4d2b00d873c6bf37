"""The suite, drives, a client and an operator for consumer_outages.py."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import rclpy
from irsbot_msgs.msg import GateStatus, Verdict
from irsbot_msgs.srv import ResetStop
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from irsbot_msgs_py.cdr import decode_joint_state, decode_verdict
from irsbot_msgs_py.records import JointSample, Level
from irsbot_supervisor.processes.asking import Asking
from irsbot_supervisor.processes.suite import JOINTS, KINEMATICS, RECORDER, SUPERVISOR, Node, Suite, free_domain
from irsbot_supervisor.sim.simulation import STANDING

PATIENCE_S = 60.0

CYCLE_S = 0.005
"""s between two cycles of the controller, and between two joint states."""

SLOWEST, STEP, NUMBERS = 0.1, 0.001, 50
"""rad/s: the rate of a command is SLOWEST + STEP times its number, which counts to NUMBERS; the sign takes turns."""

MOVES = 1e-6
"""rad/s: less is standstill."""

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Line(NamedTuple):
    """What the drives are told from a moment on, steady clock."""

    at_ns: int
    rate: float  # rad/s, first joint
    paused_ns: int  # the longest time between two cycles of the controller before
    heard_ns: int  # the last verdict


class Station:
    """The suite, the client, and an operator who resets what stops."""

    def __init__(self, folder: Path, header: bool) -> None:
        here = str(Path(__file__).resolve().parent)
        path = os.pathsep.join([here, *filter(None, [os.environ.get("PYTHONPATH")])])
        self.domain = free_domain()
        self.suite = Suite(folder / "logs", self.domain, environment={**os.environ, "PYTHONPATH": path})
        self._log = folder / "controller.txt"
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=self.domain)
        self.node = rclpy.create_node("client", context=self.context)
        self.executor = EventsExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.verdict: Any = None
        self.stops: list[str] = []  # texts of the verdicts that brake, and of what the gate holds
        self.joints: list[JointSample] = []
        self._reset: Asking | None = None
        self._operator = self.node.create_client(ResetStop, "supervisor/reset")
        self.node.create_subscription(Verdict, "supervisor/verdict", self._hear, LATCHED, raw=True)
        self.node.create_subscription(JointState, "joint_states", self._see, 1000, raw=True)
        self.node.create_subscription(GateStatus, "supervisor/gate", self._hold, LATCHED)
        self._velocity = self.node.create_publisher(Float64MultiArray, "velocity_in", 10)
        self.node.create_timer(0.02, self._command)
        self.number, self.commanding = 0, False
        lazy = {"acceleration_limit": [10.0]}  # so that a busy machine, which is late with samples, stops no robot
        drives = {"scenario": STANDING, "obey": False, "rate_hz": 1.0 / CYCLE_S}
        self._nodes = {
            "supervisor": Node("supervisor", SUPERVISOR, lazy),
            "simulated_joints": Node("simulated_joints", JOINTS, drives),
            "kinematics": Node("kinematics", KINEMATICS, {}),
            "recorder": Node("recorder", RECORDER, {"mode": "blackbox"}),
            "controller": Node("controller", "obedient_controller", {"log": str(self._log), "header": header}),
        }
        self._bags, self._folder = 0, folder

    @property
    def rate(self) -> float:
        """rad/s of the newest command."""
        return (SLOWEST + STEP * (self.number % NUMBERS)) * (1.0 if self.number % 2 else -1.0)

    @property
    def lines(self) -> list[Line]:
        stated = self._log.read_text().splitlines() if self._log.exists() else []
        return [Line(int(at), float(rate), int(pause), int(heard)) for at, rate, pause, heard in map(str.split, stated)]

    def start(self, name: str) -> None:
        node = self._nodes[name]
        if name == "recorder":
            self._bags += 1
            node = node._replace(parameters={**node.parameters, "output": str(self._folder / f"bag{self._bags}")})
        self.suite.start(node)

    def _hear(self, data: bytes) -> None:
        self.verdict = decode_verdict(data)
        if self.verdict.level > Level.WARN:
            self.stops.append(self.verdict.text)

    def _hold(self, status: GateStatus) -> None:
        if status.outcome == GateStatus.OUTCOME_HELD:
            self.stops.append(f"gate: {status.text}")

    def _see(self, data: bytes) -> None:
        self.joints.append(decode_joint_state(data, time.time_ns(), time.monotonic_ns()))

    def _command(self) -> None:
        if self.commanding:
            self._velocity.publish(Float64MultiArray(data=[self.rate, -self.rate]))

    def until(self, happened: Callable[[], Any], what: str) -> None:
        begin = time.monotonic()
        while not happened():
            if time.monotonic() - begin > PATIENCE_S:
                raise RuntimeError(f"in vain: {what}; {self.verdict}; {self.lines[-3:]}")
            self.executor.spin_until_future_complete(Future(), timeout_sec=0.01)

    def look(self, seconds: float) -> None:
        begin = time.monotonic()
        while time.monotonic() - begin < seconds:
            self.executor.spin_until_future_complete(Future(), timeout_sec=0.01)

    def move(self) -> None:
        """A new command, until the robot runs on it."""
        self.until(self.may_move, "leave to move")
        self.number, self.commanding = self.number + 1, True
        self.until(lambda: self.may_move() and self._moves(), "a robot that moves as commanded")

    def _moves(self) -> bool:
        told = [line.rate for line in self.lines[-1:]] == [self.rate]
        return told and abs(self.joints[-1].velocity[0] - self.rate) < MOVES

    def may_move(self) -> bool:
        """Reset a stop, as an operator would who has looked."""
        verdict = self.verdict
        due = self._reset is None or self._reset.answered()
        if verdict is not None and verdict.latched and due:
            self._reset = Asking(self._operator, ResetStop.Request(event=verdict.event, operator_text="campaign"))
        return bool(self.joints and verdict is not None and verdict.level <= Level.WARN)

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)
        self.suite.stop()
