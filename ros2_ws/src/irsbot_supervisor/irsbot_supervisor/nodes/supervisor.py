"""supervisor_node: joint states in, states and verdicts out. A shell around `core.supervisor.Supervisor`."""

from __future__ import annotations

import sys
import time
from dataclasses import asdict

from irsbot_msgs.msg import SingularityState
from irsbot_msgs.msg import Verdict as VerdictMsg
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.timer import Timer
from std_msgs.msg import String

from irsbot_kinematics import KinematicsError
from irsbot_msgs_py.cdr import encode_state, encode_verdict
from irsbot_msgs_py.process.priority import LIMITS, MEANING, PARAMETER, PRIORITY
from irsbot_msgs_py.process.run import run
from irsbot_msgs_py.records import Bypass, JointSample, LateBrakes, Level, Reset, Restart, Tick, Verdict
from irsbot_msgs_py.records import SingularityState as State
from irsbot_supervisor.bag.journal import Entry, configured, write_entry
from irsbot_supervisor.core.events import Configure, Event, Step
from irsbot_supervisor.core.settings import InvalidSettings, Settings
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.nodes.allowance import Allowance
from irsbot_supervisor.nodes.bond import Bond
from irsbot_supervisor.nodes.callers import Callers
from irsbot_supervisor.nodes.clocks import both_clocks
from irsbot_supervisor.nodes.declared import declare, descriptor, read_as_declared
from irsbot_supervisor.nodes.diagnostics import DiagnosticsPublisher
from irsbot_supervisor.nodes.endpoints import quality
from irsbot_supervisor.nodes.follow import FollowServer, action_type
from irsbot_supervisor.nodes.gate import CommandGate
from irsbot_supervisor.nodes.graph_monitor import GraphMonitor
from irsbot_supervisor.nodes.judging_times import JudgingTimes
from irsbot_supervisor.nodes.later import Later
from irsbot_supervisor.nodes.lifecycle import answer_every_request, forget_state_machine
from irsbot_supervisor.nodes.markers import MarkersPublisher
from irsbot_supervisor.nodes.parameters import ChangingSettings, declare_settings
from irsbot_supervisor.nodes.posture import PosturePublisher
from irsbot_supervisor.nodes.safe import PROMISED, SafePublisher
from irsbot_supervisor.nodes.samples import Samples
from irsbot_supervisor.nodes.services import Services
from irsbot_supervisor.nodes.spoken import Spoken
from irsbot_supervisor.nodes.summary import SummaryPublisher
from irsbot_supervisor.nodes.verdict_log import VerdictLog

PARAMETERS = {
    "autostart": (True, "become active at the start, without waiting for transitions", None),
    "base_frame": ("base", "frame of ~/markers, without frame_prefix", None),
    "frame_prefix": ("", "before the names of frames on /tf and of ~/markers, as robot_state_publisher has it", None),
    "lock_settings": (False, "settings are read-only from the first activation on", None),
    "start_latched": (False, "started again after an end: level UNKNOWN until a reset", None),
    PARAMETER: (PRIORITY, MEANING, LIMITS),
}
"""Parameters that are not settings, with default, description and range. All are read at the start alone."""

STREAM = QoSProfile(depth=2000, reliability=ReliabilityPolicy.RELIABLE)
"""Deep queue, as deep as the recorder's: a recorder without processor time for two seconds at 1 kHz misses nothing, and
without the states a replay does not know when samples were judged."""

INLET = QoSProfile(depth=25, reliability=ReliabilityPolicy.RELIABLE)
"""As many samples as come at 5 kHz until they are late: older ones are skipped for newer ones anyway."""

STATES_HZ, STATES_AT_ONCE = 2500.0, 50.0
"""States published in a second, and at once after a stall. To publish a state takes longer than to judge a sample; each
sample is judged at higher rates too. With each heartbeat the newest is published: a replay knows since when a silence
lasts."""

STATES_OF_CHANGES = 25.0
"""States that are kept for the samples next to a change of level or causes, whose times a replay has to know."""

SCARCE_PRICE = 2.5
"""1: states that one state counts for while there is hardly time to judge all samples. Samples come first, but without
1000 states in a second a replay would have to guess too many times."""

SHOWN_NS = 50_000_000
"""ns: shortest time between markers, postures and diagnostics."""

JOURNAL = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class SupervisorNode(LifecycleNode):
    """Judges while active. In any other state it is silent, and silence means stop.

    One `Supervisor` lives as long as the node: a latched stop and the last event number survive every transition of the
    life cycle. So only a reset ends a stop, and an old number never fits a new one. The parts of the node live as long,
    because the middleware keeps 2 kB of every dozen that are destroyed. Publishers of states, summaries, verdicts and
    the journal live as long as an activation: latched messages of an inactive supervisor must not reach late joiners.
    """

    def __init__(self) -> None:
        super().__init__("supervisor")
        answer_every_request(self)
        autostart, base, prefix, self._lock, self._restarted, priority = (
            declare(self, name, default, descriptor(text, limits))
            for name, (default, text, limits) in PARAMETERS.items()
        )
        self.thread_priority = priority
        settings, self._robot = declare_settings(self)
        self._supervisor = Supervisor(settings, self._robot)
        self._later = Later(self, self._fail)
        self._callers = Callers(self)
        self._changing = ChangingSettings(self, self._later, settings, self._robot, self._apply, self._callers)
        self._active = False
        self._log, self._spoken = VerdictLog(self.get_logger()), Spoken()
        self._safe = SafePublisher(self)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._heart: Timer | None = None
        self._publishing = Allowance(STATES_HZ, STATES_AT_ONCE, time.monotonic_ns())
        self._unpublished: State | None = None  # the newest state, if it had no turn
        self._found: tuple[Level, int] | None = None  # level and causes of the newest sample
        self._listened = False  # True if states have a subscriber; a new one is noticed with the next sample
        self._reported_ns = 0  # seen_ns of the newest state
        self._told_ns = 0  # `brakes_ns` of the newest `LateBrakes`
        self._speech: list[Publisher] = []
        self._stream = quality(self, SingularityState, "~/state", STREAM)
        self._lasting = quality(self, String, "~/journal", JOURNAL)
        self._samples = Samples(self, INLET, self._step)
        self._judging = JudgingTimes()
        graph_monitor = GraphMonitor(self, self._callers.counts)
        self._diagnostics = DiagnosticsPublisher(
            self, self._supervisor, graph_monitor, self._samples, self._judging, self._callers, self._fail
        )
        self._markers = MarkersPublisher(
            self, self._robot, settings, self._supervisor, self._later, prefix + base, self._fail
        )
        self._posture = PosturePublisher(self, self._robot, prefix, self._fail)
        self._summary = SummaryPublisher(self, self._supervisor)
        self._bond = Bond(self, self._fail)
        self._gate = CommandGate(self, settings, self._robot, self._supervisor, self._fail)
        action = action_type()
        self._follow = FollowServer(self, action, self._gate, self._supervisor) if action else None
        Services(self, self._supervisor, self._later, self._callers, lambda: self._active, self._take, self._fail)
        read_as_declared(self)
        if autostart:
            self.trigger_configure()
            self.trigger_activate()

    # --- life cycle --------------------------------------------------------------------------------------------

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Nothing to do: all parts exist since the creation of the node."""
        self.get_logger().info("configured: inactive until an activation")
        return super().on_configure(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Nothing to do: all parts stay until the end of the node."""
        self.get_logger().info("cleaned up: the state of the robot and a latched stop are kept")
        return super().on_cleanup(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Begin or continue to judge. The inactive time counts as an interval between two samples: UNKNOWN if it was a
        silence. A latched stop stays."""
        self._summary.open()  # first: who finds states alone may take them for those of a played bag
        self._states = self.create_publisher(SingularityState, "~/state", self._stream)
        self._verdicts = self.create_publisher(VerdictMsg, "~/verdict", PROMISED)
        self._journal = self.create_publisher(String, "~/journal", self._lasting)
        self._speech = [self._states, self._verdicts, self._journal]
        self._start_heart(self._settings)
        self._active, self._changing.locked = True, self._lock
        self._bond.form()
        self._configure(self._settings)
        if self._restarted:
            self._restarted = False
            restart = Restart(*both_clocks(self), int(time.time()))
            self._note(restart)
            self._step(restart)
        self._samples.open()
        self._gate.open()
        topic = self.resolve_topic_name("~/verdict")
        self.get_logger().info(f"supervising {self._robot.name}, settings {self._settings.config_hash}, on {topic}")
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop publishing."""
        self._fall_silent()
        self.get_logger().info("deactivated: silent, and nothing passes the gate")
        return super().on_deactivate(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop publishing, from any state."""
        self._fall_silent()
        self.get_logger().info(f"shut down in state '{state.label}'")
        return super().on_shutdown(state)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Clean up after an activation that failed half-way."""
        self.get_logger().error("a transition failed with an error inside")
        self._fall_silent()
        return super().on_error(state)

    def close(self) -> None:
        """Called by the shell before the node is destroyed."""
        self._fall_silent()
        self._gate.end()
        self._later.close()
        self._safe.end()

    def destroy_node(self) -> None:
        """Also destroy the state machine, which rclpy does not."""
        forget_state_machine(self)
        super().destroy_node()

    def _fall_silent(self) -> None:
        """Stop publishing. A heartbeat may still come before the executor notices; it finds the node inactive."""
        self._active = False
        self._bond.end()
        self._stop_heart()
        self._samples.close()
        self._gate.close()
        if self._follow is not None:
            self._follow.close()
        self._safe.close()
        self._diagnostics.forget()
        self._markers.verdict = self._markers.state = self._posture.state = self._unpublished = None
        for spoken in self._speech:
            self.destroy_publisher(spoken)
        self._speech = []
        self._summary.close()

    def _start_heart(self, settings: Settings) -> None:
        """Start the heartbeat on the steady clock: simulated time may stand still."""
        self._stop_heart()
        self._heart = self.create_timer(settings.heartbeat_s, self._on_tick, clock=self._steady)

    def _stop_heart(self) -> None:
        if self._heart is not None:
            self.destroy_timer(self._heart)
        self._heart = None

    # --- callbacks ---------------------------------------------------------------------------------------------

    def _on_tick(self) -> None:
        self._samples.settle()
        self._tell_newest(0.0)  # a silence may follow: a replay has to know since when
        self._listened = self._active and self._states.get_subscription_count() > 0
        self._summary.look()
        tick = Tick(*both_clocks(self))
        self._step(tick)
        self._gate.beat(tick.seen_ns)
        if self._follow is not None and self._active:
            self._follow.beat(tick.seen_ns)

    def _step(self, event: Event) -> Step | None:
        """Run the core with one guard: an internal error becomes an UNKNOWN verdict and a log line."""
        if not self._active:
            return None
        allowed_s = self._supervisor.judging_s
        try:
            if self._supervisor.is_late(event.seen_ns):
                self._tell_late_brakes(event)
            step = self._supervisor.step(event, self._is_wanted(event.seen_ns))
            state = step.state
            if state is not None:
                self._reported_ns = event.seen_ns
                compute_time_s = (time.monotonic_ns() - event.seen_ns) * 1e-9
                state = State._make((*state[:-1], compute_time_s))  # a third of the time of `_replace`
                if self._listened:
                    self._tell(state, step.found != self._found or step.verdict is not None)
                self._found = step.found
                self._markers.state = self._diagnostics.state = self._posture.state = state
            if step.verdict is not None:
                self._say(step.verdict)
                self._markers.verdict = self._diagnostics.verdict = step.verdict
            if isinstance(event, JointSample):
                self._judging.note((time.monotonic_ns() - event.seen_ns) * 1e-9, allowed_s)
                self._summary.hear(state, event.seen_ns)  # behind the verdict, which never waits for a view
            return step
        except Exception as error:
            self._fail(error)
            return None

    def _tell_late_brakes(self, event: Event) -> None:
        """Tell the core that drives braked late, if they did: neither UNKNOWN was published in time, nor had the
        verdicts been missing for long."""
        brakes_ns = self._spoken.brakes_ns(event.seen_ns)
        if brakes_ns != self._told_ns and self._supervisor.is_late(brakes_ns):
            self._told_ns = brakes_ns
            late = LateBrakes(event.received_ns - 1, event.seen_ns - 1, brakes_ns)  # a replay has it before the event
            self._note(late)
            step = self._supervisor.step(late)
            if step.verdict is not None:
                self._say(step.verdict)

    def _tell(self, state: State, changed: bool) -> None:
        """Publish a state if it has its turn. changed: the sample is judged otherwise than the one before; then the
        states of both have theirs."""
        left, price = self._publishing.grow(state.seen_ns), SCARCE_PRICE if self._samples.time_is_scarce else 1.0
        if changed := changed and left >= 2.0 * price:
            self._tell_newest(price)
        self._unpublished = state
        if changed or left >= STATES_OF_CHANGES + price:
            self._tell_newest(price)

    def _tell_newest(self, price: float) -> None:
        """Publish the newest state, unless it is published."""
        if self._unpublished is not None:
            self._states.publish(encode_state(self._unpublished))
            self._unpublished = None
            self._publishing.left -= price

    def _is_wanted(self, now_ns: int) -> bool:
        """True if states have a subscriber, or if a summary, markers, postures or diagnostics need a new one."""
        if not self._listened:
            self._listened = self._states.get_subscription_count() > 0
        return self._listened or self._summary.is_due(now_ns) or now_ns - self._reported_ns >= SHOWN_NS

    def _say(self, verdict: Verdict) -> None:
        self._verdicts.publish(encode_verdict(verdict))
        self._safe.tell(verdict.level)
        now_ns = time.monotonic_ns()
        self._spoken.note(verdict.speed_scale > 0.0, now_ns)
        self._log.hear(verdict, now_ns)

    def _fail(self, error: Exception) -> None:
        """Handle an error in a callback: UNKNOWN, until a sample is judged without error."""
        if not self._active:
            return  # its publishers are gone
        self.get_logger().error(f"{type(error).__name__}: {error}", throttle_duration_sec=1.0)
        step = self._supervisor.fail(time.monotonic_ns(), error)
        if step.verdict is not None:
            self._say(step.verdict)

    # --- parameters --------------------------------------------------------------------------------------------

    @property
    def _settings(self) -> Settings:
        return self._changing.now

    def _apply(self, settings: Settings) -> None:
        """Bring checked settings into force."""
        was, now = asdict(self._settings), asdict(settings)
        changes = ", ".join(f"{name} {was[name]!r} -> {now[name]!r}" for name in now if now[name] != was[name])
        self.get_logger().info(f"settings {settings.config_hash}: {changes or 'as before'}")
        self._gate.configure(settings)
        if self._active:
            self._configure(settings)
            if settings.heartbeat_s != self._settings.heartbeat_s:
                self._start_heart(settings)

    def _configure(self, settings: Settings) -> None:
        """Bring the settings into force; before the first sample, a silence counts from here."""
        now = both_clocks(self)
        self._note(configured(settings, self._robot, *now))
        self._step(Configure(*now, settings))

    def _take(self, wish: Reset | Bypass) -> Step | None:
        """Record an operator's wish in the journal before it is judged."""
        self._note(wish)
        return self._step(wish)

    def _note(self, entry: Entry) -> None:
        self._journal.publish(String(data=write_entry(entry)))


def main() -> None:
    """Entry point of `ros2 run irsbot_supervisor supervisor_node`."""
    sys.exit(run(SupervisorNode, usage_errors=(InvalidSettings, KinematicsError), log="supervisor"))


if __name__ == "__main__":
    main()
