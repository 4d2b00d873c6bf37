"""Deflection over a workspace, on a grid of poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from irsbot_kinematics.analysis.workspace_maps import Box, axis_of, reachable_box
from irsbot_kinematics.arguments import checked
from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_kinematics.stiffness.response import deflection, evaluate_many
from irsbot_kinematics.stiffness.structure import Structure


@dataclass(frozen=True)
class DeflectionMap:
    """Twists of the platform under one wrench on a grid; NaN where a pose is not reached or singular."""

    x: Array
    """(n,) m."""
    z: Array
    """(m,) m."""
    wrench: Array
    """(6,) N, N m at P."""
    twist: Array
    """(m, n, 6) m, rad."""
    status: NDArray[np.uint8]
    """(m, n) values of `Status`."""

    @property
    def displacement(self) -> Array:
        """(m, n) m: how far the platform point moves."""
        size: Array = np.linalg.norm(self.twist[..., :3], axis=-1)
        return size


@checked
def deflection_map(
    design: Structure,
    wrench: ArrayLike,
    box: tuple[tuple[float, float], tuple[float, float]] | None = None,
    nodes: tuple[int, int] = (161, 161),
) -> DeflectionMap:
    """Deflection over ranges of x and z, m; everything in reach if left out. Raises BadInput, SingularPosture."""
    area = reachable_box(design.mechanism) if box is None else Box(*box, ())
    x, z = axis_of(area.first, nodes[0]), axis_of(area.second, nodes[1])
    poses = np.stack(np.meshgrid(x, z), axis=-1).reshape(-1, 2)
    shape = (len(z), len(x))
    twist = deflection(design, poses, wrench).reshape(*shape, 6)
    status = evaluate_many(design, poses).status.reshape(shape)
    return DeflectionMap(x, z, np.asarray(wrench, dtype=float), twist, status)
