"""Solutions of the direct kinematics near a seed pose, and whether the seed distinguishes them."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from irsbot_kinematics import batch
from irsbot_kinematics.mechanism import Mechanism
from irsbot_kinematics.numerics.arithmetic import ARRAYS, Array
from irsbot_kinematics.numerics.tolerances import SEEN_SHARE


def nearest_solutions(
    mechanism: Mechanism, Q: Array, seed: Array
) -> tuple[Array, NDArray[np.uint8], NDArray[np.int_], Array]:
    """The solution nearest to a seed pose (m,) for joints (N, n), per row: poses, status, assembly modes, and assembly
    clearances in m."""
    answers = [batch.direct_many(mechanism, Q, mode) for mode in mechanism.assembly_modes]
    away = np.array([_away(mechanism, poses, seed) for poses, _status, _gap in answers])
    choice = np.argmin(np.where(np.isnan(away), np.inf, away), axis=0)
    rows = np.arange(len(Q))
    poses = np.array([answer[0] for answer in answers])[choice, rows]
    status = np.array([answer[1] for answer in answers])[choice, rows]
    gap = np.array([answer[2] for answer in answers])[choice, rows]
    return poses, status, np.array(mechanism.assembly_modes)[choice], gap


def _away(mechanism: Mechanism, poses: Array, seed: Array) -> Array:
    """(N,) distance of poses (N, m) from a seed pose, NaN if there is none: the largest difference of a coordinate,
    angles modulo a turn, positions over the characteristic length."""
    away = poses - seed
    for column, coordinate in enumerate(mechanism.task):
        part = away[:, column]
        away[:, column] = ARRAYS.wrap(part) if coordinate.is_angle else part / mechanism.length_m
    return np.asarray(np.abs(away).max(axis=1), dtype=float)


def tells_apart(mechanism: Mechanism, joints: Sequence[float], seed: Sequence[float]) -> bool:
    """True if a seed pose is so near to one solution that it cannot belong to another."""
    Q = np.array([joints], dtype=float)
    found = [batch.direct_many(mechanism, Q, mode)[0] for mode in mechanism.assembly_modes]
    away = sorted(value for pose in found if isfinite(value := float(_away(mechanism, pose, np.array(seed))[0])))
    return bool(away) and all(away[0] <= SEEN_SHARE * other for other in away[1:])
