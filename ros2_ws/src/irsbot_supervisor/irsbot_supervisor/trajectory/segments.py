"""Motion of the joints between trajectory points, and bounds over its parts.

Points with velocities are connected by cubics, points without by straight lines, as in trajectory controllers.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_supervisor.trajectory.joint_path import BadTrajectory


class JointSegments:
    """Cubic or straight segments of a joint motion. times: (N,) s. q: (N, n) rad or m. v: (N, n) rad/s or m/s, or None.

    low, high: (N - 1, n) exact bounds of each joint over each segment.
    """

    def __init__(
        self, n: int, times_s: Sequence[float], positions: Sequence[Sequence[float]], rates: Sequence[Sequence[float]]
    ) -> None:
        """n: number of joints. times_s: (N,) s, increasing. positions: (N, n). rates: (N, n), or empty for straight
        segments. Raises BadTrajectory for wrong shapes, for values that are not finite, and for times that do not
        increase."""
        try:
            self.times = np.array(times_s, dtype=float)
            self.q = np.array(positions, dtype=float).reshape(len(self.times), -1)
            self.v = np.array(rates, dtype=float).reshape(len(self.times), -1) if len(rates) else None
        except ValueError:
            raise BadTrajectory("each time needs positions, and velocities or none, one per joint") from None
        if len(self.times) < 1 or self.q.shape[1] != n or (self.v is not None and self.v.shape[1] != n):
            raise BadTrajectory(f"a trajectory needs points with {n} positions (and {n} velocities or none)")
        if not (np.isfinite(self.times).all() and (np.diff(self.times) > 0.0).all()):
            raise BadTrajectory("the times must be finite and increase")
        if not (np.isfinite(self.q).all() and (self.v is None or np.isfinite(self.v).all())):
            raise BadTrajectory("positions and velocities must be finite")
        self.low, self.high = self._ranges()

    def _ranges(self) -> tuple[Array, Array]:
        """Exact bounds of each joint over each segment: ends, and where the cubic's rate is zero."""
        a, b = self.q[:-1], self.q[1:]
        low, high = np.minimum(a, b), np.maximum(a, b)
        if self.v is None or not len(a):
            return low, high
        c1, c2, c3 = self._cubic
        with np.errstate(invalid="ignore", divide="ignore"):
            root = np.sqrt(c2 * c2 - 3.0 * c1 * c3)
            half = -(c2 + np.copysign(root, c2))  # no cancellation
            for u in (half / (3.0 * c3), c1 / half):
                inner = np.where((u > 0.0) & (u < 1.0), a + u * (c1 + u * (c2 + u * c3)), a)
                low, high = np.minimum(low, inner), np.maximum(high, inner)
        return low, high

    @cached_property
    def _cubic(self) -> tuple[Array, Array, Array]:
        """Coefficients over the unit interval: q = a + u (c1 + u (c2 + u c3))."""
        assert self.v is not None
        dt = np.diff(self.times)[:, np.newaxis]
        rise = np.diff(self.q, axis=0)
        c1 = self.v[:-1] * dt
        end = self.v[1:] * dt
        return c1, 3.0 * rise - 2.0 * c1 - end, c1 + end - 2.0 * rise

    def part(self, segment: int, start: float, end: float) -> tuple[Array, Array]:
        """Lower and upper bounds (n,) of the joints over a part of a segment; start, end: shares 0..1 of its time."""
        a = self.q[segment]
        if self.v is None:
            rise = self.q[segment + 1] - a
            first, last = a + start * rise, a + end * rise
            return np.minimum(first, last), np.maximum(first, last)
        c1, c2, c3 = (c[segment] for c in self._cubic)
        middle, half = 0.5 * (start + end), 0.5 * (end - start)
        value = a + middle * (c1 + middle * (c2 + middle * c3))
        slope = np.abs(c1 + middle * (2.0 * c2 + 3.0 * middle * c3))
        bend = np.abs(2.0 * c2 + 6.0 * middle * c3)
        reach = half * (slope + half * (0.5 * bend + half * np.abs(c3)))  # Taylor, exact for a cubic
        return value - reach, value + reach

    def rates(self, segment: int, start: float, end: float) -> tuple[Array, Array]:
        """Lower and upper bounds (n,) of the joint velocities over a part of a segment, rad/s or m/s."""
        dt = float(self.times[segment + 1] - self.times[segment])
        if self.v is None:
            rate = (self.q[segment + 1] - self.q[segment]) / dt
            return rate, rate
        c1, c2, c3 = (c[segment] for c in self._cubic)
        middle, half = 0.5 * (start + end), 0.5 * (end - start)
        value = c1 + middle * (2.0 * c2 + 3.0 * middle * c3)
        reach = half * (np.abs(2.0 * c2 + 6.0 * middle * c3) + 3.0 * half * np.abs(c3))
        return (value - reach) / dt, (value + reach) / dt
