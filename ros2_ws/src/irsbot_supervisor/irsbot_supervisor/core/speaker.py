"""Verdicts as they are published: when one is due, and what it says."""

from __future__ import annotations

from irsbot_msgs_py.records import Cause, Finding, Level, Tick, Verdict
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.core.escape import Escape
from irsbot_supervisor.core.estimation.estimate import Estimate
from irsbot_supervisor.core.events import Event
from irsbot_supervisor.core.latch import Latch
from irsbot_supervisor.core.settings import Settings

JUST_NOW = 0.1
"""1: share of the heartbeat. A younger verdict is not repeated at a tick, so two verdicts are at most 1.1 heartbeats
apart."""


class Speaker:
    """Numbers verdicts, and knows when the last one was published."""

    def __init__(self, settings: Settings) -> None:
        self._count = 0
        self._spoken_ns = 0
        self.configure(settings)

    def configure(self, settings: Settings) -> None:
        """Take in new settings; the numbers go on."""
        self._settings = settings
        self._heartbeat_ns = round(settings.heartbeat_s * NS_PER_S)
        self._hash = settings.config_hash

    def is_due(self, event: Event, changed: bool) -> bool:
        """True if a verdict is to be published now. Every tick is a heartbeat, also one that comes a little early: the
        next one is a full period away."""
        rest_ns = round(JUST_NOW * self._heartbeat_ns) if isinstance(event, Tick) else self._heartbeat_ns
        return changed or event.seen_ns - self._spoken_ns >= rest_ns

    def verdict(self, latch: Latch, good: Estimate | None, slow: bool, escape: Escape, seen_ns: int) -> Verdict:
        """The next verdict. good: the last good sample. slow: True if the robot is known to be slow: only then it may
        leave a stop. escape: the way out of the stop in force."""
        self._count += 1
        self._spoken_ns = seen_ns
        now, end_ns = latch.now, latch.bypassed_until_ns
        moves_away = now.level == Level.STOP
        return Verdict(
            stamp_ns=good.stamp_ns if good else 0,
            level=now.level,
            causes=now.causes,
            latched=now.latched,
            event=now.event,
            escape_direction=escape.direction,
            text=_text(now.findings),
            sequence=self._count,
            config_hash=self._hash,
            since_ns=now.since_ns,
            speed_scale=now.speed_scale if not moves_away else self._settings.recovery_share if slow else 0.0,
            findings=now.findings,
            bypassed=Cause(now.bypassed),
            bypass_left=max(end_ns - seen_ns, 0) / NS_PER_S if end_ns is not None else 0.0,
            escape_cause=Cause(escape.causes),
        )


def _text(findings: tuple[Finding, ...]) -> str:
    """All findings as text, the worst one first."""
    ordered = sorted(findings, key=lambda finding: -finding.level)
    return "; ".join(finding.text for finding in ordered)
