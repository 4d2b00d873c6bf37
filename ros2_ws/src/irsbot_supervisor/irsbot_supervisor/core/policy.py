"""Numbers against limits: the only place that compares with a threshold. The test is written for what is accepted,
so that NaN falls through to the severe answer."""

from __future__ import annotations

from math import nan
from operator import le

from irsbot_kinematics.mechanism import Coordinate
from irsbot_msgs_py.records import Cause, Finding, Floats, Level
from irsbot_supervisor.core.assess import SOLVED, Assessment, Margins
from irsbot_supervisor.core.estimation.estimate import Estimate
from irsbot_supervisor.core.estimation.sample_interval import SETTLING
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.stopping import limits_of, release_of

KINDS = (Cause.TYPE1, Cause.TYPE2, Cause.CONSTRAINT, Cause.LIMB)
"""The margins in the order of `assess.Margins`."""

ANY_MARGIN = int(Cause.TYPE1 | Cause.TYPE2 | Cause.CONSTRAINT | Cause.LIMB)
"""All margins as a plain number: arithmetic on flags costs a microsecond each."""

OBSERVABLE = 0.1
"""1: leg forces are read from motor efforts only where the Type 1 margin is above this. Dividing by a smaller one
multiplies friction and current errors more than ten times."""

WORDS = {
    Cause.TYPE1: "Type 1 margin",
    Cause.TYPE2: "Type 2 margin",
    Cause.CONSTRAINT: "constraint margin",
    Cause.LIMB: "limb margin",
}


class Policy:
    """The limits of one robot, applied."""

    def __init__(self, settings: Settings, joints: tuple[Coordinate, ...]) -> None:
        self._warn = limits_of(settings, "warn")
        self._stop = limits_of(settings, "stop")
        self._release = release_of(settings)
        self._names = settings.joint_names
        self._units = [f"{joint.unit}/s" for joint in joints]
        self._speed = settings.velocity_limit
        self._settling = SETTLING * settings.stale_s
        self._beat_s = settings.heartbeat_s
        self._reaction_level = {"none": Level.OK, "warn": Level.WARN, "stop": Level.STOP}[settings.reaction_check]
        self._reaction_limit = settings.reaction_limit_n

    def judge(
        self, estimate: Estimate, assessment: Assessment, floor: Margins | None, reaction: Floats, held: int
    ) -> list[Finding]:
        """Everything about one good sample that is not OK. floor: the margins until standstill, None where there is no
        posture. held: sum of the causes that were found just before."""
        if assessment.at.status != SOLVED or floor is None:
            return [self._not_assembled(assessment), *self._branch(assessment)]
        findings = self._branch(assessment) if assessment.branch_fault else []
        if not estimate.steady_s >= self._settling:  # nobody knows how far it gets unseen, but where it is
            findings.append(self._unsettled(estimate.steady_s))
            floor = assessment.margins
        warn = self._warn
        if not (floor[0] >= warn[0] and floor[1] >= warn[1] and floor[2] >= warn[2] and floor[3] >= warn[3]):
            findings += self._margins(assessment.margins, floor, estimate.expected_s)
        elif held & ANY_MARGIN:
            findings += self._lingering(floor, held)
        if not all(map(le, map(abs, estimate.velocity), self._speed)):
            findings += self._speeding(estimate.velocity)
        if estimate.degraded:
            known = all(rate == rate for rate in estimate.velocity)
            findings.append(_finding(Cause.DEGRADED, Level.WARN if known else Level.UNKNOWN, estimate.degraded))
        if self._reaction_level:
            findings += self._reactions(reaction, assessment.at.sines)
        return findings

    def _margins(self, now: Margins, floor: Margins, expected_s: float) -> list[Finding]:
        findings = []
        late = (
            f", the next sample being judged up to {expected_s * 1e3:.0f} ms later" if expected_s > self._beat_s else ""
        )
        for kind, value, least, warn, stop in zip(KINDS, now, floor, self._warn, self._stop, strict=True):
            if least >= warn:
                continue
            level, limit = (Level.WARN, warn) if least >= stop else (Level.STOP, stop)
            if value >= limit:
                falls = f"may fall to {least:.4f}" if least > 0.0 else "cannot be shown not to vanish"
                text = f"{WORDS[kind]} {value:.4f} {falls} before standstill{late}, limit {limit:.4f}"
                findings.append(Finding(kind | Cause.BRAKING, level, least, limit, "1", text))
            else:
                text = f"{WORDS[kind]} {value:.4f}, limit {limit:.4f}"
                findings.append(Finding(kind, level, value, limit, "1", text))
        return findings

    def _lingering(self, floor: Margins, held: int) -> list[Finding]:
        """A warning ends a little above the limit where it began."""
        findings = []
        for kind, least, release in zip(KINDS, floor, self._release, strict=True):
            if held & kind and not least >= release:
                text = f"{WORDS[kind]} {least:.4f}, warning until {release:.4f}"
                findings.append(Finding(kind, Level.WARN, least, release, "1", text))
        return findings

    def _speeding(self, velocity: Floats) -> list[Finding]:
        findings = []
        for name, rate, limit, unit in zip(self._names, velocity, self._speed, self._units, strict=True):
            if abs(rate) > limit:
                text = f"joint '{name}' moves at {rate:.4g} {unit}, limit {limit:.4g}"
                findings.append(Finding(Cause.SPEED, Level.WARN, abs(rate), limit, unit, text))
        return findings

    def _reactions(self, reaction: Floats, sines: Floats) -> list[Finding]:
        """Forces that are not observable, near Type 1, are the business of the Type 1 margin; others must be known."""
        findings = []
        level, limit = self._reaction_level, self._reaction_limit
        for leg, (force, sine) in enumerate(zip(reaction, sines, strict=True), 1):
            if abs(force) <= limit or abs(sine) < OBSERVABLE:
                continue
            said = f"carries {force:.1f} N" if force == force else "has no measured force"
            text = f"leg {leg} {said}, limit {limit:.1f} N"
            findings.append(Finding(Cause.REACTION, level, abs(force), limit, "N", text))
        return findings

    def _unsettled(self, steady_s: float) -> Finding:
        """Soon after a silence nobody knows how often samples come, so nobody knows how far the robot gets unseen."""
        need = f"{self._settling * 1e3:.0f} ms are needed to tell how often they come"
        text = f"after a silence samples have come for {steady_s * 1e3:.0f} ms, {need}"
        return Finding(Cause.STALE, Level.UNKNOWN, steady_s, self._settling, "s", text)

    def rare(self, estimate: Estimate, floor: Margins) -> Finding:
        """Samples have come so late that the robot could not be stopped in time, though it could if they came as they
        are sent: nothing is wrong with where it is. floor: the margins until standstill."""
        lack = [least - stop for least, stop in zip(floor, self._stop, strict=True)]
        k = lack.index(min(lack))
        late = f"samples come late, by now the next may be judged {estimate.expected_s * 1e3:.0f} ms after this one"
        text = f"{late}: {WORDS[KINDS[k]]} cannot be shown to stay above {self._stop[k]:.4f} before standstill"
        return Finding(Cause.STALE, Level.UNKNOWN, floor[k], self._stop[k], "1", text)

    @staticmethod
    def _branch(assessment: Assessment) -> list[Finding]:
        if not assessment.branch_fault:
            return []
        return [_finding(Cause.BRANCH, Level.UNKNOWN, assessment.branch_fault)]

    @staticmethod
    def _not_assembled(assessment: Assessment) -> Finding:
        gap = assessment.at.gaps[0]
        text = f"no pose belongs to the joints: assembly gap {gap * 1e3:.3f} mm"
        return Finding(Cause.NOT_ASSEMBLED, Level.UNKNOWN, gap, 0.0, "m", text)


def _finding(cause: Cause, level: Level, text: str) -> Finding:
    return Finding(cause, level, nan, nan, "", text)
