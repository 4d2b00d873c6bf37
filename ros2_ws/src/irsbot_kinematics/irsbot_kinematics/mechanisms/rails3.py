"""Planar 3-PRR: three carriages on straight rails and three rods to the platform. Source: [S4], section 2.4."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from irsbot_kinematics.mechanisms.branched_platform import BY_A_LOOP, Point
from irsbot_kinematics.mechanisms.geometry_checks import require, require_size
from irsbot_kinematics.mechanisms.sliding_platform import (
    Rail,
    SlidingPlatform,
    require_places,
    require_rails,
    require_range,
    unit,
)


@dataclass(frozen=True)
class Rails3Geometry:
    """Points (x, y) and lengths in metres."""

    o1: Point
    """Positions of the carriages at q = 0."""
    o2: Point
    o3: Point
    u1: Point
    """Directions of the rails, of any length."""
    u2: Point
    u3: Point
    b1: Point
    """Platform joints relative to the platform point."""
    b2: Point
    b3: Point
    L: tuple[float, float, float]
    """Rods."""
    limits: Point
    """Open range of every carriage."""

    def __post_init__(self) -> None:
        require_places(self, "o1", "o2", "o3", "u1", "u2", "u3", "b1", "b2", "b3", "limits")
        require_size(self, 3, "L")
        require_rails(self, "u1", "u2", "u3")
        require("min L > 0", min(self.L) > 0.0, min(self.L), 0.0)
        require_range(self.limits, "limits", False)


class Rails3(SlidingPlatform):
    """Joints: carriages on their rails."""

    kind: ClassVar[str] = "rails3"
    geometry: Rails3Geometry
    cuspidal = BY_A_LOOP

    def __init__(self, geometry: Rails3Geometry) -> None:
        g = self.geometry = geometry
        rails = [Rail(unit(u), rod) for u, rod in zip((g.u1, g.u2, g.u3), g.L, strict=True)]
        super().__init__((g.o1, g.o2, g.o3), rails, (g.b1, g.b2, g.b3), (g.limits,) * 3)
