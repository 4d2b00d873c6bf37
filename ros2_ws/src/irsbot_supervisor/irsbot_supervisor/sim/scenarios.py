"""Scenarios: a motion of a simulated robot, independent of the mechanism, and its plan in joint space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import floor, inf, remainder

from irsbot_kinematics import Mechanism
from irsbot_kinematics.mechanism import Floats, Signs, Status
from irsbot_kinematics.numerics.arithmetic import FLOATS
from irsbot_kinematics.numerics.tolerances import REACH_TOL_M
from irsbot_supervisor.replay.run_summary import ExpectedOutcome
from irsbot_supervisor.sim.errors import BadPath, BadScenario
from irsbot_supervisor.sim.paths import RoundedPath, corners_of
from irsbot_supervisor.sim.trajectory import MotionSequence, joint_move, nearest_turn, stand, task_move
from irsbot_supervisor.trajectory.joint_path import JointLimits, JointPath, Motion

CYCLE_TOL = 1e-9
"""rad or m: largest distance between begin and end of a cycle; far above the rounding of one cycle, too small for any
encoder."""

SAME_POSE = 1e-6
"""m or rad: accuracy with which the direct kinematics returns a pose; far above its rounding, far below the distance to
other assembly modes."""


@dataclass(frozen=True)
class TaskMove:
    """Straight lines in task space along poses, or displacements if `relative`; rounded corners; from rest to rest."""

    points: tuple[Floats, ...]
    relative: bool
    rounding_m: float = 0.0
    speed: float = 1.0


@dataclass(frozen=True)
class JointMove:
    """A straight line in joint space to a pose in a working mode (None: the present one); from rest to rest."""

    pose: Floats
    working_mode: Signs | None = None
    speed: float = 1.0


@dataclass(frozen=True)
class Wait:
    """Rest."""

    seconds: float


Piece = TaskMove | JointMove | Wait


@dataclass(frozen=True)
class Scenario:
    """One scenario for one robot."""

    name: str
    description: str
    robot: str
    expect: ExpectedOutcome
    start: Floats
    working_mode: Signs | None = None
    """None: the robot's usual mode."""
    cycle: tuple[Piece, ...] = ()
    seconds: float = inf
    """s for which the cycle is repeated: as often as it fits, at least once."""
    run: tuple[Piece, ...] = ()
    """Once, after the cycles."""
    faults: str = ""
    """A fault line, see `faults`."""

    @property
    def stands(self) -> bool:
        """True if only commands move the robot."""
        return all(isinstance(piece, Wait) for piece in (*self.cycle, *self.run))


def plan(
    scenario: Scenario, mechanism: Mechanism, limits: JointLimits, *, speed: float = 1.0, seconds: float | None = None
) -> Motion:
    """The motion of a scenario, within the limits of the joints.

    speed: factor (0..1] on all speeds. seconds: replaces the scenario's for the cycle. Raises BadScenario.
    """
    planner = _Planner(scenario, mechanism, limits, speed)
    parts: list[tuple[Motion, float]] = [(stand(planner.joints), 1)]
    if scenario.cycle:
        begin = planner.joints
        cycle = MotionSequence([(planner.drive(piece, f"cycle[{i}]"), 1) for i, piece in enumerate(scenario.cycle)])
        gap = max(abs(a - b) for a, b in zip(begin, planner.joints, strict=True))
        if not gap <= CYCLE_TOL:
            raise BadScenario(f"{scenario.name}: the cycle ends {gap:.3g} rad or m from where it begins")
        if not cycle.duration_s > 0.0:
            raise BadScenario(f"{scenario.name}: the cycle takes no time; it needs a move, or a rest above 0 s")
        wanted = (scenario.seconds if seconds is None else seconds) / cycle.duration_s
        parts.append((cycle, max(floor(wanted), 1) if wanted < inf else inf))
    parts += [(planner.drive(piece, f"run[{i}]"), 1) for i, piece in enumerate(scenario.run)]
    return MotionSequence(parts)


class _Planner:
    """Connects pieces; remembers the position of the robot."""

    def __init__(self, scenario: Scenario, mechanism: Mechanism, limits: JointLimits, speed: float) -> None:
        self._name, self._mechanism, self._limits, self._speed = scenario.name, mechanism, limits, speed
        self._mode = scenario.working_mode or mechanism.usual_working_mode
        self._pose = self._checked(scenario.start, "start")
        self.joints = self._inverse(self._pose, self._mode, "start")
        self._check_assembly()

    def drive(self, piece: Piece, where: str) -> JointPath:
        """The motion of a piece from the present position."""
        try:
            path = self._drive(piece, where)
        except BadPath as error:
            raise BadScenario(f"{self._name}: {where}: {error}") from None
        self._check_ranges(path, where)
        self.joints = path.positions[-1]
        return path

    def _check_assembly(self) -> None:
        """Refuse another assembly mode than the configured one: encoders do not show it, and a supervisor would assume
        a wrong pose."""
        usual = self._mechanism.usual_assembly_mode
        if self._begins_in(usual):
            return
        found = [mode for mode in self._mechanism.assembly_modes if self._begins_in(mode)]
        stated = f"in assembly mode {found[0]:+d}" if found else "in no assembly mode, at a Type 2 singularity"
        text = f"the pose {self._pose} is {stated}, the robot is configured for {usual:+d}"
        raise BadScenario(f"{self._name}: start: {text}; change the start, or usual.assembly_mode in the robot file")

    def _begins_in(self, assembly: int) -> bool:
        found = self._mechanism.posture(self.joints, assembly)
        axes = zip(self._mechanism.task, found.pose, self._pose, strict=True)
        return found.status == Status.SOLVED and all(
            abs(remainder(seen - wanted, axis.turn)) <= SAME_POSE for axis, seen, wanted in axes
        )

    def _check_ranges(self, path: JointPath, where: str) -> None:
        for joint, column in zip(self._mechanism.joints, zip(*path.positions, strict=True), strict=True):
            if not (joint.lower < min(column) and max(column) < joint.upper):
                reached = f"{min(column):.4g}..{max(column):.4g} {joint.unit}"
                free = f"{joint.lower:g}..{joint.upper:g}"
                raise BadScenario(f"{self._name}: {where}: {joint.name} moves over {reached}, it is free in {free}")

    def _drive(self, piece: Piece, where: str) -> JointPath:
        if isinstance(piece, Wait):
            return stand(self.joints, piece.seconds)
        speed = piece.speed * self._speed
        if isinstance(piece, JointMove):
            self._mode = piece.working_mode or self._mode
            self._pose = self._checked(piece.pose, where)
            goal = nearest_turn(self._mechanism, self._inverse(self._pose, self._mode, where), self.joints)
            return joint_move(self.joints, goal, self._limits, speed)
        points = [self._checked(point, where) for point in piece.points]
        corners = corners_of(self._pose, points) if piece.relative else [self._pose, *points]
        levers = [self._mechanism.length_m if axis.is_angle else 1.0 for axis in self._mechanism.task]
        self._pose = corners[-1]
        path = RoundedPath(corners, piece.rounding_m, levers)
        return task_move(self._mechanism, path, self._mode, self.joints, self._limits, speed=speed)

    def _checked(self, pose: Sequence[float], where: str) -> Floats:
        axes = [f"{axis.name} [{axis.unit}]" for axis in self._mechanism.task]
        if len(pose) != len(axes):
            raise BadScenario(f"{self._name}: {where}: a pose is {', '.join(axes)}, got {list(pose)}")
        return tuple(pose)

    def _inverse(self, pose: Floats, mode: Signs, where: str) -> Floats:
        if mode not in self._mechanism.working_modes:
            raise BadScenario(f"{self._name}: {where}: working mode {mode} is none of {self._mechanism.working_modes}")
        joints, reach = self._mechanism.inverse(FLOATS, pose, mode)
        if not min(reach) >= -REACH_TOL_M:
            raise BadScenario(f"{self._name}: {where}: pose {pose} is unreachable by {-min(reach) * 1e3:.1f} mm")
        return joints
