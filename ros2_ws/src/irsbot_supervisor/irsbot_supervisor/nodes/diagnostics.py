"""/diagnostics once a second: one status per check, through the standard messages."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from irsbot_msgs_py.records import Cause, Level, Verdict
from irsbot_supervisor.core.pipeline import Supervisor
from irsbot_supervisor.nodes.guard import Fail, guarded
from irsbot_supervisor.nodes.partners import Finding, Partners
from irsbot_supervisor.nodes.samples import Samples

PERIOD_S = 1.0
"""s between diagnostic messages, the customary rate."""

CHECKS = {
    "margins": Cause.TYPE1 | Cause.TYPE2 | Cause.CONSTRAINT | Cause.LIMB | Cause.BRAKING,
    "motion": Cause.SPEED | Cause.REACTION,
    "branch": Cause.NOT_ASSEMBLED | Cause.BRANCH,
    "joint states": Cause.NO_DATA | Cause.STALE | Cause.STAMP | Cause.NAMES | Cause.NONFINITE | Cause.IMPLAUSIBLE,
    "velocities": Cause.DEGRADED,
    "supervisor": Cause.INTERNAL | Cause.LATCHED,
}
"""Which causes each check looks at."""

_LEVELS = {
    Level.OK: DiagnosticStatus.OK,
    Level.WARN: DiagnosticStatus.WARN,
    Level.STOP: DiagnosticStatus.ERROR,
    Level.UNKNOWN: DiagnosticStatus.STALE,
}


class DiagnosticsPublisher:
    """Remembers the newest verdict and reports it, with the counts of rejected samples; silent without one."""

    def __init__(self, node: Node, supervisor: Supervisor, partners: Partners, samples: Samples, fail: Fail) -> None:
        self.verdict: Verdict | None = None
        self._node, self._supervisor, self._partners, self._samples = node, supervisor, partners, samples
        self._skipped = 0  # until the last report
        self._hardware = supervisor.settings.robot
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # simulated time may stand still
        node.create_timer(PERIOD_S, guarded(self._report, fail), clock=steady)

    def _report(self) -> None:
        verdict = self.verdict
        if verdict is None:
            return
        message = DiagnosticArray()
        message.header.stamp = self._node.get_clock().now().to_msg()
        for check, causes in CHECKS.items():
            found = [finding for finding in verdict.findings if finding.cause & causes]
            level = max((finding.level for finding in found), default=Level.OK)
            if check == "supervisor" and verdict.latched:
                level = max(level, Level.STOP)
            status = DiagnosticStatus(level=_LEVELS[level], hardware_id=self._hardware)
            status.name = f"{self._node.get_fully_qualified_name()}: {check}"
            status.message = "; ".join(finding.text for finding in found) or "OK"
            if check == "supervisor" and verdict.latched:
                status.message = f"a stop is latched, event {verdict.event}: {verdict.text}"
            if check == "supervisor" and verdict.bypassed:
                status.level = max(status.level, DiagnosticStatus.WARN)
                status.message = f"{verdict.bypassed.name} is bypassed for {verdict.bypass_left:.0f} s: {verdict.text}"
            if check == "joint states":
                rejected = self._supervisor.rejections.items()
                status.values = [KeyValue(key=f"rejected {c.name}", value=str(n)) for c, n in rejected]
            message.status.append(status)
        for name, status_level, text in (*self._partners.look(), self._rate(), self._stop()):
            status = DiagnosticStatus(level=status_level, hardware_id=self._hardware, message=text)
            status.name = f"{self._node.get_fully_qualified_name()}: {name}"
            message.status.append(status)
        self._publisher.publish(message)

    def _rate(self) -> Finding:
        """Whether all samples could be judged since the last report."""
        skipped, self._skipped = self._samples.skipped - self._skipped, self._samples.skipped
        if not skipped:
            return Finding("joint states rate", DiagnosticStatus.OK, "every sample is judged")
        text = f"{skipped} samples skipped for newer ones: more come than can be judged"
        return Finding("joint states rate", DiagnosticStatus.WARN, text)

    def _stop(self) -> Finding:
        """Whether the last stop kept to the brakes and the latency that are configured."""
        stop = self._supervisor.measured_stop
        if stop is None:
            return Finding("stops", DiagnosticStatus.OK, "no stop has been measured")
        text = f"joint '{stop.joint}' went {stop.way:.4g} {stop.unit} of {stop.allowed:.4g} allowed in the last stop, "
        text += f"{stop.time_s:.4g} s of {stop.allowed_s:.4g}"
        return Finding("stops", DiagnosticStatus.OK if stop.way <= stop.allowed else DiagnosticStatus.WARN, text)
