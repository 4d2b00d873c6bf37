"""From accepted samples to position and rate that can be believed: rates checked against the positions."""

from __future__ import annotations

from collections import deque
from math import copysign, inf, isfinite, nan, remainder, tau
from operator import sub
from typing import NamedTuple

from irsbot_kinematics.mechanism import Coordinate
from irsbot_msgs_py.records import Cause, Floats
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

CREEP = 0.02
"""1: share of the velocity limit. What a message reports beyond it `stale_s` after the position came to a stand is no
lag of a filter either, however slow the motion was: old positions are no better than none."""

JUDGING_S = 0.005
"""s: judging a sample takes no longer, if there is so much time between two: the work for one sample is bounded."""


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
    acceleration: Floats  # rad/s2 or m/s2, over the last latency; 0 where that is not known, at most what drives can


class Estimator:
    """Keeps the last good sample. Angles are compared modulo a turn."""

    def __init__(self, settings: Settings, joints: tuple[Coordinate, ...]) -> None:
        self._turns = tuple(tau if joint.is_angle else inf for joint in joints)
        self._names = settings.joint_names
        self.configure(settings)
        self._last: Estimate | None = None
        self._astray: Accepted | None = None
        self._interval_s = inf
        self._past: deque[tuple[int, Floats]] = deque()  # stamps and velocities, over the latency
        self._stuck: dict[int, tuple[float, int]] = {}  # joint: way reported while it stood still, and since when
        self.lost_track = False
        """A jump that no motion explains has happened and was then confirmed: the branch is not known any more."""

    def configure(self, settings: Settings) -> None:
        """New limits; the last sample stays known."""
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
        dt = (sample.stamp_ns - last.stamp_ns) / S if last is not None else 0.0
        if last is None:
            return self._start(sample)
        moved = self._difference(sample.position, last.position)
        if dt <= 0.0:  # the sender's clock was set back: by ours, has there been time for this way?
            self.lost_track = bool(self._jump(moved, (sample.seen_ns - last.seen_ns) / S))
            return self._start(sample)
        velocity, degraded = sample.velocity, ""
        if self._astray is not None or self._stuck or not self._ordinary(moved, velocity, dt):
            if fault := self._jumped(sample, last, moved, dt):
                passed_s = (sample.seen_ns - last.seen_ns) / S
                if sample.seen_ns - last.seen_ns > self._stale_ns:  # not a glitch: it stays there
                    self.lost_track = self._astray is not None or bool(
                        self._jump(moved, passed_s)
                    )  # or a clock was set
                    return self._start(sample)
                return Rejected(Cause.IMPLAUSIBLE, fault)
            if (0.0 in moved or self._stuck) and (fault := self._frozen(sample, moved, dt)):
                return Rejected(Cause.IMPLAUSIBLE, fault)
            velocity, degraded = self._believe(velocity, tuple([step / dt for step in moved]), dt)
        expected, self._interval_s = min(dt, self._interval_s), dt  # one gap does not announce another
        ahead_s = expected + min(expected, JUDGING_S)  # until the next one has come and been judged
        return self._keep(sample, velocity, degraded, ahead_s + 0.5 * expected if degraded else ahead_s)  # they lag

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

    def _start(self, sample: Accepted) -> Estimate:
        count = len(self._names)
        self._astray, self._interval_s, self._stuck = None, inf, {}
        self._past.clear()
        usable = len(sample.velocity) == count and all(map(isfinite, sample.velocity))
        if usable:
            return self._keep(sample, sample.velocity, "", 0.0)
        return self._keep(sample, (nan,) * count, "the first sample has no velocities", 0.0)

    def _jumped(self, sample: Accepted, last: Estimate, moved: Floats, dt: float) -> str:
        """Why the positions cannot have moved like this, or empty."""
        if fault := self._jump(moved, dt):
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

    def _off(self, sample: Accepted, before: Estimate | Accepted, rates: Floats) -> float:
        """s of fastest motion between where a sample is and where it would be, had the motion before gone on."""
        dt = (sample.stamp_ns - before.stamp_ns) / S
        moved = self._difference(sample.position, before.position)
        return max(abs(step - rate * dt) / v for step, rate, v in zip(moved, rates, self._fastest, strict=True))

    def _jump(self, moved: Floats, dt: float) -> str:
        for name, step, fastest in zip(self._names, moved, self._fastest, strict=True):
            if not abs(step) <= fastest * dt + self._step:
                return f"joint '{name}' jumped by {step:.4g} in {dt * 1e3:.3g} ms"
        return ""

    def _frozen(self, sample: Accepted, moved: Floats, dt: float) -> str:
        """Which joint stands still although the message has reported one long motion; until it moves."""
        limits = zip(self._brake, self._creep, self._fastest, strict=True)
        for k, (step, said, (brake, creep, fastest)) in enumerate(zip(moved, sample.velocity, limits, strict=False)):
            way, since_ns = self._stuck.pop(k, (0.0, sample.seen_ns))
            most = 0.5 * brake * FROZEN_S * FROZEN_S + self._step
            if step == 0.0 and abs(way) <= most:
                going = said * way >= 0.0 and self._slow < abs(said) < inf
                way = way + max(-fastest, min(said, fastest)) * dt if going else 0.0
            if step == 0.0 and way != 0.0:
                self._stuck[k] = way, since_ns
                still_ns = sample.seen_ns - since_ns
                far = abs(way) > most and still_ns > FROZEN_S * S
                if far or (abs(way) > self._step and abs(said) > creep and still_ns > self._stale_ns):
                    self._stuck[k] = copysign(inf, way), since_ns  # until it moves, whatever is reported
                    return f"the position of joint '{self._names[k]}' is frozen while the message reports motion"
        return ""

    def _believe(self, velocity: Floats, rates: Floats, dt: float) -> tuple[Floats, str]:
        """The rates as reported where the positions agree; never slower than the positions prove."""
        if not velocity:
            return rates, "the message has no velocities"
        believed, degraded = [], ""
        step = self._step / dt
        limits = zip(self._doubt, self._brake, self._fastest, strict=True)
        for name, said, seen, (doubt, brake, fastest) in zip(self._names, velocity, rates, limits, strict=True):
            if abs(said - seen) <= doubt + brake * dt + step:
                least = abs(seen) - 0.5 * brake * dt - step
                proven = (said if seen >= 0.0 else -said) >= least
                believed.append(said if proven else copysign(least, seen))
                continue
            # What stands still may be frozen: then the motion that is reported is the safe assumption, if it is one.
            believed.append(said if seen == 0.0 and abs(said) <= fastest else seen)
            if isfinite(said):
                fault = f"joint '{name}' reports {said:.4g} but its position moves at {seen:.4g}"
            else:
                fault = f"the velocity of joint '{name}' is {said}"
            degraded = degraded or fault
        return tuple(believed), degraded

    def _keep(self, sample: Accepted, velocity: Floats, degraded: str, expected_s: float) -> Estimate:
        age = sample.received_ns - sample.stamp_ns
        acceleration = self._acceleration(sample.stamp_ns, velocity)
        estimate = Estimate(
            sample.stamp_ns,
            sample.received_ns,
            sample.seen_ns,
            sample.position,
            velocity,
            sample.effort,
            degraded,
            expected_s + (age / S if age > 0 else 0.0),
            acceleration,
        )
        self._last = estimate
        return estimate

    def _acceleration(self, stamp_ns: int, velocity: Floats) -> Floats:
        """Mean over the time that the outlook looks ahead. Over one sample a small step of a command, or the noise of
        a velocity, would count as many times as there are samples in that time."""
        past = self._past
        while len(past) > 1 and stamp_ns - past[1][0] >= self._horizon_ns:
            past.popleft()
        acceleration = self._steady
        if past and past[0][1] != velocity:
            dt = (stamp_ns - past[0][0]) / S
            pairs = zip(velocity, past[0][1], self._brake, strict=True)
            acceleration = tuple([_within((now - then) / dt, most) for now, then, most in pairs])
        past.append((stamp_ns, velocity))
        return acceleration

    def _difference(self, now: Floats, before: Floats) -> Floats:
        return tuple(map(remainder, map(sub, now, before), self._turns))


def _within(value: float, most: float) -> float:
    """Drives speed up no faster than they brake; what is not known counts as none."""
    return min(max(value, -most), most) if isfinite(value) else 0.0
