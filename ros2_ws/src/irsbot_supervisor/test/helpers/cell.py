"""Robots for supervisors in processes of their own: joint states as told over DDS, and all that a supervisor says."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
import rclpy.node
from diagnostic_msgs.msg import DiagnosticArray
from irsbot_msgs.msg import SingularityState as StateMessage
from irsbot_msgs.msg import Verdict as VerdictMessage
from irsbot_msgs.srv import CheckTrajectory, ResetStop
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectoryPoint

from irsbot_kinematics import make_robot
from irsbot_msgs_py.cdr import decode_verdict, encode_joint_state
from irsbot_msgs_py.convert import state_record
from irsbot_msgs_py.records import Floats, JointSample, Level, SingularityState, Verdict
from irsbot_supervisor.processes.asking import Asking
from irsbot_supervisor.processes.suite import SUPERVISOR, Node, Suite, free_domain

PATIENCE_S = 120.0
"""Longest wait for anything: far more than it takes, on the slowest machine."""

PERIOD_S = 0.002
"""s between joint states: half the rate of a fast drive leaves time for everything else that runs."""

LAZY = {"acceleration_limit": [10.0]}
"""rad/s2: where drives that speed up slowly can get while a busy machine is late with samples is little, so that being
late stops no robot."""

STANDS = {"acceleration_limit": [0.1], "velocity_limit": [0.1]}
"""rad/s2, rad/s: free drives that are so slow do not get from GOOD to Type 2 in a silence of 4 s, even if it begins
with the first sample after another one, when no speed is known. For robots that only stand, as drives that move need
more."""

NAMES = ("joint_1", "joint_2")
ROBOT = make_robot("irsbot2")
GOOD: Floats = tuple(ROBOT.inverse((0.0, -0.85)).tolist())
"""Joint positions, rad, far from every singularity."""

NEAR: Floats = tuple(ROBOT.inverse((0.0, -1.198)).tolist())
"""Joint positions, rad, with Type 1 margin 0.121 and Type 2 margin 0.100: stops are at 0.15. A robot that begins here
loses its branch if its second sample comes more than 50 ms after its first."""

HIGH: Floats = tuple(np.add(ROBOT.inverse((0.0, -0.6)), (math.tau, 0.0)).tolist())
"""Joint positions, rad, with Type 1 margin 0.667 and Type 2 margin 0.788: no late sample loses the branch. Between here
and GOOD no crank passes the cut of its angle."""

STRICT = {"type1_stop": 0.7, "type1_warn": 0.8}
"""Limits that stop the robot when it is HIGH, for Type 1 alone, and that it keeps where it is GOOD."""

Say = Callable[[int], JointSample | None]
"""What the drives say at a time, ns of the clock that stamps; None: nothing."""


def sample(
    stamp_ns: int, position: Floats, velocity: Floats = (0.0, 0.0), names: tuple[str, ...] = NAMES
) -> JointSample:
    """A joint state; times of arrival are not part of it."""
    return JointSample(stamp_ns, 0, 0, names, position, velocity)


def resting(position: Floats) -> Say:
    return lambda stamp_ns: sample(stamp_ns, position)


def swinging(middle: Floats, begin_ns: int, end_ns: int | None = None) -> Say:
    """From rest in the middle to and fro by 0.05 rad with at most 0.3 rad/s, one joint after the other, and back to
    rest in the middle at an end: harmless, and in between never at rest together."""
    size, pace, fade_s = 0.05, 6.0, 0.5

    def grown(seconds: float) -> float:
        share = min(max(seconds / fade_s, 0.0), 1.0)
        return share * share * (3.0 - 2.0 * share)

    def position(seconds: float) -> Floats:
        left_s = math.inf if end_ns is None else (end_ns - begin_ns) * 1e-9 - seconds
        now = size * grown(seconds) * grown(left_s)
        phases = (pace * seconds + 0.5 * math.pi * joint for joint in range(len(middle)))
        return tuple(q + now * math.sin(phase) for q, phase in zip(middle, phases, strict=True))

    def say(stamp_ns: int) -> JointSample:
        seconds, step = (stamp_ns - begin_ns) * 1e-9, 1e-4
        ends = zip(position(seconds - step), position(seconds + step), strict=True)
        return sample(stamp_ns, position(seconds), tuple((after - before) / (2.0 * step) for before, after in ends))

    return say


def going(start: Floats, end: Floats, begin_ns: int, seconds: float) -> Say:
    """From one place to another, smoothly, and then standing there. In a pause of this process the robot stands: one
    that moves on while nothing is heard loses its branch, and rightly."""
    last_ns, gone_s = begin_ns, 0.0

    def say(stamp_ns: int) -> JointSample:
        nonlocal last_ns, gone_s
        gone_s += min(max((stamp_ns - last_ns) * 1e-9, 0.0), 10.0 * PERIOD_S)
        last_ns, turn = stamp_ns, math.pi / seconds
        phase = min(gone_s, seconds) * turn
        way, pace = 0.5 - 0.5 * math.cos(phase), 0.5 * math.sin(phase) * turn
        ways = [b - a for a, b in zip(start, end, strict=True)]
        position = tuple(a + way * d for a, d in zip(start, ways, strict=True))
        return sample(stamp_ns, position, tuple(pace * d for d in ways))

    return say


class Wire:
    """A DDS domain of our own with the supervisors on it. Close it, or use it as a context manager."""

    def __init__(self, logs: Path) -> None:
        self.logs, self.domain = logs, free_domain()
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=self.domain)
        self.executor = EventsExecutor(context=self.context)
        self.cells: list[Cell] = []

    def until(self, happened: Callable[[], Any], what: str = "") -> None:
        """Serve callbacks until something has happened."""
        deadline = time.monotonic() + PATIENCE_S
        while not happened():
            stated = [cell.verdicts[-1:] for cell in self.cells]
            assert time.monotonic() < deadline, f"in vain: {what}; last verdicts {stated}"
            for cell in self.cells:
                cell.suite.check()
            self.executor.spin_until_future_complete(Future(), timeout_sec=0.01)

    def close(self) -> None:
        """Leave before the others do: Fast DDS may wait for ever otherwise (irsbot_msgs_py.process.exit_deadline)."""
        self.executor.shutdown()
        for cell in self.cells:
            cell.node.destroy_node()
        rclpy.shutdown(context=self.context)
        for cell in self.cells:
            cell.suite.stop()

    def __enter__(self) -> Wire:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()


class Cell:
    """One robot, in a namespace of its own, and its supervisor."""

    def __init__(self, wire: Wire, namespace: str = "", *, module: str = SUPERVISOR, **parameters: Any) -> None:
        self.wire, self.say = wire, resting(GOOD)
        self.clock: Callable[[], int] = time.time_ns
        self.states: list[SingularityState] = []
        self.verdicts: list[Verdict] = []
        self._clients: dict[str, Any] = {}
        self.node = rclpy.create_node("robot", namespace=namespace, context=wire.context)
        deep = QoSProfile(depth=1000)
        latched = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.joints = self.node.create_publisher(JointState, "joint_states", deep)
        self.node.create_subscription(
            StateMessage, "supervisor/state", lambda m: self.states.append(state_record(m)), deep
        )
        self.node.create_subscription(
            VerdictMessage, "supervisor/verdict", lambda d: self.verdicts.append(decode_verdict(d)), latched, raw=True
        )
        self.node.create_timer(PERIOD_S, self._speak)
        wire.executor.add_node(self.node)
        self.suite = Suite(wire.logs / (namespace or "alone"), wire.domain, namespace, patience_s=PATIENCE_S)
        self.supervisor = Node("supervisor", module, LAZY | parameters)
        self.suite.start(self.supervisor)
        wire.cells.append(self)

    @property
    def printed(self) -> str:
        """What the supervisor has printed."""
        (log,) = self.wire.logs.glob(f"{self.node.get_namespace().strip('/') or 'alone'}/supervisor.log")
        return log.read_text()

    def logged(self, words: str) -> None:
        """Wait until the supervisor has printed something."""
        self.wire.until(lambda: words in self.printed, words)

    def heard(self, happened: Callable[[Verdict], bool], what: str = "") -> list[Verdict]:
        """The verdicts from now on until one is as wanted, that one included."""
        start = len(self.verdicts)
        self.wire.until(lambda: any(happened(v) for v in self.verdicts[start:]), what)
        fresh = self.verdicts[start:]
        return fresh[: 1 + next(k for k, verdict in enumerate(fresh) if happened(verdict))]

    def heard_level(self, level: Level) -> Verdict:
        """The first verdict of a level from now on. A verdict below STOP is one of a state, which is heard as well."""
        found = self.heard(lambda verdict: verdict.level == level, level.name)[-1]
        if level < Level.STOP:
            self.wire.until(lambda: self.states, "a state")
        return found

    def heard_many(self, number: int) -> list[Verdict]:
        """So many verdicts, from now on."""
        start = len(self.verdicts)
        self.wire.until(lambda: len(self.verdicts) >= start + number, f"{number} verdicts")
        return self.verdicts[start:]

    def call(self, kind: Any, name: str, request: Any) -> Any:
        """The answer of a service, called again if none comes: the answer to a client that a busy server has not
        discovered yet is lost. A client lasts as long as the cell."""
        if name not in self._clients:
            self._clients[name] = self.node.create_client(kind, name)
        self.wire.until(self._clients[name].service_is_ready, f"service {name}")
        asking = Asking(self._clients[name], request)
        self.wire.until(asking.answered, f"answer of {name}")
        return asking.answer

    def set(self, **values: Any) -> tuple[bool, str]:
        """Set parameters in one call, as a whole; whether they were accepted, and why not."""
        parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
        if len(parameters) == 1:
            request = SetParameters.Request(parameters=parameters)
            (result,) = self.call(SetParameters, "supervisor/set_parameters", request).results
        else:
            request = SetParametersAtomically.Request(parameters=parameters)
            result = self.call(SetParametersAtomically, "supervisor/set_parameters_atomically", request).result
        return result.successful, result.reason

    def reset(self, event: int, seed_pose: Floats = ()) -> Any:
        """The answer to a reset, asked again as long as samples are missing, as they may be on a busy machine."""
        return self._reset_until_not(("no good sample", "silence", "no usable sample"), event, seed_pose)

    def reset_at_rest(self, event: int) -> Any:
        """The answer to a reset, asked again until the samples prove that the robot stands: after a motion that takes
        some of them."""
        return self._reset_until_not(("no good sample", "silence", "no usable sample", "not standing"), event, ())

    def _reset_until_not(self, refusals: tuple[str, ...], event: int, seed_pose: Floats) -> Any:
        """The first answer to a reset that gives none of these reasons."""
        request = ResetStop.Request(event=event, operator_text="tested", seed_pose=seed_pose)
        answers: list[Any] = []

        def judged() -> bool:
            answers.append(self.call(ResetStop, "supervisor/reset", request))
            return not any(words in answers[-1].message for words in refusals)

        self.wire.until(judged, "a reset that is judged by samples")
        return answers[-1]

    def change(self, transition: int) -> bool:
        """One step of the life cycle, a constant of lifecycle_msgs/Transition."""
        request = ChangeState.Request()
        request.transition.id = transition
        return self.call(ChangeState, "supervisor/change_state", request).success

    @contextmanager
    def company(self, name: str) -> Iterator[rclpy.node.Node]:
        """Another node on the domain, for a while."""
        node = rclpy.create_node(name, context=self.wire.context)
        try:
            yield node
        finally:
            node.destroy_node()

    def _speak(self) -> None:
        stated = self.say(self.clock())
        if stated is not None:
            self.joints.publish(encode_joint_state(stated))


TOPICS = ("verdict", "state", "summary", "journal")
"""Of an activation."""


def silent(cell: Cell) -> bool:
    """True if the supervisor has nothing to speak with."""
    return not any(cell.node.count_publishers(f"supervisor/{topic}") for topic in TOPICS)


def bad(stamp_ns: int, **changes: object) -> JointSample:
    """A joint state of a robot at rest, with some of its fields changed."""
    return sample(stamp_ns, GOOD)._replace(**changes)


def check(cell: Cell, *goals: tuple[float, ...]) -> CheckTrajectory.Response:
    """What the supervisor says of a motion through these joint positions, one per second."""
    request = CheckTrajectory.Request()
    request.trajectory.joint_names = list(NAMES)
    for number, goal in enumerate(goals):
        point = JointTrajectoryPoint(positions=goal)
        point.time_from_start.sec = number
        request.trajectory.points.append(point)
    return cell.call(CheckTrajectory, "supervisor/check_trajectory", request)


def check_at_rest(cell: Cell, *goals: tuple[float, ...]) -> CheckTrajectory.Response:
    """The same of a robot that stands, asked again where a sample was late, as on a busy machine."""
    while "ask while it stands" in (answer := check(cell, *goals)).message:
        cell.heard_level(Level.OK)
    return answer


Statuses = list[dict[str, tuple[bytes, str]]]
"""Level and sentence of every check, message after message."""


def statuses_of(cell: Cell) -> Statuses:
    """What a supervisor says of its checks, from now on."""
    heard: Statuses = []

    def hear(message: DiagnosticArray) -> None:
        heard.append({status.name.split(": ")[1]: (status.level, status.message) for status in message.status})

    cell.node.create_subscription(DiagnosticArray, "/diagnostics", hear, 10)
    return heard
