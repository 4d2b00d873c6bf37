"""Deflection of a robot from the posture that its joints show: an error for the margins' uncertainties.

The motors hold their angles, the tubes bend. A margin judged at the rigid posture is then that of another machine: the
near end H of each equivalent rod is displaced by |dH|, its far end moves on the platform by |dG - dP|, and the rod is
longer or shorter by |dl|. A rod of its nominal length and direction that ends at the displaced platform begins at most

    slack = |dH| + |dG - dP| + |dl|,     |dl| <= |u . v| + |v|^2 / 2(l - |v|),  v = dG - dH

from where the rigid crank holds it: the directions of the bent rods are those of a machine whose legs are held by the
base within `slack` of their places, which `Mechanism.certified_bounds` covers as `slack_m`. So it holds for
Type 2; Type 1 and the constraint margin, see docs/explanation/stiffness.md. First order in the load, exact in the
lengths; loads across the plane of motion do not change the planar loop. Ours; proved against 3-D frames by sampling.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from irsbot_kinematics.analysis.rectangle import Limits
from irsbot_kinematics.analysis.workspace_maps import Box, reachable_box
from irsbot_kinematics.arguments import check_fields, checked
from irsbot_kinematics.batch import evaluate_many, inverse_many
from irsbot_kinematics.errors import BadInput
from irsbot_kinematics.mechanism import Status
from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_kinematics.numerics.tolerances import SAME_POSE_TOL
from irsbot_kinematics.stiffness.errors import SingularPosture
from irsbot_kinematics.stiffness.response import compliances, postures, table_of
from irsbot_kinematics.stiffness.structure import Legs, Structure

COARSE = 121
"""Nodes of the first grid along each axis; the second has half its step."""
REFINED = 24
"""Nodes of the second grid around which a finer one looks for the maximum."""
INNER = 9
"""Nodes of such a finer grid along each axis, over one cell to each side."""


@dataclass(frozen=True)
class Load:
    """Loads on the platform at P in any direction: a ball of forces and a ball of moments."""

    force_n: float = 0.0
    """N, of the process."""
    moment_nm: float = 0.0
    """N m."""
    payload_kg: float = 0.0
    """kg, platform and payload."""
    acceleration_m_s2: float = 0.0
    """m/s2, the largest of the platform, braking included."""
    gravity_m_s2: float = 9.80665

    def __post_init__(self) -> None:
        check_fields(self)
        for name, value in vars(self).items():
            if not 0.0 <= value < np.inf:
                raise BadInput(f"{name} must be a number >= 0, got {value!r}")

    @property
    def force(self) -> float:
        """N: process, weight and inertia together."""
        return self.force_n + self.payload_kg * (self.gravity_m_s2 + self.acceleration_m_s2)


class PoseErrors(NamedTuple):
    """Bounds in N poses over all loads of a `Load`; NaN where there is no answer."""

    slack_m: Array
    """(N,) m: error of a leg's length and place, for `Mechanism.certified_bounds`."""
    displacement_m: Array
    """(N,) m: of the platform point in the plane of motion."""
    lateral_m: Array
    """(N,) m: of the platform point across the plane."""


@dataclass(frozen=True)
class ComplianceError:
    """Bounds over a workspace, found by sampling: the largest value met plus what the last refinement added to it."""

    slack_m: float
    """m: add it to `slack_m` of `Mechanism.certified_bounds`."""
    displacement_m: float
    """m: of the platform point in the plane of motion."""
    lateral_m: float
    """m: of the platform point across the plane."""
    worst_pose: tuple[float, float]
    """m: where the slack is largest."""
    refinement_m: float
    """m by which finer sampling raised the slack; part of `slack_m`."""
    samples: int
    """Number of poses."""
    load: Load
    limits: Limits


@checked
def pose_errors(design: Structure, poses: ArrayLike, load: Load) -> PoseErrors:
    """Bounds of the errors in poses (N, 2) m, over all directions of the load. Raises BadInput for another shape."""
    X = table_of(poses)
    found = [np.full(len(X), np.nan) for _ in range(3)]
    for rows, legs, status, _ in postures(design, X):
        (planar, ok_p), (lateral, ok_l) = compliances(design, legs.planar.sum(axis=-1), legs.lateral.sum(axis=-1))
        good = (status == Status.SOLVED) & ~legs.singular & ok_p & ok_l
        slack = _slack(legs, planar, load, design.tilt_lever_m)
        inside = _largest(planar[:2], load)
        across = np.abs(lateral[0, 0]) * load.force + np.hypot(lateral[0, 1], lateral[0, 2]) * load.moment_nm
        for column, values in zip(found, (slack, inside, across), strict=True):
            column[rows][good] = values[good]
    return PoseErrors(*found)


@checked
def compliance_error(
    design: Structure, load: Load, limits: Limits, box: tuple[tuple[float, float], tuple[float, float]] | None = None
) -> ComplianceError:
    """Bounds over all poses of a workspace whose margins at the rigid posture are at least `limits`.

    limits: where the supervisor stops; nearer to a singularity the compliance has no bound. box: ranges of x and z, m;
    everything in reach if left out. The bounds are sampled: a grid, one of half its step, and finer ones around its
    largest values; what refinement added is added once more. Raises BadInput where no pose is left, SingularPosture
    where one has no bound.
    """
    area = reachable_box(design.mechanism) if box is None else Box(*box, ())
    grids = [_grid(design, area, limits, nodes) for nodes in (COARSE, 2 * COARSE - 1)]
    if not all(len(grid) for grid in grids):
        raise BadInput(f"no pose of the workspace has margins of at least {tuple(limits)}: there is nothing to bound")
    first, second = (pose_errors(design, grid, load) for grid in grids)
    step = [(high - low) / (2 * COARSE - 2) for low, high in (area.first, area.second)]
    order = np.argsort(-np.nan_to_num(second.slack_m, nan=-1.0))[:REFINED]
    around = np.linspace(-1.0, 1.0, INNER)
    cells = np.stack(np.meshgrid(around * step[0], around * step[1]), axis=-1).reshape(-1, 2)
    near = (grids[1][order][:, None] + cells).reshape(-1, 2)
    near = np.clip(near, *np.transpose([area.first, area.second]))
    near = near[useful(design, near, limits)]
    third = pose_errors(design, near, load)
    largest = [max(float(np.nanmax(s)), float(np.nanmax(t, initial=0.0))) for s, t in zip(second, third, strict=True)]
    added = [value - float(np.nanmax(coarse)) for value, coarse in zip(largest, first, strict=True)]
    slack, displacement, lateral = (value + max(more, 0.0) for value, more in zip(largest, added, strict=True))
    every, slacks = np.concatenate([grids[1], near]), np.concatenate([second.slack_m, third.slack_m])
    worst = every[int(np.argmax(np.nan_to_num(slacks, nan=np.inf)))]
    pose = (float(worst[0]), float(worst[1]))
    if not np.isfinite(slacks).all():
        raise SingularPosture(
            pose, f"{design.why_singular}, or it bends by more than a rod: no bound; give a smaller box"
        )
    samples = len(grids[0]) + len(every)
    return ComplianceError(slack, displacement, lateral, pose, max(added[0], 0.0), samples, load, limits)


def _slack(legs: Legs, planar: Array, load: Load, tilt_lever_m: float) -> Array:
    """(N,) the larger slack of both legs. planar: (3, 3, N) compliance."""
    near = np.einsum("ijnk,jmn->imnk", legs.elbow, planar)
    gx, gz = legs.grip
    turn = planar[2][:, :, None]  # of the platform
    rider = np.array([gz * turn, -gx * turn])  # dG - dP
    v = planar[:2][:, :, :, None] + rider - near
    length = np.sqrt(np.einsum("ink,ink->nk", legs.rod, legs.rod))
    along = np.einsum("ink,imnk->mnk", legs.rod / length, v)
    size = _largest(v, load)
    stretch = np.hypot(along[0], along[1]) * load.force + np.abs(along[2]) * load.moment_nm
    left = np.where(length > size, length - size, np.nan)
    tilt = np.hypot(turn[0], turn[1]) * load.force + np.abs(turn[2]) * load.moment_nm
    carried = tilt * np.maximum(np.hypot(gx, gz), tilt_lever_m)  # |dG - dP|, or more
    slack = _largest(near, load) + carried + stretch + 0.5 * size**2 / left
    worst: Array = np.where(np.isnan(slack), np.inf, slack).max(axis=-1)
    return worst


def _largest(moves: Array, load: Load) -> Array:
    """Largest length of moves @ [fx fz my] over the load: largest singular value times the force, plus the moment's."""
    a, b = moves[:, 0], moves[:, 1]
    aa, bb, ab = (np.einsum("i...,i...->...", p, q) for p, q in ((a, a), (b, b), (a, b)))
    spread = np.hypot(aa - bb, 2.0 * ab)
    force = np.sqrt(0.5 * (aa + bb + spread))
    largest: Array = force * load.force + np.hypot(moves[0, 2], moves[1, 2]) * load.moment_nm
    return largest


def useful(design: Structure, poses: Array, limits: Limits) -> NDArray[np.bool_]:
    """(N,) whether the margins of poses (N, 2) reach the limits in the design's working and usual assembly mode."""
    mechanism = design.mechanism
    joints, status, _ = inverse_many(mechanism, poses, design.working_mode)
    found = evaluate_many(mechanism, joints, mechanism.usual_assembly_mode)
    with np.errstate(invalid="ignore"):
        same = np.abs(found.pose - poses).max(axis=1) < SAME_POSE_TOL  # else the pose is of another assembly mode
        good = (status == Status.SOLVED) & same & (found.type1_margin.min(axis=1) >= limits.type1)
        good &= found.type2_margin >= limits.type2
        good &= np.isnan(found.constraint_margin) | (found.constraint_margin >= limits.constraint)
    return np.asarray(good)


def _grid(design: Structure, area: Box, limits: Limits, nodes: int) -> Array:
    """Poses (N, 2) of a grid whose margins reach the limits."""
    x, z = np.meshgrid(np.linspace(*area.first, nodes), np.linspace(*area.second, nodes))
    poses = np.column_stack([x.ravel(), z.ravel()])
    chosen: Array = poses[useful(design, poses, limits)]
    return chosen
