"""From findings to the verdict: the worst level wins, every cause is kept for the dwell time, a stop is latched until
its reset, or passed for a limited time if an operator has bypassed its cause."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from irsbot_msgs_py.records import Bypass, Cause, Finding, Level
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.core.bypass import InForce, in_force
from irsbot_supervisor.core.settings import Settings


class Judgement(NamedTuple):
    """Level and causes in force, and the time since when they are."""

    level: Level
    causes: int  # sum of Cause bits
    latched: bool
    event: int
    since_ns: int
    speed_scale: float
    findings: tuple[Finding, ...]
    bypassed: int = 0  # the Cause bit that does not stop at present


class Latch:
    """Holds findings and stops. Only `update`, `reset` and `bypass` change it."""

    def __init__(self, settings: Settings) -> None:
        self.configure(settings)
        self._held: dict[tuple[int, Level], tuple[Finding, int]] = {}
        self._stopped_by: tuple[Finding, ...] = ()
        self._bypass: InForce | None = None
        self._transitions: list[Judgement] = []
        self.now = Judgement(Level.UNKNOWN, 0, False, 0, 0, 0.0, ())

    def configure(self, settings: Settings) -> None:
        """Take in new times; findings and latches are kept."""
        self._dwell_ns = round(settings.dwell_s * NS_PER_S)
        self._slow = settings.recovery_share

    def take_transitions(self) -> tuple[Judgement, ...]:
        """The judgements that have come into force since the last call, in order."""
        taken, self._transitions = tuple(self._transitions), []
        return taken

    @property
    def latched(self) -> bool:
        return bool(self._stopped_by)

    @property
    def held(self) -> list[Finding]:
        """The findings in force, without those that a latched stop remembers."""
        return [finding for finding, _last in self._held.values()]

    @property
    def clear(self) -> bool:
        """True if the level is OK and nothing is held, latched or bypassed, nor waits in `take_transitions`."""
        nothing = not (self._held or self._stopped_by or self._bypass or self._transitions)
        return nothing and self.now.level == Level.OK

    @property
    def lost(self) -> bool:
        """True if the loss of the branch is latched."""
        return any(map(_is_lost, self._stopped_by))

    @property
    def bypassed_until_ns(self) -> int | None:
        """End of the bypass in force, steady clock; None if there is none."""
        return self._bypass.until_ns if self._bypass is not None else None

    def keep(self, findings: Iterable[Finding], at_ns: int) -> None:
        """Findings that last without a break until a moment, whenever they were last evaluated."""
        for finding in self._passed(findings):
            self._held[finding.cause, finding.level] = finding, at_ns

    def count_on(self, event: int) -> None:
        """Give the next stop at least this number."""
        self.now = self.now._replace(event=max(self.now.event, event - 1))

    def update(self, findings: list[Finding], at_ns: int) -> bool:
        """Take in the findings of a time (steady clock). True if the judgement changed."""
        if self._bypass is not None:
            findings = self._as_of(findings, at_ns)
        held = self._held
        if not findings and not held and not self._stopped_by:
            return self._set(at_ns)
        changed = self._release(at_ns, {(finding.cause, finding.level) for finding in findings})
        self.keep(findings, at_ns)
        stops = tuple(finding for finding in findings if _latches(finding))
        if self._stopped_by:
            # a stop within a stop is the same event, but who looked before the branch was lost is wrong
            stops = () if self.lost else tuple(filter(_is_lost, stops))
        if stops:
            self._stopped_by += stops
            self.now = self.now._replace(event=self.now.event + 1)
        return self._set(at_ns) or changed

    def _release(self, at_ns: int, again: set[tuple[int, Level]]) -> bool:
        """Remove findings that were not found for the dwell time, in the order and with the time of their end: the
        times of evaluation must not show in a replay."""
        changed = False
        lapsed = sorted(
            (last_ns + self._dwell_ns, key)
            for key, (_finding, last_ns) in self._held.items()
            if at_ns - last_ns > self._dwell_ns or (at_ns - last_ns == self._dwell_ns and key not in again)
        )
        for number, (end_ns, key) in enumerate(lapsed, 1):
            del self._held[key]
            if end_ns < (lapsed[number][0] if number < len(lapsed) else at_ns):  # not before all of that moment is done
                changed = self._set(end_ns) or changed
        return changed

    def reset(self, event: int, at_ns: int, standing: bool, active: list[Finding]) -> str:
        """End the stop number `event`. Returns an empty text, or the reason for a refusal. active: findings once the
        branch is confirmed. If the branch is confirmed while the cause of a stop is active, the branch is known from
        then on, and the stop becomes a new event."""
        if refusal := self.refused(event, standing):
            return refusal
        if unknown := self._unknown(active, at_ns):
            return unknown
        stops = tuple(finding for finding in active if finding.level == Level.STOP)
        if stops and not self.lost:
            return f"the cause is still there: {stops[0].text}"
        self._stopped_by = stops
        self._held = {key: entry for key, entry in self._held.items() if key[1] < Level.STOP}
        if stops:
            self.now = self.now._replace(event=self.now.event + 1)
        self._set(at_ns)
        return f"the branch is confirmed, but the cause of a stop is still there: {stops[0].text}" if stops else ""

    def refused(self, event: int, standing: bool) -> str:
        """Reason to refuse a reset, independent of the findings; empty if the findings decide."""
        if not self._stopped_by:
            return "nothing to reset: no stop is latched"
        if event != self.now.event:
            return f"event {event} is not the stop in force, which is {self.now.event}"
        return "" if standing else "the robot is not standing still"

    def bypass(self, wish: Bypass, standing: bool, active: list[Finding]) -> str:
        """Allow motion in spite of one cause of the stop `wish.event` for a limited time. Returns an empty text, or the
        reason for a refusal. active: present findings. The stop ends; a later stop is a new event."""
        if not self._stopped_by:
            return "nothing to bypass: no stop is latched"
        if wish.event != self.now.event:
            return f"event {wish.event} is not the stop in force, which is {self.now.event}"
        if self.lost:
            return "the branch is lost: a stop for that ends by a reset alone"
        if not standing:
            return "the robot is not standing still"
        if unknown := self._unknown(active, wish.seen_ns):
            return unknown
        bypass, refusal = in_force(wish, active)
        if bypass is None:
            return refusal
        self._bypass, self._stopped_by = bypass, ()
        self._held = {key: entry for key, entry in self._held.items() if key[1] < Level.STOP}
        self.keep(active, wish.seen_ns)
        self._set(wish.seen_ns)
        return ""

    def end_bypass(self) -> None:
        """End the bypass: its cause stops again."""
        if self._bypass is not None:
            words = self._bypass.words
            self._held = {key: entry for key, entry in self._held.items() if not entry[0].text.startswith(words)}
        self._bypass = None

    def _as_of(self, findings: list[Finding], at_ns: int) -> list[Finding]:
        """Findings with their effect at a time: those that a bypass passed may have lapsed before it ended."""
        bypass = self._bypass
        assert bypass is not None, "there is one"
        if at_ns >= bypass.until_ns or any(map(bypass.is_ended_by, findings)):
            self._release(at_ns, {(finding.cause, bypass.passed(finding).level) for finding in findings})
            self.end_bypass()
        return self._passed(findings)

    def _passed(self, findings: Iterable[Finding]) -> list[Finding]:
        """Findings with their effect: a bypassed one warns. Any other stop, and any UNKNOWN, ends the bypass."""
        found = list(findings)
        if self._bypass is not None and any(map(self._bypass.is_ended_by, found)):
            self.end_bypass()
        return found if self._bypass is None else [self._bypass.passed(finding) for finding in found]

    def _unknown(self, active: list[Finding], at_ns: int) -> str:
        """Reason if the state is unknown, or was unknown until just now; empty if it is known."""
        if unknown := [finding for finding in active if finding.level == Level.UNKNOWN]:
            return f"the state of the robot is not known: {unknown[0].text}"
        for finding, last_ns in self._held.values():
            if finding.level == Level.UNKNOWN and not _is_lost(finding) and at_ns - last_ns <= self._dwell_ns:
                return f"the state of the robot was not known until just now: {finding.text}"
        return ""

    def _set(self, at_ns: int) -> bool:
        before = self.now
        bypassed, most = (self._bypass.cause, self._slow) if self._bypass is not None else (0, 1.0)
        if not self._held and not self._stopped_by:
            if before.level == Level.OK and not before.latched and before.bypassed == bypassed:
                return False
            self.now = Judgement(Level.OK, 0, False, before.event, at_ns, most, (), bypassed)
            self._transitions.append(self.now)
            return True
        findings = tuple(self.held)
        causes = 0
        level = Level.OK
        for finding in findings:
            causes |= int(finding.cause)
            level = max(level, finding.level)
        if self._stopped_by:
            known = {(finding.cause, finding.level) for finding in findings}
            findings += tuple(f for f in self._stopped_by if (f.cause, f.level) not in known)
            for finding in self._stopped_by:
                causes |= int(finding.cause)
                level = max(level, finding.level)
            causes |= int(Cause.LATCHED)
        latched = self.latched
        same = (before.level, before.causes, before.latched, before.bypassed) == (level, causes, latched, bypassed)
        since = before.since_ns if same else at_ns
        scale = most if level < Level.STOP else 0.0
        self.now = Judgement(level, causes, latched, before.event, since, scale, findings, bypassed)
        if not same:
            self._transitions.append(self.now)
        return not same


def _latches(finding: Finding) -> bool:
    """True for findings that are latched: stops, and the loss of the branch, which no later sample can restore."""
    return finding.level == Level.STOP or _is_lost(finding)


def _is_lost(finding: Finding) -> bool:
    return finding.level == Level.UNKNOWN and bool(finding.cause & Cause.BRANCH)
