"""Planar 3-RPR: three struts of actuated length between base and platform. Source: [S4], Listing 8."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from irsbot_kinematics.mechanisms.branched_platform import BY_A_LOOP, Point
from irsbot_kinematics.mechanisms.sliding_platform import SlidingPlatform, require_places, require_range


@dataclass(frozen=True)
class Rpr3Geometry:
    """Points (x, y) in metres."""

    a1: Point
    """Base joints."""
    a2: Point
    a3: Point
    b1: Point
    """Platform joints relative to the platform point."""
    b2: Point
    b3: Point
    limits: Point
    """Open range of every strut's length."""

    def __post_init__(self) -> None:
        require_places(self, "a1", "a2", "a3", "b1", "b2", "b3", "limits")
        require_range(self.limits, "limits", True)


class Rpr3(SlidingPlatform):
    """Joints: lengths of the struts."""

    kind: ClassVar[str] = "rpr3"
    geometry: Rpr3Geometry
    cuspidal = BY_A_LOOP

    def __init__(self, geometry: Rpr3Geometry) -> None:
        g = self.geometry = geometry
        super().__init__((g.a1, g.a2, g.a3), (None,) * 3, (g.b1, g.b2, g.b3), (g.limits,) * 3)
