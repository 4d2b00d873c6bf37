"""Oracle of the campaign: margins of the true joint positions, by the batch solver.

It does not use the supervisor's core; it reads only the limits from the settings.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from math import inf, isfinite, pi

import numpy as np
from numpy.typing import NDArray

import irsbot_kinematics as irs
from irsbot_kinematics import Evaluations, Posture, Robot, Status
from irsbot_kinematics.batch import evaluate_many
from irsbot_supervisor.configuration.loading import robot_of, shipped_values
from irsbot_supervisor.core.settings import Settings

Array = NDArray[np.float64]

MARGINS = ("type1", "type2", "constraint", "limb")
"""Columns of the margins, with the names of the settings."""

HEADROOM = 1.5
"""1: a good posture has margins of at least this multiple of the warning limits."""

ENOUGH = 0.75
"""1: a margin as large as this is good for every warning limit."""

MOST_TRIED = 4096
"""Number of joint positions that are tried at once."""

WIDEST = 4.0
"""Multiple of `length_m`, on both sides of zero, over which slides without limits are searched."""

STAMP_JITTER_S = 5e-5
"""s: error of a stamp if the settings do not state it: a sender without real-time priority."""

ROUNDING = 1e-9
"""1: a margin that is below its limit by less than this has not crossed it."""

NEAR = 0.02
"""rad, or share of `length_m`: largest joint motion between two steps along a branch that has to be followed."""


@lru_cache(maxsize=1)
def supervised() -> tuple[str, ...]:
    """All presets that have shipped settings."""
    return tuple(name for name in irs.robots() if shipped_values(robot_of(name)))


def limits(settings: Settings, which: str) -> Array:
    """(4,) the `warn` or `stop` limits."""
    return np.array([getattr(settings, f"{margin}_{which}") for margin in MARGINS])


def accelerations(settings: Settings) -> tuple[float, ...]:
    """(n,) rad/s2 or m/s2: acceleration of each drive; its deceleration if it is not stated."""
    stated: tuple[float, ...] = getattr(settings, "acceleration_limit", ())
    return stated or settings.deceleration_limit


def stamp_jitter_s(settings: Settings) -> float:
    """s: largest error of a stamp."""
    jitter: float = getattr(settings, "stamp_jitter_s", STAMP_JITTER_S)
    return jitter


def joint_ranges(robot: Robot) -> tuple[Array, Array]:
    """(n,) lowest and highest joint positions to examine: one turn of an angle, the travel of a slide."""
    low, high = [], []
    for joint in robot.mechanism.joints:
        far = pi if joint.is_angle else WIDEST * robot.mechanism.length_m
        low.append(joint.lower if isfinite(joint.lower) else -far)
        high.append(joint.upper if isfinite(joint.upper) else far)
    return np.array(low), np.array(high)


def margins(robot: Robot, settings: Settings, Q: Array) -> Array:
    """(N, 4) smallest margins of independent postures (N, n): 0 if not assembled, infinite if the robot does not have
    the margin."""
    return _margins(evaluate_many(robot.mechanism, Q, settings.assembly_mode))


def _margins(found: Evaluations) -> Array:
    none = np.full(len(found.status), inf)
    limb = found.limb_margin.min(axis=1) if found.limb_margin.shape[1] else none
    constraint = np.where(np.isnan(found.constraint_margin), none, found.constraint_margin)
    columns = np.column_stack((found.type1_margin.min(axis=1), found.type2_margin, constraint, limb))
    return np.where((found.status == Status.SOLVED)[:, None], columns, 0.0)


def margins_along(robot: Robot, settings: Settings, way: Array, begin: Posture | None = None) -> Array:
    """(N, 4) the same along a path (N, n) that begins in the configured branch: 0 from the point where it is no longer
    assembled. If labels do not determine the branch it is followed, from `begin` if that is given."""
    if robot.mechanism.label_is_invariant:
        return margins(robot, settings, way)
    begin = begin or robot.mechanism.posture(tuple(way[0].tolist()), settings.assembly_mode)
    found = np.zeros((len(way), len(MARGINS)))
    for k, at in enumerate(followed(robot, way, begin)):
        if at.status != Status.SOLVED:
            break
        constraint = at.constraint if at.constraint == at.constraint else inf
        found[k] = min(at.type1), at.type2, constraint, min(at.limb, default=inf)
    return found


def followed(robot: Robot, way: Array, begin: Posture) -> Iterator[Posture]:
    """The postures of a path on the branch of `begin`, followed in steps as small as `NEAR`."""
    mechanism, at = robot.mechanism, begin
    lever = np.array([1.0 if joint.is_angle else mechanism.length_m for joint in mechanism.joints])
    for row in way:
        before = np.array(at.joints)
        steps = max(int(np.ceil(np.abs((row - before) / lever).max() / NEAR)), 1)
        for step in range(1, steps + 1):
            if at.status == Status.SOLVED:
                at = mechanism.track(tuple((before + (row - before) * step / steps).tolist()), at)
        yield at


def good_postures(robot: Robot, settings: Settings, number: int, rng: np.random.Generator) -> Array:
    """(number, n) random joint positions in the configured modes, with margins well above the warning limits."""
    low, high = joint_ranges(robot)
    enough = np.minimum(HEADROOM * limits(settings, "warn"), ENOUGH)
    rows, tried = np.empty((0, len(low))), 64
    while len(rows) < number:
        found = evaluate_many(robot.mechanism, rng.uniform(low, high, (tried, len(low))), settings.assembly_mode)
        good = (_margins(found) >= enough).all(axis=1) & (found.working_mode == settings.working_mode).all(axis=1)
        rows = np.concatenate((rows, found.joint_position[good]))
        tried = min(2 * tried, MOST_TRIED)
    return rows[:number]
