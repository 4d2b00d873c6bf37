"""Positions that joints can reach until they stand, whatever their drives do: an independent oracle, from positions and
stamps.

A sample is the position at its stamped time, with the error of the encoder and of the motion during the jitter of the
stamp. The speed at that time is bounded by the motion since several earlier samples; the displacement until standstill
is bounded by acceleration, velocity limit and brakes. This module does not use the supervisor's core; it reads only the
limits from its settings.
"""

from __future__ import annotations

import numpy as np

from irsbot_kinematics import Posture, Robot
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.validation.harness.oracle import Array, accelerations, margins, margins_along, stamp_jitter_s

JUDGING_S = 0.005
"""s: longest time to judge a sample; not longer than the sample interval."""

CLEAR_OF_STOP = 1.2
"""1: multiple of the stop limits that all margins within reach keep where no stop is due."""

POINTS = {1: 5, 2: 5, 3: 5, 4: 4}
"""Points along each edge of a box, by the number of joints."""

AT_ONCE = 40_000
"""Postures that are solved at once."""


def errors(settings: Settings) -> Array:
    """(n,) rad or m: error of a position at its stamped time."""
    encoder = 0.5 * settings.encoder_resolution + settings.encoder_offset
    return np.asarray(encoder + stamp_jitter_s(settings) * np.array(settings.velocity_limit))


def fastest(stamps: Array, positions: Array, settings: Settings) -> tuple[Array, Array]:
    """(N, n) largest speed of each joint forward and backward at each sample, both at least 0.

    stamps: (N,) s, increasing. positions: (N, n) as measured. The first sample gives no bound.
    """
    return _forwards(stamps, positions, settings), _forwards(stamps, -positions, settings)


def _forwards(stamps: Array, positions: Array, settings: Settings) -> Array:
    gain, most, error = np.array(accelerations(settings)), np.array(settings.velocity_limit), errors(settings)
    bound = np.tile(most, (len(stamps), 1))
    # Long spans reduce the effect of errors, short ones that of changes of speed; both are equal here.
    useful_s = float(np.sqrt(4.0 * error / gain).max())
    lag, spread_s = 1, 0.0
    while lag < len(stamps) and spread_s < useful_s:
        span = (stamps[lag:] - stamps[:-lag])[:, None]
        mean = (positions[lag:] - positions[:-lag] + 2.0 * error) / span
        # A joint that moved backwards may have been stopped at any time since, and have gained speed from then on.
        bound[lag:] = np.minimum(bound[lag:], np.maximum(mean + 0.5 * gain * span, gain * span))
        lag, spread_s = 2 * lag, float(span.min())
    since = gain * stamps[:, None]
    return np.asarray(np.maximum(np.minimum(np.minimum.accumulate(bound - since, axis=0) + since, most), 0.0))


def reach(speeds: Array, horizon_s: Array | float, settings: Settings) -> Array:
    """(N, n) displacement of joints with speeds (N, n) if all brakes act after (N, 1) s, or one time for all."""
    gain, most = np.array(accelerations(settings)), np.array(settings.velocity_limit)
    speeding_s = np.minimum((most - speeds) / gain, horizon_s)
    last = np.minimum(speeds + gain * horizon_s, most)
    way = speeds * speeding_s + 0.5 * gain * speeding_s**2 + most * (horizon_s - speeding_s)
    return np.asarray(way + 0.5 * last**2 / np.array(settings.deceleration_limit))


def boxes(stamps: Array, positions: Array, settings: Settings, unseen_s: Array | float) -> tuple[Array, Array]:
    """(N, n) lowest and highest joint positions until standstill. unseen_s: (N, 1) s, or one time for all, from a stamp
    until the next sample has been judged; the latency is added."""
    ahead, back = fastest(stamps, positions, settings)
    horizon_s, error = unseen_s + settings.latency_s, errors(settings)
    return positions - error - reach(back, horizon_s, settings), positions + error + reach(ahead, horizon_s, settings)


def until_judged_s(interval_s: float, age_s: float = 0.0) -> float:
    """s from a stamp until the next sample has been judged. age_s: how long samples take to arrive."""
    return age_s + interval_s + min(interval_s, JUDGING_S)


def least_margins(robot: Robot, settings: Settings, low: Array, high: Array, begins: list[Posture]) -> Array:
    """(N, 4) smallest margins on a grid over boxes (N, n), corners included. begins: a posture of the branch in or near
    each box, for robots whose labels do not determine the branch; it is followed from there through the whole grid."""
    shares = _snake(POINTS[low.shape[1]], low.shape[1])
    if not robot.mechanism.label_is_invariant:
        grids = zip(low, high, begins, strict=True)
        return np.array([margins_along(robot, settings, a + shares * (b - a), at).min(axis=0) for a, b, at in grids])
    found = []
    for rows in np.array_split(np.arange(len(low)), max(len(low) * len(shares) // AT_ONCE, 1)):
        grid = low[rows, None] + shares * (high - low)[rows, None]
        at = margins(robot, settings, grid.reshape(-1, low.shape[1]))
        found.append(at.reshape(len(rows), len(shares), -1).min(axis=1))
    return np.concatenate(found)


def _snake(points: int, joints: int) -> Array:
    """(points^n, n) 0..1: the points of a grid in an order in which consecutive points are neighbours."""
    steps = np.linspace(0.0, 1.0, points)
    rows = np.zeros((1, 0))
    for _ in range(joints):
        turns = [
            np.column_stack((np.full(len(rows), step), rows[::-1] if k % 2 else rows)) for k, step in enumerate(steps)
        ]
        rows = np.concatenate(turns)
    return rows
