"""How long this computer takes to judge a sample, and the number of cuts that follows."""

from __future__ import annotations

import time
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from itertools import product
from math import inf

from irsbot_kinematics import Mechanism, Posture, Robot
from irsbot_msgs_py.records import Floats, JointSample, Level
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.configuration.stopping_cost import (
    box_around,
    box_ways,
    free_time,
    longest_judging,
    stopped_at_rest,
    ways_at_rest,
)
from irsbot_supervisor.core.box_search import BoxBounds
from irsbot_supervisor.core.estimation.estimate import Speeds
from irsbot_supervisor.core.estimation.sample_interval import SETTLING
from irsbot_supervisor.core.margins import margins_of
from irsbot_supervisor.core.settings import Settings, time_for_cuts
from irsbot_supervisor.core.supervisor import Supervisor

REPETITIONS = 5
"""Number of times that work is done; the fastest counts, which excludes other work of the computer."""

TRIED = (0, 1, 2, 4, 8, 12)
"""Numbers of cuts that are tried."""

PLACES = 8
"""Number of places from which robots move until they are stopped."""

MOVES = 40
"""Number of samples of such a motion at most."""

BEGIN_NS = 10**15


def longest_times(
    settings: Settings, robot: Robot, period_s: float, tried: Collection[int], places: Sequence[Posture]
) -> dict[int, float]:
    """s by number of cuts: longest time to judge a sample. The longest step that was met; and, as steps may need all
    their cuts at once, the longest step without cuts and the boxes of the cuts. places: `places_above_stop`."""
    box_s = longest_box_s(settings, robot.mechanism, period_s, places)
    steps = {cuts: longest_step_s(settings, robot, cuts, period_s, places) for cuts in {0, *tried}}
    return {
        cuts: max(steps[cuts], steps[0] + 2 * cuts * box_s, time_for_cuts(box_s, cuts)) for cuts in sorted(set(tried))
    }


def longest_box_s(settings: Settings, mechanism: Mechanism, period_s: float, places: Sequence[Posture]) -> float:
    """s: longest time to bound one box, around these postures, as far as joints at rest, at half and at full speed go
    until they stand. 0 if there is none."""
    bounds, longest_ns = BoxBounds(mechanism, settings.slack_m), 0.0
    half = tuple([0.5 * speed for speed in settings.velocity_limit])
    moving = [Speeds(speeds, speeds) for speeds in (half, settings.velocity_limit)]
    free_s = free_time(settings, period_s)
    sizes = [ways_at_rest(settings, mechanism, period_s), *[box_ways(settings, speeds, free_s)[0] for speeds in moving]]
    for at, ways in product(places, sizes):
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


def longest_step_s(settings: Settings, robot: Robot, cuts: int, period_s: float, places: Sequence[Posture]) -> float:
    """s: longest step of a supervisor that makes at most so many cuts for a sample. Robots begin in some of these
    postures, and speed up as hard as they can until they are stopped. 0 if there is none."""
    judging_s = longest_judging(settings, period_s)
    timed = replace(settings, bounding_s=judging_s / time_for_cuts(1.0, cuts), judging_s=judging_s)
    longest_ns = 0
    for k, at in enumerate(places[:: max(len(places) // PLACES, 1)]):
        signs = [1.0 if k >> joint & 1 else -1.0 for joint in range(len(at.joints))]
        runs = [_steps_ns(timed, robot, at.joints, signs, period_s) for _ in range(REPETITIONS)]
        longest_ns = max(longest_ns, *map(min, zip(*runs, strict=True)))
    return longest_ns * 1e-9


def _steps_ns(settings: Settings, robot: Robot, joints: Floats, signs: list[float], period_s: float) -> list[int]:
    """ns of every step from the moment in which a robot begins to move until it is stopped."""
    supervisor, taken = Supervisor(settings, robot), []
    rest = round(SETTLING * settings.stale_s / period_s) + 2
    for k in range(rest + MOVES):
        moved_s, now_ns = max(k - rest, 0) * period_s, round(k * period_s * NS_PER_S)
        position, velocity = [], []
        for q, sign, v, a in zip(joints, signs, settings.velocity_limit, settings.acceleration_limit, strict=True):
            speed = min(a * moved_s, v)
            position.append(q + sign * speed * (moved_s - 0.5 * speed / a))
            velocity.append(sign * speed)
        sample = JointSample(
            BEGIN_NS + now_ns,
            BEGIN_NS + now_ns,
            NS_PER_S + now_ns,
            settings.joint_names,
            tuple(position),
            tuple(velocity),
        )
        begin_ns = time.perf_counter_ns()
        verdict = supervisor.step(sample).verdict
        taken.append(time.perf_counter_ns() - begin_ns)
        if k > rest and verdict is not None and verdict.level >= Level.STOP:
            break
    return taken[rest:]


def cuts_that_pay(
    settings: Settings,
    mechanism: Mechanism,
    bounding_s: Mapping[int, float],
    period_s: float,
    places: Sequence[Posture],
) -> int:
    """The number of cuts with which a resting robot is stopped in the fewest postures: every cut proves more, and takes
    time in which the joints can move, so that the box grows. bounding_s: by the number of cuts. places:
    `places_above_stop`."""
    found = []
    for cuts, box_s in bounding_s.items():
        judging_s = max(time_for_cuts(box_s, cuts), settings.judging_s)
        timed = replace(settings, bounding_s=box_s, judging_s=judging_s)
        ways = ways_at_rest(timed, mechanism, period_s)
        found.append((stopped_at_rest(timed, mechanism, places, ways), cuts))
    return min(found)[1]
