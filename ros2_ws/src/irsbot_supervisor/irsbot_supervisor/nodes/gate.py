"""The command gate in ROS: commands in, allowed commands out. A shell around `irsbot_supervisor.gate`.

Velocities pass at once, and again with every heartbeat while they are valid. A trajectory may take a while to be
certified; a separate thread does that, so that samples and heartbeats go on.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from rclpy.lifecycle import LifecycleNode
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from irsbot_kinematics import Robot
from irsbot_msgs_py.gate_status import GateCommand, GateReason
from irsbot_msgs_py.records import Level
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.core.view import View
from irsbot_supervisor.gate.answer import Answer, held
from irsbot_supervisor.gate.trajectory_gate import GatedMotion, MotionGate, Situation
from irsbot_supervisor.gate.velocity_gate import Gate
from irsbot_supervisor.nodes.certifier import Certifier, Outcome, Task
from irsbot_supervisor.nodes.commands import command_of, trajectory_msg
from irsbot_supervisor.nodes.endpoints import subscription
from irsbot_supervisor.nodes.gate_output import DEPTH, GateOutput
from irsbot_supervisor.trajectory.joint_path import BadTrajectory

Fail = Callable[[Exception], None]

WAITED = held(GateReason.UNKNOWN, "the supervisor has paused, and the command may have waited: give it again")
"""Answer to a command of unknown age."""


def nobody(_outcome: Outcome) -> None:
    """No reply: the sender of a command on a topic sees the motion itself and the log."""


class CommandGate:
    """Passes commands while it is open."""

    def __init__(
        self, node: LifecycleNode, settings: Settings, robot: Robot, supervisor: Supervisor, fail: Fail
    ) -> None:
        """fail: called with every error in a callback."""
        self._node, self._robot, self._supervisor, self._fail = node, robot, supervisor, fail
        self._out = GateOutput(node, settings)
        self._gate = Gate(settings, robot.mechanism)
        self._certifier = Certifier(MotionGate(settings, robot), self._certified)
        self.configure(settings)
        self._wanted: tuple[tuple[float, ...], int] | None = None  # commanded rates, and when
        self.stops = 0
        """Number of holds that end every motion: at STOP, at UNKNOWN, after a cancelled goal, and at closing."""
        self.commands = 0
        """Number of commands of every kind."""
        self._level = Level.UNKNOWN  # at the last heartbeat
        self._alive_ns = self._doubt_ns = 0  # when this process was awake last; until when commands may have waited
        self._open = False
        self._out.tell(GateCommand.NONE, held(GateReason.INACTIVE))
        subscription(node, JointTrajectory, "command_in", self._guarded(self._on_trajectory), DEPTH)
        subscription(node, Float64MultiArray, "velocity_in", self._guarded(self._on_velocity), DEPTH)

    def configure(self, settings: Settings) -> None:
        """Take in new settings."""
        self._settings = self._out.settings = settings
        self._gate.configure(settings)
        self._certifier.motions = MotionGate(settings, self._robot)
        self._timeout_ns = round(settings.command_timeout_s * NS_PER_S)

    def open(self) -> None:
        """Open the gate: commands count from now on. Earlier ones do not, because the robot may be elsewhere."""
        self._gate = Gate(self._settings, self._robot.mechanism)
        self._out.begin()
        self._alive_ns = time.monotonic_ns()
        self._open, self._level = True, Level.UNKNOWN
        self._out.tell(GateCommand.NONE, held(GateReason.NO_COMMAND))

    def close(self) -> None:
        """Close the gate: no command passes, not even one that is being certified. Its last messages are zeros and a
        hold: a controller keeps the last rates, and follows the last motion, until it gets another command."""
        with self._out.lock:
            if self._open and self._out.moving:
                self._out.no_rates()
            if self._open:
                self._out.hold()
                self._out.tell(GateCommand.NONE, held(GateReason.INACTIVE))
            self._open, self._wanted = False, None
            self.stops += 1

    def end(self) -> None:
        """End the thread; a command that is still being certified is dropped."""
        self._certifier.end()
        self._out.end()

    @property
    def is_open(self) -> bool:
        """True if commands count."""
        return self._open

    def halt(self, reason: GateReason) -> None:
        """Hold, whatever passed before."""
        self.commands += 1
        self._certifier.drop()
        with self._out.lock:
            self.stops += 1
            self._out.hold()
            self._out.tell(GateCommand.TRAJECTORY, held(reason))
        self._node.get_logger().info(held(reason).text)

    def beat(self, seen_ns: int) -> None:
        """Called with every heartbeat: repeat velocities, and publish a hold after a stop."""
        self._guarded(self._beat)(seen_ns)

    def _guarded(self, callback: Callable[[Any], None]) -> Callable[[Any], None]:
        def guarded(argument: Any) -> None:
            try:
                if self._open:
                    callback(argument)
            except Exception as error:
                self._fail(error)

        return guarded

    def _is_new(self) -> bool:
        """True if a command that arrives now was sent now. After a pause of this process it may have waited for an
        unknown time, because messages of velocities have no stamp: such commands are void until all waiting ones are
        gone."""
        now_ns = time.monotonic_ns()
        if now_ns - self._alive_ns > self._timeout_ns:
            self._doubt_ns = now_ns + self._timeout_ns
        self._alive_ns = now_ns
        return now_ns >= self._doubt_ns

    def _beat(self, seen_ns: int) -> None:
        self._is_new()
        for task, error in self._certifier.failed():
            self._fail(error)  # UNKNOWN, and so a hold
            self._refuse(held(GateReason.INTERNAL, f"{type(error).__name__}: {error}"), task.answered)
        view = self._look()
        level = Level.UNKNOWN if view is None else view.judgement.level
        if level > self._level and level >= Level.STOP:  # also from STOP to UNKNOWN: that ends a way out
            with self._out.lock:
                self.stops += 1
                self._out.hold()
                told = self._out.told
                if told is not None and told[0] != GateCommand.NONE:
                    self._out.tell(told[0], held(GateReason.UNKNOWN if view is None else GateReason.STOP))
        elif view is not None:
            self._out.settle(self._supervisor)
        self._level = level
        if self._wanted is not None:
            self._pass_velocity(view, seen_ns)

    def _look(self) -> View | None:
        """The present state of the robot."""
        view = self._supervisor.view
        self._out.known = view or self._out.known
        return view

    def _on_velocity(self, message: Float64MultiArray) -> None:
        now_ns = time.monotonic_ns()
        self.commands += 1
        if not self._is_new():
            self._wanted = None
            self._out.no_rates()
            self._out.tell(GateCommand.VELOCITY, WAITED)
            return
        self._wanted = tuple(message.data), now_ns
        self._pass_velocity(self._look(), now_ns)

    def _pass_velocity(self, view: View | None, now_ns: int) -> None:
        assert self._wanted is not None
        wanted, since_ns = self._wanted
        late = now_ns - since_ns > self._timeout_ns
        if late:
            wanted, self._wanted = (0.0,) * len(self._settings.joint_names), None
        rates, answer = self._gate.velocity(wanted, view and view.aged(now_ns))
        self._out.rates(rates)
        self._out.tell(GateCommand.VELOCITY, held(GateReason.NO_COMMAND) if late else answer)
        if answer.text:
            self._node.get_logger().info(f"velocity command: {answer.text}", throttle_duration_sec=1.0)

    def _on_trajectory(self, message: JointTrajectory) -> None:
        self.command(message)

    def command(self, message: JointTrajectory, answered: Callable[[Outcome], None] = nobody) -> int:
        """Certify a trajectory and pass its allowed part. answered: called once, by either thread, unless another
        command comes first. Returns the number of the command."""
        self.commands += 1
        if not self._is_new():
            self._refuse(WAITED, answered)
            return self.commands
        view = self._look()
        try:
            command = command_of(message, self._settings.joint_names)
        except BadTrajectory as error:
            self._refuse(held(GateReason.INVALID, str(error)), answered)
            return self.commands
        if view is None:
            self._refuse(held(GateReason.UNKNOWN), answered)
            return self.commands
        prediction_delay_s = view.prediction_delay_s if view.judgement.level < Level.STOP else None
        situation = Situation(view.at, view.velocity, *self._gate.allowance(view), prediction_delay_s)
        self._certifier.put(Task(command, situation, self.stops, answered))
        return self.commands

    def _certified(self, task: Task, certified: GatedMotion) -> None:
        """Publish a certified motion, or a hold. Called by the certifier's thread."""
        path, answer = certified
        motion = None
        try:
            motion = None if path is None else trajectory_msg(path, self._settings.joint_names)
        except BadTrajectory as error:
            answer = held(GateReason.INVALID, str(error))
        with self._out.lock:
            if not self._open:
                return
            if task.stops != self.stops:
                motion, answer = None, held(GateReason.STOP, "a stop came while the motion was looked at")
            self._out.tell(GateCommand.TRAJECTORY, answer, always=True)
            if motion is None:
                self._out.hold()
                task.answered(Outcome(None, answer))
            else:
                self._out.motion(motion)
                task.answered(Outcome(path, answer, self.stops))
        if answer.text:
            self._node.get_logger().info(f"trajectory command: {answer.text}")

    def _refuse(self, answer: Answer, answered: Callable[[Outcome], None]) -> None:
        with self._out.lock:
            self._out.tell(GateCommand.TRAJECTORY, answer, always=True)
            self._out.hold()
            answered(Outcome(None, answer))
        self._node.get_logger().warning(f"trajectory command: {answer.text}")
