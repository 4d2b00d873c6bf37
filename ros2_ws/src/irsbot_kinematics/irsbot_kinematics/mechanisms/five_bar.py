"""Five-bar RRRRR: two cranks on the base, two rods that meet at the platform point; two translations in a plane.

Source: the five-bar of [S1] and the translational limit of [S2]; the equations are those of the planar pair.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import nan, sqrt
from typing import ClassVar

from irsbot_kinematics.mechanism import Floats
from irsbot_kinematics.mechanisms.geometry_checks import require, require_finite
from irsbot_kinematics.mechanisms.planar_loop import Loop
from irsbot_kinematics.mechanisms.planar_pair import PlanarPair
from irsbot_kinematics.numerics.arithmetic import Arithmetic, N
from irsbot_kinematics.skeleton import BASE, HERE, Cut, Link, Skeleton, Y, planar_end


@dataclass(frozen=True)
class FiveBarGeometry:
    """Lengths in metres."""

    l1: float
    """Crank."""
    l2: float
    """Rod."""
    b: float
    """Half distance of the motor axes."""

    def __post_init__(self) -> None:
        require_finite(self)
        for name in ("l1", "l2", "b"):
            require(f"{name} > 0", getattr(self, name) > 0.0, getattr(self, name), 0.0)
        require("b <= l1 + l2 (assembly)", self.b <= self.l1 + self.l2, self.b, self.l1 + self.l2)


class FiveBar(PlanarPair):
    """Joints: crank angles. Task: x, z of the point where the rods meet."""

    kind: ClassVar[str] = "five_bar"
    geometry: FiveBarGeometry

    def __init__(self, geometry: FiveBarGeometry) -> None:
        super().__init__(Loop(geometry.b, 0.0, geometry.l1, geometry.l2))
        self.geometry = geometry

    def constraint_parts(self, k: Arithmetic[N], c1: N, mz1: N, c2: N, mz2: N) -> tuple[()]:
        """Empty: the legs are planar, nothing but the plane constrains the platform."""
        return ()

    def constraint_bound(self, parts: Floats, turn_rad: float) -> float:
        """NaN: there is no constraint margin."""
        return nan

    def skeleton(self) -> Skeleton:
        """Leg 1 carries the platform; at 0 cranks and rods point to +x."""
        g, links = self.geometry, []
        for leg, (joint, foot) in enumerate(zip(self.joints, (-g.b, g.b), strict=True), 1):
            links.append(Link(f"arm_{leg}", joint.name, BASE, (foot, 0.0, 0.0), Y, shape=((g.l1, 0.0, 0.0),)))
            elbow = Link(f"rod_{leg}", f"elbow_{leg}", f"arm_{leg}", (g.l1, 0.0, 0.0), Y, shape=((g.l2, 0.0, 0.0),))
            links.append(elbow)
        links += planar_end("rod_1", g.l2, Y, (HERE,))
        drives = tuple(joint.name for joint in self.joints)
        return Skeleton(tuple(links), drives, (Cut("rod_2", (g.l2, 0.0, 0.0), HERE),), self._passive)

    def _passive(self, joints: Floats, pose: Floats) -> dict[str, float]:
        first, second = self.rod_angles(self.at(joints, pose, 0, (0.0, 0.0)))
        return {"elbow_1": first - joints[0], "elbow_2": second - joints[1], "wrist_1": -first}

    def foot_error(self, slack_m: float) -> float:
        """The motor's place, both coordinates."""
        return sqrt(2.0) * slack_m
