"""How long this computer takes to bound the margins over one box, and the number of cuts that follows."""

from __future__ import annotations

import time
from dataclasses import replace
from math import inf

from irsbot_kinematics import Mechanism
from irsbot_supervisor.configuration.stopping_cost import (
    box_around,
    box_ways,
    free_time,
    places_above_stop,
    stopped_at_rest,
    ways_at_rest,
)
from irsbot_supervisor.core.box_search import BoxBounds
from irsbot_supervisor.core.estimation.estimate import Speeds
from irsbot_supervisor.core.margins import margins_of
from irsbot_supervisor.core.settings import Settings, time_for_cuts

REPETITIONS = 5
"""Number of times that a box is bounded; the fastest counts, which excludes other work of the computer."""

TRIED = (0, 1, 2, 4, 8, 12)
"""Numbers of cuts that are tried."""


def longest_box_s(settings: Settings, mechanism: Mechanism, period_s: float) -> float:
    """s: longest time to bound one box, around postures above the stop limits, as far as joints at full speed go until
    they stand. 0 if there is no such posture."""
    bounds, longest_ns = BoxBounds(mechanism, settings.slack_m), 0.0
    fastest = Speeds(settings.velocity_limit, settings.velocity_limit)
    ways, _ = box_ways(settings, fastest, free_time(settings, period_s))
    for at in places_above_stop(settings, mechanism):
        low, high = box_around(at, ways)
        # No box around a posture is proved to keep the margins of the posture itself: every bound is tried.
        type1, type2, constraint, limb = (margin if margin < inf else -inf for margin in margins_of(at))
        taken_ns = inf
        for _ in range(REPETITIONS):
            begin_ns = time.perf_counter_ns()
            bounds.least(at, low, high, (type1, type2, constraint, limb), 0)
            taken_ns = min(taken_ns, time.perf_counter_ns() - begin_ns)
        longest_ns = max(longest_ns, taken_ns)
    return longest_ns * 1e-9


def cuts_that_pay(settings: Settings, mechanism: Mechanism, bounding_s: float, period_s: float) -> int:
    """The number of cuts with which a resting robot is stopped in the fewest postures: every cut proves more, and takes
    time in which the joints can move, so that the box grows."""
    places, found = places_above_stop(settings, mechanism), []
    for cuts in TRIED:
        judging_s = max(time_for_cuts(bounding_s, cuts), settings.judging_s)
        timed = replace(settings, bounding_s=bounding_s, judging_s=judging_s)
        ways = ways_at_rest(timed, mechanism, period_s)
        found.append((stopped_at_rest(timed, mechanism, places, ways), cuts))
    return min(found)[1]
