"""What happens until the robot stands still: the path of braking, and the smallest margins along it, certified.

Until the latency has passed every joint goes on with the acceleration that it has, then it brakes with its own constant
deceleration. Between turns each joint goes one way, so every
stretch of it lies in a box of joint positions, and the mechanism bounds its margins over a box from below. One box for
the whole path usually settles the question; where it does not, the path is cut, worst stretch first.
"""

from __future__ import annotations

from collections.abc import Sequence
from heapq import heappop, heappush
from itertools import pairwise
from math import inf
from typing import TYPE_CHECKING, NamedTuple

from irsbot_kinematics import Guarantee, Mechanism, Posture
from irsbot_msgs_py.records import Floats
from irsbot_supervisor.core.assess import SOLVED, Margins, margins_of

if TYPE_CHECKING:
    from irsbot_supervisor.core.settings import Settings

CUTS = 8
"""How often the braking path of one sample is cut at most; the bound so far counts when they are used up. Each cut
costs two postures; 8 keep the longest step below the P4 goal of the benchmark."""

MORE_CUTS = 24
"""How often it is cut further before a robot is stopped for a bound alone. The bounds of robots whose platform turns
left one harmless sample in 30 of random motion without a proof after 8 cuts, none after 24."""


Stretch = tuple[float, float, float, Margins, Posture, Posture]
"""Of the braking path: what the worst margin has above its limit, begin and end (s), smallest margins, postures at the
begin and in the middle of its box."""


class Outlook(NamedTuple):
    """From now to standstill."""

    floor: Margins  # certified smallest margins on the braking path, encoder and geometry errors included
    travel: Floats  # rad or m each joint needs to stop, signed
    stop_s: float  # s until the last joint stands


class Way(NamedTuple):
    """How the joints go on until they stand."""

    joints: Floats  # rad or m, now
    rates: Sequence[float]  # rad/s or m/s, now
    gains: Sequence[float]  # rad/s2 or m/s2, until the brakes act
    turns: Sequence[float]  # when joints turn round, s
    travel: Floats  # rad or m, signed, from now until it stands
    reach: Sequence[float]  # rad or m that a joint gets away from where it is
    delay_s: float  # from now until the brakes act
    stop_s: float  # from now until the last joint stands


class Foresight:
    """Follows the braking path of a mechanism under given settings."""

    def __init__(self, settings: Settings, mechanism: Mechanism) -> None:
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
    ) -> Outlook:
        """Certified margins until standstill from a solved posture, if the joints go on as they are for `ahead_s` and
        the latency, then brake. NaN rates give floors of 0. wanted: bounds that high are good enough, lower ones are
        made sharper. If left out the warning limits, and more is done before a bound falls below a stop limit.
        acceleration: rad/s2 or m/s2 with which the joints go on; none if left out."""
        way = self.way(at, velocity, ahead_s, acceleration or self._steady)
        travel, reach, slowing = way.travel, way.reach, False
        if acceleration and (slowing := any(v * a < 0.0 for v, a in zip(velocity, acceleration, strict=True))):
            # Nobody knows whether slowing down lasts: both ways count.
            steady = [0.0 if v * a < 0.0 else a for v, a in zip(velocity, acceleration, strict=True)]
            other = self.way(at, velocity, ahead_s, steady)
            reach = list(map(max, reach, other.reach))
        if not way.stop_s < inf:
            return Outlook(nothing_of(at), travel, inf)
        whole = self._mechanism.guarantee(at, reach, self._slack_m)
        floor = floor_of(whole)
        stop, wanted = self._stop if wanted is None else None, wanted or self._wanted
        if not (floor[0] >= wanted[0] and floor[1] >= wanted[1] and floor[2] >= wanted[2] and floor[3] >= wanted[3]):
            floor = self._cut(at, way, wanted, stop)
            if slowing:
                type1, type2, constraint, limb = map(min, floor, self._cut(at, other, wanted, stop))
                floor = type1, type2, constraint, limb
        return Outlook(floor, travel, way.stop_s)

    def way(self, at: Posture, velocity: Floats, ahead_s: float, acceleration: Sequence[float]) -> Way:
        """The braking path, if the joints keep their acceleration until the brakes act."""
        delay, error = self._latency + ahead_s, self._error
        turns, travel, reach, braking_s = [], [], [], 0.0
        for rate, gain, brake in zip(velocity, acceleration, self._brakes, strict=True):
            more = gain * delay
            last = rate + more
            farthest = 0.0
            if rate * last < 0.0:
                turns.append(-rate / gain)
                farthest = 0.5 * rate * rate / abs(gain)
            time_s = abs(last) / brake
            path = (rate + 0.5 * more) * delay + 0.5 * last * time_s
            travel.append(path)
            reach.append(max(abs(path), farthest) + error)
            if not time_s <= braking_s:
                braking_s = time_s
        return Way(at.joints, velocity, acceleration, turns, tuple(travel), reach, delay, delay + braking_s)

    def position(self, way: Way, time_s: float) -> Floats:
        """Joint positions on the braking path, `time_s` after the sample."""
        delay = way.delay_s
        before, after = min(time_s, delay), max(time_s - delay, 0.0)
        reached = []
        for q, rate, gain, brake in zip(way.joints, way.rates, way.gains, self._brakes, strict=True):
            v = rate + gain * delay
            t = min(after, abs(v) / brake)
            q += (rate + 0.5 * gain * before) * before + v * t
            reached.append(q - (0.5 * brake * t * t if v > 0.0 else -0.5 * brake * t * t))
        return tuple(reached)

    def _cut(self, at: Posture, way: Way, wanted: Margins, stop: Margins | None) -> Margins:
        """Bounds along the path in stretches; the stretch farthest below what is wanted is cut next. stop: limits
        below which no bound shall fall as long as the margins themselves do not."""
        stretches: list[Stretch] = []
        nothing = nothing_of(at)

        def ends(start: float, end: float) -> tuple[Floats, Floats]:
            return self.position(way, start), self.position(way, end)

        def add(start: float, end: float, begin: Posture) -> Posture:
            floor, middle, after = self._bound(begin, *ends(start, end), nothing)
            heappush(stretches, (_spare(floor, wanted), start, end, floor, begin, middle))
            return after

        def halve(stretch: Stretch) -> None:
            _lack, start, end, _floor, begin, _middle = stretch
            middle = 0.5 * (start + end)
            add(middle, end, add(start, middle, begin))

        begin = at
        for start, end in pairwise([0.0, *sorted(way.turns), way.stop_s]):  # between turns every joint goes one way
            begin = add(start, end, begin)
        for _ in range(CUTS):
            if stretches[0][0] >= 0.0:
                break
            halve(heappop(stretches))
        for _ in range(MORE_CUTS if stop else 0):
            worst = min(stretches, key=lambda stretch: _spare(stretch[3], stop or wanted))
            _lack, start, end, floor, _begin, middle = worst
            if _spare(floor, stop or wanted) >= 0.0:
                break
            if not (middle.status == SOLVED and _spare(margins_of(middle), stop or wanted) >= 0.0):
                break  # it is truly so
            if not max(abs(b - a) for a, b in zip(*ends(start, end), strict=True)) > self._error:
                break  # what is left is the error of the encoders
            stretches.remove(worst)
            halve(worst)
        floors = [stretch[3] for stretch in stretches]
        return (
            min([f[0] for f in floors]),
            min([f[1] for f in floors]),
            min([f[2] for f in floors]),
            min([f[3] for f in floors]),
        )

    def _bound(self, begin: Posture, first: Floats, last: Floats, nothing: Margins) -> tuple[Margins, Posture, Posture]:
        """Bounds of the margins anywhere between two joint positions, `nothing` if there are none; the posture in the
        middle; and one of the same branch for the next stretch. begin: such a posture, the one at `first` if labels
        fail."""
        floor, at, after = nothing, begin, begin
        if begin.status == SOLVED:
            middle = tuple([0.5 * (a + b) for a, b in zip(first, last, strict=True)])
            at = self._mechanism.track(middle, begin)
            if at.status == SOLVED:
                half = [0.5 * abs(b - a) + self._error for a, b in zip(first, last, strict=True)]
                floor = floor_of(self._mechanism.guarantee(at, half, self._slack_m))
            if not self._mechanism.labels_hold:  # both ways lie in the box whose margins are bounded
                after = self._mechanism.track(last, at) if at.status == SOLVED else at
        return floor, at, after


def _spare(have: Margins, want: Margins) -> float:
    """What the worst margin has above what is wanted."""
    return min([a - b for a, b in zip(have, want, strict=True)])


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
