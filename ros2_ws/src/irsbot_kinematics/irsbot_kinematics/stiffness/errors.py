"""What the elastostatics refuses: designs that cannot be built, postures and loads that nothing holds."""

from __future__ import annotations

from collections.abc import Sequence

from irsbot_kinematics.errors import KinematicsError


class InvalidDesign(KinematicsError, ValueError):
    """A tube, material, chain or design file that cannot be used; the message names the entry and both values."""


class SingularPosture(KinematicsError):
    """A posture in which the elastic structure leaves the platform free, or a load along a motion that is free."""

    def __init__(self, pose: Sequence[float], why: str) -> None:
        where = ", ".join(f"{value:.6g}" for value in pose)
        super().__init__(f"pose ({where}) is singular: {why}" if where else f"the posture is singular: {why}")
