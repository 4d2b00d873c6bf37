"""Many samples at once: the same equations on arrays, in chunks that stay in the cache."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from irsbot_kinematics import statics
from irsbot_kinematics.mechanism import Legs, Mechanism, Posture, Signs, Status
from irsbot_kinematics.numerics.arithmetic import ARRAYS, Array
from irsbot_kinematics.numerics.tolerances import (
    ASSEMBLY_TOL_M,
    CLOSURE_TOL_M,
    COINCIDENT_TOL_M,
    FARTHEST,
    REACH_TOL_M,
    SIGN_DEAD_BAND,
)

CHUNK = 16384
"""Number of samples that are processed together: the intermediate columns of a chunk fit into the cache."""


@dataclass(frozen=True)
class Evaluations:
    """Margins of N postures; rows are NaN where `status` is not SOLVED. Fields as in SingularityState.msg.

    status: (N,) values of `Status`.
    joint_position: (N, n) rad or m.
    pose: (N, m) m or rad.
    assembly_mode: label for which the joints were solved; 0 for a motion that was followed.
    working_mode: (N, n) signs.
    type1_margin: (N, n) 0..1.
    type2_margin: (N,) 0..1.
    constraint_margin: (N,) 0..1, NaN where the mechanism has none.
    limb_margin: (N, number of limbs with a margin of their own) 0..1.
    pressure_angle: (N, n) rad.
    reach: (N,) m to the workspace boundary.
    closure_residual: (N,) m.
    reaction_max: (N, n) N, largest force of every leg under a load in its worst direction; (N, 0) where no load was
        asked for.
    """

    status: NDArray[np.uint8]
    joint_position: Array
    pose: Array
    assembly_mode: int
    working_mode: NDArray[np.int8]
    type1_margin: Array
    type2_margin: Array
    constraint_margin: Array
    limb_margin: Array
    pressure_angle: Array
    reach: Array
    closure_residual: Array
    reaction_max: Array


def evaluate_many(
    mechanism: Mechanism, joints: Array, assembly: int, load: tuple[float, float] | None = None
) -> Evaluations:
    """Poses and margins of joints (N, n) in one assembly mode. load: largest force, N, and moment, N m, of any
    direction."""
    result = _blank(mechanism, joints, assembly, load)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        for rows in _chunks(len(joints)):
            _evaluate(_solve(mechanism, joints[rows], assembly), result, rows, load)
    return result


def evaluate_motion(
    mechanism: Mechanism, joints: Array, first: Posture | None, load: tuple[float, float] | None = None
) -> Evaluations:
    """Poses and margins of joints (N, n), followed one after the other on the branch of the first posture.

    If a sample has no pose, the branch is lost: this sample and all later ones are not SOLVED. `first` may be None if
    there are no samples.
    """
    result = _blank(mechanism, joints, 0, load)
    at, followed = first, []
    for q in joints.tolist() if first is not None else ():
        assert at is not None
        if at.status == Status.SOLVED:
            at = mechanism.track(tuple(q), at)
        followed.append((at.status, at.pose if at.status == Status.SOLVED else (np.nan,) * len(mechanism.task)))
    if not followed:
        return result
    status = np.array([status for status, _ in followed], np.uint8)
    pose = np.array([pose for _, pose in followed], dtype=float)
    q_solved = np.where((status == Status.SOLVED)[:, np.newaxis], joints, np.nan)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        for rows in _chunks(len(joints)):
            x = tuple(np.ascontiguousarray(column) for column in pose[rows].T)
            legs = mechanism.legs(ARRAYS, tuple(np.ascontiguousarray(column) for column in q_solved[rows].T), x)
            found = _Solved(status[rows], x, legs, _residual(legs), np.full(len(x[0]), np.nan))
            _evaluate(found, result, rows, load)
    return result


def _blank(mechanism: Mechanism, joints: Array, assembly: int, load: tuple[float, float] | None) -> Evaluations:
    """Evaluations before any sample is solved."""
    number, n = joints.shape
    return Evaluations(
        status=np.full(number, Status.INVALID, np.uint8),
        joint_position=joints,
        pose=np.full((number, len(mechanism.task)), np.nan),
        assembly_mode=assembly,
        working_mode=np.zeros((number, n), np.int8),
        type1_margin=np.full((number, n), np.nan),
        type2_margin=np.full(number, np.nan),
        constraint_margin=np.full(number, np.nan),
        limb_margin=np.full((number, mechanism.limb_count), np.nan),
        pressure_angle=np.full((number, n), np.nan),
        reach=np.full(number, np.nan),
        closure_residual=np.full(number, np.nan),
        reaction_max=np.full((number, n if load else 0), np.nan),
    )


def _evaluate(found: _Solved, out: Evaluations, rows: slice, load: tuple[float, float] | None) -> None:
    pose, legs = found.pose, found.legs
    _, cosines = statics.pressure_cosines(ARRAYS, legs.screws, legs.attachments)
    reach = legs.reach[0]
    for other in legs.reach[1:]:
        reach = np.minimum(reach, other)
    type2 = cosines[0]
    if cosines[-1] is not cosines[0]:
        for cosine in cosines[1:]:
            type2 = np.minimum(type2, cosine)
    out.status[rows] = found.status
    for column, values in enumerate(pose):
        out.pose[rows, column] = values
    for column, sine in enumerate(legs.normalised_levers):
        size = np.abs(sine)
        out.type1_margin[rows, column] = size
        out.working_mode[rows, column] = np.sign(np.where(size > SIGN_DEAD_BAND, sine, 0.0))
        out.pressure_angle[rows, column] = np.arccos(cosines[column])
    out.type2_margin[rows] = type2
    if legs.constraint is not None:
        out.constraint_margin[rows] = legs.constraint
    for column, margin in enumerate(legs.limb):
        out.limb_margin[rows, column] = margin
    out.reach[rows] = reach
    out.closure_residual[rows] = found.residual
    if load:
        sizes = statics.reaction_max(ARRAYS, legs.screws, *load, turns=bool(legs.attachments))
        for column, size in enumerate(sizes):
            out.reaction_max[rows, column] = size


class _Solved(NamedTuple):
    """Postures of one chunk; all but status and gap are NaN where not SOLVED."""

    status: NDArray[np.uint8]
    pose: tuple[Array, ...]
    legs: Legs[Array]
    residual: Array
    gap: Array


def _solve(mechanism: Mechanism, joints: Array, assembly: int) -> _Solved:
    """Solve many samples with the decisions of `Mechanism.posture`."""
    q = tuple(np.ascontiguousarray(column) for column in joints.T)
    pose, gaps = mechanism.direct(ARRAYS, q, assembly)
    finite = (np.abs(q) <= FARTHEST).all(axis=0)
    assembled = gaps[0] >= -ASSEMBLY_TOL_M
    solved = finite & assembled & (gaps[1] > COINCIDENT_TOL_M)
    status = np.where(assembled, Status.SINGULAR, Status.UNREACHABLE).astype(np.uint8)
    status[~finite] = Status.INVALID
    while True:
        if not solved.all():  # NaN flows through the equations and marks every dependent number
            pose = tuple(np.where(solved, column, np.nan) for column in pose)
            q = tuple(np.where(solved, column, np.nan) for column in q)
        legs = mechanism.legs(ARRAYS, q, pose)
        residual = _residual(legs)
        believed = residual <= CLOSURE_TOL_M
        if (believed | ~solved).all():
            break
        status[solved & ~believed] = Status.INVALID
        solved &= believed
    status[solved] = Status.SOLVED
    return _Solved(status, pose, legs, residual, gaps[0])


def _residual(legs: Legs[Array]) -> Array:
    """(N,) m: largest closure error."""
    residual = np.abs(legs.closure[0])
    for error in legs.closure[1:]:
        residual = np.maximum(residual, np.abs(error))
    return residual


def inverse_many(mechanism: Mechanism, poses: Array, mode: Signs) -> tuple[Array, NDArray[np.uint8], Array]:
    """Joints (N, n), status (N,) and reach (N,) in m of poses (N, m); joints are NaN where not SOLVED."""
    number = len(poses)
    joints = np.full((number, len(mechanism.joints)), np.nan)
    status = np.full(number, Status.INVALID, np.uint8)
    reach = np.full(number, np.nan)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        for rows in _chunks(number):
            x = tuple(np.ascontiguousarray(column) for column in poses[rows].T)
            q, slack = mechanism.inverse(ARRAYS, x, mode)
            least = slack[0]
            for other in slack[1:]:
                least = np.minimum(least, other)
            meant = (np.abs(x) <= FARTHEST).all(axis=0)
            solved = meant & (least >= -REACH_TOL_M)
            status[rows] = np.where(solved, Status.SOLVED, np.where(meant, Status.UNREACHABLE, Status.INVALID))
            reach[rows] = least
            for column, values in enumerate(q):
                joints[rows, column] = np.where(solved, values, np.nan)
    return joints, status, reach


def direct_many(mechanism: Mechanism, joints: Array, assembly: int) -> tuple[Array, NDArray[np.uint8], Array]:
    """Poses (N, m), status (N,) and assembly gap (N,) in m of joints (N, n); NaN where not SOLVED."""
    number = len(joints)
    poses = np.full((number, len(mechanism.task)), np.nan)
    status = np.full(number, Status.INVALID, np.uint8)
    gap = np.full(number, np.nan)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        for rows in _chunks(number):
            found = _solve(mechanism, joints[rows], assembly)
            status[rows] = found.status
            gap[rows] = found.gap
            for column, values in enumerate(found.pose):
                poses[rows, column] = values
    return poses, status, gap


def _chunks(number: int) -> Iterator[slice]:
    for start in range(0, number, CHUNK):
        yield slice(start, min(start + CHUNK, number))
