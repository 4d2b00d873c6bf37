"""From accepted samples to estimates: runs the detectors and the observer in their order."""

from __future__ import annotations

from typing import NamedTuple

from irsbot_kinematics.mechanism import Coordinate
from irsbot_msgs_py.records import Cause, Floats
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.core.estimation.clock_steps import passed_s, stamped_s, step_ns, was_set
from irsbot_supervisor.core.estimation.estimate import Estimate, Silence, Speeds
from irsbot_supervisor.core.estimation.frozen import Frozen, Suspicion
from irsbot_supervisor.core.estimation.jumps import Jumps
from irsbot_supervisor.core.estimation.observer import Observer, excess
from irsbot_supervisor.core.estimation.reported import Reported
from irsbot_supervisor.core.estimation.sample_interval import (
    SampleIntervals,
    SecondLargest,
    judging_time,
)
from irsbot_supervisor.core.estimation.silence import Known, Silences
from irsbot_supervisor.core.memory import EstimatorMemory, Standstill
from irsbot_supervisor.core.reachable_box import ReachableBox
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.validation import Accepted, Rejected

LEAD_NS = 10 * NS_PER_S
"""ns: least time for which a lead of the sender's clock is remembered."""

HARD = "a joint speeds up faster than acceleration_limit, or stamps are off by more than stamp_jitter_s"
JUMPED = "a joint jumped farther than it can move"
CERTAIN = Suspicion()


class Wait(NamedTuple):
    """Time until the next sample has come and is judged."""

    expected_s: float
    judging_s: float  # of it for judging
    usual_s: float  # at the present interval of the sender
    late: bool  # True if samples have come more rarely than that
    rare: bool  # and more rarely than heartbeats


class Estimator:
    """Estimates of one robot; keeps the last good samples."""

    def __init__(self, settings: Settings, joints: tuple[Coordinate, ...]) -> None:
        self._intervals, self._leads = SampleIntervals(), SecondLargest()
        self._observer, self._reported = Observer(settings, joints), Reported(settings, joints)
        self._jumps, self._frozen = Jumps(settings, joints), Frozen(settings, joints)
        self._silences = Silences(settings, joints)
        self._last: Estimate | None = None
        self._before: Estimate | None = None  # the one before the last
        self._wrong_ns: int | None = None  # when a stamp was last believed to be late
        self._rest: Floats = ()  # positions since which no joint has moved faster than the standstill speed
        self._rest_ns = 0  # and the time of these positions
        self._stood_ns = 0  # time since which no joint has moved faster
        self.configure(settings)

    def configure(self, settings: Settings) -> None:
        """Take in new limits; the last sample and the learned sample interval are kept."""
        self._settings, self._stale_s, self._judging_s = settings, settings.stale_s, settings.judging_s
        self._slow, self._step = settings.standstill_speed, 2.0 * settings.encoder_resolution
        self._box = ReachableBox(settings)
        self._intervals.configure(settings.stale_s, settings.least_gap_s, settings.heartbeat_s)
        for part in (self._observer, self._reported, self._jumps, self._frozen, self._silences):
            part.configure(settings)

    @property
    def last(self) -> Estimate | None:
        """The estimate of the last good sample."""
        return self._last

    @property
    def silences(self) -> Silences:
        """What is known of the present silence."""
        return self._silences

    @property
    def quiet(self) -> bool:
        """True if no joint is where it jumped, and no lead of the sender's clock is remembered."""
        return not (self._leads.any or self._jumps.away)

    @property
    def memory(self) -> EstimatorMemory:
        """What is remembered of the last samples, for `remember`."""
        return EstimatorMemory(
            self._last,
            self._before,
            self._observer.memory,
            self._reported.memory,
            self._intervals.memory,
            self._frozen.still,
            Standstill(self._rest, self._rest_ns, self._stood_ns),
        )

    def remember(self, memory: EstimatorMemory) -> None:
        """Go on from a memory. The estimator is `quiet`."""
        self._last, self._before = memory.last, memory.before
        self._observer.remember(memory.observer)
        self._reported.remember(memory.reported)
        self._intervals.remember(memory.intervals)
        self._frozen.still = memory.still
        self._rest, self._rest_ns, self._stood_ns = memory.standstill

    def update(
        self,
        sample: Accepted,
        held: bool = False,
        followed: Estimate | None = None,
        known: Known = Known.COVERED,
    ) -> Estimate | Rejected:
        """The estimate for a sample, or the reason why the sample contradicts the earlier motion.

        followed: the last estimate of which the posture was judged, if it is not the last one; a silence is counted
        from there. held: a latched stop held the robot then, and holds it still. known: of the motion since then."""
        last, jumps = self._last, self._jumps
        if last is None:
            return self._anew(sample, Wait(0.0, 0.0, 0.0, False, False))
        if step := step_ns(sample, last):
            last = self._last = self._moved(last, step)
            self._before = self._before and self._moved(self._before, step)
            self._observer.clock_set(step)
            self._reported.clock_set(step)
        passed, stamped = passed_s(sample, last), stamped_s(sample, last)
        clock_set = was_set(stamped, passed, self._stale_s)
        span = passed if clock_set else max(passed, stamped)
        moved = jumps.moved(sample.position, last.position)
        too_far = jumps.too_far(moved, span)
        since = followed or last
        way = moved if since is last else jumps.moved(sample.position, since.position)
        unseen = self._silences.region(since, passed_s(sample, since), way, held, known)
        if too_far and not jumps.away and self._last_was_wrong(sample):
            before = self._before
            assert before is not None
            self._wrong_ns = sample.seen_ns
            if before.seen_ns < since.seen_ns:  # the last one does not count
                since, way = before, jumps.moved(sample.position, before.position)
                unseen = self._silences.region(since, passed_s(sample, since), way, held, Known.SPEEDS)
            expected = self._expected(sample, passed, passed)
            self._observer.without_last(before.speeds)
            self._reported.without_last()
            speeds = self._observer.update(sample.stamp_ns, sample.position)
            if speeds is None:
                unseen = self._silences.region(since, passed_s(sample, since), way, held, Known.NOTHING)
                return self._anew(sample, expected, HARD, silence=unseen)
            return self._keep(sample, speeds, expected, HARD, silence=unseen)
        if fault := jumps.fault(sample, last, moved, too_far, span):
            if passed > self._stale_s:  # not a glitch: the joint stays there
                return self._anew(sample, self._expected(sample, passed, passed), branch_lost=JUMPED)
            return Rejected(Cause.IMPLAUSIBLE, fault)
        sent = passed if clock_set else stamped  # s between two samples for the sender
        suspicion = self._frozen.look(sample, moved, sent)
        if suspicion.fault:
            return Rejected(Cause.IMPLAUSIBLE, suspicion.fault)
        expected = self._expected(sample, passed, sent)
        if clock_set or passed > self._stale_s:
            return self._anew(sample, expected, silence=unseen, suspicion=suspicion)
        speeds = self._observer.update(sample.stamp_ns, sample.position)
        if speeds is None:
            unseen = self._silences.region(since, passed_s(sample, since), way, held, Known.NOTHING)
            return self._anew(sample, expected, HARD, silence=unseen, suspicion=suspicion)
        return self._keep(sample, speeds, expected, silence=unseen, suspicion=suspicion)

    def in_time(self, estimate: Estimate, prediction_delay_s: float) -> Speeds:
        """The speeds as the observer would bound them if samples came as they are sent now and the joints moved as they
        appear to. These speeds are not certified: they distinguish a robot in danger from one whose samples come too
        rarely.

        prediction_delay_s: `in_time_s` of the estimate.
        """
        usual_s = prediction_delay_s - (estimate.prediction_delay_s - estimate.expected_s)
        joints = list(zip(estimate.velocity, *estimate.speeds, excess(self._settings, 0.5 * usual_s), strict=True))
        forward = [min(up, max(rate, 0.0) + e) if rate == rate else up for rate, up, _down, e in joints]
        backward = [min(down, max(-rate, 0.0) + e) if rate == rate else down for rate, _up, down, e in joints]
        return Speeds(tuple(forward), tuple(backward))

    @staticmethod
    def _moved(estimate: Estimate, step: int) -> Estimate:
        """The estimate by a clock that was set by `step` ns."""
        return estimate._replace(stamp_ns=estimate.stamp_ns + step, received_ns=estimate.received_ns + step)

    def _last_was_wrong(self, sample: Accepted) -> bool:
        """True if a sample that cannot follow the last one follows the one before it: then the last was stamped late,
        by a sender that was interrupted between reading and stamping. One is not interrupted again at once: two in
        `stale_s` may be two publishers."""
        before, wrong_ns = self._before, self._wrong_ns
        if before is None or (wrong_ns is not None and sample.seen_ns - wrong_ns <= self._stale_s * NS_PER_S):
            return False
        span = max((sample.stamp_ns - before.stamp_ns) / NS_PER_S, passed_s(sample, before))
        if not 0.0 < span <= self._stale_s:
            return False
        ahead, back = self._box.going(before.speeds, span)
        moved = self._jumps.moved(sample.position, before.position)
        errors = self._box.errors
        joints = zip(moved, ahead, back, errors, strict=True)
        return all(-down - 2.0 * e <= way <= up + 2.0 * e for way, up, down, e in joints)

    def _expected(self, sample: Accepted, passed_s: float, stamped_s: float) -> Wait:
        interval = self._intervals.expected(sample.seen_ns, passed_s, stamped_s)
        longest_s, usual_s = interval.longest_s, interval.usual_s
        judging_s = judging_time(self._judging_s, longest_s)
        usual_s += judging_time(self._judging_s, usual_s)
        return Wait(longest_s + judging_s, judging_s, usual_s, interval.late, interval.rare)

    def _anew(
        self,
        sample: Accepted,
        wait: Wait,
        degraded: str = "",
        branch_lost: str = "",
        silence: Silence | None = None,
        suspicion: Suspicion = CERTAIN,
    ) -> Estimate:
        """Estimate without history: positions and stamps before the sample are not used for velocities."""
        self._jumps.restart()
        if not degraded:
            self._reported.restart()
        if suspicion is CERTAIN:
            self._frozen.restart()
        speeds = self._observer.restart(sample.stamp_ns, sample.position)
        return self._keep(sample, speeds, wait, degraded, branch_lost, silence, suspicion)

    def _keep(
        self,
        sample: Accepted,
        speeds: Speeds,
        wait: Wait,
        degraded: str = "",
        branch_lost: str = "",
        silence: Silence | None = None,
        suspicion: Suspicion = CERTAIN,
    ) -> Estimate:
        age = sample.received_ns - sample.stamp_ns
        if age < 0 or self._leads.any:  # a sender whose clock is ahead: its samples are older than they say
            age += round(self._leads.second(sample.seen_ns, max(-age, 0), LEAD_NS))
        velocities = self._reported.look(sample, speeds)
        speeds = self._reported.trusted(sample, velocities, speeds)
        if suspicion.speeds:  # a joint whose position may be frozen may move as it says
            speeds = Speeds(
                tuple(map(max, speeds.forward, suspicion.speeds)),
                tuple([max(speed, -stated) for speed, stated in zip(speeds.backward, suspicion.speeds, strict=True)]),
            )
        age_s = age / NS_PER_S if age > 0 else 0.0
        standing_s = 0.0 if suspicion.speeds else self._standing_s(sample)
        # For a moving robot, jitter within a heartbeat does not count as late samples.
        excused = wait.rare or (wait.late and standing_s >= self._stale_s)
        estimate = Estimate(
            sample.stamp_ns,
            sample.received_ns,
            sample.seen_ns,
            sample.position,
            velocities.rates,
            sample.effort,
            speeds,
            wait.expected_s + age_s,
            wait.expected_s,
            self._intervals.steady_s(sample.seen_ns),
            standing_s,
            wait.judging_s,
            degraded or velocities.fault,
            branch_lost or (silence.fault if silence is not None else "") or suspicion.branch_lost,
            silence,
            age_s + wait.usual_s if excused else None,
        )
        self._before, self._last = self._last, estimate
        return estimate

    def _standing_s(self, sample: Accepted) -> float:
        """s for which no joint has moved faster than the standstill speed, by its reported velocity and by its
        positions over at most the last `stale_s`."""
        now_ns, since_s = sample.seen_ns, (sample.seen_ns - self._rest_ns) / NS_PER_S
        if self._rest and not any(abs(rate) > self._slow for rate in sample.velocity):
            most = self._slow * since_s + self._step
            if all(-most <= way <= most for way in self._jumps.moved(sample.position, self._rest)):
                if since_s > self._stale_s:
                    self._rest, self._rest_ns = sample.position, now_ns
                return (now_ns - self._stood_ns) / NS_PER_S
        self._rest, self._rest_ns, self._stood_ns = sample.position, now_ns, now_ns
        return 0.0
