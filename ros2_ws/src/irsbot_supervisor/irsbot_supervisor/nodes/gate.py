"""The command gate in ROS: commands in, allowed commands out. A shell around `core.gate` and `core.motion_gate`.

Velocities are passed at once, and again with every heartbeat as long as they count. A trajectory may take a while to
be certified; that happens in a thread of its own, so that samples and heartbeats go on.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from enum import Enum, auto
from queue import SimpleQueue
from threading import Lock, Thread
from typing import Any, NamedTuple

from builtin_interfaces.msg import Duration
from rclpy.duration import Duration as Span
from rclpy.lifecycle import LifecycleNode
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from irsbot_kinematics import Robot
from irsbot_msgs_py.records import Level
from irsbot_msgs_py.stamps import NS_PER_S, sec_nanosec
from irsbot_supervisor.core.gate import Gate, View
from irsbot_supervisor.core.hold import Hold, hold
from irsbot_supervisor.core.motion import BadTrajectory, Command, JointPath
from irsbot_supervisor.core.motion_gate import MotionGate, Situation
from irsbot_supervisor.core.pipeline import Supervisor
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.nodes.commands import command_of
from irsbot_supervisor.nodes.endpoints import publisher, subscription

Fail = Callable[[Exception], None]

DEPTH = 10
"""Commands that may wait; only the newest counts."""

LONGEST_NS = 2**31 * NS_PER_S
"""ns: no later can a point of a trajectory be, as messages have it."""

END_S = 1.0
"""Longest that the end of the node waits for a command that is being looked at."""

HEARD_S = 0.2
"""Longest that the end of the node waits until its last words have arrived: those of a node that is gone never do."""


class Owed(Enum):
    """What the drives still have to be told."""

    NOTHING = auto()
    HOLD = auto()  # as soon as it is known where the robot is: what runs was let through before, by whomever
    HOLD_AT_REST = (
        auto()
    )  # where the robot stands, once it does: brakes may have brought it elsewhere than the hold says


class Answer(NamedTuple):
    """What became of a trajectory command."""

    path: JointPath | None  # what was let through; None: the robot is held
    text: str  # what was taken away, or why it is held
    stops: int = 0  # of the gate, when it was let through
    shortened: bool = False  # it ends before what was commanded


class Task(NamedTuple):
    """A trajectory command that waits to be looked at."""

    command: Command
    situation: Situation
    stops: int
    answered: Callable[[Answer], None]


def nobody(_answer: Answer) -> None:
    """Who sent a command by a topic hears the motion itself, and the log."""


class CommandGate:
    """Lets commands pass while it is open."""

    def __init__(
        self, node: LifecycleNode, settings: Settings, robot: Robot, supervisor: Supervisor, fail: Fail
    ) -> None:
        """fail: told of every error in a callback."""
        self._node, self._robot, self._supervisor, self._fail = node, robot, supervisor, fail
        self._gate = Gate(settings, robot.mechanism)
        self.configure(settings)
        self._wanted: tuple[tuple[float, ...], int] | None = None  # commanded rates, and when
        self._moving = False  # whether the last rates that were let through were other than zeros
        self._known: View | None = None  # the last time that the state of the robot was known
        self.stops = 0
        """How often the level has risen to STOP or UNKNOWN, or the gate was closed."""
        self.commands = 0
        """How many commands have come, of every kind."""
        self._stopped = True
        self._held: tuple[int, Hold] | None = None  # the last hold, and the time of the sample that it is made from
        self._owed = Owed.NOTHING
        self._open = False
        self._out = Lock()  # held by whoever says something, so that nothing follows a hold that was known before
        self._work: SimpleQueue[Task | None] = SimpleQueue()
        self._trajectories = publisher(node, JointTrajectory, "command_out", DEPTH)
        self._velocities = publisher(node, Float64MultiArray, "velocity_out", DEPTH)
        subscription(node, JointTrajectory, "command_in", self._guarded(self._on_trajectory), DEPTH)
        subscription(node, Float64MultiArray, "velocity_in", self._guarded(self._on_velocity), DEPTH)
        self._worker = Thread(target=self._certify, name="command gate", daemon=True)
        self._worker.start()

    def configure(self, settings: Settings) -> None:
        """New settings."""
        self._settings = settings
        self._gate.configure(settings)
        self._motions = MotionGate(settings, self._robot)
        self._timeout_ns = round(settings.command_timeout_s * NS_PER_S)

    def open(self) -> None:
        """From now on commands count, and nothing of what was before: the robot may be elsewhere."""
        self._gate = Gate(self._settings, self._robot.mechanism)
        self._known, self._held, self._owed = None, None, Owed.HOLD
        self._open = self._stopped = True

    def close(self) -> None:
        """No command passes, not even one that is being looked at. The last words are zeros and a hold: a controller
        keeps the last rates, and follows the last motion, as long as nobody says otherwise."""
        with self._out:
            if self._open and self._moving:
                self._publish_rates((0.0,) * len(self._settings.joint_names))
            if self._open:
                self._publish_hold()
            self._open, self._wanted = False, None
            self.stops += 1

    def end(self) -> None:
        """Ends the thread; a command that is still being looked at then has nobody who waits for it."""
        self._drop()
        self._work.put(None)
        self._worker.join(END_S)
        for told in (self._velocities, self._trajectories):
            told.wait_for_all_acked(Span(seconds=HEARD_S))

    @property
    def is_open(self) -> bool:
        """Whether commands count."""
        return self._open

    def halt(self, why: str) -> None:
        """Hold, whatever passed before."""
        self.commands += 1
        self._drop()
        with self._out:
            self.stops += 1
            self._publish_hold()
        self._node.get_logger().info(f"held: {why}")

    def beat(self, seen_ns: int) -> None:
        """With every heartbeat: velocities again, and a hold when a stop has come."""
        self._guarded(self._beat)(seen_ns)

    def _guarded(self, callback: Callable[[Any], None]) -> Callable[[Any], None]:
        def guarded(argument: Any) -> None:
            try:
                if self._open:
                    callback(argument)
            except Exception as error:
                self._fail(error)

        return guarded

    def _beat(self, seen_ns: int) -> None:
        view = self._look()
        stopped = view is None or view.judgement.level >= Level.STOP
        if stopped and not self._stopped:
            with self._out:
                self.stops += 1
                self._publish_hold()
        elif view is not None and self._owed == Owed.HOLD:
            with self._out:
                self._publish_hold()
        elif view is not None and self._owed == Owed.HOLD_AT_REST and self._supervisor.standing:
            with self._out:
                self._publish_hold()
                self._owed = Owed.NOTHING
        self._stopped = stopped
        if self._wanted is not None:
            self._pass_velocity(view, seen_ns)

    def _look(self) -> View | None:
        """What is known of the robot now."""
        view = self._supervisor.view
        self._known = view or self._known
        return view

    def _on_velocity(self, message: Float64MultiArray) -> None:
        now_ns = time.monotonic_ns()
        self.commands += 1
        self._wanted = tuple(message.data), now_ns
        self._pass_velocity(self._look(), now_ns)

    def _pass_velocity(self, view: View | None, now_ns: int) -> None:
        assert self._wanted is not None
        wanted, since_ns = self._wanted
        if now_ns - since_ns > self._timeout_ns:
            wanted, self._wanted = (0.0,) * len(self._settings.joint_names), None
        allowed = self._gate.velocity(wanted, view and view.aged(now_ns))
        self._publish_rates(allowed.rates)
        if allowed.text:
            self._node.get_logger().info(f"velocity command: {allowed.text}", throttle_duration_sec=1.0)

    def _publish_rates(self, rates: Sequence[float]) -> None:
        self._velocities.publish(Float64MultiArray(data=list(rates)))
        self._moving = any(rates)

    def _on_trajectory(self, message: JointTrajectory) -> None:
        self.command(message)

    def command(self, message: JointTrajectory, answered: Callable[[Answer], None] = nobody) -> int:
        """Look at a trajectory and let through what is allowed of it. answered: told once, by whichever thread, unless
        another command comes first. Returns the number of the command."""
        self.commands += 1
        view = self._look()
        try:
            command = command_of(message, self._settings.joint_names)
        except BadTrajectory as error:
            self._refuse(str(error), answered)
            return self.commands
        if view is None:
            self._refuse("the state of the robot is not known", answered)
            return self.commands
        share, limits = self._gate.share(view), self._gate.limits(view)
        ahead_s = view.ahead_s if view.judgement.level < Level.STOP else None
        situation = Situation(view.at, view.velocity, share, limits, ahead_s)
        self._drop()
        self._work.put(Task(command, situation, self.stops, answered))
        return self.commands

    def _drop(self) -> None:
        """Forget the commands that wait."""
        while not self._work.empty():
            self._work.get()

    def _certify(self) -> None:
        """The thread: one command after another, until there is None."""
        while (task := self._work.get()) is not None:
            motion = path = None
            try:
                path, text = self._motions.motion(task.command, task.situation)
                motion = None if path is None else self._message(path)
            except Exception as error:  # an error inside holds the robot
                text = f"held: {type(error).__name__}: {error}"
            with self._out:
                if not self._open:
                    continue
                if task.stops != self.stops:
                    motion, text = None, "held: a stop came while the motion was looked at"
                if motion is None:
                    self._publish_hold()
                    task.answered(Answer(None, text or "held, as commanded"))
                else:
                    self._trajectories.publish(motion)
                    self._owed = Owed.NOTHING
                    task.answered(Answer(path, text, self.stops, _ends_early(path, task.command)))
            if text:
                self._node.get_logger().info(f"trajectory command: {text}")

    def _refuse(self, text: str, answered: Callable[[Answer], None]) -> None:
        with self._out:
            self._publish_hold()
            answered(Answer(None, f"held: {text}"))
        self._node.get_logger().warning(f"trajectory command: held: {text}")

    def _publish_hold(self) -> None:
        """One point at rest: a message without points is refused by controllers, which go on with what they have.
        Nothing where nothing is known: nothing has been let through then. Without news of the robot it is held where it
        was told to be before. `_out` is held."""
        known, settings = self._known, self._settings
        if known is None:
            return
        if self._held is None or self._held[0] != known.seen_ns:
            age_s = min((time.monotonic_ns() - known.seen_ns) / NS_PER_S, settings.stale_s)  # later it is no knowledge
            brakes, shortest_s = settings.deceleration_limit, settings.heartbeat_s
            rest = hold(known.at.joints, known.velocity, brakes, age_s, settings.latency_s, shortest_s)
            self._held = known.seen_ns, rest
        after_s, position = self._held[1]
        still = (0.0,) * len(position)
        self._trajectories.publish(self._message(JointPath((0.0, after_s), (position, position), (still, still))))
        self._owed = Owed.HOLD_AT_REST

    def _message(self, path: JointPath) -> JointTrajectory:
        """A motion, without its first point, which is where the robot is. Raises BadTrajectory if it takes longer than
        messages can say."""
        message = JointTrajectory(joint_names=list(self._settings.joint_names))
        for after_s, position, velocity in list(zip(path.times, path.positions, path.velocities, strict=True))[1:]:
            after_ns = round(after_s * NS_PER_S)
            if not after_ns < LONGEST_NS:
                raise BadTrajectory(f"slowed down to what is allowed it takes {after_s:.3g} s")
            sec, nanosec = sec_nanosec(after_ns)
            point = JointTrajectoryPoint(positions=list(position), velocities=list(velocity))
            point.time_from_start = Duration(sec=sec, nanosec=nanosec)
            message.points.append(point)
        return message


def _ends_early(path: JointPath | None, command: Command) -> bool:
    """A motion that is allowed to its end keeps its last point as it was commanded."""
    return path is not None and path.positions[-1] != command.positions[-1]
