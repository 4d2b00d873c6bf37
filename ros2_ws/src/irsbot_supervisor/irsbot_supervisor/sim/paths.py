"""Paths in task space: straight pieces with rounded corners, smooth enough for a drive."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_supervisor.sim.errors import BadPath


class RoundedPath:
    """Poses connected by straight pieces with rounded corners, as a twice continuously differentiable curve.

    corners: (k, m) task coordinates, k >= 2.
    rounding_m: distance before and after a corner at which the rounding begins and ends.
    angle_m: lever that converts rad of a task angle into m of path; 1 for lengths, one value per task coordinate.
    """

    def __init__(self, corners: Sequence[Sequence[float]], rounding_m: float, angle_m: Sequence[float]) -> None:
        points = np.array(corners, dtype=float)
        steps = np.diff(points, axis=0)
        lengths = np.sqrt(((steps * np.array(angle_m)) ** 2).sum(axis=1))
        if not (len(points) >= 2 and np.isfinite(points).all() and (lengths > 0.0).all()):
            raise BadPath(f"a path needs two or more different poses in a row, got {points.tolist()}")
        self._points, self._ahead = points, steps / lengths[:, None]
        self._cut = np.full(len(points), float(rounding_m))
        self._cut[0] = self._cut[-1] = 0.0
        straight = lengths - self._cut[:-1] - self._cut[1:]
        if not (self._cut >= 0.0).all() or not (straight >= 0.0).all():
            tight = int(np.argmin(straight))
            raise BadPath(
                f"rounding_m {rounding_m:g} does not fit into piece {tight + 1}, which is {lengths[tight]:g} m long"
            )
        # Alternating straight pieces and corners; a corner counts twice its cut, its length before it was rounded.
        pieces = np.empty(2 * len(straight) - 1)
        pieces[0::2], pieces[1::2] = straight, 2.0 * self._cut[1:-1]
        self._starts = np.concatenate(([0.0], np.cumsum(pieces)))
        self.length_m = float(self._starts[-1])

    def at(self, s_m: Array) -> Array:
        """Poses (N, m) at distances (N,) along the path, 0..length_m."""
        piece = np.clip(np.searchsorted(self._starts, s_m, side="right") - 1, 0, len(self._starts) - 2)
        within = s_m - self._starts[piece]
        leg = piece // 2
        poses: Array = self._points[leg] + self._ahead[leg] * (self._cut[leg] + within)[:, None]
        turning = piece % 2 == 1
        corner = leg[turning] + 1
        cut = self._cut[corner]
        share = np.divide(within[turning], 2.0 * cut, out=np.zeros_like(cut), where=cut > 0.0)
        bend = _bend(share)[:, None] * self._ahead[corner] - _bend(1.0 - share)[:, None] * self._ahead[corner - 1]
        poses[turning] = self._points[corner] + cut[:, None] * bend
        return poses


def _bend(u: Array) -> Array:
    """From 0 to 1 with slope 2 at the end and zero curvature at both ends: connects straight pieces smoothly."""
    return u * u * u * (2.0 - u)


def corners_of(start: Sequence[float], steps: Sequence[Sequence[float]]) -> list[tuple[float, ...]]:
    """Poses reached from a start by displacements, the start included."""
    poses = [tuple(start)]
    for step in steps:
        poses.append(tuple(a + b for a, b in zip(poses[-1], step, strict=True)))
    return poses
