"""Places at rest that a supervisor allows, as near to a stop limit as it does: where attacks begin."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from irsbot_kinematics import Robot
from irsbot_msgs_py.records import SingularityState
from irsbot_supervisor.campaign.deceit import Attack, Deceit, Timing, told
from irsbot_supervisor.campaign.hostile import Course
from irsbot_supervisor.campaign.truth import Array, accelerations, good_postures, joint_ranges, limits, margins_along
from irsbot_supervisor.core.pipeline import Supervisor
from irsbot_supervisor.core.settings import Settings

PERIODS_S = (0.001, 0.001, 0.002, 0.0005)
BURSTS = (1, 1, 1, 4)
AGES_S = (0.0, 0.0005, 0.003)
COARSE = {"encoder_resolution": 5e-4, "encoder_offset": 2e-4}
"""Encoders of every fourth place."""

PROBE_S = 0.03
"""s at rest after which it is asked what is published."""
LOOKS = 200
"""Points of a line on which a stop limit is looked for."""
HALVINGS = 9
TRIES = 200
"""Lines without a place to begin at, one after another, until a robot is given up."""
PROBE = 1e-5
"""rad or m: step of the differences that give the slope of a margin."""


class Edge(NamedTuple):
    """A place at rest that is only just allowed."""

    settings: Settings
    timing: Timing
    place: Array  # (n,) rad or m
    down: Array  # (n,) -1..1: steepest descent of the margin nearest its stop limit, in units of the velocity limits

    def back(self, seconds: float) -> Edge:
        """A place as far up from here as full acceleration goes in this time."""
        way = 0.5 * self.down * np.array(accelerations(self.settings)) * seconds**2
        return self._replace(place=self.place - way)


def published(state: SingularityState | None) -> float:
    """1: what the published stop margin has above its limit, relative to it; NaN where nothing is known."""
    return (state.stop_margin - state.stop_limit) / state.stop_limit if state is not None else np.nan


def edges(robot: Robot, shipped: Settings, number: int, rng: np.random.Generator) -> Iterator[Edge]:
    """As many of them, on random lines from good postures to a stop limit; fewer if there are hardly any."""
    low, high = joint_ranges(robot)
    found = tries = 0
    while found < number and tries < TRIES:
        for start in good_postures(robot, shipped, 8, rng):
            coarse = (
                {name: max(value, getattr(shipped, name)) for name, value in COARSE.items()} if found % 4 == 3 else {}
            )
            settings = replace(shipped, dwell_s=0.0, **coarse)
            timing = Timing(float(rng.choice(PERIODS_S)), int(rng.choice(BURSTS)), float(rng.choice(AGES_S)))
            way = (high - low) * rng.uniform(-0.5, 0.5, len(start))
            place = _last_allowed(robot, settings, timing, start, way)
            down = None if place is None else descent(robot, settings, place)
            tries += 1
            if place is not None and down is not None:
                yield Edge(settings, timing, place, down)
                found, tries = found + 1, 0
            if found == number:
                return


def descent(robot: Robot, settings: Settings, place: Array) -> Array | None:
    """(n,) steepest descent of the margin nearest its stop limit, in units of the velocity limits and at most 1; None
    where there is none."""
    n, speeds, stop = len(place), np.array(settings.velocity_limit), limits(settings, "stop")
    around = np.repeat(place[None], 2 * n + 1, axis=0)
    around[1 : n + 1] += PROBE * np.eye(n)
    around[n + 1 :] -= PROBE * np.eye(n)
    found = margins_along(robot, settings, around)
    kind = int(((found[0] - stop) / stop).argmin())
    slope = (found[1 : n + 1, kind] - found[n + 1 :, kind]) * speeds
    steepest = np.abs(slope).max()
    return -slope / steepest if 0.0 < steepest < np.inf else None


def _last_allowed(robot: Robot, settings: Settings, timing: Timing, start: Array, way: Array) -> Array | None:
    """The place on a line where the supervisor is only just content; None if it is not at the start, or the line meets
    no stop limit."""
    shares = np.linspace(0.0, 1.0, LOOKS)
    crossed = (margins_along(robot, settings, start + shares[:, None] * way) < limits(settings, "stop")).any(axis=1)
    if not crossed.any() or not _published_at(robot, settings, timing, start) >= 0.0:
        return None
    near, far = 0.0, float(shares[crossed.argmax()])
    for _ in range(HALVINGS):
        middle = 0.5 * (near + far)
        if _published_at(robot, settings, timing, start + middle * way) >= 0.0:
            near = middle
        else:
            far = middle
    return start + near * way


def _published_at(robot: Robot, settings: Settings, timing: Timing, place: Array) -> float:
    """What is published at rest there."""
    number = max(round(PROBE_S / timing.period_s), 2 * timing.burst)
    nothing = Deceit("right", "rounded", np.zeros(len(place)), np.empty(0), np.empty(0), np.empty(0))
    rest = Attack(np.inf, np.zeros(len(place)))
    supervisor, state = Supervisor(settings, robot), None
    for sample in told(Course(place, (), settings), rest, nothing, timing, settings, 0, 0, number):
        state = supervisor.step(sample).state
    return published(state)
