"""Robot and supervisor in one process and in simulated time: the nodes without the middleware.

For reproducible bags, for campaigns of thousands of runs, and for tests. Drives, faults, supervisor and stop response
are those of the nodes; a message arrives in the cycle in which it is sent.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from irsbot_kinematics import Robot
from irsbot_kinematics.mechanism import Floats
from irsbot_msgs_py.records import CONSUMER_TIMEOUT_S, JointSample, Level, Reset, SingularityState, Tick, Verdict
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.bag.bag_writer import BagWriter
from irsbot_supervisor.bag.journal import configured, write_entry
from irsbot_supervisor.core.events import Step
from irsbot_supervisor.core.latch import Judgement
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.gate.velocity_gate import Allowed, Gate
from irsbot_supervisor.sim.faults import FaultInjector, parse_faults
from irsbot_supervisor.sim.joints import Drives
from irsbot_supervisor.sim.simulation import Simulation, build
from irsbot_supervisor.sim.stop_response import StopResponse
from irsbot_supervisor.sim.trajectory import stand
from irsbot_supervisor.trajectory.joint_path import joint_limits_of

BEGIN_NS = 1_700_000_000 * NS_PER_S
"""ns: ROS time at the begin of every simulated run; steady time begins at one second."""

STEADY_NS = NS_PER_S

GUIDED_PERIOD_S = 0.001
"""s between the samples of a guided robot."""


class Cycle(NamedTuple):
    """One period of the drives."""

    now_ns: int  # ROS time
    position: Floats  # where the joints really are, rad or m
    velocity: Floats
    sent: tuple[JointSample, ...]  # samples that the supervisor received
    states: tuple[SingularityState, ...]
    verdicts: tuple[Verdict, ...]
    level: Level  # in force after this cycle
    resets: tuple[Reset, ...] = ()  # requests of an operator


def cycles(
    simulation: Simulation,
    robot: Robot,
    settings: Settings,
    faults: str | None = None,
    resets_s: Sequence[float] = (),
) -> Iterator[Cycle]:
    """The run of a scenario, cycle by cycle, without end. faults: a fault line in place of the scenario's. resets_s:
    times at which an operator requests a reset, in ascending order.

    Raises SimulationError for a simulation that cannot be run.
    """
    machine, scenario = build(simulation, robot)
    injector = FaultInjector(
        parse_faults(scenario.faults if faults is None else faults), robot.mechanism, simulation.seed
    )
    supervisor = Supervisor(settings, robot)
    stop_response = StopResponse(simulation.verdict_timeout_s, simulation.gated)
    period_ns = round(simulation.period_s * NS_PER_S)
    heartbeat_ns = round(settings.heartbeat_s * NS_PER_S)
    supervisor.step(Tick(BEGIN_NS, STEADY_NS))  # silence counts from the moment in which the settings come into force
    due_ns, elapsed_ns, level, event = STEADY_NS, 0, Level.UNKNOWN, 0
    asked = deque(round(reset_s * NS_PER_S) for reset_s in resets_s)
    while True:
        elapsed_ns += period_ns
        seen_ns, now_ns = STEADY_NS + elapsed_ns, BEGIN_NS + elapsed_ns
        started = elapsed_ns >= simulation.start_delay_s * NS_PER_S
        allowed = (stop_response.allowed(seen_ns) if simulation.obey else 1.0) if started else 0.0
        reading = machine.step(simulation.period_s, allowed)
        sample = JointSample(now_ns, now_ns, seen_ns, simulation.joint_names, *reading)
        sent = tuple(out.sample for out in injector.send(sample))
        steps = [supervisor.step(one) for one in sent]
        if seen_ns >= due_ns:
            due_ns += heartbeat_ns
            steps.append(supervisor.step(Tick(now_ns, seen_ns)))
        resets = []
        while asked and asked[0] <= elapsed_ns:
            asked.popleft()
            resets.append(Reset(now_ns, seen_ns, event, "operator"))
            steps.append(supervisor.step(resets[-1]))
        verdicts = tuple(step.verdict for step in steps if step.verdict is not None)
        for verdict in verdicts:
            stop_response.hear(verdict.level, verdict.speed_scale, seen_ns)
            level, event = verdict.level, verdict.event
        joints = machine.drives.now
        states = tuple(step.state for step in steps if step.state is not None)
        yield Cycle(now_ns, joints.position, joints.velocity, sent, states, verdicts, level, tuple(resets))


def record(run: Iterator[Cycle], seconds: float, robot: Robot, settings: Settings, target: Path) -> None:
    """Record the first seconds of a run as the recorder does. Raises BagError."""
    with BagWriter(target, compression="zstd") as opened:
        entry = configured(settings, robot, BEGIN_NS, STEADY_NS)
        opened.add("/supervisor/journal", write_entry(entry), BEGIN_NS)
        for cycle in run:
            if cycle.now_ns > BEGIN_NS + seconds * NS_PER_S:
                break
            for sample in cycle.sent:
                opened.add("/joint_states", sample, cycle.now_ns)
            for reset in cycle.resets:
                opened.add("/supervisor/journal", write_entry(reset), cycle.now_ns)
            for state in cycle.states:
                opened.add("/supervisor/state", state, cycle.now_ns)
            for verdict in cycle.verdicts:
                opened.add("/supervisor/verdict", verdict, cycle.now_ns)


class GuidedRobot:
    """A robot that velocity commands move through the command gate, in simulated time."""

    def __init__(self, robot: Robot, settings: Settings, start: Floats, latency_s: float = 0.0) -> None:
        """start: joint positions, at rest. latency_s: of the drives."""
        limits = joint_limits_of(settings)
        self.settings = settings
        self.supervisor = Supervisor(settings, robot)
        self.drives = Drives(stand(start), limits, latency_s)
        self.transitions: list[Judgement] = []
        """Every judgement that came into force."""
        self._gate = Gate(settings, robot.mechanism)
        self._stop_response = StopResponse(CONSUMER_TIMEOUT_S, gated=True)
        self._elapsed_ns = 0

    @property
    def now(self) -> Judgement:
        return self.transitions[-1]

    @property
    def way_out(self) -> Floats:
        """Escape direction of the stop in force, from where the robot is; empty if none is known."""
        return self.supervisor.escape.direction

    def beat(self, wanted: Sequence[float]) -> Allowed:
        """Advance by one heartbeat with a commanded velocity, rad/s or m/s; returns the velocity that the gate
        passed."""
        allowed = self._gate.velocity(wanted, self.supervisor.view)
        self.drives.jog(allowed.rates, self.settings.command_timeout_s)
        self.drift()
        return allowed

    def rush(self, rates: Sequence[float]) -> None:
        """Advance by one heartbeat with a velocity that does not pass the gate."""
        self.drives.jog(tuple(rates), self.settings.command_timeout_s)
        self.drift()

    def drift(self) -> None:
        """Advance by one heartbeat without a command."""
        for _ in range(round(self.settings.heartbeat_s / GUIDED_PERIOD_S)):
            self._elapsed_ns += round(GUIDED_PERIOD_S * NS_PER_S)
            seen_ns, now_ns = STEADY_NS + self._elapsed_ns, BEGIN_NS + self._elapsed_ns
            joints = self.drives.step(GUIDED_PERIOD_S, self._stop_response.allowed(seen_ns))
            names = self.settings.joint_names
            self._hear(JointSample(now_ns, now_ns, seen_ns, names, joints.position, joints.velocity))

    def reset(self) -> str:
        """Reset as an operator does; returns the reason for a refusal, or an empty text."""
        now_ns, seen_ns = BEGIN_NS + self._elapsed_ns, STEADY_NS + self._elapsed_ns
        return self._hear(Reset(now_ns, seen_ns, self.now.event, "guided")).refusal

    def _hear(self, event: JointSample | Reset) -> Step:
        step = self.supervisor.step(event)
        self.transitions += step.transitions
        if step.verdict is not None:
            self._stop_response.hear(step.verdict.level, step.verdict.speed_scale, event.seen_ns)
        return step
