"""Orthoglide: three slides on orthogonal rails through one point. Source: [S4] (3); its limbs P R Pi R: [S3]."""

from __future__ import annotations

from typing import ClassVar

from irsbot_kinematics.mechanisms.delta_family import DeltaFamily
from irsbot_kinematics.mechanisms.delta_kinematics import Rail

_O = (0.0, 0.0, 0.0)
_X, _Y, _Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


class Orthoglide(DeltaFamily):
    """Slides along x, y, z through the origin.

    A limb is a slide along u, a revolute joint along z normal to u, a parallelogram with rods along l, and a revolute
    joint along z. Its margin min(|l.u|, |z x l|) (limbs.prpir_factors) is |l.u|, because z x l has the component l.u:
    whatever z is, a limb is singular where its leg is of Type 1, and the parallelogram is flat nowhere else.
    """

    kind: ClassVar[str] = "orthoglide"
    rails = (Rail(_O, _X), Rail(_O, _Y), Rail(_O, _Z))
    limb_count = 3
