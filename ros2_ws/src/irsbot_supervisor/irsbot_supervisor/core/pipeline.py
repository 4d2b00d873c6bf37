"""The supervisor: events in, states and verdicts out. Time is in the events; nothing here asks a clock.

A sample, a tick of a timer, a restart, an operator's reset or bypass and new settings enter by the same door, so that
all of it replays.
"""

from __future__ import annotations

from dataclasses import fields
from math import inf, nan, remainder, sqrt
from typing import NamedTuple

from irsbot_kinematics import Posture, Robot
from irsbot_kinematics.requests import solve_direct, tells_apart
from irsbot_kinematics.tolerances import SAME_POSE_TOL
from irsbot_msgs_py.records import (
    Bypass,
    Cause,
    Finding,
    Floats,
    JointSample,
    Level,
    Reset,
    Restart,
    SingularityState,
    Tick,
    Verdict,
)
from irsbot_supervisor.core.assess import SOLVED, Assessment, Assessor, Margins, slopes
from irsbot_supervisor.core.estimation.estimate import Estimate
from irsbot_supervisor.core.estimation.estimator import Estimator
from irsbot_supervisor.core.estimation.sample_interval import SETTLING
from irsbot_supervisor.core.gate import View
from irsbot_supervisor.core.intake import Intake, Rejected, S
from irsbot_supervisor.core.latch import Judgement, Latch
from irsbot_supervisor.core.policy import KINDS, Policy
from irsbot_supervisor.core.position_limits import PositionLimits
from irsbot_supervisor.core.report import Reporter
from irsbot_supervisor.core.settings import LEAST_LIMIT, InvalidSettings, Settings
from irsbot_supervisor.core.stop_monitor import MeasuredStop, StopMonitor
from irsbot_supervisor.core.stopping import PATIENT_CUTS, BoxBounds, StoppingPredictor, limits_of, spare_of

APART = ((-inf, LEAST_LIMIT, -inf, -inf), PATIENT_CUTS)
"""What has to be proved of a silence: that no Type 2 singularity was met, and how much may be done for it once."""


class Configure(NamedTuple):
    """Settings come into force. They are checked where they enter (`settings_from`), and not again."""

    received_ns: int
    seen_ns: int
    settings: Settings


Event = JointSample | Tick | Restart | Reset | Bypass | Configure

RESTARTED = "the supervisor was started again, and nobody watched the robot meanwhile: it waits for a reset"
"""Why nobody knows the branch after a restart."""

FOREVER = 2**63
"""ns: later than any clock."""

JUST_NOW = 0.1
"""1: share of the heartbeat. A verdict younger than this need not be repeated at a tick; so silence is at most 1.1
heartbeats long."""


class Step(NamedTuple):
    """What an event leads to: each part None where there is nothing to publish."""

    state: SingularityState | None
    verdict: Verdict | None  # due now: a transition, or the heartbeat
    refusal: str = ""  # why a reset or a bypass was refused
    turns: tuple[Judgement, ...] = ()  # every judgement that came into force, in order


class Supervisor:
    """One robot under supervision. `step` is the only way in."""

    def __init__(self, settings: Settings, robot: Robot) -> None:
        self.robot = robot
        robot.mechanism.prepare()
        self._latch = Latch(settings)
        self._estimator = Estimator(settings, robot.mechanism.joints)
        self._assessor = Assessor(settings, robot.mechanism)
        self._intake = Intake(settings, robot.mechanism.joints)
        self._stops = StopMonitor(settings, robot.mechanism.joints)
        self._set(settings)
        self._samples = 0
        self._verdicts = 0
        self._spoken_ns = 0
        self._good: Estimate | None = None
        self._begun_ns = self._known_ns = 0  # first good sample, and since when it is known how often samples come
        self._at: Posture | None = None  # where the last good sample was
        self._stale = False
        self._found: list[Finding] = []
        self._found_until_ns = FOREVER  # what a rejected sample showed is no news once nothing comes any more
        self._silence: list[Finding] = []
        self.rejections: dict[Cause, int] = {}
        """Rejected samples by reason."""
        self.seen_too_rarely = 0
        """How often a robot was not allowed to move any more for nothing but late samples."""

    def step(self, event: Event) -> Step:
        """What an event means. Never raises for values; InvalidSettings for a change of what is read only."""
        latch = self._latch
        latch.turns = []
        state, refusal = None, ""
        changed = self._pass_time(event.seen_ns)
        if isinstance(event, JointSample):
            state = self._sample(event)
        elif isinstance(event, Configure):
            self._configure(event)
            self._pass_time(event.seen_ns)  # what silence is has changed, too
            changed = True
        elif isinstance(event, Restart):
            self._restart(event)
        elif isinstance(event, Reset):
            refusal = self._reset(event)
        elif isinstance(event, Bypass):
            refusal = self._bypass(event)
        verdict = self._speak(event, changed or bool(latch.turns))
        return Step(state, verdict, refusal, tuple(latch.turns))

    def _set(self, settings: Settings) -> None:
        mechanism = self.robot.mechanism
        self.settings = settings
        self._predictor = StoppingPredictor(settings, mechanism)
        self._bounds = BoxBounds(mechanism, settings.slack_m)
        self._stop = limits_of(settings, "stop")
        self._policy = Policy(settings, mechanism.joints)
        self._position = PositionLimits(settings, mechanism.joints)
        self._reporter = Reporter(settings, mechanism, self.robot.name)
        self._stale_ns = round(settings.stale_s * S)
        self._heartbeat_ns = round(settings.heartbeat_s * S)
        self._hash = settings.config_hash

    def _configure(self, change: Configure) -> None:
        """New settings, whole and checked. What is known of the robot, and a latched stop, stay as they are.

        Raises InvalidSettings for a change of what is read only.
        """
        settings = change.settings
        for entry in fields(Settings):
            now, then = getattr(self.settings, entry.name), getattr(settings, entry.name)
            if entry.metadata.get("read_only") and now != then:
                raise InvalidSettings(f"{entry.name} is {now!r} and cannot become {then!r} while supervising")
        self._set(settings)
        for stage in (self._intake, self._estimator, self._assessor, self._latch, self._stops):
            stage.configure(settings)
        if self._good is not None:
            self._learn(change.seen_ns)

    @property
    def standing(self) -> bool:
        """Whether the last good sample is fresh and no joint has moved for `stale_s`."""
        good = self._good
        return good is not None and not self._stale and good.standing_s >= self.settings.stale_s

    @property
    def measured_stop(self) -> MeasuredStop | None:
        """The last stop that came to rest."""
        return self._stops.last

    @property
    def view(self) -> View | None:
        """What the command gate needs to know; None while the robot's state is not known."""
        good = self._good
        if good is None or self._at is None or self._latch.now.level == Level.UNKNOWN:
            return None
        return View(self._at, good.velocity, good.speeds, good.ahead_s, good.expected_s, self._latch.now, good.seen_ns)

    def fail(self, seen_ns: int, error: Exception) -> Step:
        """What an error inside means, of `step` too: UNKNOWN, whatever the samples said, until one is judged without
        error."""
        text = f"{type(error).__name__}: {error}"
        self._found_until_ns = FOREVER
        self._found = [Finding(Cause.INTERNAL, Level.UNKNOWN, nan, nan, "", text)]
        self._hold(seen_ns)
        return Step(None, self._verdict(seen_ns), "", tuple(self._latch.turns))

    def _pass_time(self, seen_ns: int) -> bool:
        """Silence since the last good sample, noticed now but dated to when it began to count. What the last sample
        showed holds until another shows otherwise."""
        good, latch = self._good, self._latch
        end_ns = latch.bypassed_until_ns
        if end_ns is not None and end_ns <= seen_ns and good is not None and end_ns <= good.seen_ns + self._stale_ns:
            latch.update(self._found, end_ns)  # or silence has ended it before
        latch.keep(self._found, min(seen_ns, self._found_until_ns))
        if seen_ns > self._found_until_ns:
            self._found, self._found_until_ns = [], FOREVER
        if good is None:
            text = "no usable sample has arrived"
            self._silence = [Finding(Cause.NO_DATA, Level.UNKNOWN, nan, nan, "", text)]
        else:
            limit_ns = good.seen_ns + self._stale_ns
            if seen_ns <= limit_ns:
                return False
            limit = self.settings.stale_s
            text = f"no usable sample for more than {limit * 1e3:.0f} ms"
            self._silence = [Finding(Cause.STALE, Level.UNKNOWN, (seen_ns - good.seen_ns) / S, limit, "s", text)]
            if not self._stale:
                self._stale = True
                latch.update([*self._found, *self._silence], limit_ns)
        latch.keep([*self._found, *self._silence], seen_ns)
        return self._hold(seen_ns)

    def _learn(self, now_ns: int) -> None:
        """After the first good sample what it says counts, but OK has to wait until it is known how often samples come:
        as long as new settings ask for, but never shorter than the old ones."""
        learning_s = SETTLING * self.settings.stale_s
        end_ns = self._begun_ns + round(learning_s * S)
        if end_ns > max(now_ns, self._known_ns):
            self._known_ns = end_ns
            text = f"samples have only begun to come, {learning_s * 1e3:.0f} ms are needed to tell how often"
            self._latch.keep([Finding(Cause.NO_DATA, Level.UNKNOWN, nan, nan, "", text)], end_ns)

    def _hold(self, seen_ns: int) -> bool:
        """What holds now: what the last sample showed, and the silence since the last good one."""
        return self._latch.update([*self._found, *self._silence], seen_ns)

    def _sample(self, sample: JointSample) -> SingularityState:
        self._samples += 1
        accepted = self._intake.check(sample)
        if isinstance(accepted, Rejected):
            return self._rejected(sample, accepted)
        estimate = self._estimator.update(accepted, self._latch.now.level >= Level.STOP)
        if isinstance(estimate, Rejected):
            return self._rejected(sample, estimate)
        assessment = self._assess(estimate)
        at = assessment.at
        self._found_until_ns = FOREVER
        if at.status != SOLVED:
            self._found = self._policy.judge(estimate, assessment, None, (), 0)
            self._hold(sample.seen_ns)
            return self._reporter.unsolved(estimate, self._samples, _causes(self._found))
        first = self._good is None
        if first:
            self._begun_ns = sample.seen_ns
            self._learn(sample.seen_ns)
        self._good, self._at, self._stale, self._silence = estimate, at, False, []
        if self._latch.now.bypassed and not self._is_slow(estimate.velocity):
            self._latch.end_bypass()  # it was given for slow motion
        predict = self._predictor.once if self._latch.latched else self._predictor.predict
        floor = predict(at, estimate.speeds, estimate.ahead_s)
        reaction = self._reporter.reaction(estimate, assessment)
        # Of a first sample nobody knows how fast the joints are; the level is UNKNOWN for a while anyway.
        counts = assessment.margins if first else self._counts(at, estimate, floor)
        found = self._policy.judge(estimate, assessment, counts, reaction, self._latch.now.causes)
        late = counts is not floor and not first
        if late:
            found.append(self._policy.rare(estimate, floor))
        found = self._found = [*found, *self._position.judge(estimate, first), *self._stops.look(estimate)]
        escape: Floats = ()
        if found and not self._latch.latched and any(finding.level == Level.STOP for finding in found):
            escape = self._escape(assessment, found)
        moved_freely = self._latch.now.level < Level.STOP
        self._latch.update(found, sample.seen_ns, escape)
        if moved_freely and self._latch.now.level >= Level.STOP:
            self._stops.begin(estimate)
            self.seen_too_rarely += late
        level = max([finding.level for finding in found]) if found else Level.OK
        return self._reporter.solved(estimate, assessment, floor, reaction, self._samples, level, _causes(found))

    def _counts(self, at: Posture, estimate: Estimate, floor: Margins) -> Margins:
        """What counts of the margins until standstill: where they stop the robot only because samples have come late,
        what they would be in time."""
        ahead_s, stop = estimate.in_time_s, self._stop
        if ahead_s is None or self._latch.latched or spare_of(floor, stop) >= 0.0:
            return floor
        better = self._predictor.predict(at, self._estimator.in_time(estimate, ahead_s), ahead_s, stop)
        return better if spare_of(better, stop) >= 0.0 else floor

    def _rejected(self, sample: JointSample, why: Rejected) -> SingularityState:
        self.rejections[why.cause] = self.rejections.get(why.cause, 0) + 1
        if not why.harmless:
            self._found_until_ns = sample.seen_ns + self._stale_ns
            self._found = [Finding(why.cause, Level.UNKNOWN, nan, nan, "", why.text)]
            self._hold(sample.seen_ns)
        return self._reporter.rejected(sample, self._samples, why.cause)

    def _restart(self, restart: Restart) -> None:
        """A stop of the supervisor that ended may have been in force, and the branch may have changed since."""
        self._assessor.lose(RESTARTED)
        self._latch.count_on(restart.event)
        self._found = [Finding(Cause.BRANCH, Level.UNKNOWN, nan, nan, "", RESTARTED)]
        self._hold(restart.seen_ns)

    def _reset(self, reset: Reset) -> str:
        good = self._good
        if good is None or self._stale:
            return "no good sample to judge by"
        if unknown := [f for f in self._found if f.level == Level.UNKNOWN and not f.cause & Cause.BRANCH]:
            return f"the state of the robot is not known: {unknown[0].text}"
        if refusal := self._latch.refused(reset.event, self.standing):
            return refusal  # at once: whoever asks in vain, and often, must not take the time that samples need
        seen: Posture | None = None
        if reset.seed_pose:
            seen, doubt = self._seen(good.position, reset.seed_pose)
            if doubt:
                return doubt
        # The operator has looked: what only a look can tell is told. What can be seen, as a wrong mode, is seen again.
        assessment = self._assessor.confirmed(good.position, seen)
        at = assessment.at
        floor = self._predictor.predict(at, good.speeds, good.ahead_s) if at.status == SOLVED else None
        active = self._policy.judge(good, assessment, floor, self._reporter.reaction(good, assessment), 0)
        active += self._position.judge(good)
        stopped = any(finding.level == Level.STOP for finding in active)
        escape = self._escape(assessment, active) if stopped else ()
        lost = self._latch.lost
        refusal = self._latch.reset(reset.event, reset.seen_ns, self.standing, active, escape)
        if not refusal or lost > self._latch.lost:
            self._assessor.confirm(seen)
            self._found, self._at = active, assessment.at
        return refusal

    def _bypass(self, wish: Bypass) -> str:
        if self._good is None or self._stale:
            return "no good sample to judge by"
        return self._latch.bypass(wish, self.standing, self._found)

    def _seen(self, joints: Floats, seed_pose: Floats) -> tuple[Posture | None, str]:
        """The posture in which an operator sees the platform, where that tells more than the settings, and why it
        cannot be; empty if it can. Where labels hold it must be of the configured assembly mode; where they do not, of
        the branch that is followed, as long as that is known."""
        mechanism = self.robot.mechanism
        answer = solve_direct(self.robot, joints, 0, seed_pose)
        if answer.message or answer.status[0] != SOLVED:
            return None, answer.message or "the joints determine no pose to compare the seed pose with"
        if not tells_apart(self.robot, joints, seed_pose):
            return None, "the seed pose is too far from every pose of these joints to tell which one it means"
        label, configured = answer.assembly_mode[0], self.settings.assembly_mode
        if mechanism.labels_hold:
            if label == configured:
                return None, ""
            return None, f"the seed pose is nearest to assembly mode {label:+d}, the settings say {configured:+d}"
        if self._assessor.lost:
            return mechanism.posture(joints, label), ""
        here = self._assessor.confirmed(joints).at.pose
        turns = [axis.turn for axis in mechanism.task]
        away = [abs(remainder(a - b, turn)) for a, b, turn in zip(here, answer.poses, turns, strict=True)]
        return None, "" if all(way <= SAME_POSE_TOL for way in away) else "the seed pose is nearest to another branch"

    def _assess(self, estimate: Estimate) -> Assessment:
        """The posture. After a silence the branch is known if no Type 2 singularity can have been met meanwhile."""
        silence, lost, at = estimate.silence, estimate.branch_lost, self._at
        proved = silence is not None and not lost and at is not None
        if proved and silence is not None and at is not None:
            floor = self._bounds.least(at, silence.low, silence.high, (APART,))
            if not floor[1] >= APART[0][1]:
                proved, lost = False, "the robot may have met a Type 2 singularity while no samples came"
        return self._assessor.assess(estimate.position, lost, proved=proved)

    def _escape(self, assessment: Assessment, found: list[Finding]) -> Floats:
        """Unit vector in joint space along which the margin that caused the stop grows most."""
        cause = next(finding.cause for finding in found if finding.level == Level.STOP)
        kind = next((i for i, bit in enumerate(KINDS) if cause & bit), -1)
        if kind < 0:
            return ()
        slope = slopes(self.robot.mechanism, assessment.at, kind)
        size = sqrt(sum([s * s for s in slope]))
        return tuple([s / size for s in slope]) if 0.0 < size < inf else ()

    def _speak(self, event: Event, changed: bool) -> Verdict | None:
        """Every tick is a heartbeat, also one that comes a little early: the next is as far away as usual."""
        rest_ns = round(JUST_NOW * self._heartbeat_ns) if isinstance(event, Tick) else self._heartbeat_ns
        return self._verdict(event.seen_ns) if changed or event.seen_ns - self._spoken_ns >= rest_ns else None

    def _verdict(self, seen_ns: int) -> Verdict:
        self._verdicts += 1
        self._spoken_ns = seen_ns
        now, end_ns = self._latch.now, self._latch.bypassed_until_ns
        return Verdict(
            self._good.stamp_ns if self._good else 0,
            now.level,
            now.causes,
            now.latched,
            now.event,
            now.escape,
            _text(now.findings),
            self._verdicts,
            self._hash,
            now.since_ns,
            self._recovery_scale() if now.level == Level.STOP else now.speed_scale,
            now.findings,
            Cause(now.bypassed),
            max(end_ns - seen_ns, 0) / S if end_ns is not None else 0.0,
        )

    def _recovery_scale(self) -> float:
        """After a STOP: 0 until the robot has become slow, then what the command gate may use to move it away."""
        good = self._good
        if good is None or self._stale:
            return 0.0
        return self.settings.recovery_share if self._is_slow(good.velocity) else 0.0

    def _is_slow(self, velocity: Floats) -> bool:
        """Whether no joint is faster than it may be while it is moved away from a stop, or beyond one."""
        share, slow = self.settings.recovery_share, self.settings.standstill_speed
        pairs = zip(velocity, self.settings.velocity_limit, strict=True)
        return all(abs(rate) <= share * most + slow for rate, most in pairs)


def _causes(findings: list[Finding]) -> int:
    causes = 0
    for finding in findings:
        causes |= int(finding.cause)
    return causes


def _text(findings: tuple[Finding, ...]) -> str:
    """The worst finding first, all of them named."""
    ordered = sorted(findings, key=lambda finding: -finding.level)
    return "; ".join(finding.text for finding in ordered)
