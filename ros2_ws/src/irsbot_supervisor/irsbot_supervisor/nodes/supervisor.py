"""supervisor_node: joint states in, states and verdicts out. A shell around `core.pipeline.Supervisor`."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any

from irsbot_msgs.msg import SingularityState, Verdict
from irsbot_msgs.srv import CheckTrajectory, ResetStop
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.timer import Timer
from std_msgs.msg import String

from irsbot_kinematics import KinematicsError
from irsbot_msgs_py.cdr import encode_state, encode_verdict
from irsbot_msgs_py.records import Configure, Reset, Tick
from irsbot_msgs_py.shell import run
from irsbot_supervisor.core.pipeline import Event, Step, Supervisor
from irsbot_supervisor.core.settings import InvalidSettings
from irsbot_supervisor.journal import configured, write_entry
from irsbot_supervisor.nodes.check import checked, refused
from irsbot_supervisor.nodes.diagnostics import DiagnosticsPublisher
from irsbot_supervisor.nodes.gate import CommandGate
from irsbot_supervisor.nodes.lifecycle import answer_every_request
from irsbot_supervisor.nodes.markers import MarkersPublisher
from irsbot_supervisor.nodes.parameters import changed_settings, declare_settings
from irsbot_supervisor.nodes.partners import Partners
from irsbot_supervisor.nodes.samples import Samples

STREAM = QoSProfile(depth=200, reliability=ReliabilityPolicy.RELIABLE)
"""Every sample counts as long as all can be judged in time."""

INLET = QoSProfile(depth=12, reliability=ReliabilityPolicy.RELIABLE)
"""What waits longer is skipped for newer samples anyway, and every place may come to hold the largest message ever."""

LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
REQUESTS = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
"""By default ten requests and ten answers are kept, and of a hundred clients at once most would wait for ever."""

JOURNAL = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class SupervisorNode(LifecycleNode):
    """Judges while active. In any other state it is silent, and silence means stop."""

    def __init__(self) -> None:
        super().__init__("supervisor")
        answer_every_request(self)
        autostart = self.declare_parameter("autostart", True).value
        described = ParameterDescriptor(description="frame of ~/markers", read_only=True)
        self._frame = self.declare_parameter("base_frame", "base", described).value
        self._settings, self._robot = declare_settings(self)
        self._supervisor: Supervisor | None = None
        self._gate: CommandGate | None = None
        self._parts: list[tuple[Any, Callable[[Any], object]]] = []
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._heart: Timer | None = None
        self.add_on_set_parameters_callback(self._check_parameters)
        self.add_post_set_parameters_callback(self._apply_parameters)
        if autostart:
            self.trigger_configure()
            self.trigger_activate()

    # --- life cycle --------------------------------------------------------------------------------------------

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start with nothing known: UNKNOWN until good samples have arrived."""
        self._supervisor = Supervisor(self._settings, self._robot)
        publisher, kept = self.create_publisher, self._kept
        self._states = kept(publisher(SingularityState, "~/state", STREAM), self.destroy_publisher)
        self._verdicts = kept(publisher(Verdict, "~/verdict", LATCHED), self.destroy_publisher)
        self._journal = kept(publisher(String, "~/journal", JOURNAL), self.destroy_publisher)
        self._samples = Samples(self, INLET, self._step)
        kept(self._samples.subscription, self.destroy_subscription)
        self._diagnostics = DiagnosticsPublisher(self, self._settings, Partners(self), self._samples, self._fail)
        kept(self._diagnostics.publisher, self.destroy_publisher)
        kept(self._diagnostics.timer, self.destroy_timer)
        self._markers = MarkersPublisher(self, self._robot, self._supervisor, self._frame, self._fail)
        kept(self._markers.publisher, self.destroy_publisher)
        kept(self._markers.timer, self.destroy_timer)
        service = self.create_service
        kept(service(ResetStop, "~/reset", self._on_reset, qos_profile=REQUESTS), self.destroy_service)
        check = service(CheckTrajectory, "~/check_trajectory", self._on_check, qos_profile=REQUESTS)
        kept(check, self.destroy_service)
        self._gate = CommandGate(self, self._settings, self._robot, self._supervisor, self._fail)
        for commands in self._gate.subscriptions:
            kept(commands, self.destroy_subscription)
        for allowed in (self._gate.trajectories, self._gate.velocities):
            kept(allowed, self.destroy_publisher)
        self._start_heart()
        now = self._now()
        self._note(configured(self._settings, self._robot, *now))
        self._step(Tick(*now))  # silence counts from the moment in which the settings come into force
        self.get_logger().info(f"supervising {self._robot.name}, settings {self._settings.config_hash}")
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Fall silent; a latched stop is not remembered, the next activation starts at UNKNOWN."""
        self._fall_silent()
        return super().on_deactivate(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """From whatever state."""
        self._fall_silent()
        return super().on_shutdown(state)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """An activation that failed half-way leaves nothing behind."""
        self._fall_silent()
        return super().on_error(state)

    def close(self) -> None:
        """Called by the shell before the node is destroyed."""
        self._fall_silent()

    def _fall_silent(self) -> None:
        self._supervisor = None
        if self._gate is not None:
            self._gate.close()
        for part, destroy in self._parts:
            destroy(part)
        self._parts, self._gate = [], None
        self._stop_heart()

    def _kept(self, part: Any, destroy: Callable[[Any], object]) -> Any:
        """A part of the active state, and how it goes."""
        self._parts.append((part, destroy))
        return part

    def _start_heart(self) -> None:
        """On the steady clock: simulated time may stand still, and the heart must not."""
        self._stop_heart()
        self._heart = self.create_timer(self._settings.heartbeat_s, self._on_tick, clock=self._steady)

    def _stop_heart(self) -> None:
        if self._heart is not None:
            self.destroy_timer(self._heart)
        self._heart = None

    # --- callbacks ---------------------------------------------------------------------------------------------

    def _on_tick(self) -> None:
        self._samples.settle()
        tick = Tick(*self._now())
        self._step(tick)
        if self._gate is not None:
            self._gate.beat(tick.seen_ns)

    def _on_reset(self, request: ResetStop.Request, response: ResetStop.Response) -> ResetStop.Response:
        reset = Reset(*self._now(), request.event, request.operator_text, tuple(request.seed_pose))
        self._note(reset)
        step = self._step(reset)
        response.accepted = step is not None and not step.refusal
        response.message = step.refusal if step is not None else "an error occurred inside the supervisor"
        if response.accepted:
            self.get_logger().info(f"reset of event {request.event}: accepted")
        else:
            text = f"reset of event {request.event}: {response.message}"
            self.get_logger().info(text, throttle_duration_sec=1.0)  # whoever asks without end gets answers, not lines
        return response

    def _on_check(
        self, request: CheckTrajectory.Request, response: CheckTrajectory.Response
    ) -> CheckTrajectory.Response:
        """Only while the robot stands: a long answer delays the heartbeat, and a consumer then brakes."""
        supervisor = self._supervisor
        if supervisor is None or not supervisor.standing:
            return refused(response, "the robot is moving, or its state is not known: ask while it stands")
        try:
            return checked(self._robot, self._settings, request, response)
        except Exception as error:
            self._fail(error)
            return refused(CheckTrajectory.Response(), f"an error occurred inside the supervisor: {error}")

    def _step(self, event: Event) -> Step | None:
        """The one guard: an error inside becomes an UNKNOWN verdict and a log line."""
        supervisor = self._supervisor
        if supervisor is None:
            return None
        try:
            step = supervisor.step(event)
            if step.state is not None:
                spent = (time.monotonic_ns() - event.seen_ns) * 1e-9
                self._states.publish(encode_state(step.state._replace(compute_time=spent)))
                self._markers.state = step.state
            if step.verdict is not None:
                self._verdicts.publish(encode_verdict(step.verdict))
                self._markers.verdict = step.verdict
                self._diagnostics.watch(step.verdict, supervisor)
            return step
        except Exception as error:
            self._fail(error)
            return None

    def _fail(self, error: Exception) -> None:
        """An error in a callback: UNKNOWN, until a sample is judged without one."""
        self.get_logger().error(f"{type(error).__name__}: {error}", throttle_duration_sec=1.0)
        if self._supervisor is not None:
            verdict = self._supervisor.fail(time.monotonic_ns(), f"{type(error).__name__}: {error}")
            self._verdicts.publish(encode_verdict(verdict))

    # --- parameters --------------------------------------------------------------------------------------------

    def _check_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        try:
            changed_settings(self._settings, self._robot, parameters)
        except InvalidSettings as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply_parameters(self, parameters: list[Parameter]) -> None:
        settings = changed_settings(self._settings, self._robot, parameters)
        if settings is None:
            return
        self._settings = settings
        if self._supervisor is not None:
            change = configured(settings, self._robot, *self._now())
            self._note(change)
            self._step(change)
        if self._gate is not None:
            self._gate.configure(settings)
            self._start_heart()

    def _note(self, event: Configure | Reset) -> None:
        self._journal.publish(String(data=write_entry(event)))

    def _now(self) -> tuple[int, int]:
        return self.get_clock().now().nanoseconds, time.monotonic_ns()


def main() -> None:
    """Entry point of `ros2 run irsbot_supervisor supervisor_node`."""
    sys.exit(run(SupervisorNode, usage_errors=(InvalidSettings, KinematicsError)))


if __name__ == "__main__":
    main()
