"""Base of the elastic robots: two legs, mirror images in the plane of motion, at a common point P.

Actuators locked; tubes elastic; joints, platform and base rigid (elastostatic sheet section 1).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from irsbot_kinematics.mechanism import Mechanism, Signs
from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_kinematics.stiffness.errors import InvalidDesign
from irsbot_kinematics.stiffness.tubes import Section, Tube

S = TypeVar("S", bound="Structure")


class Part(NamedTuple):
    """A kind of tube of a robot and how many of it there are."""

    tube: Tube
    number: int


class Legs(NamedTuple):
    """Both legs in N postures; the last axis is the leg. Blocks as in `symmetric`, at P in base axes."""

    planar: Array
    """(3, 3, N, 2) stiffness of each leg in the plane of motion."""
    lateral: Array
    """(3, 3, N, 2) stiffness of each leg across the plane."""
    elbow: Array
    """(2, 3, N, 2) displacement [dx dz] of the near end of the equivalent rod, m per planar twist of the platform."""
    rod: Array
    """(2, N, 2) vector [x z] from the near to the far end of the equivalent rod, m."""
    grip: Array
    """(2, N, 2) vector [x z] from P to the far end of the equivalent rod, m."""
    singular: NDArray[np.bool_]
    """(N,) True if a leg itself is singular; its stiffness is then invalid."""


@dataclass(frozen=True)
class Structure(ABC):
    """An elastic robot of the two families. Instances are checked and never change."""

    family: ClassVar[str]
    kinds: ClassVar[tuple[str, ...]]
    """Kinds of tubes of the family."""
    may_be_rigid: ClassVar[tuple[str, ...]] = ()
    why_singular: ClassVar[str]
    """Meaning of `Legs.singular`."""

    name: str
    description: str
    mechanism: Mechanism
    sections: Mapping[str, Section]
    working_mode: Signs
    sources: Mapping[str, str]
    """Source of each number of the geometry."""
    assumed: tuple[str, ...]
    """Numbers that the source does not print."""

    def __post_init__(self) -> None:
        if set(self.sections) != set(self.kinds):
            raise InvalidDesign(
                f"the family {self.family} has the tubes {', '.join(self.kinds)}, got {', '.join(self.sections)}"
            )
        for kind, section in self.sections.items():
            if section.rigid and kind not in self.may_be_rigid:
                allowed = ", ".join(self.may_be_rigid) or "none"
                raise InvalidDesign(
                    f"the {kind} tubes of the family {self.family} cannot be rigid; those that can: {allowed}"
                )
        if self.working_mode not in self.mechanism.working_modes:
            raise InvalidDesign(f"working mode {self.working_mode} is not one of {self.mechanism.working_modes}")

    @abstractmethod
    def parts(self) -> dict[str, Part]:
        """Tubes and their numbers, by kind."""

    @abstractmethod
    def legs(self, joints: Array, pose: Array) -> Legs:
        """Legs at consistent joints (N, 2) and poses (N, 2)."""

    @property
    @abstractmethod
    def free(self) -> tuple[int, ...]:
        """Coordinates of the platform's twist that no posture holds, by their index in [dx dy dz rx ry rz]."""

    @property
    def length_m(self) -> float:
        """Length by which moments are divided to compare them with forces."""
        return self.mechanism.length_m

    @property
    def tilt_lever_m(self) -> float:
        """m: what turns the platform by 1 rad counts at least as what displaces a rod's end there by so much."""
        return 0.0

    def fitted(self: S, mechanism: Mechanism, working_mode: Signs | None = None) -> S:
        """The same tubes on the lengths of another robot of the family, for example of the one that is supervised.

        working_mode: the robot's usual one if left out. Raises InvalidDesign for a robot of another family.
        """
        if mechanism.kind != self.family:
            raise InvalidDesign(
                f"the tubes of '{self.name}' are for the family {self.family}, the robot is a {mechanism.kind}"
            )
        mode = mechanism.usual_working_mode if working_mode is None else working_mode
        return replace(self, mechanism=mechanism, working_mode=mode)

    @property
    def mass(self) -> float:
        """Mass of all tubes, kg; platform, joints, motors and elbow carriers are not counted."""
        return sum(part.number * part.tube.mass for part in self.parts().values())
