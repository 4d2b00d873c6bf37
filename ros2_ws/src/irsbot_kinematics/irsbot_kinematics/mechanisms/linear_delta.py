"""Linear Delta robot with user-defined rails: the common part of the family of [S4]."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import ClassVar

from irsbot_kinematics.mechanisms.delta_family import DeltaFamily
from irsbot_kinematics.mechanisms.delta_kinematics import DeltaGeometry, Rail
from irsbot_kinematics.mechanisms.geometry_checks import require, require_size
from irsbot_kinematics.skeleton import Vector


@dataclass(frozen=True)
class LinearDeltaGeometry(DeltaGeometry):
    """Rods, limits, and per rail i a point o_i where rho_i = 0 (m) and a direction u_i (any length)."""

    o1: Vector
    u1: Vector
    o2: Vector
    u2: Vector
    o3: Vector
    u3: Vector

    def __post_init__(self) -> None:
        super().__post_init__()
        require_size(self, 3, "o1", "u1", "o2", "u2", "o3", "u3")
        for name in ("u1", "u2", "u3"):
            size = _size(getattr(self, name))
            require(f"|{name}| > 0", size > 0.0, size, 0.0)


class LinearDelta(DeltaFamily):
    """Slides C_i = o_i + rho_i u_i with unit u_i."""

    kind: ClassVar[str] = "linear_delta"
    geometry: LinearDeltaGeometry

    def __init__(self, geometry: LinearDeltaGeometry) -> None:
        g = geometry
        self.rails = (_rail(g.o1, g.u1), _rail(g.o2, g.u2), _rail(g.o3, g.u3))
        super().__init__(geometry)


def _rail(origin: Vector, along: Vector) -> Rail:
    size = _size(along)
    return Rail(origin, (along[0] / size, along[1] / size, along[2] / size))


def _size(vector: Vector) -> float:
    x, y, z = vector
    return sqrt(x * x + y * y + z * z)
