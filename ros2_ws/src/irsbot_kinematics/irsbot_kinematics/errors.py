"""Exceptions of the library: mistakes of the caller, and poses that do not exist."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


class KinematicsError(Exception):
    """Base of all exceptions that this package raises on purpose."""


class InvalidGeometry(KinematicsError, ValueError):
    """A geometry that no machine can have; the message names the broken inequality with both values."""


class UnknownRobot(KinematicsError, KeyError):
    """A name that is not a mechanism, a preset or a file."""

    def __init__(self, name: str, known: Iterable[str]) -> None:
        super().__init__(f"no robot '{name}'; known robots are {', '.join(known)}, or give a YAML file")

    def __str__(self) -> str:
        return str(self.args[0])


class BadInput(KinematicsError, ValueError):
    """Wrong length, not finite, or a mode that the robot does not have."""


class NotCompiled(KinematicsError, RuntimeError):
    """Equations of which no machine code can be made here: there is no compiler, or they are not in closed form."""


class Unreachable(KinematicsError):
    """A pose outside the workspace of a working mode.

    reach_m: distance to the workspace boundary, negative = how far outside; legs: reach of each leg.
    """

    def __init__(self, pose: Sequence[float], legs_reach_m: Sequence[float]) -> None:
        self.legs_reach_m = tuple(legs_reach_m)
        self.reach_m = min(self.legs_reach_m)
        leg = self.legs_reach_m.index(self.reach_m) + 1
        where = ", ".join(f"{value:.6g}" for value in pose)
        super().__init__(f"pose ({where}) is unreachable by {-self.reach_m * 1e3:.2f} mm (leg {leg})")


class NotAssembled(KinematicsError):
    """Joint positions to which no pose belongs, or no single one.

    gap_m: assembly clearance; negative: how far the legs are apart.
    """

    def __init__(self, joints: Sequence[float], gap_m: float, why: str) -> None:
        self.gap_m = gap_m
        where = ", ".join(f"{value:.6g}" for value in joints)
        super().__init__(f"joints ({where}) have no pose: {why}")
