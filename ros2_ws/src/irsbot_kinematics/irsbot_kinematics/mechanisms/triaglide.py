"""Triaglide: three parallel rails in one plane, 1 m apart. Source: [S4] (5)."""

from __future__ import annotations

from typing import ClassVar

from irsbot_kinematics.mechanisms.delta_family import DeltaFamily
from irsbot_kinematics.mechanisms.delta_kinematics import Rail

_Y = (0.0, 1.0, 0.0)


class Triaglide(DeltaFamily):
    """Slides along y at x = 1, x = -1 and x = 0. Parallel singularities: z = 0, and no other ([S4] (8), corrected)."""

    kind: ClassVar[str] = "triaglide"
    rails = (Rail((1.0, 0.0, 0.0), _Y), Rail((-1.0, 0.0, 0.0), _Y), Rail((0.0, 0.0, 0.0), _Y))
