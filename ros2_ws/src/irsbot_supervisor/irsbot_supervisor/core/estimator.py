"""From accepted samples to position and rate that can be believed: rates checked against the positions."""

from __future__ import annotations

from collections import deque
from itertools import pairwise
from math import copysign, inf, isfinite, nan, remainder
from operator import sub
from typing import NamedTuple

from irsbot_kinematics.mechanism import Coordinate
from irsbot_msgs_py.records import Cause, Floats
from irsbot_supervisor.core.agreement import JITTER_S, Agreement
from irsbot_supervisor.core.arrivals import Gaps, SecondLargest
from irsbot_supervisor.core.intake import OVERSPEED, Accepted, Rejected, S
from irsbot_supervisor.core.settings import Settings

ASTRAY = 2.0
"""1: a jump this many times longer than that is no noise at full speed; until it comes back the position is not
known, however much time passes in which a joint could have gone there."""

DISAGREEMENT = 0.25
"""1: share of the velocity limit by which a reported rate may differ from the differences of the positions,
beyond what the allowed acceleration and the encoder step explain. Differences lag behind by half a sample."""

FROZEN_S = 0.02
"""s: a position that stands still this long while the message reports motion is frozen. Filtered velocities lag behind
less, so that what they report after a stop is less than a joint at full braking goes in this time."""

RESTED_S = 1.0
"""s: an encoder that was frozen and still stands although the message has reported rest for so long may be sound, as
after a stop that was faster than the filter of the velocities; or it may not. An operator can look."""

CREEP = 0.02
"""1: share of the velocity limit. What a message reports beyond it `stale_s` after the position came to a stand is no
lag of a filter either, however slow the motion was: old positions are no better than none."""

SHORTEST = 0.25
"""1: speeding up counts as the mean over the latency or, if that is more, over its last half or this last part."""

FINEST = 8
"""1: parts of the latency, at most, from one to the next of which an acceleration is seen to grow."""

JUDGING_S = 0.005
"""s: judging a sample takes no longer, if there is so much time between two: the work for one sample is bounded."""

LEAD_NS = 10 * S
"""ns for which it is remembered at least that a sender's clock is ahead of ours."""


class Estimate(NamedTuple):
    """Where the joints are and how fast they move."""

    stamp_ns: int
    received_ns: int
    seen_ns: int
    position: Floats  # rad or m
    velocity: Floats  # rad/s or m/s; NaN in a first sample without velocities
    effort: Floats  # N m or N; empty when not measured
    degraded: str  # empty, or why rates were derived from the positions
    ahead_s: float  # s that the robot goes on unseen: the age of the sample, and until the next has been judged
    steady_s: float  # s for which samples have come without a silence; infinite if there was none
    acceleration: Floats  # rad/s2 or m/s2, until the brakes act; 0 where that is not known, at most what drives can


class Past(NamedTuple):
    """What tells an acceleration: reported rates, or the ways that positions went. Not both together."""

    stamp_ns: int
    told: Floats  # rad/s or m/s: as reported, where that is believed
    moved: Floats  # rad or m since the sample before; empty in a first one
    dt: float  # s since then


class Estimator:
    """Keeps the last good sample. Angles are compared modulo a turn."""

    def __init__(self, settings: Settings, joints: tuple[Coordinate, ...]) -> None:
        self._turns = tuple(joint.turn for joint in joints)
        self._units = tuple(joint.unit for joint in joints)
        self._names = settings.joint_names
        self._gaps, self._leads = Gaps(), SecondLargest()
        self.configure(settings)
        self._last: Estimate | None = None
        self._before: Estimate | None = None  # the one before the last
        self._astray: Accepted | None = None
        self._past: deque[Past] = deque()  # over the latency
        self._agreement = Agreement()
        # Joint: the way that was reported while it stood still, where that began, and since when; of a frozen one
        # infinite, where it froze, and since when the message reports rest.
        self._stuck: dict[int, tuple[float, float, int]] = {}
        self.lost_track = ""
        """Why the branch is not known any more: a jump that no motion explains was confirmed, an encoder was frozen."""

    def configure(self, settings: Settings) -> None:
        """New limits; the last sample, and when samples have come, stay known."""
        self._gaps.configure(settings.stale_s)
        self._longest_s = settings.stale_s
        self._fastest = tuple(OVERSPEED * speed for speed in settings.velocity_limit)
        self._creep = tuple(CREEP * speed for speed in settings.velocity_limit)
        self._doubt = tuple(DISAGREEMENT * speed for speed in settings.velocity_limit)
        self._brake = settings.deceleration_limit
        self._slow = settings.standstill_speed
        self._steady = (0.0,) * len(settings.deceleration_limit)
        self._horizon_ns = round(settings.latency_s * S)
        self._step = 2.0 * settings.encoder_resolution
        self._stale_ns = round(settings.stale_s * S)

    def update(self, sample: Accepted) -> Estimate | Rejected:
        """The estimate for a sample, or why the sample contradicts the motion so far."""
        last = self._last
        if last is None:
            return self._start(sample)
        dt, passed_s = (sample.stamp_ns - last.stamp_ns) / S, (sample.seen_ns - last.seen_ns) / S
        moved = self._difference(sample.position, last.position)
        if dt <= 0.0:  # the sender's clock was set back: by ours, has there been time for this way?
            self._lose_track(moved, passed_s)
            return self._start(sample, passed_s)
        velocity, degraded, told, stamped_s = sample.velocity, "", sample.velocity, dt
        if self._astray is not None or self._stuck or not self._ordinary(moved, velocity, dt):
            sure = self._astray is None
            fault = self._jumped(sample, last, moved, dt)
            change = self._change(moved, dt, last.velocity)
            odd = fault or (change > 1.0 and not self._stuck)
            if sure and odd and (before := self._gone_on(sample, 0.5 * change)):
                self._astray, self._before, self._last, last, fault = None, None, before, before, ""
                self._past.pop()
                self._agreement.forget()
                dt = (sample.stamp_ns - last.stamp_ns) / S
                moved = self._difference(sample.position, last.position)
                change = self._change(moved, dt, last.velocity)
            if fault and sample.seen_ns - last.seen_ns > self._stale_ns:
                self._lose_track(moved, passed_s)  # not a glitch: it stays there, or a clock was set
                return self._start(sample, passed_s)
            if fault:
                return Rejected(Cause.IMPLAUSIBLE, fault)
            stands = any(-self._step <= step <= self._step for step in moved)
            if (stands or self._stuck) and (fault := self._frozen(sample, moved, dt)):
                return Rejected(Cause.IMPLAUSIBLE, fault)
            by_stamps = inf if dt > self._longest_s else change
            if by_stamps > 1.0 and self._was_set(moved, passed_s, last.velocity, 0.5 * by_stamps):
                dt = stamped_s = passed_s
            velocity, told, degraded = self._believe(velocity, last.velocity, moved, (dt, passed_s))
        elif self._agreement.begun:
            self._agreement.forget()
        expected = self._gaps.expected(sample.seen_ns, passed_s, stamped_s)
        ahead_s = expected + min(expected, JUDGING_S)  # until the next one has come and been judged
        if degraded:
            ahead_s += 0.5 * min(dt, self._longest_s)  # differences lag
        return self._keep(sample, velocity, degraded, ahead_s, Past(sample.stamp_ns, told, moved, dt))

    def _rates(self, moved: Floats, dt: float) -> Floats:
        """Differences of positions over time; where stamps are off they may be more than any joint can."""
        return tuple([max(-most, min(step / dt, most)) for step, most in zip(moved, self._fastest, strict=True)])

    def _ordinary(self, moved: Floats, velocity: Floats, dt: float) -> bool:
        """Whether every joint moves, no farther than it can and as it reports: then all that follows has no objection.

        A rate as near as this to the difference of the positions is believed and not slower than the positions prove.
        """
        play = self._step
        for step, said, fastest, brake in zip(moved, velocity, self._fastest, self._brake, strict=False):
            way = fastest * dt + play
            if not (step != 0.0 and -way <= step <= way and abs(said - step / dt) <= 0.5 * brake * dt + play / dt):
                return False
        return bool(velocity)

    def _start(self, sample: Accepted, passed_s: float = 0.0) -> Estimate:
        count = len(self._names)
        self._gaps.expected(sample.seen_ns, passed_s, passed_s)
        self._astray, self._stuck = None, {}
        self._past.clear()
        self._agreement.forget()
        usable = len(sample.velocity) == count and all(map(isfinite, sample.velocity))
        if usable:
            return self._keep(sample, sample.velocity, "", 0.0, Past(sample.stamp_ns, sample.velocity, (), 0.0))
        return self._keep(sample, (nan,) * count, "the first sample has no velocities", 0.0, None)

    def _jumped(self, sample: Accepted, last: Estimate, moved: Floats, dt: float) -> str:
        """Why the positions cannot have moved like this, or empty."""
        if self._jump(moved, dt) and (fault := self._jump(moved, dt, sample.velocity or self._pace())):
            if self._jump(moved, ASTRAY * max(dt, (sample.seen_ns - last.seen_ns) / S)):  # a wrong stamp is no jump
                self._astray = sample
            return fault
        if self._astray is None:
            return ""
        away, self._astray = self._astray, None
        rates = last.velocity if all(map(isfinite, last.velocity)) else (0.0,) * len(moved)
        if self._off(sample, last, rates) <= self._off(sample, away, rates):
            return ""  # it came back
        self._astray = sample
        return "the positions stay where they jumped"

    def _pace(self) -> Floats:
        """The fastest that positions went lately."""
        known = [self._rates(then.moved, then.dt) for then in self._past if then.moved]
        return tuple([max(map(abs, rates)) for rates in zip(*known, strict=True)])

    def _gone_on(self, sample: Accepted, most: float) -> Estimate | None:
        """The estimate before the last, if the sample goes on from there as it moved then: it was the last one that
        was stamped late, by a sender that was interrupted between reading and stamping. most: change of the rates that
        this is worth."""
        before = self._before
        if before is None or not all(map(isfinite, before.velocity)):
            return None
        dt = (sample.stamp_ns - before.stamp_ns) / S
        if not 0.0 < dt <= self._longest_s:
            return None
        moved = self._difference(sample.position, before.position)
        if self._jump(moved, dt, sample.velocity) or not self._change(moved, dt, before.velocity) < most:
            return None
        for step, rate, brake in zip(moved, before.velocity, self._brake, strict=True):
            if not abs(step - rate * dt) <= 0.5 * brake * dt * dt + abs(rate) * JITTER_S + self._step:
                return None
        return before

    def _was_set(self, moved: Floats, passed_s: float, before: Floats, most: float) -> bool:
        """Whether the sender's clock was set: where by its stamps there was a silence that was none, or the joints come
        to other rates, by our clock they nearly keep theirs. most: change of the rates that is near enough."""
        return passed_s > 0.0 and self._change(moved, passed_s, before) < min(most, 2.0)

    def _change(self, moved: Floats, span_s: float, before: Floats) -> float:
        """1: the largest change of a rate, over the doubt about it, if the joints moved so far in this time."""
        joints = zip(moved, before, self._doubt, strict=True)
        return max(abs(step / span_s - rate) / (doubt + self._step / span_s) for step, rate, doubt in joints)

    def _lose_track(self, moved: Floats, passed_s: float) -> None:
        """If a joint stays where it jumped, or cannot have gone so far in the time that has passed."""
        if self._astray is not None or self._jump(moved, passed_s):
            self.lost_track = "a joint jumped farther than it can move"

    def _off(self, sample: Accepted, before: Estimate | Accepted, rates: Floats) -> float:
        """s of fastest motion between where a sample is and where it would be, had the motion before gone on."""
        dt = (sample.stamp_ns - before.stamp_ns) / S
        moved = self._difference(sample.position, before.position)
        return max(abs(step - rate * dt) / v for step, rate, v in zip(moved, rates, self._fastest, strict=True))

    def _jump(self, moved: Floats, dt: float, said: Floats = ()) -> str:
        """Why no joint moves so far in this time. said: its rate, if that is known: then a stamp may be off."""
        rates = said or self._steady
        joints = zip(self._names, self._units, moved, rates, self._fastest, strict=True)
        for name, unit, step, rate, fastest in joints:
            way = max(fastest * dt, min(OVERSPEED * abs(rate), fastest) * (dt + JITTER_S))
            if not abs(step) <= way + self._step:
                return f"joint '{name}' jumped by {step:.4g} {unit} in {dt * 1e3:.3g} ms"
        return ""

    def _frozen(self, sample: Accepted, moved: Floats, dt: float) -> str:
        """Which joint stands still although the message has reported one long motion; until it moves, or the message
        has reported rest for so long that an operator can look where it is."""
        limits = zip(self._brake, self._creep, self._fastest, strict=True)
        for k, (step, said, (brake, creep, fastest)) in enumerate(zip(moved, sample.velocity, limits, strict=False)):
            now, now_ns = sample.position[k], sample.seen_ns
            way, where, since_ns = self._stuck.pop(k, (0.0, now - step, now_ns))
            if abs(remainder(now - where, self._turns[k])) > self._step:  # more than a flickering digit: it moves
                continue
            moves = self._slow < abs(said) < inf
            if way == inf:
                if moves:
                    since_ns = now_ns
                if now_ns - since_ns > RESTED_S * S:
                    self.lost_track = f"joint '{self._names[k]}' may have moved while its position was frozen"
                    continue
                self._stuck[k] = way, where, since_ns
                return self._freezing(k)
            most = 0.5 * brake * FROZEN_S * FROZEN_S + self._step
            if abs(way) <= most:
                way = way + max(-fastest, min(said, fastest)) * dt if moves and said * way >= 0.0 else 0.0
            if way != 0.0:
                self._stuck[k] = way, where, since_ns
                still_ns = now_ns - since_ns
                far = abs(way) > most and still_ns > FROZEN_S * S
                if far or (abs(way) > 2.0 * self._step and abs(said) > creep and still_ns > self._stale_ns):
                    self._stuck[k] = inf, where, now_ns
                    return self._freezing(k)
        return ""

    def _freezing(self, k: int) -> str:
        return f"the position of joint '{self._names[k]}' is frozen while the message reports motion"

    def _believe(
        self, velocity: Floats, before: Floats, moved: Floats, times_s: tuple[float, float]
    ) -> tuple[Floats, Floats, str]:
        """The rates as reported where the positions agree, never slower than the positions prove; the same without
        what they prove, which changes with every stamp that is a little off; and what is wrong. times_s: since the last
        sample, by the sender's clock and by ours."""
        dt = times_s[0]
        rates = self._rates(moved, dt)
        if not velocity:
            return rates, rates, "the message has no velocities"
        believed, told, degraded, play = [], [], "", self._step
        doubts = self._agreement.doubts(moved, velocity, before, times_s, self._fastest, self._brake, play)
        joints = zip(self._names, self._units, self._doubt, self._brake, self._fastest, strict=True)
        samples = zip(velocity, rates, moved, doubts, strict=True)
        for (name, unit, doubt, brake, fastest), (said, seen, step, doubted) in zip(joints, samples, strict=True):
            late = play + min(abs(said), fastest) * JITTER_S
            if abs(said * dt - step) <= (doubt + brake * dt) * dt + late and not doubted:
                least = min((abs(step) - late) / dt - 0.5 * brake * dt, fastest)
                believed.append(max(said, least) if step >= 0.0 else min(said, -least))
                told.append(said)
                continue
            # What stands still may be frozen: then the motion that is reported is the safe assumption, if it is one.
            believed.append(said if abs(step) <= play and abs(said) <= fastest else seen)
            told.append(believed[-1])
            if isfinite(said):
                fault = f"joint '{name}' reports {said:.4g} {unit}/s but its position moves at {seen:.4g} {unit}/s"
            else:
                fault = f"the velocity of joint '{name}' is {said}"
            degraded = degraded or fault
        return tuple(believed), tuple(told), degraded

    def _keep(
        self, sample: Accepted, velocity: Floats, degraded: str, expected_s: float, last: Past | None
    ) -> Estimate:
        age = sample.received_ns - sample.stamp_ns
        if age < 0 or self._leads.any:  # a sender whose clock is ahead: its samples are older than they say
            age += round(self._leads.second(sample.seen_ns, max(-age, 0), LEAD_NS))
        ahead_s = expected_s + (age / S if age > 0 else 0.0)
        acceleration = self._steady
        if last is not None:
            acceleration = self._acceleration(last, bool(degraded), ahead_s)
        estimate = Estimate(
            sample.stamp_ns,
            sample.received_ns,
            sample.seen_ns,
            sample.position,
            velocity,
            sample.effort,
            degraded,
            ahead_s,
            self._gaps.steady_s(sample.seen_ns),
            acceleration,
        )
        self._before, self._last = self._last, estimate
        return estimate

    def _acceleration(self, last: Past, by_positions: bool, ahead_s: float) -> Floats:
        """Mean over the time that the outlook looks ahead, or over its last half or quarter where a joint speeds up
        more in these: what has just begun is not thinned out. What began from standstill in this time grows on, until
        the brakes act, as it grew. Over one sample a small step of a command, or the noise of a velocity, would count
        as many times as there are samples in that time. by_positions: rates are not taken as reported."""
        past, stamp_ns = self._past, last.stamp_ns
        while len(past) > 1 and stamp_ns - past[1].stamp_ns >= self._horizon_ns:
            past.popleft()
        if by_positions and past and not past[0].moved:
            past.popleft()  # a first sample
        acceleration, velocity = self._steady, self._known(last, by_positions)
        if past and not self._known(past[0], by_positions) == self._known(past[-1], by_positions) == velocity:
            spans = past[0], past[-max(len(past) // 2, 1)], past[-max(len(past) // 4, 1)]
            whole_s, half_s, quarter_s = [(stamp_ns - then.stamp_ns) / S for then in spans]
            found, slow = [], self._slow
            joints = zip(velocity, self._brake, *[self._known(then, by_positions) for then in spans], strict=True)
            for k, (now, most, a, b, c) in enumerate(joints):
                mean, later = (now - a) / whole_s, (now - c) / quarter_s
                if -slow <= a <= slow and not -slow <= now <= slow:
                    growth = self._growth(k, now, stamp_ns, by_positions)
                    later += growth * 0.5 * (quarter_s + self._horizon_ns / S + ahead_s)
                for other in ((now - b) / half_s, later):
                    if other * now > 0.0 and abs(other) > mean * now / abs(now):
                        mean = other
                # Drives speed up no faster than they brake; what is not known counts as none.
                found.append(mean if -most <= mean <= most else copysign(most, mean) if mean == mean else 0.0)
            acceleration = tuple(found)
        past.append(last)
        return acceleration

    def _known(self, then: Past, by_positions: bool) -> Floats:
        """rad/s or m/s: rates of one kind."""
        return self._rates(then.moved, then.dt) if by_positions else then.told

    def _growth(self, joint: int, now: float, stamp_ns: int, by_positions: bool) -> float:
        """rad/s3 or m/s3: the least by which the acceleration of a joint grows from each of the last few samples to the
        next; 0 unless it does so from each. A rate that is reached with a constant acceleration is no such growth.
        now: its rate at `stamp_ns`."""
        past = self._past
        apart = max(len(past) // FINEST, 1)
        if len(past) < 4 * apart:
            return 0.0
        rates = [*[self._known(past[-k * apart], by_positions)[joint] for k in (4, 3, 2, 1)], now]
        gains = [later - earlier for earlier, later in pairwise(rates)]
        growths = [later - earlier for earlier, later in pairwise(gains)]
        least = min(growths) if now > 0.0 else max(growths)
        step_s = (stamp_ns - past[-4 * apart].stamp_ns) / S / 4.0
        return least / (step_s * step_s) if least * now > 0.0 else 0.0

    def _difference(self, now: Floats, before: Floats) -> Floats:
        return tuple(map(remainder, map(sub, now, before), self._turns))
