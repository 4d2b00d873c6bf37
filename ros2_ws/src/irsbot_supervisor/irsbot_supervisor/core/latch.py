"""From findings to the verdict: the worst wins, every cause is kept for a dwell time, a stop is held until reset, or
passed for a while where an operator has bypassed its cause.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from irsbot_msgs_py.records import Bypass, Cause, Finding, Floats, Level
from irsbot_supervisor.core.bypass import InForce, in_force
from irsbot_supervisor.core.intake import S
from irsbot_supervisor.core.settings import Settings


class Judgement(NamedTuple):
    """Level and causes now in force, and since when."""

    level: Level
    causes: int  # sum of Cause bits
    latched: bool
    event: int
    since_ns: int
    speed_scale: float
    findings: tuple[Finding, ...]
    escape: Floats
    bypassed: int = 0  # the Cause bit that does not stop at present


class Latch:
    """Holds findings and stops. Moved by `update`, `reset` and `bypass` alone."""

    def __init__(self, settings: Settings) -> None:
        self.configure(settings)
        self._held: dict[tuple[int, Level], tuple[Finding, int]] = {}
        self._stopped_by: tuple[Finding, ...] = ()
        self._escape: Floats = ()
        self._bypass: InForce | None = None
        self.turns: list[Judgement] = []
        """Judgements that came into force since this list was last emptied."""
        self.now = Judgement(Level.UNKNOWN, 0, False, 0, 0, 0.0, (), ())

    def configure(self, settings: Settings) -> None:
        """New times; what is held and latched stays so."""
        self._dwell_ns = round(settings.dwell_s * S)
        self._slow = settings.recovery_share

    @property
    def latched(self) -> bool:
        return bool(self._stopped_by)

    @property
    def lost(self) -> bool:
        """Whether the loss of the branch is latched."""
        return any(map(_is_lost, self._stopped_by))

    @property
    def bypassed_until_ns(self) -> int | None:
        """When the bypass in force ends, steady clock; None if there is none."""
        return self._bypass.until_ns if self._bypass is not None else None

    def keep(self, findings: Iterable[Finding], at_ns: int) -> None:
        """Findings that hold without a break until a moment, however long ago somebody looked."""
        for finding in self._passed(findings):
            self._held[finding.cause, finding.level] = finding, at_ns

    def count_on(self, event: int) -> None:
        """The next stop has at least this number."""
        self.now = self.now._replace(event=max(self.now.event, event - 1))

    def update(self, findings: list[Finding], at_ns: int, escape: Floats = ()) -> bool:
        """Take in what was found at a time (steady clock). True if the judgement changed."""
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
            self._escape = self._escape or escape
            self.now = self.now._replace(event=self.now.event + 1)
        return self._set(at_ns) or changed

    def _release(self, at_ns: int, again: set[tuple[int, Level]]) -> bool:
        """Let go of what was not found for the dwell time, in the order in which it lapsed and dated to that moment:
        when somebody looks must not show in a replay."""
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

    def reset(self, event: int, at_ns: int, standing: bool, active: list[Finding], escape: Floats = ()) -> str:
        """End the stop number `event`. Returns an empty text, or why not. active: what is found as soon as the branch
        is confirmed. A branch that is confirmed while the cause of a stop is active is known from then on, and a new
        event is the stop: there is a way out of it, `escape`."""
        if refusal := self.refused(event, standing):
            return refusal
        if unknown := self._unknown(active, at_ns):
            return unknown
        stops = tuple(finding for finding in active if finding.level == Level.STOP)
        if stops and not self.lost:
            return f"the cause is still there: {stops[0].text}"
        self._stopped_by, self._escape = stops, escape
        self._held = {key: entry for key, entry in self._held.items() if key[1] < Level.STOP}
        if stops:
            self.now = self.now._replace(event=self.now.event + 1)
        self._set(at_ns)
        return f"the branch is confirmed, but the cause of a stop is still there: {stops[0].text}" if stops else ""

    def refused(self, event: int, standing: bool) -> str:
        """Why a reset is refused, whatever is found; empty if that has to be looked at."""
        if not self._stopped_by:
            return "nothing to reset: no stop is latched"
        if event != self.now.event:
            return f"event {event} is not the stop in force, which is {self.now.event}"
        return "" if standing else "the robot is not standing still"

    def bypass(self, wish: Bypass, standing: bool, active: list[Finding]) -> str:
        """Let motion pass one cause of the stop `wish.event` for a while. Returns an empty text, or why not. active:
        what is found now. The stop is over then; what stops afterwards is another one."""
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
        self._bypass, self._stopped_by, self._escape = bypass, (), ()
        self._held = {key: entry for key, entry in self._held.items() if key[1] < Level.STOP}
        self.keep(active, wish.seen_ns)
        self._set(wish.seen_ns)
        return ""

    def end_bypass(self) -> None:
        """From now on its cause stops as any other."""
        if self._bypass is not None:
            words = self._bypass.words
            self._held = {key: entry for key, entry in self._held.items() if not entry[0].text.startswith(words)}
        self._bypass = None

    def _as_of(self, findings: list[Finding], at_ns: int) -> list[Finding]:
        """Findings as they act at a time: what a bypass that ends now has passed may have lapsed before."""
        bypass = self._bypass
        assert bypass is not None, "there is one"
        if at_ns >= bypass.until_ns or any(map(bypass.is_ended_by, findings)):
            self._release(at_ns, {(finding.cause, bypass.passed(finding).level) for finding in findings})
            self.end_bypass()
        return self._passed(findings)

    def _passed(self, findings: Iterable[Finding]) -> list[Finding]:
        """Findings as they act: what is bypassed warns. Whatever else stops, and whatever is not known, ends that."""
        found = list(findings)
        if self._bypass is not None and any(map(self._bypass.is_ended_by, found)):
            self.end_bypass()
        return found if self._bypass is None else [self._bypass.passed(finding) for finding in found]

    def _unknown(self, active: list[Finding], at_ns: int) -> str:
        """What is not known, or was not known until just now; empty if all is."""
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
            self.now = Judgement(Level.OK, 0, False, before.event, at_ns, most, (), (), bypassed)
            self.turns.append(self.now)
            return True
        findings = tuple(finding for finding, _last in self._held.values())
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
        self.now = Judgement(level, causes, latched, before.event, since, scale, findings, self._escape, bypassed)
        if not same:
            self.turns.append(self.now)
        return not same


def _latches(finding: Finding) -> bool:
    """Stops are held; so is the loss of the branch, which no later sample can bring back."""
    return finding.level == Level.STOP or _is_lost(finding)


def _is_lost(finding: Finding) -> bool:
    return finding.level == Level.UNKNOWN and bool(finding.cause & Cause.BRANCH)
