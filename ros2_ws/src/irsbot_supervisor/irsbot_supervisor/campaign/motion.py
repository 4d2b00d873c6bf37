"""Motion that is free of singularities, period by period: the work of the scenarios, and random swings."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count

import numpy as np

from irsbot_kinematics import Posture, Robot
from irsbot_kinematics.mechanism import Floats
from irsbot_supervisor.campaign.truth import (
    ENOUGH,
    HEADROOM,
    Array,
    followed,
    good_postures,
    joint_ranges,
    limits,
    margins_along,
)
from irsbot_supervisor.core.motion import JointPath, joint_limits_of
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.sim.scenario_file import read_scenario, scenario_robots
from irsbot_supervisor.sim.scenarios import plan
from irsbot_supervisor.sim.trajectory import swing

PERIOD_S = 0.001
WORK = "pick_and_place"
"""The scenario that is work and nothing else."""

BEYOND_S = 0.003
"""s beyond the latency that a stop may begin late: three periods."""

REST_S = 0.02
"""s that the joints stand between two swings."""

SHORTEST = 0.02
"""1: share of the joint ranges that the shortest swing covers."""

LOOKS, BRAKING = 120, 6
"""Points of a swing from which it is looked how the joints would brake, and points of each of these ways."""

Motion = Iterator[tuple[Floats, Floats]]
"""Joint positions and rates, one pair per period."""


def works() -> tuple[str, ...]:
    """The robots for which there is work."""
    return scenario_robots(WORK)


def work(robot: Robot, settings: Settings) -> Motion:
    """Pick and place as the scenario says, for ever."""
    motion = plan(read_scenario(WORK, robot), robot.mechanism, joint_limits_of(settings))
    for k in count():
        point = motion.at(k * PERIOD_S)
        yield point.position, point.velocity


def swings(robot: Robot, settings: Settings, rng: np.random.Generator) -> Motion:
    """Random swings at full speed, straight in joint space. They are free of singularities, and so is the way on which
    the joints would brake, each by itself, from anywhere on them."""
    low, high = joint_ranges(robot)
    here = good_postures(robot, settings, 1, rng)[0]
    at = robot.mechanism.posture(tuple(here.tolist()), settings.assembly_mode)
    while True:
        reach = (high - low) * SHORTEST ** rng.uniform(0.0, 1.0)
        there = np.clip(here + rng.uniform(-1.0, 1.0, len(here)) * reach, low, high)
        motion = swing(tuple(here.tolist()), tuple(there.tolist()), joint_limits_of(settings))
        if not _is_clean(motion, robot, settings, at):
            continue
        for t in np.arange(0.0, motion.duration_s + REST_S, PERIOD_S):
            point = motion.at(float(t))
            yield point.position, point.velocity
        here = there
        (at,) = followed(robot, there[None], at)  # whose label may be another one than at the start


def braking(position: Array, velocity: Array, gain: Array, settings: Settings, number: int) -> Array:
    """(number, n) points on the way to standstill if the joints keep an acceleration until a little later than the
    latency, and each then brakes by itself."""
    brakes, late = np.array(settings.deceleration_limit), settings.latency_s + BEYOND_S
    last = velocity + gain * late
    times = np.linspace(0.0, late + (np.abs(last) / brakes).max(), number)[:, None]
    going, slowing = np.minimum(times, late), np.clip(times - late, 0.0, np.abs(last) / brakes)
    way = (velocity + 0.5 * gain * going) * going + last * slowing - 0.5 * np.sign(last) * brakes * slowing**2
    return np.asarray(position + way)


def _is_clean(motion: JointPath, robot: Robot, settings: Settings, begin: Posture) -> bool:
    """Whether the margins are good wherever the joints would get: as they go, if their acceleration lasts, if they do
    not slow down as they are about to."""
    enough = np.minimum(HEADROOM * limits(settings, "warn"), ENOUGH)
    rows = []
    for t in np.linspace(0.0, motion.duration_s, LOOKS):
        position, velocity, gain = (np.array(part) for part in motion.at(float(t)))
        mean = _lasting(motion, float(t), settings)
        for kept in (gain, mean, np.where(velocity * mean < 0.0, 0.0, mean), np.zeros(len(gain))):
            out = braking(position, velocity, kept, settings, BRAKING)
            rows += [out, out[::-1]]  # and back, so that a branch can be followed through all of it
    return bool((margins_along(robot, settings, np.concatenate(rows), begin) >= enough).all())


def _lasting(motion: JointPath, t: float, settings: Settings) -> Array:
    """The acceleration of each joint as far as anybody can tell from the last samples: its mean over the latency, or
    over the last half or quarter of that where it speeds up more; if it stood before, growing on until it brakes."""
    span_s, slow = max(settings.latency_s, PERIOD_S), settings.standstill_speed

    def before(span_s: float) -> Array:
        return np.array(motion.at(max(t - span_s, 0.0)).velocity)

    velocity = before(0.0)
    found, half, quarter = ((velocity - before(share * span_s)) / (share * span_s) for share in (1.0, 0.5, 0.25))
    jerks = np.diff([before(k * PERIOD_S) for k in (4, 3, 2, 1, 0)], n=2, axis=0) / PERIOD_S**2
    jerk = np.where(velocity > 0.0, np.maximum(jerks.min(axis=0), 0.0), np.minimum(jerks.max(axis=0), 0.0))
    grown = quarter + jerk * (0.125 * span_s + 0.5 * (settings.latency_s + BEYOND_S))
    begun = (np.abs(before(span_s)) <= slow) & (np.abs(velocity) > slow)
    for later in (half, np.where(begun, grown, quarter)):
        found = np.where((later * velocity > 0.0) & (np.abs(later) > found * np.sign(velocity)), later, found)
    most = np.array(settings.deceleration_limit)
    return np.asarray(np.clip(found, -most, most))


def measured(position: Floats, settings: Settings) -> Floats:
    """What the encoders make of it: whole steps."""
    step = settings.encoder_resolution
    return tuple([round(value / step) * step for value in position]) if step > 0.0 else position
