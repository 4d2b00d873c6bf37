"""The contract of every mechanism, and the posture. Code outside `mechanisms` does not depend on the mechanism.

Convention of all mechanisms: A t + B qdot = 0 with t the platform twist, the rows of A unit actuation screws at the
platform point, B diagonal. Type 1: a B_ii is zero. Type 2: det A is zero.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from math import inf, isfinite, nan, tau
from typing import Any, ClassVar, Generic, NamedTuple

from irsbot_kinematics import statics
from irsbot_kinematics.numerics.arithmetic import FLOATS, Arithmetic, Array, N
from irsbot_kinematics.numerics.tolerances import (
    ASSEMBLY_TOL_M,
    CLOSURE_TOL_M,
    COINCIDENT_TOL_M,
    FARTHEST,
    SIGN_DEAD_BAND,
)
from irsbot_kinematics.skeleton import Skeleton

Floats = tuple[float, ...]
Signs = tuple[int, ...]


class Status(IntEnum):
    """Result of a request for one pose or posture; the numbers are those of the services."""

    SOLVED = 0
    UNREACHABLE = 1
    SINGULAR = 2
    INVALID = 3


class Coordinate(NamedTuple):
    """One joint or task coordinate: its name, its unit (`rad` or `m`) and its range, ends included.

    name: as in messages and tables.
    unit: 'rad' or 'm'.
    lower: lower end of its range.
    upper: upper end.
    """

    name: str
    unit: str
    lower: float
    upper: float

    @property
    def is_angle(self) -> bool:
        return self.unit == "rad"

    @property
    def turn(self) -> float:
        """Period of the positions: 2 pi rad, infinite for a slide. For use with `math.remainder`."""
        return tau if self.is_angle else inf

    def contains(self, position: float) -> bool:
        """True if a position is within the range; an angle may differ by whole turns."""
        if self.is_angle and isfinite(self.lower):
            position = self.lower + (position - self.lower) % tau
        return self.lower <= position <= self.upper


class Cuspidal(NamedTuple):
    """Whether the robot can change its assembly mode without meeting a singularity.

    answer: 'yes', 'no' or 'unknown'.
    reason: how that is known.
    lengths: Whether the answer holds for the shipped lengths alone, because a motion of that robot proves it.
    """

    answer: str
    reason: str
    lengths: bool = False


@dataclass(slots=True)
class Legs(Generic[N]):
    """Effect of the legs on the platform in one posture (N = float) or many (N = array).

    screws: Rows of A: unit actuation screws at the platform point; moments in metres.
    levers: Diagonal of B: m/rad for a revolute actuator, 1 for a slide.
    normalised_levers: Signed Type 1 measure of each leg, B_ii over its largest possible size: -1..1.
    reach: signed distance to the workspace boundary of each leg, m.
    closure: m by which each leg fails to connect base and platform.
    constraint: Constraint margin, at least 0, may exceed 1; None where the legs cannot lose a constraint together.
    limb: Margin of each limb against losing a constraint of its own, 0..1.
    parts: Numbers behind the margins that the mechanism's own guarantee starts from.
    attachments: Attachment vectors of a platform that can turn, m; empty if it cannot turn.
    """

    screws: tuple[tuple[N, ...], ...]
    levers: tuple[N, ...]
    normalised_levers: tuple[N, ...]
    reach: tuple[N, ...]
    closure: tuple[N, ...]
    constraint: N | None = None
    limb: tuple[N, ...] = ()
    parts: tuple[N, ...] = ()
    attachments: tuple[tuple[N, N], ...] = ()


class Posture(NamedTuple):
    """One posture of one mechanism with its instantaneous kinematics. If `status` is not SOLVED, undetermined
    numbers are NaN.

    status: `Status`: SOLVED, or the reason.
    joints: (n,) rad or m.
    pose: (m,) m or rad.
    working_mode: sign per leg, 0 where it has none.
    assembly_mode: label of the assembly mode; 0 where nothing is solved.
    screws: (n, n) rows of A, see `Legs`.
    levers: (n,) diagonal of B, see `Legs`.
    normalised_levers: (n,) signed Type 1 measure, see `Legs`.
    reach: (n,) m to the workspace boundary of each leg.
    gaps: assembly clearances, m: [0] 0 where two assembly modes meet; [1] distance to not determining the pose.
    cos_pressure: Cosine of each leg's pressure angle, 0..1; the smallest is the Type 2 margin.
    det: Determinant of the screws.
    constraint: constraint margin, at least 0, may exceed 1; NaN where there is none.
    limb: margin of each limb of its own, 0..1.
    residual: m: largest closure error.
    attachments: (n, 2) attachment vectors of a platform that can turn, m; empty if it cannot turn.
    parts: Numbers behind the margins that the mechanism's own guarantee starts from.
    """

    status: Status
    joints: Floats
    pose: Floats
    working_mode: Signs
    assembly_mode: int
    screws: tuple[Floats, ...]
    levers: Floats
    normalised_levers: Floats
    reach: Floats
    gaps: Floats
    cos_pressure: Floats
    det: float
    constraint: float
    limb: Floats
    residual: float
    attachments: tuple[Floats, ...]
    parts: Floats

    @property
    def type1(self) -> Floats:
        """Type 1 margin of each leg, 0..1."""
        return tuple(map(abs, self.normalised_levers))

    @property
    def type2(self) -> float:
        """Type 2 margin, 0..1."""
        return min(self.cos_pressure) if self.status == Status.SOLVED else nan


class CertifiedBounds(NamedTuple):
    """Lower bounds of the margins over all postures within a given travel of each joint.

    type1: (n,) of every leg.
    type2: of all legs.
    constraint: NaN where there is none.
    limb: of every limb of its own.
    """

    type1: Floats
    type2: float
    constraint: float
    limb: Floats


class CertifiedColumns(NamedTuple):
    """`CertifiedBounds` of many postures.

    type1: (N,) of every leg.
    type2: (N,) of all legs.
    constraint: (N,), None where there is none.
    limb: (N,) of every limb of its own.
    """

    type1: tuple[Array, ...]
    type2: Array
    constraint: Array | None
    limb: tuple[Array, ...]


class Locus(NamedTuple):
    """A curve of poses at which one working mode is singular.

    kind: 'type1' or 'type2'.
    points: (N, 2) first two task coordinates, m; NaN where the curve is interrupted.
    """

    kind: str
    points: Array


class Mechanism(ABC):
    """A parallel robot. Instances hold a validated geometry and never change.

    The equations `inverse`, `direct` and `legs` are written once for floats and arrays (`Arithmetic`).

    kind: Name of the topology, as in the registry and in YAML files.
    geometry: Frozen dataclass of lengths (m) and angles (rad).
    joints: every joint; their order is that of all joint positions.
    task: every task coordinate; a turn of the platform comes last.
    length_m: Characteristic length that makes moments comparable with forces.
    working_modes: sign per leg, every combination that exists.
    assembly_modes: labels, none of them 0.
    usual_working_mode: which one robots run in if nothing else is said.
    usual_assembly_mode: likewise.
    label_is_invariant: Whether the assembly label is invariant along a branch, which is any motion free of Type 2.
        Where it is not, only `track` follows the branch.
    cuspidal: Whether assembly modes are joined by motions free of singularities, and how that is known.
    limb_count: How many limbs have a margin of their own.
    """

    kind: ClassVar[str]
    geometry: Any
    joints: tuple[Coordinate, ...]
    task: tuple[Coordinate, ...]
    length_m: float
    working_modes: tuple[Signs, ...]
    assembly_modes: tuple[int, ...]
    usual_working_mode: Signs
    usual_assembly_mode: int
    label_is_invariant: ClassVar[bool] = True
    cuspidal: ClassVar[Cuspidal] = Cuspidal("unknown", "not examined")
    limb_count: int = 0

    @abstractmethod
    def inverse(self, k: Arithmetic[N], pose: Sequence[N], mode: Signs) -> tuple[tuple[N, ...], tuple[N, ...]]:
        """Joint positions of a pose in one working mode, and the reach of each leg (m, negative = too far).

        Outside the workspace the joints are those of the leg stretched or folded towards the pose.
        """

    @abstractmethod
    def direct(self, k: Arithmetic[N], joints: Sequence[N], assembly: int) -> tuple[tuple[N, ...], tuple[N, N]]:
        """Pose of joint positions in one assembly mode, and its assembly clearances (m) as in `Posture.gaps`.

        The pose is valid only if both clearances are positive; nothing is raised if they are not.
        """

    @abstractmethod
    def legs(self, k: Arithmetic[N], joints: Sequence[N], pose: Sequence[N]) -> Legs[N]:
        """Screws, levers and margins of a posture that closes."""

    @abstractmethod
    def certified_bounds(self, at: Posture, travel: Sequence[float], slack_m: float = 0.0) -> CertifiedBounds:
        """Lower bounds of all margins while every joint k moves by at most travel[k] from the posture.

        travel: rad or m per joint; slack_m: largest error of the geometry, m, 0.0 for an exact machine:
        every length is off by at most slack_m, and so is every coordinate of every place at which a leg is held by the
        base or holds the platform, each independently and of every leg its own. A rail is held at both ends of its
        slide's range. An angle is off by what takes the end of its arm off by slack_m. What the drawing has parallel,
        level or symmetric to the plane of motion stays so.
        `at` is the posture of the exact machine. The bounds hold for the margins of the machine as it is, at joints in
        the box, on the branch on which its geometry comes out of the exact one.
        The bounds are proved, not sampled; they are 0 where nothing can be said, as of a travel or slack that is
        negative or NaN. `at` must be SOLVED.
        """

    def certified_bounds_many(
        self, legs: Legs[Array], gaps: Sequence[Array], travel: Sequence[Array], slack_m: float = 0.0
    ) -> CertifiedColumns | None:
        """`certified_bounds` of many solved postures at once, in columns (N,), up to rounding.

        legs, gaps: as `legs` and `direct` give them. travel: (N,) rad or m per joint. Returns None where the mechanism
        has no such form; 0 in the rows of which nothing can be said.
        """
        return None

    def sharp_bounds(self, at: Posture, travel: Sequence[float], slack_m: float = 0.0) -> CertifiedBounds:
        """Second-order bounds over the same box, with the same guarantee: tighter in small boxes. Neither is always the
        better one."""
        return self.certified_bounds(at, travel, slack_m)

    def sharp_bounds_many(
        self,
        joints: Sequence[Array],
        pose: Sequence[Array],
        legs: Legs[Array],
        gaps: Sequence[Array],
        travel: Sequence[Array],
        slack_m: float = 0.0,
    ) -> CertifiedColumns | None:
        """`sharp_bounds` of many solved postures at once, in columns (N,), up to rounding.

        joints, pose: of the postures. legs, gaps, travel: as for `certified_bounds_many`. Returns None where the
        mechanism has no such form; 0 or NaN in the rows of which nothing can be said.
        """
        return None

    @abstractmethod
    def clearance(self, at: Posture) -> float:
        """Distance, m, that the platform can move in any direction without meeting a singularity: a lower bound."""

    @abstractmethod
    def bias(self, at: Posture, joint_rates: Sequence[float], pose_rates: Sequence[float]) -> Floats:
        """c of A a + B qddot + c = 0: the part of the accelerations that depends on velocities."""

    def workspace_ranges(self) -> tuple[tuple[float, float], tuple[float, float]] | None:
        """Ranges of the first two task coordinates that hold every reachable pose; None: not known in closed form."""
        first, second = ((coordinate.lower, coordinate.upper) for coordinate in self.task[:2])
        return (first, second) if all(map(isfinite, (*first, *second))) else None

    def symmetric_extent(self) -> tuple[float, float] | None:
        """Largest x and lowest z, m, of a workspace that is its own mirror image about x = 0; None: it is not."""
        return None

    def loci(self, mode: Signs) -> tuple[Locus, ...] | None:
        """Type 1 and Type 2 curves of one working mode from their equations; None: not known in closed form."""
        return None

    def constraint_points(self, mode: Signs) -> tuple[Floats, ...] | None:
        """Isolated poses at which the legs lose a constraint in one working mode; None: no such poses are known."""
        return None

    def skeleton(self) -> Skeleton | None:
        """Links and joints for pictures of the robot; None if there is no description."""
        return None

    def prepare(self) -> None:  # noqa: B027 - most mechanisms have nothing to prepare
        """Compute everything that is computed once, so that the first sample takes no longer than the others."""

    def posture(self, joints: Sequence[float], assembly: int) -> Posture:
        """The complete posture in plain floats. Never raises for values."""
        q = tuple(joints)
        if not meant(q):
            return self._undetermined(Status.INVALID, q, (nan, nan))
        pose, gaps = self.direct(FLOATS, q, assembly)
        if not gaps[0] >= -ASSEMBLY_TOL_M:
            return self._undetermined(Status.UNREACHABLE, q, gaps)
        if not gaps[1] > COINCIDENT_TOL_M:
            return self._undetermined(Status.SINGULAR, q, gaps)
        found = self.at(q, pose, assembly, gaps)
        if not found.residual <= CLOSURE_TOL_M:  # joints of so many turns or metres that no digits are left
            return self._undetermined(Status.INVALID, q, gaps)
        return found

    def track(self, joints: Sequence[float], previous: Posture) -> Posture:
        """The posture at joints near those of `previous`, on the same branch of the direct kinematics."""
        return self.posture(joints, previous.assembly_mode or self.usual_assembly_mode)

    def at(self, joints: Floats, pose: Floats, assembly: int, gaps: tuple[float, float]) -> Posture:
        """The posture of joints and a pose that belong together."""
        legs = self.legs(FLOATS, joints, pose)
        det, cosines = statics.pressure_cosines(FLOATS, legs.screws, legs.attachments)
        return Posture(
            Status.SOLVED,
            joints,
            pose,
            tuple([sign_of(s) for s in legs.normalised_levers]),
            assembly,
            legs.screws,
            legs.levers,
            legs.normalised_levers,
            legs.reach,
            gaps,
            cosines,
            det,
            nan if legs.constraint is None else legs.constraint,
            legs.limb,
            max(map(abs, legs.closure)),
            legs.attachments,
            legs.parts,
        )

    def _undetermined(self, status: Status, joints: Floats, gaps: tuple[float, float]) -> Posture:
        each = (nan,) * len(self.joints)
        pose = (nan,) * len(self.task)
        no_mode = (0,) * len(self.joints)
        return Posture(status, joints, pose, no_mode, 0, (), each, each, each, gaps, each, nan, nan, (), nan, (), ())


def meant(joints: Sequence[float]) -> bool:
    """True if joint positions are numbers of size at most FARTHEST; their sum is the fastest test."""
    return sum(map(abs, joints)) <= FARTHEST or all(abs(value) <= FARTHEST for value in joints)


def sign_of(sine: float) -> int:
    """-1 or +1; 0 within the dead band, and for NaN."""
    return 1 if sine > SIGN_DEAD_BAND else -1 if sine < -SIGN_DEAD_BAND else 0
