"""Motions in joint space within the joints' limits.

A path is sampled, converted by the inverse kinematics of one working mode and unwrapped. A smooth time law is then
stretched until no joint exceeds its velocity and acceleration limits, also between the samples.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from functools import lru_cache
from itertools import accumulate
from math import inf, tau
from typing import Protocol

import numpy as np

from irsbot_kinematics import Mechanism
from irsbot_kinematics.batch import inverse_many
from irsbot_kinematics.mechanism import Floats, Signs
from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_kinematics.numerics.tolerances import REACH_TOL_M
from irsbot_supervisor.sim.errors import BadPath
from irsbot_supervisor.sim.paths import RoundedPath
from irsbot_supervisor.trajectory.joint_path import JointLimits, JointPath, JointPoint, Motion, excess_of, peaks_of

KNOTS = 257
"""Samples of one task-space move; between them the joints move on cubics, whose limits are checked exactly."""

RAMPS = (0.5, 0.4, 0.3, 0.2, 0.14, 0.1, 0.07, 0.05)
"""Shares of the time for acceleration, and the same for deceleration, that are tried; the fastest law is used."""


class MotionSequence:
    """Motions one after another, each repeated a number of times; the last may be repeated without end (`inf` times).

    Every motion begins at the end of the one before, and a repeated one ends where it begins.
    """

    def __init__(self, parts: Sequence[tuple[Motion, float]]) -> None:
        self._parts = tuple(motion for motion, times in parts if times > 0.0)
        lengths = [
            motion.duration_s * times if motion.duration_s > 0.0 else 0.0 for motion, times in parts if times > 0.0
        ]
        self._starts = list(accumulate(lengths, initial=0.0))
        if not self._parts:
            raise BadPath("a sequence of motions needs at least one motion that runs at least once")

    @property
    def duration_s(self) -> float:
        return self._starts[-1]

    def at(self, time_s: float) -> JointPoint:
        """Joint positions after `time_s`."""
        if not time_s < self.duration_s:
            last = self._parts[-1]
            return last.at(last.duration_s)
        i = max(bisect_right(self._starts, time_s) - 1, 0)
        motion, within = self._parts[i], time_s - self._starts[i]
        return motion.at(within % motion.duration_s if within >= 0.0 else within)


def stand(position: Floats, seconds: float = 0.0) -> JointPath:
    """Rest."""
    rest = (0.0,) * len(position)
    if not seconds > 0.0:
        return JointPath((0.0,), (position,), (rest,))
    return JointPath((0.0, seconds), (position, position), (rest, rest))


def joint_move(start: Floats, goal: Floats, limits: JointLimits, speed: float = 1.0) -> JointPath:
    """From rest to rest on a straight line in joint space, at `speed` (0..1] of the fastest."""
    span = np.array(goal) - np.array(start)
    return _fastest(lambda share: np.array(start) + share[:, None] * span, limits, speed)


def task_move(
    mechanism: Mechanism, path: RoundedPath, mode: Signs, near: Floats, limits: JointLimits, *, speed: float = 1.0
) -> JointPath:
    """From rest to rest along a path in task space, in one working mode, at `speed` (0..1] of the fastest.

    near: joint positions before the move; the joints begin in the same turn. Raises BadPath where the path leaves
    the workspace.
    """

    def joints(share: Array) -> Array:
        poses = path.at(share * path.length_m)
        positions, _, reach = inverse_many(mechanism, poses, mode)
        if not (reach >= -REACH_TOL_M).all():
            worst = int(np.argmin(reach))
            where = ", ".join(f"{value:.4g}" for value in poses[worst])
            raise BadPath(f"the path leaves the workspace at ({where}) by {-reach[worst] * 1e3:.1f} mm")
        return np.column_stack(
            [
                _unwrapped(column, start) if coordinate.is_angle else column
                for column, start, coordinate in zip(positions.T, near, mechanism.joints, strict=True)
            ]
        )

    return _fastest(joints, limits, speed)


def nearest_turn(mechanism: Mechanism, joints: Sequence[float], near: Floats) -> Floats:
    """Joint positions with every angle moved by whole turns to be closest to `near`."""
    return tuple(
        float(_unwrapped(np.array([value]), start)[0]) if coordinate.is_angle else value
        for value, start, coordinate in zip(joints, near, mechanism.joints, strict=True)
    )


class _Sampler(Protocol):
    def __call__(self, share: Array, /) -> Array: ...


def _fastest(joints: _Sampler, limits: JointLimits, speed: float) -> JointPath:
    """The shortest of the time laws with different ramps, then slowed down to `speed`."""
    if not 0.0 < speed <= 1.0:
        raise BadPath(f"speed must be in (0, 1], got {speed!r}")
    least = inf
    best: tuple[Array, Array] = np.zeros((1, 1)), np.zeros((1, 1))
    times = np.linspace(0.0, 1.0, KNOTS)
    for ramp in RAMPS:
        positions = joints(_time_law(times, ramp))
        velocities = _spline_rates(positions)
        excess = excess_of(peaks_of(times, positions, velocities), limits)
        if excess < least:
            least, best = excess, (positions, velocities)
    positions, velocities = best
    if not least > 0.0:
        return stand(tuple(positions[0].tolist()))
    duration = least / speed
    return JointPath(
        tuple((times * duration).tolist()),
        tuple(map(tuple, positions.tolist())),
        tuple(map(tuple, (velocities / duration).tolist())),
    )


def _time_law(t: Array, ramp: float) -> Array:
    """Share of the path (0..1) after a share t of the time: the speed rises and falls as a smoothstep of length
    ramp."""
    u, v = np.minimum(t / ramp, 1.0), np.minimum((1.0 - t) / ramp, 1.0)
    rising, falling = u * u * u * (1.0 - 0.5 * u), v * v * v * (1.0 - 0.5 * v)
    steady = np.clip(t - ramp, 0.0, 1.0 - 2.0 * ramp)
    share: Array = (ramp * (rising + 0.5 - falling) + steady) / (1.0 - ramp)
    return share


def _spline_rates(positions: Array) -> Array:
    """Velocities that make cubics through KNOTS positions of the unit interval twice continuously differentiable,
    at rest at both ends."""
    velocities: Array = np.zeros(positions.shape)
    velocities[1:-1] = _spline_solver() @ (3.0 * (KNOTS - 1) * (positions[2:] - positions[:-2]))
    return velocities


@lru_cache(maxsize=1)
def _spline_solver() -> Array:
    inner = KNOTS - 2
    return np.asarray(np.linalg.inv(4.0 * np.eye(inner) + np.eye(inner, k=1) + np.eye(inner, k=-1)), dtype=np.float64)


def _unwrapped(angles: Array, near: float) -> Array:
    """Angles without jumps, beginning in the turn closest to `near`."""
    turns: Array = np.unwrap(angles)
    turns += round((near - float(turns[0])) / tau) * tau
    return turns
