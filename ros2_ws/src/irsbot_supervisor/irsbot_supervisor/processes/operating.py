"""Requests of an operator to a running suite: read the verdict, send commands, reset, set. Needs ROS."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import rclpy
from builtin_interfaces.msg import Duration
from irsbot_msgs.msg import GateStatus as GateStatusMsg
from irsbot_msgs.msg import Verdict as VerdictMessage
from irsbot_msgs.srv import ResetStop
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from irsbot_msgs_py.cdr import decode_verdict
from irsbot_msgs_py.convert import gate_status_record
from irsbot_msgs_py.gate_status import GateOutcome, GateStatus
from irsbot_msgs_py.process.fastdds import choose_transport
from irsbot_msgs_py.records import Level, Verdict
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.processes.asking import Asking
from irsbot_supervisor.processes.listener import LATCHED

NEWEST = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Quality of service of the gate's status: the newest message, and all later ones."""

DEPTH = 10
"""Depth of the queue of commands, as the command gate has it."""

RATE_HZ = 20.0
"""Velocity messages per second; each is valid for 0.1 s."""


class NobodyThere(Exception):
    """No supervisor answers on this DDS domain in this namespace."""


class Answer(NamedTuple):
    """Reply of a supervisor to a request."""

    accepted: bool
    message: str
    """Reason for a refusal."""


class Operator:
    """A node that operates a running suite. Close it, or use it as a context manager."""

    def __init__(self, domain: int = 0, namespace: str = "", patience_s: float = 5.0) -> None:
        """patience_s: longest time to wait for answers, s."""
        choose_transport(os.environ, rclpy.get_rmw_implementation_identifier())
        self._where = f"DDS domain {domain}" + (f", namespace {namespace}" if namespace else "")
        self._patience_s = patience_s
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain)
        self._node = rclpy.create_node("operator", context=self._context, namespace=namespace)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._verdicts: list[Verdict] = []
        self._node.create_subscription(
            VerdictMessage,
            "supervisor/verdict",
            lambda data: self._verdicts.append(decode_verdict(data)),
            LATCHED,
            raw=True,
        )
        self._gate: list[GateStatus] = []
        self._node.create_subscription(
            GateStatusMsg, "supervisor/gate", lambda message: self._gate.append(gate_status_record(message)), NEWEST
        )

    @property
    def held(self) -> str:
        """Last reason why the gate held a command, as text; empty if it has held none."""
        return next((status.text for status in reversed(self._gate) if status.outcome == GateOutcome.HELD), "")

    def verdict(self) -> Verdict:
        """The next verdict. Raises NobodyThere."""
        self._verdicts.clear()
        self._await(lambda: bool(self._verdicts), "no verdict on supervisor/verdict")
        return self._verdicts[-1]

    def reset(self, event: int, text: str, seed_pose: Sequence[float] = ()) -> Answer:
        """End the latched stop of this number. text: operator and reason. seed_pose: pose of the platform, if it was
        seen."""
        request = ResetStop.Request(event=event, operator_text=text, seed_pose=list(seed_pose))
        response = self._call(ResetStop, "supervisor/reset", request)
        return Answer(response.accepted, response.message)

    def set(self, values: Mapping[str, Any]) -> Answer:
        """Change settings of the supervisor, all of them or none."""
        parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
        request = SetParametersAtomically.Request(parameters=parameters)
        result = self._call(SetParametersAtomically, "supervisor/set_parameters_atomically", request).result
        return Answer(result.successful, result.reason)

    def send_velocity(self, rates: Sequence[float], seconds: float) -> list[tuple[float, ...]]:
        """Send joint velocities, rad/s or m/s in robot order, through the command gate for this time, then zero.
        Returns the velocities that passed. Raises NobodyThere."""
        return self._send(lambda: rates, seconds)

    def send_escape(self, seconds: float) -> list[tuple[float, ...]]:
        """Follow the escape direction from verdict to verdict through the command gate for this time, or until there is
        none. Ends at once if the first verdict has no direction; later it waits while the state is UNKNOWN. The gate
        makes it slow. Returns the velocities that passed. Raises NobodyThere."""
        joints = len(self.verdict().escape_direction)

        def way() -> Sequence[float]:
            now = self._verdicts[-1]
            return now.escape_direction or ((0.0,) * joints if now.level == Level.UNKNOWN else ())

        return self._send(way, seconds)

    def _send(self, rates: Callable[[], Sequence[float]], seconds: float) -> list[tuple[float, ...]]:
        """Send the present velocities for this time or until there are none, then zero. Before, zero is sent until the
        gate answers: on a busy machine it may hear and be heard late."""
        passed: list[tuple[float, ...]] = []
        publisher = self._node.create_publisher(Float64MultiArray, "velocity_in", DEPTH)
        heard = self._node.create_subscription(
            Float64MultiArray, "velocity_out", lambda message: passed.append(tuple(message.data)), DEPTH
        )
        self._await(
            lambda: publisher.get_subscription_count() > 0, "velocity_in has no subscriber (./irsbot up --gate)"
        )
        if joints := len(rates()):
            stand = Float64MultiArray(data=[0.0] * joints)
            what = "no answer of the command gate on velocity_out"
            self._await(lambda: bool(passed), what, lambda: publisher.publish(stand))
            passed.clear()
            for _ in range(max(round(seconds * RATE_HZ), 1)):
                if not (now := list(rates())):
                    break
                publisher.publish(Float64MultiArray(data=now))
                self._look(1.0 / RATE_HZ)
            publisher.publish(stand)
        self._look(1.0 / RATE_HZ)
        self._node.destroy_subscription(heard)
        self._node.destroy_publisher(publisher)
        return passed

    def send_trajectory(
        self,
        names: Sequence[str],
        times_s: Sequence[float],
        positions: Sequence[Sequence[float]],
        velocities: Sequence[Sequence[float]] = (),
    ) -> JointTrajectory:
        """Send a motion of the joints through the command gate. Returns the motion that passed; one point if the gate
        holds.

        times_s: from now on. Raises NobodyThere.
        """
        message = JointTrajectory(joint_names=list(names))
        for k, (time_s, row) in enumerate(zip(times_s, positions, strict=True)):
            point = JointTrajectoryPoint(positions=list(row), velocities=list(velocities[k]) if len(velocities) else [])
            sec, nanosec = divmod(round(time_s * NS_PER_S), NS_PER_S)
            point.time_from_start = Duration(sec=sec, nanosec=nanosec)
            message.points.append(point)
        passed: list[JointTrajectory] = []
        publisher = self._node.create_publisher(JointTrajectory, "command_in", DEPTH)
        heard = self._node.create_subscription(JointTrajectory, "command_out", passed.append, DEPTH)
        self._await(lambda: publisher.get_subscription_count() > 0, "command_in has no subscriber (./irsbot up --gate)")
        self._await(lambda: heard.get_publisher_count() > 0, "no command gate on command_out")
        self._await(lambda: bool(self._gate), "no answer of the command gate on supervisor/gate")
        before = len(self._gate)
        publisher.publish(message)
        self._await(lambda: len(self._gate) > before, "no answer of the command gate on supervisor/gate")
        self._await(lambda: bool(passed), "no answer of the command gate on command_out")
        self._node.destroy_subscription(heard)
        self._node.destroy_publisher(publisher)
        return passed[-1]

    def close(self) -> None:
        """Leave the domain."""
        self._executor.shutdown()
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def _call(self, kind: Any, name: str, request: Any) -> Any:
        client = self._node.create_client(kind, name)
        self._await(client.service_is_ready, f"no service {name}")
        asking = Asking(client, request)
        self._await(asking.answered, f"no answer of {name}")
        self._node.destroy_client(client)
        return asking.answer

    def _await(self, done: Callable[[], bool], what: str, ask: Callable[[], None] | None = None) -> None:
        """ask: what to do until it is done, again and again."""
        deadline = time.monotonic() + self._patience_s
        while not done():
            if time.monotonic() > deadline:
                raise NobodyThere(f"{what} in {self._patience_s:g} s ({self._where})")
            if ask is not None:
                ask()
            self._executor.spin_once(timeout_sec=0.05)

    def _look(self, seconds: float) -> None:
        """Process messages for this time."""
        deadline = time.monotonic() + seconds
        while (left := deadline - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)

    def __enter__(self) -> Operator:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()
