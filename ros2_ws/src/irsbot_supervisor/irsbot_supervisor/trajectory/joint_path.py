"""Motions of joints: limits, a path of cubics through points, and points in the form of a message."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import isfinite, sqrt
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from irsbot_kinematics.mechanism import Floats
from irsbot_kinematics.numerics.arithmetic import Array

if TYPE_CHECKING:
    from irsbot_supervisor.core.settings import Settings


class BadTrajectory(ValueError):
    """Points or limits that are not a motion of these joints."""


@dataclass(frozen=True)
class JointLimits:
    """Limits of the drives, per joint: rad/s or m/s, rad/s2 or m/s2."""

    velocity: Floats
    acceleration: Floats
    """Of planned motion, for accelerating and braking."""
    deceleration: Floats
    """Of the brakes."""

    def __post_init__(self) -> None:
        if not len(self.velocity) == len(self.acceleration) == len(self.deceleration):
            raise BadTrajectory(f"limits must have one entry per joint each, got {self}")
        if not all(isfinite(limit) and limit > 0.0 for limit in self.velocity + self.acceleration + self.deceleration):
            raise BadTrajectory(f"limits must be positive and finite, got {self}")


def joint_limits_of(settings: Settings) -> JointLimits:
    """The limits of the drives for planning. A plan brakes no harder than it accelerates."""
    gains = tuple(map(min, settings.acceleration_limit, settings.deceleration_limit))
    return JointLimits(settings.velocity_limit, gains, settings.deceleration_limit)


class JointPoint(NamedTuple):
    """Position, velocity and acceleration of the joints at one time; rad or m."""

    position: Floats
    velocity: Floats
    acceleration: Floats


class Motion(Protocol):
    """A motion that the drives can follow."""

    @property
    def duration_s(self) -> float: ...
    def at(self, time_s: float) -> JointPoint: ...


@dataclass(frozen=True)
class JointPath:
    """Joint positions and velocities at increasing times, with cubics between them.

    times: (N,) s, beginning with 0. positions: (N, n) rad or m. velocities: (N, n). Before the first and after the last
    time the joints stand.
    """

    times: Floats
    positions: tuple[Floats, ...]
    velocities: tuple[Floats, ...]

    def __post_init__(self) -> None:
        if not len(self.times) == len(self.positions) == len(self.velocities) >= 1:
            raise BadTrajectory("a joint path needs as many positions and velocities as times, and at least one")
        if not (self.times[0] == 0.0 and all(b > a for a, b in pairwise(self.times)) and isfinite(self.times[-1])):
            raise BadTrajectory("the times of a joint path must begin with 0 and increase")
        if not np.isfinite(np.array(self.positions + self.velocities)).all():
            raise BadTrajectory("the positions and velocities of a joint path must be finite")

    @property
    def duration_s(self) -> float:
        return self.times[-1]

    def at(self, time_s: float) -> JointPoint:
        """Joint positions after `time_s`."""
        times = self.times
        if not 0.0 <= time_s < times[-1]:
            rest = (0.0,) * len(self.positions[0])
            return JointPoint(self.positions[0 if time_s < 0.0 else -1], rest, rest)
        i = bisect_right(times, time_s) - 1
        t = time_s - times[i]
        position, velocity, acceleration = [], [], []
        for q, v, a, jerk in self._cubics[i]:
            change = t * jerk
            position.append(q + t * (v + t * (0.5 * a + change / 6.0)))
            velocity.append(v + t * (a + 0.5 * change))
            acceleration.append(a + change)
        return JointPoint(tuple(position), tuple(velocity), tuple(acceleration))

    @cached_property
    def _cubics(self) -> list[tuple[tuple[float, ...], ...]]:
        """Position, velocity, acceleration and jerk of each joint at the begin of each interval."""
        times, q, v = np.array(self.times), np.array(self.positions), np.array(self.velocities)
        a, after = _accelerations(times, q, v)
        jerk = (after - a) / np.diff(times)[:, None]
        rows: list[tuple[tuple[float, ...], ...]] = np.stack((q[:-1], v[:-1], a, jerk), axis=-1).tolist()
        return rows

    @cached_property
    def peaks(self) -> tuple[Floats, Floats]:
        """Largest |velocity| and |acceleration| of each joint, exact for the cubics."""
        return peaks_of(np.array(self.times), np.array(self.positions), np.array(self.velocities))

    def stretched(self, factor: float) -> JointPath:
        """The same path with its time multiplied by `factor`."""
        return JointPath(
            tuple(t * factor for t in self.times),
            self.positions,
            tuple(tuple(v / factor for v in row) for row in self.velocities),
        )

    def excess(self, limits: JointLimits) -> float:
        """Factor by which time has to be stretched to respect the limits; at most 1 if it does."""
        return excess_of(self.peaks, limits)


class Command(NamedTuple):
    """Points in robot order."""

    times: tuple[float, ...]  # s from now
    positions: tuple[Floats, ...]
    velocities: tuple[Floats, ...]  # empty where the points have none


def commanded(
    joints: Sequence[str],
    names: Sequence[str],
    times: Sequence[float],
    positions: Sequence[Sequence[float]],
    velocities: Sequence[Sequence[float]],
) -> Command:
    """Points of a message in robot order. Raises BadTrajectory unless every joint is named once."""
    if not times:
        return Command((), (), ())
    if sorted(names) != sorted(joints):
        raise BadTrajectory(f"the joints are {', '.join(joints)}, the command names {', '.join(names) or 'none'}")
    with_rates = any(velocities)
    for row in (*positions, *(velocities if with_rates else ())):
        if len(row) != len(names):
            raise BadTrajectory(f"every point needs {len(names)} positions, and {len(names)} velocities or none")
    order = [list(names).index(joint) for joint in joints]
    picked = [[tuple(row[i] for i in order) for row in rows] for rows in (positions, velocities if with_rates else ())]
    return Command(tuple(times), tuple(picked[0]), tuple(picked[1]))


def path_through(
    times: Sequence[float], positions: Sequence[Floats], velocities: Sequence[Floats], n: int
) -> JointPath:
    """Commanded points of n joints as a path that begins with the first of them. Raises BadTrajectory."""
    rows = [*positions, *velocities]
    if len(positions) != len(times) or len(velocities) not in (0, len(times)) or any(len(row) != n for row in rows):
        raise BadTrajectory(f"every point needs {n} positions, and {n} velocities or none")
    if not times[0] >= 0.0:
        raise BadTrajectory(f"the first point lies in the past: {times[0]!r} s")
    shifted = tuple(time - times[0] for time in times)
    rates = [tuple(row) for row in velocities] or _slopes(times, positions)
    if any(rates[-1]):
        raise BadTrajectory(f"the last point must be at rest, its velocities are {rates[-1]}")
    return JointPath(shifted, tuple(map(tuple, positions)), tuple(rates))


def _slopes(times: Sequence[float], positions: Sequence[Floats]) -> list[Floats]:
    """Velocities between the neighbours of each point; at rest at both ends."""
    rates: list[Floats] = [(0.0,) * len(positions[0])] * len(times)
    for i in range(1, len(times) - 1):
        span = times[i + 1] - times[i - 1]
        rates[i] = tuple((b - a) / span for a, b in zip(positions[i - 1], positions[i + 1], strict=True))
    return rates


def _accelerations(times: Array, q: Array, v: Array) -> tuple[Array, Array]:
    """Accelerations at the begin and the end of each interval's cubic."""
    h = np.diff(times)[:, None]
    mean = np.diff(q, axis=0) / h
    return (6.0 * mean - 4.0 * v[:-1] - 2.0 * v[1:]) / h, (2.0 * v[:-1] + 4.0 * v[1:] - 6.0 * mean) / h


def peaks_of(times: Array, q: Array, v: Array) -> tuple[Floats, Floats]:
    """Largest |velocity| and |acceleration| of each joint."""
    a0, a1 = _accelerations(times, q, v)
    # Inside an interval the velocity is extreme where the acceleration, linear in time, passes zero.
    turns = a0 * a1 < 0.0
    when = np.divide(a0, a0 - a1, out=np.zeros_like(a0), where=turns) * np.diff(times)[:, None]
    inside = np.where(turns, v[:-1] + 0.5 * a0 * when, 0.0)
    return _largest(v, inside), _largest(a0, a1)


def _largest(*arrays: Array) -> Floats:
    """Largest absolute value in each column of all arrays."""
    each = np.max([np.abs(array).max(axis=0, initial=0.0) for array in arrays], axis=0)
    return tuple(each.tolist())


def excess_of(peaks: tuple[Floats, Floats], limits: JointLimits) -> float:
    by_velocity = max(peak / limit for peak, limit in zip(peaks[0], limits.velocity, strict=True))
    by_acceleration = max(peak / limit for peak, limit in zip(peaks[1], limits.acceleration, strict=True))
    return max(by_velocity, sqrt(by_acceleration))
