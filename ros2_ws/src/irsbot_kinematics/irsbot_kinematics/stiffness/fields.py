"""Deflection over a workspace, on a grid of poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from irsbot_kinematics.arithmetic import Array
from irsbot_kinematics.errors import BadInput
from irsbot_kinematics.maps import Box, reachable_box
from irsbot_kinematics.stiffness.response import answers, deflection
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


def deflection_map(
    design: Structure,
    wrench: ArrayLike,
    box: tuple[tuple[float, float], tuple[float, float]] | None = None,
    nodes: tuple[int, int] = (161, 161),
) -> DeflectionMap:
    """Deflection over ranges of x and z, m; everything in reach if left out. Raises BadInput, SingularPosture."""
    area = reachable_box(design.mechanism) if box is None else Box(*box, ())
    for low, high in (area.first, area.second):
        if not (np.isfinite(low) and np.isfinite(high) and low < high and min(nodes) >= 2):
            raise BadInput(f"a map needs a range low < high and at least 2 nodes, got {low} to {high} with {nodes}")
    x, z = np.linspace(*area.first, nodes[0]), np.linspace(*area.second, nodes[1])
    poses = np.stack(np.meshgrid(x, z), axis=-1).reshape(-1, 2)
    shape = (len(z), len(x))
    twist = deflection(design, poses, wrench).reshape(*shape, 6)
    status = answers(design, poses).status.reshape(shape)
    return DeflectionMap(x, z, np.asarray(wrench, dtype=float), twist, status)
