"""Checks assumption 9 of the guarantee while the robot works: samples are judged within the allowed time."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticStatus

from irsbot_supervisor.nodes.graph_monitor import GraphFault


class JudgingTimes:
    """Counts samples that took longer to judge than their box allows, for /diagnostics."""

    def __init__(self) -> None:
        self.late = 0
        """Number of such samples."""
        self.longest_s = 0.0
        """Longest time to judge a sample."""
        self._fresh, self._worst_s, self._allowed_s = 0, 0.0, 0.0  # since the last report

    def note(self, took_s: float, allowed_s: float) -> None:
        """Add a sample. took_s: from its arrival to its verdict. allowed_s: J of the box before it."""
        self.longest_s = max(self.longest_s, took_s)
        if not took_s <= allowed_s:
            self.late += 1
            self._fresh += 1
            if not took_s <= self._worst_s:
                self._worst_s, self._allowed_s = took_s, allowed_s

    def report(self) -> GraphFault:
        """Finding on the samples since the last report."""
        fresh, worst_s, allowed_s = self._fresh, self._worst_s, self._allowed_s
        self._fresh, self._worst_s = 0, 0.0
        if not fresh:
            return GraphFault("judging", DiagnosticStatus.OK, "every sample is judged in time")
        text = f"{fresh} samples took longer to judge than the certified box allows, up to {worst_s * 1e3:.1f} ms "
        text += f"of {allowed_s * 1e3:.1f} ms: state bounding_s and judging_s (irsbot limits --measure)"
        return GraphFault("judging", DiagnosticStatus.WARN, text)
