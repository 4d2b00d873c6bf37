"""Many samples at once: the same equations on arrays, in chunks that stay in the cache."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import reduce
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from irsbot_kinematics import statics
from irsbot_kinematics.errors import BadInput
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

CHUNK = 8192
"""Number of samples that are processed together: the intermediate columns of a chunk fit into the cache."""
COLUMNS = 64
"""Intermediate columns that mechanisms in closed form have at a time, at most."""


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
    constraint_margin: (N,) at least 0, may exceed 1; NaN where the mechanism has none.
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


Load = tuple[float, float]
"""Largest force, N, and moment, N m, of any direction."""

Fill = Callable[[Array, Evaluations], None]
"""Fills evaluations of joints (N, n) in one assembly mode, without a load."""


def evaluate_many(
    mechanism: Mechanism,
    joints: Array,
    assembly: int,
    load: Load | None = None,
    fill: Fill | None = None,
    out: Evaluations | None = None,
) -> Evaluations:
    """Poses and margins of joints (N, n) in one assembly mode. fill: the same equations in another form, for use where
    no load is given. out: evaluations whose arrays are filled anew. Raises BadInput if they do not fit."""
    result = _blank(mechanism, joints, assembly, load, out)
    joints = result.joint_position
    if fill is not None and load is None:
        fill(joints, result)
        return result
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        for rows in _chunks(len(joints)):
            _evaluate(_solve(mechanism, joints[rows], assembly), result, rows, load)
    return result


def evaluate_motion(
    mechanism: Mechanism,
    joints: Array,
    first: Posture | None,
    load: Load | None = None,
    out: Evaluations | None = None,
) -> Evaluations:
    """Poses and margins of joints (N, n), followed one after the other on the branch of the first posture.

    If a sample has no pose, the branch is lost: this sample and all later ones are not SOLVED. `first` may be None if
    there are no samples. out: evaluations whose arrays are filled anew. Raises BadInput if they do not fit.
    """
    result = _blank(mechanism, joints, 0, load, out)
    joints = result.joint_position
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


def _blank(
    mechanism: Mechanism, joints: Array, assembly: int, load: Load | None, out: Evaluations | None
) -> Evaluations:
    """Evaluations that `_evaluate` is to fill, with a copy of the joints, and NaN in what a mechanism need not have."""
    number, n = joints.shape
    shapes: dict[str, tuple[type, tuple[int, ...]]] = {
        "status": (np.uint8, (number,)),
        "joint_position": (np.float64, (number, n)),
        "pose": (np.float64, (number, len(mechanism.task))),
        "working_mode": (np.int8, (number, n)),
        "type1_margin": (np.float64, (number, n)),
        "type2_margin": (np.float64, (number,)),
        "constraint_margin": (np.float64, (number,)),
        "limb_margin": (np.float64, (number, mechanism.limb_count)),
        "pressure_angle": (np.float64, (number, n)),
        "reach": (np.float64, (number,)),
        "closure_residual": (np.float64, (number,)),
        "reaction_max": (np.float64, (number, n if load else 0)),
    }
    if out is None:
        arrays: dict[str, Any] = {name: np.empty(shape, dtype) for name, (dtype, shape) in shapes.items()}
    else:
        arrays = {name: _reused(out, name, *wanted) for name, wanted in shapes.items()}
    result = Evaluations(**arrays, assembly_mode=assembly)
    result.joint_position[:] = joints
    result.status.fill(Status.INVALID)
    result.constraint_margin.fill(np.nan)
    result.limb_margin.fill(np.nan)
    return result


def _reused(out: Evaluations, name: str, dtype: type, shape: tuple[int, ...]) -> NDArray[Any]:
    """An array of earlier evaluations, which machine code may fill."""
    array: object = getattr(out, name)
    given = type(array).__name__
    if isinstance(array, np.ndarray):
        fits = array.dtype == dtype and array.shape == shape
        if fits and array.flags.c_contiguous and array.flags.writeable and array.flags.aligned:
            return array
        given = f"{array.dtype} {array.shape}"
    raise BadInput(
        f"out must be evaluations of {shape[0]} samples of such a robot, got {name} {given}, "
        f"not {np.dtype(dtype)} {shape}, contiguous and writeable"
    )


def _evaluate(found: _Solved, out: Evaluations, rows: slice, load: Load | None) -> None:
    pose, legs = found.pose, found.legs
    _, cosines = statics.pressure_cosines(ARRAYS, legs.screws, legs.attachments)
    alike = cosines[-1] is cosines[0]  # both legs of a planar pair
    angles = [np.arccos(cosines[0])] * len(cosines) if alike else [np.arccos(cosine) for cosine in cosines]
    out.status[rows] = found.status
    for pose_column, values in zip(out.pose[rows].T, pose, strict=True):
        pose_column[:] = values
    columns = zip(out.type1_margin[rows].T, out.working_mode[rows].T, out.pressure_angle[rows].T, strict=True)
    for (type1, mode, pressure), sine, angle in zip(columns, legs.normalised_levers, angles, strict=True):
        np.abs(sine, out=type1)
        positive, negative = np.greater(sine, SIGN_DEAD_BAND), np.less(sine, -SIGN_DEAD_BAND)
        np.subtract(positive.view(np.int8), negative.view(np.int8), out=mode)
        pressure[:] = angle
    out.type2_margin[rows] = cosines[0] if alike else reduce(np.minimum, cosines)
    if legs.constraint is not None:
        out.constraint_margin[rows] = legs.constraint
    for column, margin in enumerate(legs.limb):
        out.limb_margin[rows, column] = margin
    out.reach[rows] = reduce(np.minimum, legs.reach)
    out.closure_residual[rows] = found.residual
    if load:
        sizes = statics.reaction_max(ARRAYS, legs.screws, *load, turns=bool(legs.attachments))
        for reaction, size in zip(out.reaction_max[rows].T, sizes, strict=True):
            reaction[:] = size


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
    status = np.where(assembled, np.uint8(Status.SINGULAR), np.uint8(Status.UNREACHABLE))
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
    residual: Array = reduce(np.maximum, map(np.abs, legs.closure))
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
            least = reduce(np.minimum, slack)
            meant = (np.abs(x) <= FARTHEST).all(axis=0)
            solved = meant & (least >= -REACH_TOL_M)
            status[rows] = np.where(solved, Status.SOLVED, np.where(meant, Status.UNREACHABLE, Status.INVALID))
            reach[rows] = least
            for column, values in enumerate(q):
                joints[rows, column] = np.where(solved, values, np.nan)
    return joints, status, reach


def direct_many(mechanism: Mechanism, joints: Array, assembly: int) -> tuple[Array, NDArray[np.uint8], Array]:
    """Poses (N, m), status (N,) and assembly clearance (N,) in m of joints (N, n); NaN where not SOLVED."""
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
    """Rows of each chunk."""
    # The GNU C library keeps freed memory for the next column, instead of returning it to the system, which has to
    # clear it, if a block of that size has been freed before (mallopt, M_TRIM_THRESHOLD); this one is never touched.
    np.empty((COLUMNS, min(number, CHUNK)))
    for start in range(0, number, CHUNK):
        yield slice(start, min(start + CHUNK, number))
