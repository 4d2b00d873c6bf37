"""The legs of a mechanism as rods, computed from `legs` alone, so that declared bounds are compared with its own
equations.

`legs` can be evaluated at any joints and any pose, also if they do not close. The line of a screw passes through the
near end of its rod and the attachment, so lines from several poses meet in the near end.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos
from typing import Any, NamedTuple

import numpy as np

from irsbot_kinematics.mechanism import Mechanism, Posture
from irsbot_kinematics.numerics.arithmetic import ARRAYS, Array

APART = 0.3
"""1: distance of the poses from which lines are taken, as a share of the characteristic length."""
ALIKE = 1e-9
"""1: differences of places and lengths, over the characteristic length, that are rounding errors."""
CIRCLE_RAD = 0.5
"""rad: range on both sides of a joint over which the centre of a crank is computed from its near end."""
ALONG = 0.1
"""1: the same for a slide, over the characteristic length."""


class Rods(NamedTuple):
    """The n legs of a posture as rods in the plane (d = 2) or in space (d = 3)."""

    directions: Array
    """(n, d) unit vectors, from the near end to the platform."""
    attachments: Array
    """(n, d) m, attachment vectors; 0 if the platform cannot turn."""
    near: Array
    """(n, d) m, their near ends."""
    length: Array
    """(n,) m."""
    tangents: Array
    """(n, d) unit vectors along which the joints move the near ends; 0 for near ends that do not move."""
    cranks: Array
    """(n, d) m, from the axis of a crank to its near end; 0 if there is no crank."""
    rails: Array
    """(n,) m, the range of a carriage; 0 if the near end is not on a rail."""
    measured: Array
    """(n,) 1 if the length of the rod is a length of the machine; 0 if the rod consists of several links."""

    @property
    def turning(self) -> bool:
        """True if the platform turns: there is one more rod than directions."""
        return self.directions.shape[0] > self.directions.shape[1]


def rods_at(mechanism: Mechanism, at: Posture) -> Rods | None:
    """The rods of a posture; None if the legs are not rods."""
    angles = np.array([axis.is_angle for axis in mechanism.joints])
    ranges = np.array([axis.upper - axis.lower for axis in mechanism.joints])
    size = mechanism.length_m
    step = np.where(angles, CIRCLE_RAD, ALONG * size)
    found = moved(mechanism, at, np.array(at.joints) + np.array([[0.0], [-1.0], [1.0]]) * step)
    if found is None:
        return None
    (near, before, after), lengths = found
    chord, bend = after - before, before + after - 2.0 * near
    way = np.linalg.norm(chord, axis=1)
    moves = way > ALIKE * size
    tangents = np.where(moves[:, None], chord / np.where(moves, way, 1.0)[:, None], 0.0)
    cranks = np.where((angles & moves)[:, None], -bend / (2.0 - 2.0 * cos(CIRCLE_RAD)), 0.0)
    rails = np.where(moves & ~angles & np.isfinite(ranges), ranges, 0.0)
    measured = np.abs(lengths[1] + lengths[2] - 2.0 * lengths[0]) < ALIKE * size
    directions = units(np.array(at.screws)[:, : near.shape[1]])
    return Rods(directions, _arms(at), near, lengths[0], tangents, cranks, rails, measured.astype(float))


def moved(mechanism: Mechanism, at: Posture, joints: Array) -> tuple[Array, Array] | None:
    """Near ends (N, n, d) and lengths (N, n), m, at joints (N, n) for a fixed platform; None if the lines of a screw do
    not meet: then the legs are not rods."""
    attachments, size = _arms(at), mechanism.length_m
    n, d = attachments.shape
    away = APART * size * np.concatenate([np.eye(d), -np.eye(d)])
    poses = np.array(at.pose) + np.pad(away, ((0, 0), (0, len(at.pose) - d)))
    q, x = np.repeat(joints, len(poses), axis=0), np.tile(poses, (len(joints), 1))
    legs = mechanism.legs(ARRAYS, tuple(q.T), tuple(x.T))
    shape = (len(joints), len(poses), n)
    r = units(np.array([_table(row[:d], len(q)).T for row in legs.screws])).swapaxes(0, 1).reshape(*shape, d)
    closure = np.abs(_table(legs.closure, len(q)).T.reshape(shape))
    held = poses[:, None, :d] + attachments
    across = np.eye(d) - r[..., None] * r[..., None, :]
    try:
        near = np.linalg.solve(across.sum(axis=1), (across @ held[..., None]).sum(axis=1))[..., 0]
    except np.linalg.LinAlgError:
        return None
    rods = held - near[:, None]
    aside = np.linalg.norm((across @ rods[..., None])[..., 0], axis=-1)
    far = np.linalg.norm(rods, axis=-1)
    # |far - length| is the closure error: of the two lengths that fit the first pose, one fits the others
    lengths = np.stack([far[:, 0] - closure[:, 0], far[:, 0] + closure[:, 0]])
    left = np.abs(np.abs(far - lengths[:, :, None]) - closure).max(axis=2)
    if not (aside.max() < ALIKE * size and left.min(axis=0).max() < ALIKE * size):
        return None
    return near, np.where(left[0] < left[1], lengths[0], lengths[1])


def units(vectors: Array) -> Array:
    """Vectors (.., d) over their lengths."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def _table(values: Sequence[Any], number: int) -> Array:
    """(values, N): arrays, or numbers repeated for all samples."""
    return np.array([np.broadcast_to(value, number) for value in values], dtype=float)


def _arms(at: Posture) -> Array:
    """(n, d)"""
    if not at.attachments:
        return np.zeros((len(at.joints), len(at.pose)))
    return np.pad(np.array(at.attachments), ((0, 0), (0, len(at.pose) - 3)))
