"""What the services do, without ROS: flat lists in, flat lists and a status per item out. Nothing raises for values."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from irsbot_kinematics import batch
from irsbot_kinematics.arithmetic import ARRAYS, Array
from irsbot_kinematics.mechanism import Signs, Status
from irsbot_kinematics.robot import Robot
from irsbot_kinematics.tolerances import FARTHEST, SEEN_SHARE


class InverseAnswer(NamedTuple):
    """Answer of SolveInverse."""

    joints: list[float]
    status: list[int]
    reach: list[float]
    message: str


class DirectAnswer(NamedTuple):
    """Answer of SolveDirect."""

    poses: list[float]
    status: list[int]
    assembly_mode: list[int]
    gap: list[float]
    message: str


def solve_inverse(robot: Robot, poses: Sequence[float], working_mode: Sequence[int]) -> InverseAnswer:
    """Joint positions of n poses, given one after the other. An empty mode is the robot's usual one."""
    mechanism = robot.mechanism
    X, fault = _rows(poses, len(mechanism.task), "poses")
    mode: Signs = tuple(working_mode) or mechanism.usual_working_mode
    if mode not in mechanism.working_modes:
        fault = f"working mode {mode} is not one of {mechanism.working_modes}"
    if fault:
        number = max(len(X), 1)
        blank = [float("nan")] * (number * len(mechanism.joints))
        return InverseAnswer(blank, [int(Status.INVALID)] * number, [float("nan")] * number, fault)
    joints, status, reach = batch.inverse_many(mechanism, X, mode)
    return InverseAnswer(joints.ravel().tolist(), status.tolist(), reach.tolist(), "")


def solve_direct(robot: Robot, joints: Sequence[float], assembly_mode: int, seed: Sequence[float]) -> DirectAnswer:
    """Poses of n postures. Mode 0: nearest to the seed pose, or the usual mode where no seed is given."""
    mechanism = robot.mechanism
    Q, fault = _rows(joints, len(mechanism.joints), "joints")
    if assembly_mode not in (0, *mechanism.assembly_modes):
        fault = f"assembly mode {assembly_mode} is not one of {mechanism.assembly_modes}, nor 0"
    if seed and not (len(seed) == len(mechanism.task) and np.abs(seed).max() <= FARTHEST):
        fault = f"seed must be {len(mechanism.task)} finite numbers, at most {FARTHEST:g}, or empty"
    if fault:
        number = max(len(Q), 1)
        blank = [float("nan")] * (number * len(mechanism.task))
        none = [float("nan")] * number
        return DirectAnswer(blank, [int(Status.INVALID)] * number, [0] * number, none, fault)
    if assembly_mode == 0 and seed:
        poses, status, labels, gap = _nearest(robot, Q, np.asarray(seed, dtype=float))
    else:
        label = assembly_mode or mechanism.usual_assembly_mode
        poses, status, gap = batch.direct_many(mechanism, Q, label)
        labels = np.full(len(Q), label, np.int_)
    return DirectAnswer(poses.ravel().tolist(), status.tolist(), labels.tolist(), gap.tolist(), "")


def _nearest(robot: Robot, Q: Array, seed: Array) -> tuple[Array, NDArray[np.uint8], NDArray[np.int_], Array]:
    """In every assembly mode, then per posture the solution nearest to the seed."""
    mechanism = robot.mechanism
    answers = [batch.direct_many(mechanism, Q, mode) for mode in mechanism.assembly_modes]
    away = np.array([_away(robot, poses, seed) for poses, _status, _gap in answers])
    choice = np.argmin(np.where(np.isnan(away), np.inf, away), axis=0)
    rows = np.arange(len(Q))
    poses = np.array([answer[0] for answer in answers])[choice, rows]
    status = np.array([answer[1] for answer in answers])[choice, rows]
    gap = np.array([answer[2] for answer in answers])[choice, rows]
    return poses, status, np.array(mechanism.assembly_modes)[choice], gap


def _away(robot: Robot, poses: Array, seed: Array) -> Array:
    """(N,) how far poses (N, m) are from a seed pose, NaN where there is none: the largest difference of a coordinate,
    angles modulo a turn, positions over the characteristic length."""
    mechanism, away = robot.mechanism, poses - seed
    for column, coordinate in enumerate(mechanism.task):
        part = away[:, column]
        away[:, column] = ARRAYS.wrap(part) if coordinate.is_angle else part / mechanism.length_m
    return np.asarray(np.abs(away).max(axis=1), dtype=float)


def tells_apart(robot: Robot, joints: Sequence[float], seed: Sequence[float]) -> bool:
    """Whether a pose that somebody sees is so near to one solution that no other can be meant."""
    Q, mechanism = np.array([joints], dtype=float), robot.mechanism
    found = [batch.direct_many(mechanism, Q, mode)[0] for mode in mechanism.assembly_modes]
    away = sorted(value for pose in found if isfinite(value := float(_away(robot, pose, np.array(seed))[0])))
    return bool(away) and all(away[0] <= SEEN_SHARE * other for other in away[1:])


def _rows(values: Sequence[float], width: int, what: str) -> tuple[Array, str]:
    flat = np.asarray(values, dtype=float)
    if flat.size == 0 or flat.size % width:
        return np.zeros((0, width)), f"{what} must hold a multiple of {width} numbers, got {flat.size}"
    return flat.reshape(-1, width), ""
