"""Skeleton of a new mechanism: a Python file with three equations to fill in, and a robot file."""

from __future__ import annotations

PLANAR = '''"""NAME: a planar platform on three rods; a carriage moves the near end of each.

Fill in `near_end`, `inverse` and `direct`, then: ./irsbot check-mechanism LOWER.yaml
Cranks instead of carriages: unit "rad", speeds and bends both the crank's length.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from irsbot_kinematics.own_mechanism import Arithmetic, Coordinate, InvalidGeometry, N, Pair, RodPlatform, Signs


@dataclass(frozen=True)
class NAMEGeometry:
    """Lengths in metres, angles in radians. Rail i starts at o_i, where q_i = 0, in the direction a_i."""

    o1: tuple[float, float]
    o2: tuple[float, float]
    o3: tuple[float, float]
    a1: float
    a2: float
    a3: float
    b1: tuple[float, float]  # where rod i holds the platform, seen from P
    b2: tuple[float, float]
    b3: tuple[float, float]
    l1: float
    l2: float
    l3: float
    travel: tuple[float, float]  # open range of every carriage

    def __post_init__(self) -> None:
        for name in ("l1", "l2", "l3"):
            if not getattr(self, name) > 0.0:
                raise InvalidGeometry(f"{name} > 0 is broken: {name} = {getattr(self, name)}")


class NAME(RodPlatform):
    """Joints: carriages q_i. Task: x, y of P and the turn phi of the platform.

    Say here what the signs of a working mode and the labels of the assembly modes mean.
    """

    kind: ClassVar[str] = "LOWER"
    geometry: NAMEGeometry
    label_is_invariant: ClassVar[bool] = True  # False, with `track`, where a motion free of Type 2 changes a label

    def __init__(self, geometry: NAMEGeometry) -> None:
        g = self.geometry = geometry
        super().__init__((g.l1, g.l2, g.l3), (g.b1, g.b2, g.b3), speeds=(1.0, 1.0, 1.0), bends=(0.0, 0.0, 0.0))
        self.origins, self.directions = (g.o1, g.o2, g.o3), (g.a1, g.a2, g.a3)
        self.joints = tuple(Coordinate(f"carriage_{i}", "m", *g.travel) for i in (1, 2, 3))
        self.working_modes = tuple((i, j, k) for i in (1, -1) for j in (1, -1) for k in (1, -1))
        self.assembly_modes = (1, -1)
        self.usual_working_mode, self.usual_assembly_mode = (1, 1, 1), 1

    # --- equations, floats or arrays: no `if` on values, functions from k ---

    def near_end(self, k: Arithmetic[N], leg: int, joint: N) -> tuple[Pair[N], Pair[N], Pair[N]]:
        """C_i = o_i + q_i u_i, its derivative by q_i, and the second derivative."""
        raise NotImplementedError("near_end: return C, C' and C'' of this leg, (x, y) each")

    def inverse(self, k: Arithmetic[N], pose: Sequence[N], mode: Signs) -> tuple[tuple[N, ...], tuple[N, ...]]:
        """Joint positions of a pose in one working mode, and the reach of each leg, m, negative outside.

        The sign of a leg must be that of -r.C', r from C to the platform: `check-mechanism` says so if it is not.
        """
        raise NotImplementedError("inverse: return the joints, and the reach of each leg")

    def direct(self, k: Arithmetic[N], joints: Sequence[N], assembly: int) -> tuple[tuple[N, ...], tuple[N, N]]:
        """Pose, and two assembly clearances, m: [0] distance to coming apart, [1] to not determining the pose."""
        raise NotImplementedError("direct: return (x, y, phi), and both assembly clearances")
'''

PLANAR_ROBOT = """# Check it: ./irsbot check-mechanism LOWER.yaml
mechanism: LOWER.py:NAME
description: say in one line what machine this is
geometry:
  o1: {value: [0.0, 0.0], source: "drawing"}
  o2: {value: [1.0, 0.0], source: "drawing"}
  o3: {value: [0.0, 0.6], source: "drawing"}
  a1: {value: 0.0, source: "drawing"}
  a2: {value: 3.141592653589793, source: "drawing"}
  a3: {value: 0.0, source: "drawing"}
  b1: {value: [0.0, 0.0], source: "drawing"}
  b2: {value: [0.0, 0.0], source: "drawing"}
  b3: {value: [0.2, 0.0], source: "drawing"}
  l1: {value: 0.4, source: "drawing"}
  l2: {value: 0.4, source: "drawing"}
  l3: {value: 0.4, source: "drawing"}
  travel: {value: [0.0, 1.2], source: "drawing"}
usual: {working_mode: [1, 1, 1], assembly_mode: 1}
supervision:
  velocity_limit: [1.0]       # m/s, every joint
  deceleration_limit: [20.0]  # m/s2
"""

SPATIAL = '''"""NAME: a platform that translates in space, on three carriages and rods of one length.

Fill in `_rails`, then: ./irsbot check-mechanism LOWER.yaml
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from irsbot_kinematics.own_mechanism import DeltaFamily, DeltaGeometry, RailInSpace


@dataclass(frozen=True)
class NAMEGeometry(DeltaGeometry):
    """Lengths in metres: L (rods) and limits (open range of every carriage) come from DeltaGeometry; add yours."""

    size: float


class NAME(DeltaFamily):
    """Joints: carriages. Task: x, y, z of the platform point."""

    kind: ClassVar[str] = "LOWER"
    geometry: NAMEGeometry

    def __init__(self, geometry: NAMEGeometry) -> None:
        self.rails = self._rails(geometry)
        super().__init__(geometry)

    @staticmethod
    def _rails(g: NAMEGeometry) -> tuple[RailInSpace, RailInSpace, RailInSpace]:
        """Where every carriage stands at 0, less where its rod holds the platform, and the unit vector of its rail."""
        raise NotImplementedError("_rails: return three RailInSpace((x, y, z), (ux, uy, uz))")
'''

SPATIAL_ROBOT = """# Check it: ./irsbot check-mechanism LOWER.yaml
mechanism: LOWER.py:NAME
description: say in one line what machine this is
geometry:
  L: {value: 0.5, source: "drawing"}
  limits: {value: [0.0, 1.0], source: "drawing"}
  size: {value: 0.3, source: "drawing"}
usual: {working_mode: [1, 1, 1], assembly_mode: -1}
supervision:
  velocity_limit: [1.0]       # m/s, every joint
  deceleration_limit: [20.0]  # m/s2
"""

SKELETONS = {("planar", 3): (PLANAR, PLANAR_ROBOT), ("spatial", 3): (SPATIAL, SPATIAL_ROBOT)}
"""Mechanism and robot file, by platform and number of legs."""


def skeleton(name: str, platform: str, legs: int) -> tuple[str, str]:
    """Text of the Python file and of the robot file. name: of the class; the file names are its lower-case form."""
    source, robot = (text.replace("NAME", name).replace("LOWER", name.lower()) for text in SKELETONS[platform, legs])
    return source, robot
