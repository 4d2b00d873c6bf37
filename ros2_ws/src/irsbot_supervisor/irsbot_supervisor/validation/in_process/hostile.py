"""Motion of adversarial joints, exact: pieces of constant acceleration within the limits of the drives.

A joint never moves faster than its velocity limit and never accelerates faster than its acceleration limit. It may slow
down at any rate: only the brakes of a stop have a stated deceleration.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from math import copysign, inf
from typing import NamedTuple

import numpy as np

from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.validation.harness.oracle import Array, accelerations

LONG_AGO_S = -1e3
"""s: before the first push all joints have stood since then."""


class Push(NamedTuple):
    """From a moment on, every joint changes to its own speed, independently."""

    begin_s: float
    speeds: Array  # (n,) rad/s or m/s, signed
    gain: float = 1.0  # share of the acceleration limit while a joint gets faster
    hardness: float = 1.0  # times the acceleration limit while it gets slower


class Piece(NamedTuple):
    """Motion of one joint from a moment until the next piece."""

    begin_s: float
    position: float
    speed: float
    acceleration: float

    def at(self, time_s: float) -> tuple[float, float]:
        """Position and speed at a time."""
        t = time_s - self.begin_s
        return self.position + t * (self.speed + 0.5 * t * self.acceleration), self.speed + t * self.acceleration


class DrivenMotion:
    """Motion of all joints. From rest at `start`, through pushes in the order of time."""

    def __init__(self, start: Array, pushes: Sequence[Push], settings: Settings) -> None:
        self._settings = settings
        limits = zip(start.tolist(), settings.velocity_limit, accelerations(settings), strict=True)
        self._joints = [_pieces(j, q, pushes, most, gain) for j, (q, most, gain) in enumerate(limits)]

    def at(self, times: Array) -> tuple[Array, Array]:
        """(N, n) positions and speeds at times (N,)."""
        columns: list[tuple[Array, Array]] = []
        for pieces in self._joints:
            begins, *rest = np.array(pieces).T
            index = np.searchsorted(begins, times, side="right") - 1
            q, v, a = (values[index] for values in rest)
            t = times - begins[index]
            columns.append((q + t * (v + 0.5 * t * a), v + t * a))
        positions, speeds = zip(*columns, strict=True)
        return np.column_stack(positions), np.column_stack(speeds)

    def braked(self, begin_s: float, brakes: Array) -> tuple[DrivenMotion, float]:
        """The same motion with every joint braking from a moment on (rad/s2 or m/s2, each), and the time at which the
        last one stands."""
        driven = object.__new__(DrivenMotion)
        driven._settings, driven._joints, rest_s = self._settings, [], begin_s
        for pieces, brake in zip(self._joints, brakes.tolist(), strict=True):
            kept = pieces[: bisect_right([piece.begin_s for piece in pieces], begin_s)]
            q, v = kept[-1].at(begin_s)
            slowing = Piece(begin_s, q, v, -copysign(brake, v) if v else 0.0)
            end_s = begin_s + abs(v) / brake
            driven._joints.append([*kept, slowing, Piece(end_s, slowing.at(end_s)[0], 0.0, 0.0)])
            rest_s = max(rest_s, end_s)
        return driven, rest_s


def _pieces(joint: int, q: float, pushes: Sequence[Push], most: float, gain: float) -> list[Piece]:
    """The pieces of one joint. most: its velocity limit; gain: its acceleration limit."""
    pieces, v = [Piece(LONG_AGO_S, q, 0.0, 0.0)], 0.0
    ends = [*(push.begin_s for push in pushes), inf][1:]
    for push, end in zip(pushes, ends, strict=True):
        t, wanted = push.begin_s, max(-most, min(float(push.speeds[joint]), most))
        while t < end:
            if v == wanted:
                goal, a = v, 0.0
            elif v != 0.0 and (v * wanted <= 0.0 or abs(wanted) < abs(v)):
                goal, a = (0.0 if v * wanted <= 0.0 else wanted), -copysign(push.hardness * gain, v)
            else:
                goal, a = wanted, copysign(push.gain * gain, wanted)
            piece = Piece(t, q, v, a)
            pieces.append(piece)
            reached = t + (goal - v) / a if a else inf
            if reached >= end:
                if end < inf:
                    q, v = piece.at(end)
                t = end
            else:
                q, _ = piece.at(reached)
                t, v = reached, goal
    return pieces
