"""/diagnostics once a second: one status per check, in the standard messages.

STOP and UNKNOWN are errors. The aggregator sets STALE: a supervisor that is frozen or has ended publishes nothing.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from math import inf, isfinite, tau

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from irsbot_kinematics import Coordinate
from irsbot_msgs_py.process.priority import priority_now
from irsbot_msgs_py.records import Cause, Level, SingularityState, Verdict
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.nodes.callers import Callers
from irsbot_supervisor.nodes.endpoints import publisher
from irsbot_supervisor.nodes.graph_monitor import GraphFault, GraphMonitor
from irsbot_supervisor.nodes.guard import Fail, guarded
from irsbot_supervisor.nodes.judging_times import JudgingTimes
from irsbot_supervisor.nodes.samples import Samples

PERIOD_S = 1.0
"""s between diagnostic messages, the usual rate."""

CHECKS = {
    "margins": Cause.TYPE1 | Cause.TYPE2 | Cause.CONSTRAINT | Cause.LIMB | Cause.BRAKING,
    "motion": Cause.SPEED | Cause.REACTION | Cause.POSITION,
    "branch": Cause.NOT_ASSEMBLED | Cause.BRANCH,
    "joint states": Cause.NO_DATA | Cause.STALE | Cause.STAMP | Cause.NAMES | Cause.NONFINITE | Cause.IMPLAUSIBLE,
    "velocities": Cause.DEGRADED,
    "supervisor": Cause.INTERNAL | Cause.LATCHED,
}
"""Causes of each check."""

_LEVELS = {
    Level.OK: DiagnosticStatus.OK,
    Level.WARN: DiagnosticStatus.WARN,
    Level.STOP: DiagnosticStatus.ERROR,
    Level.UNKNOWN: DiagnosticStatus.ERROR,
}


class DiagnosticsPublisher:
    """Keeps the newest state and verdict and reports them, with rates and counts; silent without a verdict."""

    def __init__(
        self,
        node: Node,
        supervisor: Supervisor,
        graph_monitor: GraphMonitor,
        samples: Samples,
        judging: JudgingTimes,
        callers: Callers,
        fail: Fail,
    ) -> None:
        self.verdict: Verdict | None = None
        self.state: SingularityState | None = None
        self._node, self._supervisor, self._graph_monitor, self._samples = node, supervisor, graph_monitor, samples
        self._judging, self._callers = judging, callers
        self._skipped = 0  # until the last report
        self._counted = (time.monotonic_ns(), 0, 0)  # at the last turn: steady clock, samples, verdicts
        self._publisher = publisher(node, DiagnosticArray, "/diagnostics", 10)
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # simulated time may stand still
        node.create_timer(PERIOD_S, guarded(self._report, fail), clock=steady)

    def forget(self) -> None:
        """An inactive supervisor reports nothing, and rates count from its next activation on."""
        self._rates()
        self.verdict = self.state = None

    def _report(self) -> None:
        verdict, rates = self.verdict, self._rates()
        if verdict is None:
            return
        values = self._values(verdict, *rates)
        message = DiagnosticArray()
        message.header.stamp = self._node.get_clock().now().to_msg()
        for check, causes in CHECKS.items():
            found = [finding for finding in verdict.findings if finding.cause & causes]
            level = max((finding.level for finding in found), default=Level.OK)
            text = "; ".join(finding.text for finding in found) or "OK"
            if check == "supervisor" and verdict.latched:
                level = max(level, Level.STOP)
                text = f"a stop is latched, event {verdict.event}: {verdict.text}"
            stated = _LEVELS[level]
            if check == "supervisor" and verdict.bypassed:
                stated = max(stated, DiagnosticStatus.WARN)
                text = f"{verdict.bypassed.name} is bypassed for {verdict.bypass_left:.0f} s: {verdict.text}"
            message.status.append(self._status(GraphFault(check, stated, text), values.get(check, {})))
        robot, names = self._supervisor.robot, self._supervisor.settings.joint_names
        units = of_units(robot.mechanism.joints, names, self.state.joint_position if self.state else ())
        for finding in (*self._graph_monitor.look(), self._rate(), self._judging.report(), self._stop(), units):
            message.status.append(self._status(finding, {}))
        message.status.append(self._status(self._callers.report(), self._callers.counts))
        self._publisher.publish(message)

    def _status(self, finding: GraphFault, values: Mapping[str, object]) -> DiagnosticStatus:
        status = DiagnosticStatus(level=finding.level, message=finding.text)
        status.name = f"{self._node.get_fully_qualified_name()}: {finding.name}"
        status.hardware_id = self._supervisor.settings.robot
        status.values = [KeyValue(key=key, value=_stated(value)) for key, value in values.items()]
        return status

    def _rates(self) -> tuple[float, float]:
        """Samples and verdicts per second since the last call."""
        then_ns, judged, told = self._counted
        self._counted = (
            time.monotonic_ns(),
            self.state.sequence if self.state else judged,
            self.verdict.sequence if self.verdict else told,
        )
        passed_s = (self._counted[0] - then_ns) / NS_PER_S or inf
        return (self._counted[1] - judged) / passed_s, (self._counted[2] - told) / passed_s

    def _values(self, verdict: Verdict, samples_hz: float, verdicts_hz: float) -> dict[str, dict[str, object]]:
        """Values of the checks, by check."""
        now_ns, state = time.monotonic_ns(), self.state
        rejected = {f"rejected {c.name}": count for c, count in self._supervisor.rejections.items()}
        found: dict[str, dict[str, object]] = {
            "joint states": {
                "samples [1/s]": samples_hz,
                "skipped": self._samples.skipped,
                **rejected,
                "seen too rarely": self._supervisor.seen_too_rarely,
            },
            "supervisor": {
                "level": verdict.level.name,
                "event": verdict.event,
                "speed scale": verdict.speed_scale,
                "verdicts [1/s]": verdicts_hz,
                "verdict": verdict.sequence,
                "settings": verdict.config_hash,
            },
        }
        view = self._supervisor.view
        if view is not None:  # the longer this is, the farther joints get unseen: gaps cost as much as speed
            found["joint states"]["next one expected within [s]"] = view.expected_s
        if state is not None:
            found["margins"] = _margins(state)
            found["motion"] = {"joint velocity": state.joint_velocity, "largest leg force [N]": state.reaction_max}
            found["branch"] = {"working mode": state.working_mode, "assembly mode": state.assembly_mode}
            found["joint states"]["age on arrival [s]"] = state.sample_age
            found["joint states"]["since arrival [s]"] = (now_ns - state.seen_ns) / NS_PER_S
            found["supervisor"]["time to judge [s]"] = state.compute_time
        found["supervisor"]["real-time priority"] = priority_now()
        found["supervisor"]["longest time to judge [s]"] = self._judging.longest_s
        found["supervisor"]["judged late"] = self._judging.late
        return found

    def _rate(self) -> GraphFault:
        """Finding on samples that were skipped since the last report."""
        skipped, self._skipped = self._samples.skipped - self._skipped, self._samples.skipped
        if not skipped:
            return GraphFault("joint states rate", DiagnosticStatus.OK, "every sample is judged")
        text = f"{skipped} samples skipped for newer ones: more come than can be judged"
        return GraphFault("joint states rate", DiagnosticStatus.WARN, text)

    def _stop(self) -> GraphFault:
        """Finding on the brakes and the latency of the last stop."""
        stop = self._supervisor.measured_stop
        if stop is None:
            return GraphFault("stops", DiagnosticStatus.OK, "no stop has been measured")
        text = f"joint '{stop.joint}' went {stop.way:.4g} {stop.unit} of {stop.allowed:.4g} allowed in the last stop, "
        text += f"{stop.time_s:.4g} s of {stop.allowed_s:.4g}"
        return GraphFault("stops", DiagnosticStatus.OK if stop.way <= stop.allowed else DiagnosticStatus.WARN, text)


def of_units(joints: Sequence[Coordinate], names: Sequence[str], position: Sequence[float]) -> GraphFault:
    """Note on units: angles are used modulo a turn, for encoders of many turns. So positions in degrees are not
    detected while they do not move."""
    far = [
        f"'{name}' is at {value:.4g} rad, {abs(value) / tau:.1f} turns from zero"
        for name, joint, value in zip(names, joints, position, strict=False)
        if joint.is_angle and isfinite(value) and abs(value) > tau
    ]
    if not far:
        return GraphFault("joint states units", DiagnosticStatus.OK, "within one turn of zero")
    text = f"{'; '.join(far)}: right for encoders of many turns, wrong if these are degrees"
    return GraphFault("joint states units", DiagnosticStatus.WARN, text)


def _margins(state: SingularityState) -> dict[str, object]:
    """The margins that the robot has, and the stop margin."""
    return {
        "Type 1": min(state.type1_margin, default=None),
        "Type 2": state.type2_margin,
        **({"constraint": state.constraint_margin} if isfinite(state.constraint_margin) else {}),
        **({"limb": min(state.limb_margin)} if state.limb_margin else {}),
        "while stopping": state.stop_margin,
        "stop limit": state.stop_limit,
        "time to stop [s]": state.time_to_stop,
    }


def _stated(value: object) -> str:
    """A number for people: six digits."""
    if isinstance(value, float):
        return f"{value:.6g}"
    return ", ".join(map(_stated, value)) if isinstance(value, Sequence) and not isinstance(value, str) else str(value)
