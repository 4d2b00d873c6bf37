"""Elastic five-bar RRRRR: clamped crank tube, revolute, rod tube, and a revolute or a ball joint at the platform.

Source: elastostatic sheet section 5; [S1] compares the IRSBot-2 with it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, cast

import numpy as np

from irsbot_kinematics.mechanisms.five_bar import FiveBarGeometry
from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_kinematics.stiffness.errors import InvalidDesign
from irsbot_kinematics.stiffness.irsbot2 import SIGMA
from irsbot_kinematics.stiffness.structure import Legs, Part, Structure
from irsbot_kinematics.stiffness.symmetric import congruent, inverse3
from irsbot_kinematics.stiffness.tubes import Terms

JOINTS = ("revolute", "spherical")


@dataclass(frozen=True)
class FiveBarStructure(Structure):
    """Kinds of tubes: proximal (crank), distal (rod)."""

    family: ClassVar[str] = "five_bar"
    kinds: ClassVar[tuple[str, ...]] = ("proximal", "distal")
    why_singular: ClassVar[str] = "a rod has no length"

    platform_joint: str
    """revolute: each leg holds the platform in all but its turn about y0; spherical: it passes forces alone."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.platform_joint not in JOINTS:
            raise InvalidDesign(f"platform_joint must be one of {', '.join(JOINTS)}, got {self.platform_joint!r}")

    @property
    def geometry(self) -> FiveBarGeometry:
        return cast(FiveBarGeometry, self.mechanism.geometry)

    @property
    def free(self) -> tuple[int, ...]:
        return (4,) if self.platform_joint == "revolute" else (3, 4, 5)

    def parts(self) -> dict[str, Part]:
        g = self.geometry
        lengths = {"proximal": g.l1, "distal": g.l2}
        return {kind: Part(self.sections[kind].tube(lengths[kind]), 2) for kind in self.kinds}

    def legs(self, joints: Array, pose: Array) -> Legs:
        g, parts = self.geometry, self.parts()
        crank, rod = parts["proximal"].tube.terms, parts["distal"].tube.terms
        c, s = np.cos(joints), np.sin(joints)
        rx = pose[:, :1] + SIGMA * g.b - g.l1 * c  # P seen from B
        rz = pose[:, 1:] + g.l1 * s
        length = np.hypot(rx, rz)
        ux, uz = rx / length, rz / length
        one, none = np.ones_like(rx), np.zeros_like(rx)
        # In the plane each leg passes nothing but a force along its rod.
        along, across = c * ux - s * uz, s * ux + c * uz
        give = rod.stretch + along**2 * crank.stretch + across**2 * crank.bend
        force = np.array([ux, uz, none])
        planar = force[:, None] * force[None] / give
        moved_x, moved_z = along * crank.stretch, across * crank.bend
        moved = np.array([c * moved_x + s * moved_z, c * moved_z - s * moved_x])
        elbow = moved[:, None] * force[None] / give
        # Across the plane the revolutes release nothing: the compliances of both tubes add up at P.
        at_elbow = np.array([[one, none, none], [-s * rx - c * rz, c, -s], [c * rx - s * rz, s, c]])
        at_platform = np.array([[one, none, none], [none, ux, uz], [none, -uz, ux]])
        S = congruent(at_elbow, _lateral(crank)) + congruent(at_platform, _lateral(rod))
        if self.platform_joint == "revolute":
            lateral = inverse3(S)
        else:
            lateral = np.zeros_like(S)
            lateral[0, 0] = 1.0 / S[0, 0]
        grip, singular = np.zeros((2, *rx.shape)), np.logical_not((length > 0.0).all(axis=1))
        return Legs(planar, lateral, elbow, np.array([rx, rz]), grip, np.asarray(singular))


def _lateral(t: Terms) -> Array:
    """Compliance (3, 3, 1, 1) of a tube's end for [fy mx mz] in the tube's axes."""
    return np.array([[t.bend, 0.0, t.couple], [0.0, t.twist, 0.0], [t.couple, 0.0, t.turn]])[:, :, None, None]
