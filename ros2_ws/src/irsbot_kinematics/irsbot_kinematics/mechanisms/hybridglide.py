"""Hybridglide: two parallel rails 2 m apart and one across them. Source: [S4] (4)."""

from __future__ import annotations

from typing import ClassVar

from irsbot_kinematics.mechanisms.delta_family import DeltaFamily
from irsbot_kinematics.mechanisms.delta_kinematics import Rail

_Y, _Z = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


class Hybridglide(DeltaFamily):
    """Slides 1 and 2 along y at x = 1 and x = -1, slide 3 along z through the origin."""

    kind: ClassVar[str] = "hybridglide"
    rails = (Rail((1.0, 0.0, 0.0), _Y), Rail((-1.0, 0.0, 0.0), _Y), Rail((0.0, 0.0, 0.0), _Z))
