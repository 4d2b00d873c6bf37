"""The services without ROS: flat lists in, flat lists and a status per item out. No value raises."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from irsbot_kinematics import arguments, batch
from irsbot_kinematics.branches import nearest_solutions
from irsbot_kinematics.errors import BadInput
from irsbot_kinematics.mechanism import Floats, Status
from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_kinematics.robot import Robot


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
    """Joint positions of n poses, listed one after the other. An empty mode is the robot's usual one."""
    mechanism = robot.mechanism
    X, fault = _rows(poses, len(mechanism.task), "poses")
    try:
        mode = arguments.working_mode(mechanism, working_mode if len(working_mode) else None)
    except BadInput as error:
        fault = str(error)
    if fault:
        number = max(len(X), 1)
        blank = [float("nan")] * (number * len(mechanism.joints))
        return InverseAnswer(blank, [int(Status.INVALID)] * number, [float("nan")] * number, fault)
    joints, status, reach = batch.inverse_many(mechanism, X, mode)
    return InverseAnswer(joints.ravel().tolist(), status.tolist(), reach.tolist(), "")


def solve_direct(robot: Robot, joints: Sequence[float], assembly_mode: int, seed: Sequence[float]) -> DirectAnswer:
    """Poses of n postures. Mode 0: the solution nearest to the seed pose, or the usual mode if no seed pose is
    given."""
    mechanism = robot.mechanism
    Q, fault = _rows(joints, len(mechanism.joints), "joints")
    near: Floats = ()
    try:
        label = arguments.assembly_mode(mechanism, assembly_mode or None)
        near = arguments.place(seed, mechanism.task, "seed") if len(seed) else ()
    except BadInput as error:
        fault = str(error)
    if fault:
        number = max(len(Q), 1)
        blank = [float("nan")] * (number * len(mechanism.task))
        none = [float("nan")] * number
        return DirectAnswer(blank, [int(Status.INVALID)] * number, [0] * number, none, fault)
    if assembly_mode == 0 and near:
        poses, status, labels, gap = nearest_solutions(mechanism, Q, np.array(near))
    else:
        poses, status, gap = batch.direct_many(mechanism, Q, label)
        labels = np.full(len(Q), label, np.int_)
    return DirectAnswer(poses.ravel().tolist(), status.tolist(), labels.tolist(), gap.tolist(), "")


def _rows(values: Sequence[float], width: int, what: str) -> tuple[Array, str]:
    try:
        flat = arguments.array(values, what, "numbers")
    except BadInput as error:
        return np.zeros((0, width)), str(error)
    if flat.size == 0 or flat.size % width:
        return np.zeros((0, width)), f"{what} must hold a multiple of {width} numbers, got {flat.size}"
    return flat.reshape(-1, width), ""
