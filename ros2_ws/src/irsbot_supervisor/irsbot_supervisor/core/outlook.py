"""What happens until the robot stands still: the path of braking, and the smallest margins along it, certified.

Until the latency has passed every joint goes on with the acceleration that it has, then it brakes with its own constant
deceleration. The mechanism bounds its margins from below over a box of joint positions and along a course, that is near
a chord. One box for the whole path usually settles the question; where it does not, the path is cut into courses, the
worst of them further.
"""

from __future__ import annotations

from math import inf
from operator import sub
from typing import TYPE_CHECKING, NamedTuple

from irsbot_kinematics import Guarantee, Mechanism, Posture
from irsbot_msgs_py.records import Floats
from irsbot_supervisor.core.assess import SOLVED, Margins, margins_of

if TYPE_CHECKING:
    from irsbot_supervisor.core.settings import Settings

CUTS, MORE_CUTS = 4, 10
"""How often the braking path of one sample is cut at most to prove that no warning is due, and how often further before
a robot is stopped for a bound alone. Each cut costs two postures, and while they are computed the robot goes on."""

PATIENT_CUTS = 8
"""The same where no robot waits for the answer, and for no limit but the one that is wanted."""


class Way(NamedTuple):
    """How the joints go on until they stand."""

    at: Posture  # now
    rates: Floats  # rad/s or m/s, now
    gains: Floats  # rad/s2 or m/s2, until the brakes act
    travel: Floats  # rad or m, signed, from now until it stands
    delay_s: float  # from now until the brakes act
    stop_s: float  # from now until the last joint stands


class Moment(NamedTuple):
    """A point of a way."""

    time_s: float  # from now
    joints: Floats


class Stretch(NamedTuple):
    """A part of a way."""

    first: Moment
    last: Moment
    floor: Margins  # certified
    begin: Posture  # of the branch; where labels do not hold the one at its start
    middle: Posture  # the one in the middle of its chord
    width: float = 0.0  # rad or m that a joint gets away from there, error included


class Foresight:
    """Follows the braking path of a mechanism under given settings."""

    def __init__(self, settings: Settings, mechanism: Mechanism, cuts: int = CUTS) -> None:
        """cuts: for bounds that are wanted."""
        self._cuts = cuts
        self._mechanism = mechanism
        self._latency = settings.latency_s
        self._brakes = settings.deceleration_limit
        self._error = position_error(settings)
        self._steady = (0.0,) * len(settings.deceleration_limit)
        self._slack_m = settings.geometry_tolerance_m
        self._wanted = limits_of(settings, "warn")
        self._stop = limits_of(settings, "stop")

    def foresee(
        self, at: Posture, velocity: Floats, ahead_s: float, wanted: Margins | None = None, acceleration: Floats = ()
    ) -> Margins:
        """Certified smallest margins until standstill from a solved posture, if the joints go on as they are for
        `ahead_s` and the latency, then brake; errors of encoders and geometry included. NaN rates give 0. wanted:
        bounds that high are good enough, lower ones are made sharper. If left out the warning limits, and more is done
        before a bound falls below a stop limit. acceleration: rad/s2 or m/s2 that last; none if left out."""
        reach = self.reach(velocity, acceleration or self._steady, self._latency + ahead_s)
        floor = floor_of(self._mechanism.guarantee(at, reach, self._slack_m))
        stop, wanted = self._stop if wanted is None else None, wanted or self._wanted
        if floor[0] >= wanted[0] and floor[1] >= wanted[1] and floor[2] >= wanted[2] and floor[3] >= wanted[3]:
            return floor
        if max(reach) <= 2.0 * self._error:  # standing still: all that is left is the error of the joints
            return floor
        floor = self._cut(self.way(at, velocity, ahead_s, acceleration), wanted, stop)
        slows = acceleration and any(v * a < 0.0 for v, a in zip(velocity, acceleration, strict=True))
        if slows and _spare(floor, stop or wanted) >= 0.0:
            # Nobody knows whether slowing down lasts: both ways count.
            steady = tuple([0.0 if v * a < 0.0 else a for v, a in zip(velocity, acceleration, strict=True)])
            other = self._cut(self.way(at, velocity, ahead_s, steady), wanted, stop)
            floor = lowest([floor, other])
        return floor

    def reach(self, velocity: Floats, acceleration: Floats, delay_s: float) -> list[float]:
        """rad or m that each joint gets away at most, whatever part of slowing down lasts. A joint that turns round
        ends up faster than it is now only by what is left when its speed has been taken away twice."""
        reach, error = [], self._error
        for rate, gain, brake in zip(velocity, acceleration, self._brakes, strict=True):
            speed, more = abs(rate), abs(gain) * delay_s
            if rate * gain < 0.0:
                more = max(more - 2.0 * speed, 0.0)
            last = speed + more
            reach.append((speed + 0.5 * more) * delay_s + 0.5 * last * last / brake + error)
        return reach

    def way(self, at: Posture, velocity: Floats, ahead_s: float, acceleration: Floats = ()) -> Way:
        """The braking path, if the joints keep their acceleration until the brakes act."""
        acceleration = acceleration or self._steady
        delay, travel, braking_s = self._latency + ahead_s, [], 0.0
        for rate, gain, brake in zip(velocity, acceleration, self._brakes, strict=True):
            more = gain * delay
            last = rate + more
            time_s = abs(last) / brake
            travel.append((rate + 0.5 * more) * delay + 0.5 * last * time_s)
            if not time_s <= braking_s:
                braking_s = time_s
        return Way(at, velocity, acceleration, tuple(travel), delay, delay + braking_s)

    def position(self, way: Way, time_s: float) -> Floats:
        """Joint positions on the braking path, `time_s` after the sample."""
        delay = way.delay_s
        before, after = min(time_s, delay), max(time_s - delay, 0.0)
        reached = []
        for q, rate, gain, brake in zip(way.at.joints, way.rates, way.gains, self._brakes, strict=True):
            v = rate + gain * delay
            t = min(after, abs(v) / brake)
            q += (rate + 0.5 * gain * before) * before + v * t
            reached.append(q - (0.5 * brake * t * t if v > 0.0 else -0.5 * brake * t * t))
        return tuple(reached)

    def bend(self, way: Way, start_s: float, end_s: float) -> list[float]:
        """rad or m that each joint may be away from the chord between two times of a way: an eighth of its acceleration
        times the square of the time, and its error."""
        eighth, error = 0.125 * (end_s - start_s) * (end_s - start_s), self._error
        if end_s <= way.delay_s:
            return [eighth * abs(gain) + error for gain in way.gains]
        return [eighth * max(abs(gain), brake) + error for gain, brake in zip(way.gains, self._brakes, strict=True)]

    def _cut(self, way: Way, wanted: Margins, stop: Margins | None) -> Margins:
        """Bounds along the way in stretches; the one farthest below what is wanted is cut next, as long as the margins
        in its middle and where the robot stands are not. stop: limits for which more is done."""
        if not way.stop_s < inf:
            return nothing_of(way.at)
        last = self._moment(way, way.stop_s)
        stretches = [*self._halves(way, way.at, Moment(0.0, way.at.joints), way.delay_s, last)]
        floor = lowest([stretch.floor for stretch in stretches])
        if _spare(floor, wanted) >= 0.0:
            return floor
        end = stretches[-1].middle
        if end.status == SOLVED:
            end = self._mechanism.track(last.joints, end)
        for limits, cuts in ((wanted, self._cuts), *([(stop, MORE_CUTS)] if stop else [])):
            for _ in range(cuts if self._is_good(end, limits) else 0):  # where it stands most margins are smallest
                worst = min(stretches, key=lambda stretch: _spare(stretch.floor, limits))
                if not (_spare(worst.floor, limits) < 0.0 and self._is_worth_cutting(worst, limits)):
                    break
                stretches.remove(worst)
                middle_s = 0.5 * (worst.first.time_s + worst.last.time_s)
                stretches += self._halves(way, worst.begin, worst.first, middle_s, worst.last, worst.middle)
        return lowest([stretch.floor for stretch in stretches])

    def _is_worth_cutting(self, stretch: Stretch, limits: Margins) -> bool:
        """Whether shorter courses can prove more: not where the margins are truly low, nor where all that is left is
        the error of the joints."""
        return stretch.width > 2.0 * self._error and self._is_good(stretch.middle, limits)

    @staticmethod
    def _is_good(at: Posture, limits: Margins) -> bool:
        return at.status == SOLVED and _spare(margins_of(at), limits) >= 0.0

    def _moment(self, way: Way, time_s: float) -> Moment:
        return Moment(time_s, self.position(way, time_s))

    def _halves(
        self, way: Way, begin: Posture, first: Moment, cut_s: float, last: Moment, near: Posture | None = None
    ) -> tuple[Stretch, Stretch]:
        """Two stretches of a way. begin: a posture of the same branch; the one at the start if labels do not hold.
        near: one of the same branch that is near the cut."""
        cut = self._moment(way, cut_s)
        before = self._stretch(way, begin, first, cut)
        after = near or before.middle
        if after.status == SOLVED and not self._mechanism.labels_hold:
            after = self._mechanism.track(cut.joints, after)
        return before, self._stretch(way, after, cut, last)

    def _stretch(self, way: Way, begin: Posture, first: Moment, last: Moment) -> Stretch:
        """Bounds of the margins anywhere between two moments of a way, nothing where there are none."""
        if begin.status != SOLVED:
            return Stretch(first, last, nothing_of(way.at), begin, begin)
        middle = self._mechanism.track(
            tuple([0.5 * (a + b) for a, b in zip(first.joints, last.joints, strict=True)]), begin
        )
        if middle.status != SOLVED:
            return Stretch(first, last, nothing_of(way.at), begin, middle)
        half = [0.5 * (b - a) for a, b in zip(first.joints, last.joints, strict=True)]
        bend = self.bend(way, first.time_s, last.time_s)
        floor = floor_of(self._mechanism.guarantee_along(middle, half, bend, self._slack_m))
        width = max([abs(h) + b for h, b in zip(half, bend, strict=True)])
        return Stretch(first, last, floor, begin, middle, width)


def lowest(floors: list[Margins]) -> Margins:
    """The smallest of each margin."""
    type1, type2, constraint, limb = map(min, zip(*floors, strict=True))
    return type1, type2, constraint, limb


def _spare(have: Margins, want: Margins) -> float:
    """What the worst margin has above what is wanted."""
    spare: float = min(map(sub, have, want))
    return spare


def floor_of(guarantee: Guarantee) -> Margins:
    """A guarantee as four margins; infinite where the mechanism has none."""
    type1, type2, constraint, limb = guarantee
    return min(type1), type2, constraint if constraint == constraint else inf, min(limb) if limb else inf


def nothing_of(at: Posture) -> Margins:
    """What is known where nothing can be bounded; infinite where the mechanism of a solved posture has no margin."""
    return 0.0, 0.0, 0.0 if at.constraint == at.constraint else inf, 0.0 if at.limb else inf


def limits_of(settings: Settings, which: str) -> Margins:
    """The `warn` or `stop` limits of the four margins."""
    kinds = ("type1", "type2", "constraint", "limb")
    type1, type2, constraint, limb = (getattr(settings, f"{kind}_{which}") for kind in kinds)
    return type1, type2, constraint, limb


def position_error(settings: Settings) -> float:
    """rad or m by which a joint position may be wrong."""
    return 0.5 * settings.encoder_resolution + settings.encoder_offset
