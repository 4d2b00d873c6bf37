"""What happens until the robot stands still: the path of braking, and the smallest margins along it, certified.

After the latency every joint brakes with its own constant deceleration. The path is monotonic per joint, so every
stretch of it lies in a box of joint positions, and the mechanism bounds its margins over a box from below. One box for
the whole path usually settles the question; where it does not, the path is cut, worst stretch first.
"""

from __future__ import annotations

from heapq import heappop, heappush
from math import copysign, inf
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


class Foresight:
    """Follows the braking path of a mechanism under given settings."""

    def __init__(self, settings: Settings, mechanism: Mechanism) -> None:
        self._mechanism = mechanism
        self._latency = settings.latency_s
        self._brakes = settings.deceleration_limit
        self._error = position_error(settings)
        self._slack_m = settings.geometry_tolerance_m
        self._wanted = limits_of(settings, "warn")
        self._stop = limits_of(settings, "stop")

    def foresee(self, at: Posture, velocity: Floats, ahead_s: float, wanted: Margins | None = None) -> Outlook:
        """Certified margins until standstill from a solved posture, if the joints go on as they are for `ahead_s` and
        the latency, then brake. NaN velocities give floors of 0. wanted: bounds that high are good enough, lower ones
        are made sharper. If left out the warning limits, and more is done before a bound falls below a stop limit."""
        latency, error = self._latency + ahead_s, self._error
        travel, reach, stop_s = [], [], 0.0
        for rate, brake in zip(velocity, self._brakes, strict=True):
            speed = abs(rate)
            time_s = speed / brake
            path = speed * (latency + 0.5 * time_s)
            travel.append(copysign(path, rate))
            reach.append(path + error)
            if not time_s <= stop_s:
                stop_s = time_s
        stop_s += latency
        if not stop_s < inf:
            return Outlook(nothing_of(at), tuple(travel), inf)
        whole = self._mechanism.guarantee(at, reach, self._slack_m)
        floor = floor_of(whole)
        stop, wanted = self._stop if wanted is None else None, wanted or self._wanted
        if not (floor[0] >= wanted[0] and floor[1] >= wanted[1] and floor[2] >= wanted[2] and floor[3] >= wanted[3]):
            floor = self._cut(at, velocity, latency, stop_s, wanted, stop)
        return Outlook(floor, tuple(travel), stop_s)

    def position(self, joints: Floats, velocity: Floats, latency_s: float, time_s: float) -> Floats:
        """Joint positions `time_s` after the sample when the robot begins to brake `latency_s` after it."""
        coasting = min(time_s, latency_s)
        braking = max(time_s - latency_s, 0.0)
        reached = []
        for q, v, a in zip(joints, velocity, self._brakes, strict=True):
            t = min(braking, abs(v) / a)
            reached.append(q + v * (coasting + t) - (0.5 * a * t * t if v > 0.0 else -0.5 * a * t * t))
        return tuple(reached)

    def _cut(
        self,
        at: Posture,
        velocity: Floats,
        latency_s: float,
        stop_s: float,
        wanted: Margins,
        stop: Margins | None,
    ) -> Margins:
        """Bounds along the path in stretches; the stretch farthest below what is wanted is cut next. stop: limits
        below which no bound shall fall as long as the margins themselves do not."""
        stretches: list[Stretch] = []
        nothing = nothing_of(at)

        def ends(start: float, end: float) -> tuple[Floats, Floats]:
            begun, over = (self.position(at.joints, velocity, latency_s, time_s) for time_s in (start, end))
            return begun, over

        def add(start: float, end: float, begin: Posture) -> Posture:
            floor, middle, after = self._bound(begin, *ends(start, end), nothing)
            heappush(stretches, (_spare(floor, wanted), start, end, floor, begin, middle))
            return after

        def halve(stretch: Stretch) -> None:
            _lack, start, end, _floor, begin, _middle = stretch
            middle = 0.5 * (start + end)
            add(middle, end, add(start, middle, begin))

        add(0.0, stop_s, at)
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
