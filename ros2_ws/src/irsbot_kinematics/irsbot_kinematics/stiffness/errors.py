"""Refusals of the elastostatics: invalid designs, postures and loads without equilibrium."""

from __future__ import annotations

from collections.abc import Sequence

from irsbot_kinematics.errors import BadInput, KinematicsError


class InvalidDesign(BadInput):
    """A tube, material, chain or design file that cannot be used; the message names the entry and both values."""


class SingularPosture(KinematicsError):
    """A posture in which the elastic structure leaves the platform free, or a load along a free motion."""

    def __init__(self, pose: Sequence[float], why: str) -> None:
        where = ", ".join(f"{value:.6g}" for value in pose)
        super().__init__(f"pose ({where}) is singular: {why}" if where else f"the posture is singular: {why}")
