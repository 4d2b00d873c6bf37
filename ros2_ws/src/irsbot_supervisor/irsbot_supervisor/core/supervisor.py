"""The supervisor: events in, states and verdicts out. Time is in the events; this module reads no clock.

A sample, a timer tick, a restart, an operator's reset or bypass and new settings all enter by `step`, so that a replay
computes the same.
"""

from __future__ import annotations

from math import inf, nan

from irsbot_kinematics import Posture, Robot
from irsbot_msgs_py.records import (
    Bypass,
    Cause,
    Finding,
    Floats,
    JointSample,
    LateBrakes,
    Level,
    Reset,
    Restart,
    SingularityState,
    Verdict,
)
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.core.assessment import SOLVED, Assessment, Assessor
from irsbot_supervisor.core.box_search import spare_of
from irsbot_supervisor.core.branch_proof import BranchProof
from irsbot_supervisor.core.escape import NO_ESCAPE, Escape, escape_of
from irsbot_supervisor.core.estimation.estimate import Estimate
from irsbot_supervisor.core.estimation.estimator import Estimator
from irsbot_supervisor.core.estimation.sample_interval import SETTLING
from irsbot_supervisor.core.estimation.silence import Known
from irsbot_supervisor.core.events import Configure, Event, Step
from irsbot_supervisor.core.latch import Latch
from irsbot_supervisor.core.margins import Margins, margins_of
from irsbot_supervisor.core.memory import EstimatorMemory, Memory
from irsbot_supervisor.core.pace import Pace
from irsbot_supervisor.core.policy import Policy
from irsbot_supervisor.core.position_limits import PositionLimits
from irsbot_supervisor.core.reachable_box import ReachableBox
from irsbot_supervisor.core.reaction import leg_forces
from irsbot_supervisor.core.report import Moment, Reporter, governing
from irsbot_supervisor.core.seed_pose import seen_posture
from irsbot_supervisor.core.settings import LEAST_LIMIT, Settings, refuse_other_robot
from irsbot_supervisor.core.speaker import Speaker
from irsbot_supervisor.core.stop_monitor import MeasuredStop, StopMonitor
from irsbot_supervisor.core.stopping import StoppingPredictor, cuts_in, limits_of
from irsbot_supervisor.core.validation import Intake, IntakeMemory, Rejected
from irsbot_supervisor.core.view import View

RESTARTED = "the supervisor was started again, and the robot was not supervised in between: reset it"
"""Reason why the branch is unknown after a restart."""

OK = Level.OK
STOP = Level.STOP
"""Local copies, as in `assessment`."""

FOREVER = 2**63
"""ns: later than every time."""


class Supervisor:
    """One robot under supervision. `step` is the only entry."""

    def __init__(self, settings: Settings, robot: Robot) -> None:
        self.robot = robot
        robot.mechanism.prepare()
        self._latch = Latch(settings)
        self._estimator = Estimator(settings, robot.mechanism.joints)
        self._assessor = Assessor(settings, robot.mechanism)
        self._intake = Intake(settings, robot.mechanism.joints)
        self._stops = StopMonitor(settings, robot.mechanism.joints)
        self._speaker, self._pace = Speaker(settings), Pace(settings, robot.mechanism.joints)
        self._set(settings)
        self._samples = 0
        self._good: Estimate | None = None
        self._covered = False  # True if no Type 2 singularity is in the reachable box of the last good sample
        self._begun_ns = self._known_ns = 0  # first good sample, and since when it is known how often samples come
        self._at: Posture | None = None  # where the last good sample was
        self._last: Moment | None = None  # the margins there
        self._judged: tuple[Margins, Margins] | None = None  # margins of the last sample, now and until standstill
        self._event: int | None = None  # number of the latched stop at the last good sample
        self._stands_ns: int | None = None  # from then on a stopped robot stands; None while nothing stops it
        self._loose_ns = 0  # until then a stopped robot may move as its drives can
        self._stale = False
        self._found: list[Finding] = []
        self._found_until_ns = FOREVER  # end of the findings of a rejected sample
        self._silence: list[Finding] = []
        self.rejections: dict[Cause, int] = {}
        """Number of rejected samples by reason."""
        self.seen_too_rarely = 0
        """Number of stops for which late samples were the only reason."""

    def step(self, event: Event, report: bool = True) -> Step:
        """Process an event. Never raises for values; raises InvalidSettings for a change of a read-only setting.
        report: True if the state of a sample is needed; it takes a fifth of the time, and changes no verdict."""
        state, found, refusal = None, None, ""
        changed = self._pass_time(event.seen_ns)
        if isinstance(event, JointSample):
            found, state = self._sample(event, report)
        elif isinstance(event, Configure):
            self._configure(event)
            self._pass_time(event.seen_ns)  # the silence limit may have changed too
            changed = True
        elif isinstance(event, LateBrakes):
            if self._good is not None:
                self._estimator.silences.free_until(self._good.seen_ns, event.brakes_ns)
        elif isinstance(event, Restart):
            self._restart(event)
        elif isinstance(event, Reset):
            refusal = self._reset(event)
        elif isinstance(event, Bypass):
            refusal = self._bypass(event)
        transitions = self._latch.take_transitions()
        due = self._speaker.is_due(event, changed or bool(transitions))
        verdict = self._verdict(event.seen_ns) if due else None
        return Step(state, verdict, refusal, transitions, found)

    def _set(self, settings: Settings) -> None:
        mechanism = self.robot.mechanism
        self.settings = settings
        self._predictor = StoppingPredictor(settings, mechanism)
        self._proof = BranchProof(settings, mechanism)
        self._cuts = self._proof.cuts
        self._stop = limits_of(settings, "stop")
        self._policy = Policy(settings, mechanism.joints)
        self._position = PositionLimits(settings, mechanism.joints)
        self._reporter = Reporter(settings, mechanism, self.robot.name)
        self._stale_ns = round(settings.stale_s * NS_PER_S)
        self._box = ReachableBox(settings)
        self._noticed_ns = round((settings.stale_s + settings.heartbeat_s) * NS_PER_S)

    def _configure(self, change: Configure) -> None:
        """Take in new settings, complete and checked. Knowledge of the robot and a latched stop are kept.

        Raises InvalidSettings for a change of a read-only setting.
        """
        settings = change.settings
        refuse_other_robot(self.settings, settings)
        good, cuts = self._good, self._proof.cuts
        if good is not None:
            self._estimator.silences.keep(good.seen_ns)
        self._set(settings)
        if good is not None:  # the last box covers the time that it has for the next sample, no longer one
            self._allow(min(self._cuts, cuts, cuts_in(good.judging_s, settings.bounding_s)))
        for stage in (
            self._intake,
            self._estimator,
            self._assessor,
            self._latch,
            self._stops,
            self._pace,
            self._speaker,
        ):
            stage.configure(settings)
        if self._good is not None:
            self._learn(change.seen_ns)

    def _allow(self, cuts: int) -> None:
        """Set the number of cuts for the next sample."""
        if cuts != self._proof.cuts:
            self._proof.cuts = cuts
            self._predictor.allow(cuts)

    @property
    def standing(self) -> bool:
        """True if the last good sample is fresh and no joint has moved for `stale_s`."""
        good = self._good
        return good is not None and not self._stale and good.standing_s >= self.settings.stale_s

    @property
    def judging_s(self) -> float:
        """Longest time to judge the next sample that the last certified box allows, s; infinite while the state is
        UNKNOWN: then no motion is allowed."""
        good = self._good
        return good.judging_s if good is not None and self._latch.now.level < Level.UNKNOWN else inf

    def is_late(self, brakes_ns: int) -> bool:
        """True if drives that brake from this time on (steady clock) brake later after the last good sample than it is
        supposed of a silence: `LateBrakes` has to say so."""
        return self._good is not None and brakes_ns - self._good.seen_ns > self._noticed_ns

    @property
    def measured_stop(self) -> MeasuredStop | None:
        """The last stop that came to rest."""
        return self._stops.last

    @property
    def margins(self) -> Floats:
        """Margins of the last sample as its state has them, without the making of it: smallest Type 1, Type 2,
        constraint, smallest limb, and the governing one until standstill. Infinite if the robot does not have it. Empty
        if the sample determines no pose."""
        if self._judged is None:
            return ()
        margins, certified = self._judged
        return (*margins, certified[governing(certified, self._stop)[1]])

    @property
    def view(self) -> View | None:
        """The robot's state for the command gate; None while it is not known."""
        good = self._good
        if good is None or self._at is None or self._latch.now.level == Level.UNKNOWN:
            return None
        return View(
            at=self._at,
            velocity=good.velocity,
            speeds=good.speeds,
            prediction_delay_s=good.prediction_delay_s,
            expected_s=good.expected_s,
            standing=self.standing,
            judgement=self._latch.now,
            seen_ns=good.seen_ns,
        )

    @property
    def escape(self) -> Escape:
        """The way out of the stop in force, from where the robot is; none while its state is not known, nor where
        nothing stops it any more and a reset is due."""
        now, good, at = self._latch.now, self._good, self._at
        if now.level != Level.STOP or good is None or at is None:
            return NO_ESCAPE
        return escape_of(self.robot.mechanism, at, self._latch.held, self._position.into_range(good))

    @property
    def quiet(self) -> bool:
        """True if nothing is in force or under suspicion, so that a sample without findings changes no verdict."""
        good = self._good
        return (
            self._latch.clear
            and good is not None
            and not (self._stale or self._found or self._silence)
            and self._found_until_ns == FOREVER
            and not (self._stops.measuring or self._pace.watching)
            and self._assessor.steady
            and self._estimator.quiet
            and good is self._estimator.last
            and self._proof.cuts == self._cuts
        )

    @property
    def memory(self) -> Memory:
        """What is remembered of the last samples, as long as the supervisor is `quiet`."""
        return Memory(
            self._intake.memory,
            self._estimator.memory,
            self._predictor,
            self._at,
            self._assessor.contact_m,
            self._samples,
        )

    def remember(self, intake: IntakeMemory, estimator: EstimatorMemory, samples: int) -> None:
        """Go on as if so many more samples had been judged without findings, the last of which left these memories. The
        supervisor is `quiet`."""
        last = estimator.last
        assert last is not None
        self._intake.remember(intake)
        self._estimator.remember(estimator)
        self._good, self._at, self._covered = last, self._assessor.passed(last.position), True
        self._last = Moment(last.stamp_ns, margins_of(self._at))
        self._samples += samples

    def fail(self, seen_ns: int, error: Exception) -> Step:
        """Result of an internal error, also of `step`: UNKNOWN, until a sample is judged without error."""
        text = f"{type(error).__name__}: {error}"
        self._found_until_ns = FOREVER
        self._found = [Finding(Cause.INTERNAL, Level.UNKNOWN, nan, nan, "", text)]
        self._hold(seen_ns)
        return Step(None, self._verdict(seen_ns), transitions=self._latch.take_transitions())

    def _verdict(self, seen_ns: int) -> Verdict:
        good = self._good
        slow = good is not None and not self._stale and self._pace.is_slow(good)
        return self._speaker.verdict(self._latch, good, slow, self.escape, seen_ns)

    def _pass_time(self, seen_ns: int) -> bool:
        """Take in a silence since the last good sample; it is dated to the moment at which it began to count. The
        findings of the last sample hold until another sample changes them."""
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
            self._silence = [Finding(Cause.STALE, Level.UNKNOWN, (seen_ns - good.seen_ns) / NS_PER_S, limit, "s", text)]
            if not self._stale:
                self._stale = True
                latch.update([*self._found, *self._silence], limit_ns)
        latch.keep([*self._found, *self._silence], seen_ns)
        return self._hold(seen_ns)

    def _learn(self, now_ns: int) -> None:
        """After the first good sample its findings count, but OK is given only when the sample interval is known: after
        the time that the settings require, never shorter than with earlier settings."""
        learning_s = SETTLING * self.settings.stale_s
        end_ns = self._begun_ns + round(learning_s * NS_PER_S)
        if end_ns > max(now_ns, self._known_ns):
            self._known_ns = end_ns
            text = f"samples have only begun to come, {learning_s * 1e3:.0f} ms are needed to learn their interval"
            self._latch.keep([Finding(Cause.NO_DATA, Level.UNKNOWN, nan, nan, "", text)], end_ns)

    def _hold(self, seen_ns: int) -> bool:
        """Update the latch with the findings of the last sample and the silence since the last good one."""
        return self._latch.update([*self._found, *self._silence], seen_ns)

    def _sample(self, sample: JointSample, report: bool) -> tuple[tuple[Level, int], SingularityState | None]:
        self._samples += 1
        self._judged = None
        accepted = self._intake.check(sample)
        if isinstance(accepted, Rejected):
            return self._rejected(sample, accepted, report)
        estimate = self._estimator.update(accepted, self._was_held(), followed=self._good, known=self._known())
        if isinstance(estimate, Rejected):
            return self._rejected(sample, estimate, report)
        assessment = self._assess(estimate)
        at = assessment.at
        self._found_until_ns = FOREVER
        if at.status != SOLVED:
            self._found = self._policy.judge(estimate, assessment, None, (), 0)
            self._hold(sample.seen_ns)
            causes = _causes(self._found)
            told = self._reporter.unsolved(estimate, self._samples, causes) if report else None
            return (Level.UNKNOWN, causes), told
        first, good = self._good is None, self._good
        if first:
            self._begun_ns = sample.seen_ns
            self._learn(sample.seen_ns)
        self._good, self._at, self._stale, self._silence, self._covered = estimate, at, False, [], False
        self._watch_pace(estimate)
        # At the first sample the speeds are unknown, and a box of all speeds would take milliseconds to no effect.
        certified = self._predictor.predict(at, estimate.speeds, estimate.prediction_delay_s, search=not first)
        self._covered = certified[1] >= LEAST_LIMIT
        reaction = leg_forces(estimate.effort, at)
        # While the interval is learned the level is UNKNOWN anyway: until then the posture alone stops a robot at rest.
        waits = first or (sample.seen_ns < self._known_ns and estimate.standing_s > 0.0)
        better = None if waits else self._in_time(at, estimate, certified)
        counts = assessment.margins if waits else better or certified
        found = self._policy.judge(estimate, assessment, counts, reaction, self._latch.now.causes)
        late = better is not None
        if late:
            found.append(self._policy.rare(estimate, certified))
        found = self._found = [*found, *self._position.judge(estimate, waits), *self._stops.look(estimate)]
        moved_freely = self._latch.now.level < STOP
        self._latch.update(found, sample.seen_ns)
        if moved_freely and self._latch.now.level >= STOP:
            self._stops.begin(estimate)
            self.seen_too_rarely += late
        self._watch_stop(estimate, good)
        level = max([finding.level for finding in found]) if found else OK
        causes = _causes(found) if found else 0
        self._allow(self._cuts)
        self._judged = assessment.margins, certified
        before, self._last = self._last, Moment(estimate.stamp_ns, assessment.margins)
        if not report:
            return (level, causes), None
        told = self._reporter.solved(estimate, assessment, certified, reaction, self._samples, level, causes, before)
        return (level, causes), told

    def _watch_pace(self, estimate: Estimate) -> None:
        """Watch a robot that a stop or a bypass makes slow; a bypass ends if it is faster."""
        now, pace = self._latch.now, self._pace
        if now.level >= STOP or now.bypassed:
            pace.look(estimate)
            if now.bypassed and not pace.is_slow(estimate):
                self._latch.end_bypass()
        elif pace.watching:
            pace.restart()

    def _watch_stop(self, estimate: Estimate, before: Estimate | None) -> None:
        """Take in whether the robot is stopped. Once its brakes have acted it stands, or moves at recovery speed. Until
        then it is in the box of the sample before, if the next one came in time."""
        now = self._latch.now
        self._event = now.event if self._latch.latched else None
        if now.level < STOP and not now.bypassed:
            self._stands_ns = None
        elif self._stands_ns is None:
            self._stands_ns = self._rest_ns(estimate)
            if before is not None and before.expected_s:  # else no motion was allowed
                due_ns = before.seen_ns + round((before.expected_s - before.judging_s) * NS_PER_S)
                if estimate.seen_ns > due_ns or estimate.degraded:
                    self._loose_ns = self._stands_ns
        if estimate.silence is not None and estimate.silence.fast:
            self._loose_ns = self._rest_ns(estimate)

    def _rest_ns(self, estimate: Estimate) -> int:
        """When the joints stand at the latest if the verdict on this estimate is a stop."""
        free_s = estimate.judging_s + self.settings.latency_s
        return estimate.seen_ns + round(self._box.stop_s(estimate.speeds, free_s) * NS_PER_S)

    def _was_held(self) -> bool:
        """True if the stop that is latched now held the robot at the last good sample: it stood, or moved at recovery
        speed. Silence alone holds nobody: it is noticed when the robot may have moved."""
        good, stands_ns, latch = self._good, self._stands_ns, self._latch
        if good is None or stands_ns is None or not latch.latched or self._event != latch.now.event:
            return False
        return good.seen_ns >= max(stands_ns, self._loose_ns)

    def _known(self) -> Known:
        """What is known of the motion since the last good sample."""
        if self._covered:
            return Known.COVERED
        return Known.SPEEDS if self._good is not None and self._good.seen_ns < self._loose_ns else Known.STOPPED

    def _in_time(self, at: Posture, estimate: Estimate, certified: Margins) -> Margins | None:
        """The margins until standstill if samples came in time, if late samples are the only reason for a stop; else
        None."""
        prediction_delay_s, stop = estimate.in_time_s, self._stop
        if prediction_delay_s is None or self._latch.latched or spare_of(certified, stop) >= 0.0:
            return None
        speeds, has_time = self._estimator.in_time(estimate, prediction_delay_s), self.settings.bounding_s == 0.0
        better = self._predictor.predict(at, speeds, prediction_delay_s, stop, search=has_time)
        return better if spare_of(better, stop) >= 0.0 else None

    def _rejected(
        self, sample: JointSample, why: Rejected, report: bool
    ) -> tuple[tuple[Level, int], SingularityState | None]:
        self.rejections[why.cause] = self.rejections.get(why.cause, 0) + 1
        overdue = self._overdue(sample.seen_ns) if why.harmless else ""
        if overdue or not why.harmless:
            self._found_until_ns = sample.seen_ns + self._stale_ns
            self._found = [Finding(why.cause, Level.UNKNOWN, nan, nan, "", why.text + overdue)]
            self._hold(sample.seen_ns)
        told = self._reporter.rejected(sample, self._samples, why.cause) if report else None
        return (Level.UNKNOWN, why.cause), told

    def _overdue(self, seen_ns: int) -> str:
        """Why a sample that is not newer than the last good one is not harmless: a newer one should have been judged by
        now. Empty if it is harmless."""
        good = self._good
        if good is None or not good.expected_s or seen_ns - good.seen_ns <= round(good.expected_s * NS_PER_S):
            return ""
        since_ms, due_ms = (seen_ns - good.seen_ns) / NS_PER_S * 1e3, good.expected_s * 1e3
        return f"; no newer one has come for {since_ms:.1f} ms, one is expected within {due_ms:.1f} ms"

    def _restart(self, restart: Restart) -> None:
        """Take in a restart: a stop of the previous supervisor may have been in force, and the branch may have changed
        since."""
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
            return refusal
        if not self._assessor.lost and any(finding.level == STOP for finding in self._found):
            # At once: frequent refused requests must not take the time that samples need.
            return self._latch.reset(reset.event, reset.seen_ns, self.standing, self._found)
        seen: Posture | None = None
        if reset.seed_pose:
            label = self.settings.assembly_mode
            followed = None if self._assessor.lost else self._assessor.confirmed(good.position).at.pose
            seen, doubt = seen_posture(self.robot.mechanism, good.position, reset.seed_pose, label, followed)
            if doubt:
                return doubt
        # The operator has confirmed the branch. Visible faults, such as a wrong mode, are found again.
        assessment = self._assessor.confirmed(good.position, seen)
        at = assessment.at
        # Nothing was proved of this branch yet. The robot stands and is stopped: the answer may take its time.
        predictor = StoppingPredictor(self.settings, self.robot.mechanism, patient=True)
        certified = predictor.predict(at, good.speeds, good.prediction_delay_s) if at.status == SOLVED else None
        active = self._policy.judge(good, assessment, certified, leg_forces(good.effort, at), 0)
        active += self._position.judge(good)
        lost = self._latch.lost
        refusal = self._latch.reset(reset.event, reset.seen_ns, self.standing, active)
        if not refusal or lost > self._latch.lost:
            self._assessor.confirm(seen)
            predictor.hurry()
            self._found, self._at, self._predictor = active, at, predictor
            self._covered = certified is not None and certified[1] >= LEAST_LIMIT
        return refusal

    def _bypass(self, wish: Bypass) -> str:
        if self._good is None or self._stale:
            return "no good sample to judge by"
        return self._latch.bypass(wish, self.standing, self._found)

    def _assess(self, estimate: Estimate) -> Assessment:
        """The posture. Where the last box does not cover the time since the last sample, the branch is known if no Type
        2 singularity can have been met."""
        silence, lost, at = estimate.silence, estimate.branch_lost, self._at
        if silence is not None and not lost and at is not None and not self._assessor.lost:
            if not self._proof.holds(at, silence):
                when = "between two samples" if silence.in_time else "while no samples came"
                lost = f"the robot may have met a Type 2 singularity {when}"
        else:
            self._proof.forget()
        return self._assessor.assess(estimate.position, lost)


def _causes(findings: list[Finding]) -> int:
    causes = 0
    for finding in findings:
        causes |= int(finding.cause)
    return causes
