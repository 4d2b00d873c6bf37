"""Cost of a stop: the distance until the robot stands, and the postures in which it cannot rest.

The reachable box grows with the latency, the time between samples, the acceleration of the drives, and the errors of
stamps. Each of them is halved in turn (the errors are left out) to show which improvement helps most.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import ceil, hypot, nan, sqrt
from operator import add
from typing import NamedTuple

import numpy as np

from irsbot_kinematics import Mechanism, Posture
from irsbot_kinematics.mechanism import Coordinate, Floats
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.configuration.stoppable_speed import candidates, postures
from irsbot_supervisor.core.assessment import SOLVED
from irsbot_supervisor.core.box_search import BoxBounds
from irsbot_supervisor.core.estimation.estimate import Speeds
from irsbot_supervisor.core.estimation.observer import Observer
from irsbot_supervisor.core.estimation.sample_interval import judging_time
from irsbot_supervisor.core.reachable_box import ReachableBox
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.stopping import cuts_of, goals_of, limits_of

POSTURES = 200
"""Number of postures above the stop limits in which the robot rests: their share is exact within a few per cent."""


SETTLED = 8
"""Multiple of the observer's window, and least number of samples, after which its bounds are constant."""


class Cost(NamedTuple):
    """Stopping distances of a machine, from the reachable box; errors of positions and stamps are included."""

    machine: str  # difference from the machine as stated
    free_s: float  # T: from a sample until brakes act, if the next sample is the one that stops
    from_rest: Floats  # rad or m per joint until it stands
    from_full: Floats  # rad or m per joint at its velocity limit
    platform_rest_m: float  # m that the platform goes at most while one joint does that; NaN if it gets lost
    platform_full_m: float
    stopped: float  # share of the postures above the stop limits in which a resting robot is stopped


def costs(settings: Settings, mechanism: Mechanism, rate_hz: float) -> list[Cost]:
    """The machine as it is, and with one property improved at a time."""
    half = tuple([0.5 * gain for gain in settings.acceleration_limit])
    machines = [
        ("as stated", settings, rate_hz),
        ("half of latency_s", replace(settings, latency_s=0.5 * settings.latency_s), rate_hz),
        ("twice the rate", settings, 2.0 * rate_hz),
        ("half of acceleration_limit", replace(settings, acceleration_limit=half), rate_hz),
        ("stamp_jitter_s 0", replace(settings, stamp_jitter_s=0.0), rate_hz),
    ]
    best = next(candidates(settings, mechanism), None)
    places = places_above_stop(settings, mechanism)
    return [_cost(what, machine, mechanism, 1.0 / rate, best, places) for what, machine, rate in machines]


def speeds_at_rest(settings: Settings, joints: tuple[Coordinate, ...], period_s: float) -> Speeds:
    """rad/s or m/s: speed bound of a joint whose measured position does not change."""
    observer, still = Observer(settings, joints), (0.0,) * len(joints)
    speeds = observer.restart(0, still)
    errors = zip(ReachableBox(settings).errors, settings.acceleration_limit, strict=True)
    window_s = max(sqrt(4.0 * error / gain) for error, gain in errors)
    for sample in range(1, SETTLED * ceil(window_s / period_s) + SETTLED):
        speeds = observer.update(round(sample * period_s * NS_PER_S), still) or speeds
    return speeds


def free_time(settings: Settings, period_s: float) -> float:
    """T, s: from a sample, which is not delayed, until brakes act, if the next sample is the one that stops."""
    return prediction_delay(settings, period_s) + settings.latency_s


def prediction_delay(settings: Settings, period_s: float) -> float:
    """G + J, s: from a sample, which is not delayed, until the next one is judged."""
    return max(period_s, settings.least_gap_s) + longest_judging(settings, period_s)


def longest_judging(settings: Settings, period_s: float) -> float:
    """J, s: longest time to judge a sample. period_s: between samples."""
    return judging_time(settings.judging_s, max(period_s, settings.least_gap_s))


def box_ways(settings: Settings, speeds: Speeds, free_s: float) -> tuple[Floats, Floats]:
    """rad or m from the measured positions to the ends of the reachable box, forward and backward."""
    reach = ReachableBox(settings)
    forward, backward = reach.until_rest(speeds, free_s)
    return tuple(map(add, forward, reach.errors)), tuple(map(add, backward, reach.errors))


def ways_at_rest(settings: Settings, mechanism: Mechanism, period_s: float) -> Floats:
    """The same of a resting robot, in either direction."""
    speeds = speeds_at_rest(settings, mechanism.joints, period_s)
    return box_ways(settings, speeds, free_time(settings, period_s))[0]


def box_around(at: Posture, ways: Floats) -> tuple[Floats, Floats]:
    """Low and high ends, rad or m, of the box with these half extents."""
    low = tuple([q - way for q, way in zip(at.joints, ways, strict=True)])
    return low, tuple([q + way for q, way in zip(at.joints, ways, strict=True)])


def platform_way(mechanism: Mechanism, at: Posture, joint: int, travel: float) -> float:
    """m: displacement of the platform while one joint moves from a posture, the longer of both directions."""
    ways = []
    for sign in (1.0, -1.0):
        moved = tuple([q + sign * travel if k == joint else q for k, q in enumerate(at.joints)])
        there = mechanism.posture(moved, at.assembly_mode)
        pairs = zip(there.pose, at.pose, mechanism.task, strict=True)
        ways.append(hypot(*[a - b for a, b, axis in pairs if not axis.is_angle]))
    return max(ways) if all(way == way for way in ways) else nan


def places_above_stop(settings: Settings, mechanism: Mechanism) -> list[Posture]:
    """Postures above the stop limits, an even sample."""
    found, stop = postures(settings, mechanism), np.array(limits_of(settings, "stop"))
    kept = found.joints[(found.margins >= stop).all(axis=1)]
    rows = kept[:: max(len(kept) // POSTURES, 1)]
    solved = [mechanism.posture(tuple(row.tolist()), settings.assembly_mode) for row in rows]
    return [at for at in solved if at.status == SOLVED]


def _cost(
    what: str, settings: Settings, mechanism: Mechanism, period_s: float, best: Posture | None, places: list[Posture]
) -> Cost:
    free_s, fastest = free_time(settings, period_s), Speeds(settings.velocity_limit, settings.velocity_limit)
    rest = ways_at_rest(settings, mechanism, period_s)
    full = box_ways(settings, fastest, free_s)[0]
    slow_m, fast_m = [nan if best is None else _farthest(mechanism, best, way) for way in (rest, full)]
    return Cost(what, free_s, rest, full, slow_m, fast_m, stopped_at_rest(settings, mechanism, places, rest))


def _farthest(mechanism: Mechanism, at: Posture, ways: Floats) -> float:
    each = [platform_way(mechanism, at, joint, way) for joint, way in enumerate(ways)]
    return max(each) if all(way == way for way in each) else nan


def stopped_at_rest(settings: Settings, mechanism: Mechanism, places: Sequence[Posture], ways: Floats) -> float:
    """Share of postures around which a box cannot be certified with the supervisor's number of cuts. ways: half extents
    of the box, rad or m."""
    bounds, (_, no_stop) = BoxBounds(mechanism, settings.slack_m), goals_of(settings, cuts_of(settings))
    lost = 0
    for at in places:
        low, high = box_around(at, ways)
        lost += not no_stop.is_proved_by(bounds.search(at, low, high))
    return lost / len(places) if places else 1.0
