"""Planar RPR-2PRR: a strut of actuated length, and two carriages with rods. Source: [S4], section 2.4."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from irsbot_kinematics.mechanisms.branched_platform import BY_A_LOOP, Point
from irsbot_kinematics.mechanisms.geometry_checks import require
from irsbot_kinematics.mechanisms.sliding_platform import (
    Rail,
    SlidingPlatform,
    require_places,
    require_rails,
    require_range,
    unit,
)


@dataclass(frozen=True)
class Rails2Geometry:
    """Points (x, y) and lengths in metres."""

    o1: Point
    """Base joint of the strut."""
    o2: Point
    """Positions of the carriages at q = 0."""
    o3: Point
    u2: Point
    """Directions of the rails, of any length."""
    u3: Point
    b1: Point
    """Platform joints relative to the platform point."""
    b2: Point
    b3: Point
    L2: float
    """Rods."""
    L3: float
    limits: Point
    """Open range of the strut's length."""
    travel: Point
    """Open range of both carriages."""

    def __post_init__(self) -> None:
        require_places(self, "o1", "o2", "o3", "u2", "u3", "b1", "b2", "b3", "limits", "travel")
        require_rails(self, "u2", "u3")
        require("min(L2, L3) > 0", min(self.L2, self.L3) > 0.0, min(self.L2, self.L3), 0.0)
        require_range(self.limits, "limits", True)
        require_range(self.travel, "travel", False)


class Rails2(SlidingPlatform):
    """Joints: length of the strut, then both carriages."""

    kind: ClassVar[str] = "rails2"
    geometry: Rails2Geometry
    cuspidal = BY_A_LOOP

    def __init__(self, geometry: Rails2Geometry) -> None:
        g = self.geometry = geometry
        rails = (None, Rail(unit(g.u2), g.L2), Rail(unit(g.u3), g.L3))
        super().__init__((g.o1, g.o2, g.o3), rails, (g.b1, g.b2, g.b3), (g.limits, g.travel, g.travel))
