"""Compares numbers with limits; no other module compares with a threshold. Tests are written for accepted values, so
that NaN falls through to the severe answer."""

from __future__ import annotations

from math import nan

from irsbot_kinematics.mechanism import Coordinate
from irsbot_msgs_py.records import Cause, Finding, Floats, Level
from irsbot_supervisor.core.assessment import SOLVED, Assessment
from irsbot_supervisor.core.estimation.estimate import Estimate
from irsbot_supervisor.core.estimation.sample_interval import SETTLING
from irsbot_supervisor.core.margins import ANY_MARGIN, MARGIN_CAUSES, MARGIN_KINDS, MARGIN_TEXTS, Margins
from irsbot_supervisor.core.reaction import OBSERVABLE
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.stopping import limits_of, release_of


class Policy:
    """Applies the limits of one robot."""

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
        self, estimate: Estimate, assessment: Assessment, certified: Margins | None, reaction: Floats, held: int
    ) -> list[Finding]:
        """All findings about one good sample. certified: the margins until standstill, None if there is no posture.
        held: sum of the causes that were found just before."""
        if assessment.at.status != SOLVED or certified is None:
            return [self._not_assembled(assessment), *self._branch(assessment)]
        findings = self._branch(assessment) if assessment.branch_fault else []
        if not estimate.steady_s >= self._settling:  # its motion between samples is unknown, but its posture is known
            findings.append(self._unsettled(estimate.steady_s))
            certified = assessment.margins
        warn = self._warn
        if not (
            certified[0] >= warn[0] and certified[1] >= warn[1] and certified[2] >= warn[2] and certified[3] >= warn[3]
        ):
            findings += self._margins(assessment.margins, certified, estimate.expected_s)
        elif held & ANY_MARGIN:
            findings += self._lingering(certified, held)
        if not all(abs(rate) <= most for rate, most in zip(estimate.velocity, self._speed, strict=True)):
            findings += self._speeding(estimate.velocity)
        if estimate.degraded:
            known = all(rate == rate for rate in estimate.velocity)
            findings.append(_finding(Cause.DEGRADED, Level.WARN if known else Level.UNKNOWN, estimate.degraded))
        if self._reaction_level:
            findings += self._reactions(reaction, assessment.at.normalised_levers)
        return findings

    def _margins(self, now: Margins, certified: Margins, expected_s: float) -> list[Finding]:
        findings = []
        late = (
            f", the next sample being judged up to {expected_s * 1e3:.0f} ms later" if expected_s > self._beat_s else ""
        )
        for kind, value, least, warn, stop in zip(MARGIN_CAUSES, now, certified, self._warn, self._stop, strict=True):
            if least >= warn:
                continue
            level, limit = (Level.WARN, warn) if least >= stop else (Level.STOP, stop)
            if value >= limit:
                falls = f"may fall to {least:.4f}" if least > 0.0 else "cannot be shown not to vanish"
                text = f"{MARGIN_TEXTS[kind]} {value:.4f} {falls} before standstill{late}, limit {limit:.4f}"
                findings.append(Finding(kind | Cause.BRAKING, level, least, limit, "1", text))
            else:
                text = f"{MARGIN_TEXTS[kind]} {value:.4f}, limit {limit:.4f}"
                findings.append(Finding(kind, level, value, limit, "1", text))
        return findings

    def _lingering(self, certified: Margins, held: int) -> list[Finding]:
        """Findings while a warning lasts: it ends a little above the limit at which it began."""
        findings = []
        for kind, least, release in zip(MARGIN_CAUSES, certified, self._release, strict=True):
            if held & kind and not least >= release:
                text = f"{MARGIN_TEXTS[kind]} {least:.4f}, warning until {release:.4f}"
                findings.append(Finding(kind, Level.WARN, least, release, "1", text))
        return findings

    def _speeding(self, velocity: Floats) -> list[Finding]:
        findings = []
        for name, rate, limit, unit in zip(self._names, velocity, self._speed, self._units, strict=True):
            if abs(rate) > limit:
                text = f"joint '{name}' moves at {rate:.4g} {unit}, limit {limit:.4g}"
                findings.append(Finding(Cause.SPEED, Level.WARN, abs(rate), limit, unit, text))
        return findings

    def _reactions(self, reaction: Floats, normalised_levers: Floats) -> list[Finding]:
        """Findings about leg forces. Near Type 1 forces are not observable, and the Type 1 margin applies; elsewhere
        they must be known."""
        findings = []
        level, limit = self._reaction_level, self._reaction_limit
        for leg, (force, sine) in enumerate(zip(reaction, normalised_levers, strict=True), 1):
            if abs(force) <= limit or abs(sine) < OBSERVABLE:
                continue
            stated = f"carries {force:.1f} N" if force == force else "has no measured force"
            text = f"leg {leg} {stated}, limit {limit:.1f} N"
            findings.append(Finding(Cause.REACTION, level, abs(force), limit, "N", text))
        return findings

    def _unsettled(self, steady_s: float) -> Finding:
        """Finding soon after a silence: the sample interval, and so the motion between samples, is not known yet."""
        need = f"{self._settling * 1e3:.0f} ms are needed to learn their interval"
        text = f"after a silence samples have come for {steady_s * 1e3:.0f} ms, {need}"
        return Finding(Cause.STALE, Level.UNKNOWN, steady_s, self._settling, "s", text)

    def rare(self, estimate: Estimate, certified: Margins) -> Finding:
        """Finding for samples that have come so late that the robot could not be stopped in time, although it could if
        they came as they are sent. The posture itself is safe. certified: the margins until standstill."""
        lack = [least - stop for least, stop in zip(certified, self._stop, strict=True)]
        k = lack.index(min(lack))
        late = f"samples come late, by now the next may be judged {estimate.expected_s * 1e3:.0f} ms after this one"
        text = f"{late}: {MARGIN_KINDS[k].text} cannot be shown to stay above {self._stop[k]:.4f} before standstill"
        return Finding(Cause.STALE, Level.UNKNOWN, certified[k], self._stop[k], "1", text)

    @staticmethod
    def _branch(assessment: Assessment) -> list[Finding]:
        if not assessment.branch_fault:
            return []
        return [_finding(Cause.BRANCH, Level.UNKNOWN, assessment.branch_fault)]

    @staticmethod
    def _not_assembled(assessment: Assessment) -> Finding:
        gap = assessment.at.gaps[0]
        text = f"no pose belongs to the joints: assembly clearance {gap * 1e3:.3f} mm"
        return Finding(Cause.NOT_ASSEMBLED, Level.UNKNOWN, gap, 0.0, "m", text)


def _finding(cause: Cause, level: Level, text: str) -> Finding:
    return Finding(cause, level, nan, nan, "", text)
