"""Postures that a supervisor only just allows, next to a stop limit: attacks begin there."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from math import ceil, inf
from typing import NamedTuple

import numpy as np

from irsbot_kinematics import Robot
from irsbot_msgs_py.records import JointSample, Level, SingularityState
from irsbot_supervisor.core.estimation.sample_interval import SETTLING
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.validation.harness.oracle import (
    Array,
    accelerations,
    good_postures,
    joint_ranges,
    limits,
    margins_along,
)
from irsbot_supervisor.validation.in_process.deceit import Attack, Deceit, Timing, told
from irsbot_supervisor.validation.in_process.hostile import DrivenMotion, Push

PERIODS_S = (0.001, 0.001, 0.002, 0.0005)
BURSTS = (1, 1, 1, 4)
AGES_S = (0.0, 0.0005, 0.003)
COARSE = {"encoder_resolution": 5e-4, "encoder_offset": 2e-4}
"""Encoder resolution of every fourth place."""

STROLL, SETTLED_S = 0.2, 0.02
"""1: share of full speed on the way from the base of an edge; s for which the robot then stands."""
ASIDE_S = 0.006
"""s of full acceleration: at this distance from an edge, errors do not forbid a posture that is allowed without
them."""
PROBE_S = 0.03
"""s at rest after which the published state is read."""
WARM = 1.15
"""1: multiple of the wait for OK for which a robot stands before anything begins."""
LOOKS = 200
"""Number of points on a line at which a stop limit is searched."""
HALVINGS, ROUGH_HALVINGS = 9, 4
TRIES = 200
"""Number of consecutive lines without a usable place before a robot is given up."""
PROBE = 1e-5
"""rad or m: step of the differences that give the slope of a margin."""


class Edge(NamedTuple):
    """A posture that is only just allowed: at rest, or to a robot that walks there slowly from the base."""

    settings: Settings
    timing: Timing
    place: Array  # (n,) rad or m
    base: Array  # (n,) from where a straight line leads to the place
    afar: bool  # a robot that is switched on at the place is not let go; it has to come from the base
    down: Array  # (n,) -1..1: steepest descent of the margin nearest its stop limit, in units of the velocity limits

    def back(self, seconds: float) -> Edge:
        """The posture, and the base too, farther from the limit by the path of full acceleration in this time."""
        path = 0.5 * np.array(accelerations(self.settings)) * seconds**2
        place, away = self.place - self.down * path, self.base - self.place
        farthest = np.abs(away).max()
        return self._replace(place=place, base=self.base + (away / farthest * path if farthest > 0.0 else 0.0))


def published(state: SingularityState | None) -> float:
    """1: distance of the published stop margin from its limit, relative to it; NaN if it is not known."""
    return (state.stop_margin - state.stop_limit) / state.stop_limit if state is not None else np.nan


def edges(robot: Robot, shipped: Settings, number: int, rng: np.random.Generator) -> Iterator[Edge]:
    """Postures on random lines from good postures to a stop limit; fewer than requested if there are hardly any."""
    low, high = joint_ranges(robot)
    found = tries = 0
    while found < number and tries < TRIES:
        for start in good_postures(robot, shipped, 8, rng):
            coarse = (
                {name: max(value, getattr(shipped, name)) for name, value in COARSE.items()} if found % 4 == 3 else {}
            )
            settings = replace(shipped, dwell_s=0.0, **coarse)
            timing = Timing(float(rng.choice(PERIODS_S)), int(rng.choice(BURSTS)), float(rng.choice(AGES_S)))
            beyond = _beyond(robot, settings, start, (high - low) * rng.uniform(-0.5, 0.5, len(start)))
            tries += 1
            begin = Edge(settings, timing, start, start, False, np.zeros(len(start)))
            edge = None if beyond is None else _edge(robot, begin, beyond)
            if edge is not None:
                yield edge
                found, tries = found + 1, 0
            if found == number:
                return


def _edge(robot: Robot, begin: Edge, beyond: Array) -> Edge | None:
    """The edge on the line from a good posture to one beyond a stop limit; None if there is none. begin: at the good
    one."""
    edge = _at(robot, begin, _last_allowed(robot, begin, beyond))
    if edge is None or _is_let_go(robot, edge, edge.back(ASIDE_S).place):
        return edge
    if not _is_let_go(robot, edge, edge.base):
        return None
    afar = edge._replace(base=_last_start(robot, edge), afar=True)
    return _at(robot, afar, _stopped_at(robot, afar, beyond))


def _at(robot: Robot, edge: Edge, place: Array | None) -> Edge | None:
    """The same at another place; None if no margin has a slope there."""
    down = None if place is None else descent(robot, edge.settings, place)
    return None if place is None or down is None else edge._replace(place=place, down=down)


def descent(robot: Robot, settings: Settings, place: Array) -> Array | None:
    """(n,) steepest descent of the margin nearest its stop limit, in units of the velocity limits and at most 1; None
    if there is none."""
    n, speeds, stop = len(place), np.array(settings.velocity_limit), limits(settings, "stop")
    around = np.repeat(place[None], 2 * n + 1, axis=0)
    around[1 : n + 1] += PROBE * np.eye(n)
    around[n + 1 :] -= PROBE * np.eye(n)
    found = margins_along(robot, settings, around)
    kind = int(((found[0] - stop) / stop).argmin())
    slope = (found[1 : n + 1, kind] - found[n + 1 :, kind]) * speeds
    steepest = np.abs(slope).max()
    return -slope / steepest if 0.0 < steepest < np.inf else None


def _beyond(robot: Robot, settings: Settings, start: Array, way: Array) -> Array | None:
    """The first posture beyond a stop limit on a line; None if it meets none."""
    shares = np.linspace(0.0, 1.0, LOOKS)
    crossed = (margins_along(robot, settings, start + shares[:, None] * way) < limits(settings, "stop")).any(axis=1)
    return start + shares[crossed.argmax()] * way if crossed.any() else None


def _last_allowed(robot: Robot, begin: Edge, beyond: Array) -> Array | None:
    """The posture on a line that is only just allowed; None if its begin is not allowed."""

    def is_allowed(place: Array) -> bool:
        return _published_at(robot, begin.settings, begin.timing, place) >= 0.0

    return _last(begin.place, beyond, is_allowed, HALVINGS) if is_allowed(begin.place) else None


def _last(start: Array, end: Array, holds: Callable[[Array], bool], halvings: int) -> Array:
    """The last posture for which something holds, on a line from one where it does to one where it does not."""
    near, far = 0.0, 1.0
    for _ in range(halvings):
        middle = 0.5 * (near + far)
        near, far = (middle, far) if holds(start + middle * (end - start)) else (near, middle)
    return np.asarray(start + near * (end - start))


def _published_at(robot: Robot, settings: Settings, timing: Timing, place: Array) -> float:
    """State that is published at rest in a posture."""
    supervisor, state = Supervisor(settings, robot), None
    for sample in _standing(settings, timing, place, PROBE_S):
        state = supervisor.step(sample).state
    return published(state)


def _is_let_go(robot: Robot, edge: Edge, place: Array) -> bool:
    """True if a robot that is switched on there, and stands, is allowed to move after the wait for OK."""
    supervisor, level = Supervisor(edge.settings, robot), Level.UNKNOWN
    for sample in _standing(edge.settings, edge.timing, place, wait_s(edge.settings, edge.timing)):
        verdict = supervisor.step(sample).verdict
        level = level if verdict is None else verdict.level
    return level < Level.STOP


def _stopped_at(robot: Robot, edge: Edge, beyond: Array) -> Array:
    """Where a robot was that walks from the base to a posture beyond a limit, when its last sample was allowed."""
    start, pushes, seconds = walk(edge, beyond)
    settings, timing = edge.settings, edge.timing
    number = ceil((wait_s(settings, timing) + seconds) / timing.period_s)
    supervisor, driven, allowed = Supervisor(settings, robot), DrivenMotion(start, pushes, settings), 0
    samples = told(driven, _at_rest(beyond), _exact(beyond, "missing"), timing, settings, number, 0, number)
    for k, sample in enumerate(samples):
        verdict = supervisor.step(sample).verdict
        if verdict is not None and verdict.level < Level.STOP:
            allowed = k
        elif verdict is not None and allowed:
            break
    return np.asarray(driven.at(np.array([(allowed - number) * timing.period_s]))[0][0])


def walk(edge: Edge, goal: Array) -> tuple[Array, tuple[Push, ...], float]:
    """Slow motion from the base of an edge: where it starts, the pushes, and s until it ends, at rest, at time 0."""
    settings, way = edge.settings, goal - edge.base
    full = np.array(settings.velocity_limit)
    seconds = float(np.abs(way / full).max()) / STROLL + SETTLED_S
    pushes = Push(-seconds - SETTLED_S, way / seconds), Push(-SETTLED_S, 0.0 * full)
    short = goal - DrivenMotion(edge.base, pushes, settings).at(np.zeros(1))[0][0]
    return edge.base + short, pushes, seconds + SETTLED_S


def _last_start(robot: Robot, edge: Edge) -> Array:
    """The posture nearest to an edge, on the line to it, in which a robot that is switched on is allowed to move."""
    return _last(edge.base, edge.place, lambda place: _is_let_go(robot, edge, place), ROUGH_HALVINGS)


def wait_s(settings: Settings, timing: Timing) -> float:
    """s after which a standing robot in an allowed posture may move."""
    return WARM * SETTLING * settings.stale_s + timing.burst * timing.period_s


def _standing(settings: Settings, timing: Timing, place: Array, seconds: float) -> list[JointSample]:
    number = max(ceil(seconds / timing.period_s), 2 * timing.burst)
    driven = DrivenMotion(place, (), settings)
    return told(driven, _at_rest(place), _exact(place, "right"), timing, settings, 0, 0, number)


def _at_rest(place: Array) -> Attack:
    return Attack(inf, np.zeros(len(place)))


def _exact(place: Array, lie: str) -> Deceit:
    """Positions without errors but those of rounding."""
    return Deceit(lie, "rounded", np.zeros(len(place)), np.empty(0), np.empty(0), np.empty(0))
