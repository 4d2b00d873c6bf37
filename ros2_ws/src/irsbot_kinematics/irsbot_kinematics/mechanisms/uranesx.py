"""UraneSX: three parallel rails through the corners of an equilateral triangle. Source: [S4] (6)."""

from __future__ import annotations

from math import sqrt
from typing import ClassVar

from irsbot_kinematics.mechanisms.delta_family import DeltaFamily
from irsbot_kinematics.mechanisms.delta_kinematics import Rail

_Z = (0.0, 0.0, 1.0)


class UraneSX(DeltaFamily):
    """Slides along z through corners 1 m from the origin, at 0, 120 and 240 deg."""

    kind: ClassVar[str] = "uranesx"
    rails = (Rail((1.0, 0.0, 0.0), _Z), Rail((-0.5, 0.5 * sqrt(3.0), 0.0), _Z), Rail((-0.5, -0.5 * sqrt(3.0), 0.0), _Z))
