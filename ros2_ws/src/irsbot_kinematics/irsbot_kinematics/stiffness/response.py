"""Answers of an elastic structure: stiffness at the platform, deflection under a wrench, first natural frequency.

Twist [dx dy dz rx ry rz] (m, rad), wrench [fx fy fz mx my mz] (N, N m), in base axes at the platform point P.
A pose is (x, z) in m; (2,) for one, (N, 2) for many. One that cannot be answered is refused; of many it is NaN.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from irsbot_kinematics import arguments
from irsbot_kinematics.arguments import checked
from irsbot_kinematics.batch import inverse_many
from irsbot_kinematics.errors import BadInput, Unreachable
from irsbot_kinematics.mechanism import Status
from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_kinematics.numerics.tolerances import FARTHEST
from irsbot_kinematics.stiffness.chains import ChainStructure
from irsbot_kinematics.stiffness.errors import SingularPosture
from irsbot_kinematics.stiffness.structure import Legs, Structure
from irsbot_kinematics.stiffness.symmetric import LATERAL, PLANAR, full, inverse3

TWIST = ("dx", "dy", "dz", "rx", "ry", "rz")

RANK_TOL = 1e-12
"""1: reciprocal condition number, with lengths divided by the robot's, below which a stiffness has no inverse. Slender
tubes bend some 1e6 times easier than they stretch; rounding shows at 1e-15."""

CHUNK = 2048
"""Postures worked on together: the intermediate arrays of a chunk fit into the cache."""

Design = Structure | ChainStructure


@dataclass(frozen=True)
class Responses:
    """Stiffness and compliance in N poses; rows are NaN where `status` is not SOLVED."""

    status: NDArray[np.uint8]
    """(N,) values of `Status`; SINGULAR: the platform is free in that posture."""
    reach: Array
    """(N,) m to the workspace boundary, negative = how far outside."""
    stiffness: Array
    """(N, 6, 6); also where the robot is singular, unless a leg itself is."""
    compliance: Array
    """(N, 6, 6), 0 for the coordinates that the structure never holds."""


@checked
def evaluate_many(design: Structure, poses: ArrayLike) -> Responses:
    """Stiffness, compliance and status of many poses (N, 2). Raises BadInput for another shape."""
    X = table_of(poses)
    number = len(X)
    status, reach = np.full(number, Status.INVALID, np.uint8), np.full(number, np.nan)
    K, C = np.full((number, 6, 6), np.nan), np.full((number, 6, 6), np.nan)
    for rows, legs, found, near in postures(design, X):
        planar, lateral = legs.planar.sum(axis=-1), legs.lateral.sum(axis=-1)
        (cp, ok_p), (cl, ok_l) = compliances(design, planar, lateral)
        reached = found == Status.SOLVED
        held = reached & ~legs.singular & ok_p & ok_l
        found[reached & ~held] = Status.SINGULAR
        status[rows], reach[rows] = found, near
        K[rows][reached & ~legs.singular] = full(planar, lateral)[reached & ~legs.singular]
        C[rows][held] = full(cp, cl)[held]
    return Responses(status, reach, K, C)


def postures(design: Structure, poses: Array) -> Iterator[tuple[slice, Legs, NDArray[np.uint8], Array]]:
    """Chunk by chunk: rows, legs, status of the inverse kinematics, reach. Legs are NaN where not SOLVED."""
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        for start in range(0, len(poses), CHUNK):
            rows = slice(start, min(start + CHUNK, len(poses)))
            joints, status, reach = inverse_many(design.mechanism, poses[rows], design.working_mode)
            yield rows, design.legs(joints, poses[rows]), status, reach


def compliances(design: Structure, planar: Array, lateral: Array) -> list[tuple[Array, NDArray[np.bool_]]]:
    """Inverse of both blocks (3, 3, N) and whether it exists. Coordinates that nothing holds are left out by name,
    not found by a pseudo-inverse; their rows and columns of the inverse are 0."""
    found = []
    for block, coordinates in ((planar, PLANAR), (lateral, LATERAL)):
        scale = np.array([1.0 if at < 3 else design.length_m for at in coordinates])
        scaling = (scale[:, None] * scale)[:, :, None]
        K = block / scaling  # moments over the length, turns times the length: N/m throughout
        size = np.sqrt(np.einsum("ijn,ijn->n", K, K))
        for i, at in enumerate(coordinates):
            if at in design.free:
                K[i, i] = size
        inverse = inverse3(K)
        condition = size * np.sqrt(np.einsum("ijn,ijn->n", inverse, inverse))
        for i, at in enumerate(coordinates):
            if at in design.free:
                inverse[i, i] = 0.0
        found.append((inverse / scaling, condition * RANK_TOL < 1.0))
    return found


@checked
def matrix(design: Design, pose: ArrayLike = ()) -> Array:
    """Stiffness (6, 6) at P of one pose, (N, 6, 6) of many; symmetric, positive semidefinite, N/m, N, N m/rad.

    Its rank is 6 less the coordinates that the joints leave free (`design.free`). A chain structure has one posture
    and takes no pose. Raises Unreachable, SingularPosture, BadInput for one pose; NaN for many.
    """
    if isinstance(design, ChainStructure):
        return design.stiffness
    return _of_poses(design, pose, need_inverse=False)[0]


@checked
def compliance(design: Design, pose: ArrayLike = ()) -> Array:
    """Compliance (6, 6) of one pose, (N, 6, 6) of many: inverse of `matrix` on the coordinates that are held.

    Rows and columns of free coordinates are 0. Raises and returns NaN as `matrix` does.
    """
    if isinstance(design, ChainStructure):
        return design.compliance
    return _of_poses(design, pose, need_inverse=True)[1]


@checked
def deflection(design: Design, pose: ArrayLike, wrench: ArrayLike) -> Array:
    """Twist (6,) of the platform under a wrench (6,) at P; (N, 6) for many poses. Actuators locked.

    The twist of a coordinate that the joints leave free (`design.free`) is not determined and returned as 0.
    Raises SingularPosture for a wrench along such a coordinate, and what `matrix` raises.
    """
    w = np.array(arguments.vector(wrench, 6, "wrench [fx fy fz mx my mz]"))
    if isinstance(design, ChainStructure):
        return design.deflection(w)
    for at in design.free:
        if w[at] != 0.0:
            where = np.ravel(pose).tolist() if _single(pose) else ()
            raise SingularPosture(
                where, f"the joints leave {TWIST[at]} free, nothing balances {w[at]:.6g} N m along it"
            )
    moved: Array = compliance(design, pose) @ w
    return moved


@checked
def frequency(design: Design, pose: ArrayLike, mass_kg: float, inertia: ArrayLike | None = None) -> Array | float:
    """First natural frequency, Hz, of a platform of mass_kg on the massless structure; (N,) for many poses.

    inertia: (3, 3) about P in base axes, kg m2, centre of mass at P; without it the platform turns without inertia.
    A motion that the joints leave free has the frequency 0 and is left out: the result is the lowest frequency of the
    other motions. Raises what `matrix` raises, BadInput.
    """
    mass_kg = arguments.positive(mass_kg, "mass_kg")
    M = np.zeros((6, 6))
    M[:3, :3] = mass_kg * np.eye(3)
    if inertia is not None:
        turning = arguments.matrix(inertia, (3, 3), "inertia")
        if not np.allclose(turning, turning.T) or np.linalg.eigvalsh(turning)[0] < 0.0:
            raise BadInput(f"inertia must be symmetric and positive (3, 3) kg m2, got {arguments.shown(inertia)}")
        M[3:, 3:] = turning
    values, vectors = np.linalg.eigh(M)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    C = compliance(design, pose)
    found = np.full(C.shape[:-2], np.nan)
    known = np.isfinite(C).all(axis=(-1, -2))
    largest = np.linalg.eigvalsh(root.T @ C[known] @ root)[..., -1]  # of M^1/2 C M^1/2: 1/omega^2
    found[known] = 1.0 / (2.0 * np.pi * np.sqrt(largest))
    return found if found.ndim else float(found)


def _of_poses(design: Structure, pose: ArrayLike, *, need_inverse: bool) -> tuple[Array, Array]:
    """Stiffness and compliance of many poses, or of one; what refuses that is raised."""
    if not _single(pose):
        many = evaluate_many(design, pose)
        return many.stiffness, many.compliance
    one = evaluate_many(design, np.atleast_2d(np.array(arguments.vector(pose, 2, "pose (x, z)", FARTHEST))))
    _refuse(design, one, pose, need_inverse=need_inverse)
    return one.stiffness[0], one.compliance[0]


def _single(pose: ArrayLike) -> bool:
    return arguments.array(pose, "pose", "x and z in m").ndim < 2


def table_of(poses: ArrayLike) -> Array:
    """Many poses as (N, 2). Raises BadInput for another shape."""
    return arguments.table(poses, 2, "poses")


def _refuse(design: Structure, found: Responses, pose: ArrayLike, *, need_inverse: bool) -> None:
    """Raise for a single pose without an answer."""
    where = np.ravel(pose).tolist()
    status = found.status[0]
    if status == Status.INVALID:
        raise BadInput(f"a pose must be finite, got {where}")
    if status == Status.UNREACHABLE:
        raise Unreachable(where, [float(found.reach[0])])
    if status == Status.SINGULAR and np.isnan(found.stiffness[0, 0, 0]):
        raise SingularPosture(where, design.why_singular)
    if status == Status.SINGULAR and need_inverse:
        raise SingularPosture(where, f"the legs leave the platform free to move by {free_motion(design, found)}")


def free_motion(design: Structure, found: Responses) -> str:
    """The softest twist of the first posture in words, largest part 1: of the block that is nearest to singular."""
    softest: list[tuple[float, list[str]]] = []
    for coordinates in (PLANAR, LATERAL):
        held = [at for at in coordinates if at not in design.free]
        scale = np.array([1.0 if at < 3 else design.length_m for at in held])
        values, vectors = np.linalg.eigh(found.stiffness[0][np.ix_(held, held)] / np.outer(scale, scale))
        twist = vectors[:, 0] / scale
        twist = twist / twist[np.argmax(np.abs(twist))]
        parts = [f"{TWIST[at]} {part:.3g}" for at, part in zip(held, twist, strict=True) if abs(part) > 1e-3]
        softest.append((float(values[0] / values[-1]), parts))
    return ", ".join(min(softest)[1])
