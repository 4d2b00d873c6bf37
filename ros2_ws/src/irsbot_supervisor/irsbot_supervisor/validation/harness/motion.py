"""Motion without singularities, period by period: the cycles of the scenarios, and random swings."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count

import numpy as np

from irsbot_kinematics import Posture, Robot
from irsbot_kinematics.mechanism import Floats
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.sim.scenario_file import read_scenario, scenario_robots
from irsbot_supervisor.sim.scenarios import plan
from irsbot_supervisor.sim.trajectory import joint_move
from irsbot_supervisor.trajectory.joint_path import JointPath, joint_limits_of
from irsbot_supervisor.validation.harness.oracle import (
    ENOUGH,
    HEADROOM,
    followed,
    good_postures,
    joint_ranges,
    limits,
    margins_along,
)

PERIOD_S = 0.001
WORK = "pick_and_place"
"""The scenario that contains only clean work."""

REST_S = 0.02
"""s that the joints stand between two swings."""

SHORTEST = 0.02
"""1: share of the joint ranges that the shortest swing covers."""

SLOWEST = 0.2
"""1: share of the fastest swing that the slowest one has."""

LOOKS = 120
"""Points of a swing at which its margins are evaluated."""

Motion = Iterator[tuple[Floats, Floats]]
"""Joint positions and rates, one pair per period."""


def works() -> tuple[str, ...]:
    """Robots with a cycle of work."""
    return scenario_robots(WORK)


def work(robot: Robot, settings: Settings) -> Motion:
    """Pick and place as the scenario defines it, without end."""
    motion = plan(read_scenario(WORK, robot), robot.mechanism, joint_limits_of(settings))
    for k in count():
        point = motion.at(k * PERIOD_S)
        yield point.position, point.velocity


def swings(robot: Robot, settings: Settings, rng: np.random.Generator) -> Motion:
    """Random swings at up to full speed, straight in joint space, with large margins everywhere."""
    low, high = joint_ranges(robot)
    here = good_postures(robot, settings, 1, rng)[0]
    at = robot.mechanism.posture(tuple(here.tolist()), settings.assembly_mode)
    while True:
        reach = (high - low) * SHORTEST ** rng.uniform(0.0, 1.0)
        there = np.clip(here + rng.uniform(-1.0, 1.0, len(here)) * reach, low, high)
        speed = float(rng.uniform(SLOWEST, 1.0))
        motion = joint_move(tuple(here.tolist()), tuple(there.tolist()), joint_limits_of(settings), speed)
        if not _is_clean(motion, robot, settings, at):
            continue
        yield from played(motion)
        here = there
        (at,) = followed(robot, there[None], at)  # whose label may be another one than at the start


def played(path: JointPath) -> Motion:
    """A path from its begin to its end, and a rest there."""
    for t in np.arange(0.0, path.duration_s + REST_S, PERIOD_S):
        point = path.at(float(t))
        yield point.position, point.velocity


def _is_clean(motion: JointPath, robot: Robot, settings: Settings, begin: Posture) -> bool:
    """True if the margins are large everywhere."""
    enough = np.minimum(HEADROOM * limits(settings, "warn"), ENOUGH)
    way = np.array([motion.at(float(t)).position for t in np.linspace(0.0, motion.duration_s, LOOKS)])
    return bool((margins_along(robot, settings, way, begin) >= enough).all())


def measured(position: Floats, settings: Settings) -> Floats:
    """Encoder readings: whole steps."""
    step = settings.encoder_resolution
    return tuple([round(value / step) * step for value in position]) if step > 0.0 else position
