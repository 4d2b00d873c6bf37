"""A robot for library users: arrays in, arrays out, exceptions for postures that do not exist."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from math import acos, remainder
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from irsbot_kinematics import arguments, batch, statics
from irsbot_kinematics.batch import Evaluations
from irsbot_kinematics.description.robot_file import RobotFile, preset_names, read_robot
from irsbot_kinematics.errors import BadInput, NotAssembled, Unreachable
from irsbot_kinematics.mechanism import Cuspidal, Floats, Legs, Mechanism, Posture, Status
from irsbot_kinematics.numerics.arithmetic import FLOATS, Array
from irsbot_kinematics.numerics.tolerances import REACH_TOL_M
from irsbot_kinematics.solutions import DirectSolution, Evaluation, InverseSolution, LabelsVary

MOST_THREADS = 1024
"""Threads of `Robot.compile`, at most: more than any machine has cores."""


class Robot:
    """One machine. Poses are (m,) task coordinates, joints (n,) joint positions, SI units and radians.

    Modes left out mean the robot's usual ones.

    mechanism: the equations, and the joints, `task`, `working_modes`, `assembly_modes`, `geometry`, see `Mechanism`.
    name, description: as the robot's file says.
    supervision: settings of the supervisor that belong to this machine, by name.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        name: str = "",
        description: str = "",
        supervision: Mapping[str, Any] | None = None,
    ) -> None:
        """supervision: settings of the supervisor that belong to this machine; this class does not read them."""
        self.mechanism = arguments.instance(mechanism, "mechanism", Mechanism, "a Mechanism; see make_robot")
        self.name = name or mechanism.kind
        self.description = description
        self.supervision = dict(supervision or {})
        self._machine_code: dict[int, batch.Fill] = {}  # by assembly mode

    def compile(self, threads: int = 1) -> None:
        """Let `evaluate_many` of this object run on machine code, two to four times as fast; with a load or a start it
        does not. threads: number of threads, at most one per core is of use.

        A C compiler makes it in a few seconds (cc, or the one named in the environment variable CC); later processes
        find it in ~/.cache/irsbot. Results differ from the others by the rounding of sine, cosine and arc cosine. A
        copy of the robot, also in another process, is not compiled. Raises NotCompiled without a compiler, and for a
        mechanism without equations in closed form, and BadInput.
        """
        from irsbot_kinematics.machine_code.library import compiled  # not for nodes, which are to start at once

        count = arguments.count(threads, "threads", 1, MOST_THREADS)
        codes = {mode: compiled(self.mechanism, mode, count) for mode in self.mechanism.assembly_modes}
        self._machine_code = {mode: code.evaluate for mode, code in codes.items()}

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_machine_code": {}}  # a library of this process

    @property
    def cuspidal(self) -> Cuspidal:
        """Whether the robot can change its assembly mode without a singularity (yes, no or unknown), and the reason."""
        stated, kind = self.mechanism.cuspidal, self.mechanism.kind
        shipped = kind in preset_names() and self.mechanism.geometry == read_robot(kind).mechanism.geometry
        if stated.lengths and not shipped:
            return Cuspidal("unknown", "the shipped lengths are cuspidal; for others look for a loop about a cusp")
        return stated

    def __repr__(self) -> str:
        return f"Robot('{self.name}', {self.mechanism.geometry})"

    def inverse(self, pose: ArrayLike, working_mode: str | Sequence[int] | None = None) -> Array:
        """Joint positions (n,), rad or m, of a pose (m,) in a working mode, as (1, -1) or '+-'. Raises Unreachable,
        BadInput."""
        x, mode = self._pose(pose), arguments.working_mode(self.mechanism, working_mode)
        q, reach = self.mechanism.inverse(FLOATS, x, mode)
        if not min(reach) >= -REACH_TOL_M:
            raise Unreachable(x, reach)
        return np.array(q)

    def inverse_all(self, pose: ArrayLike) -> list[Array]:
        """Joint positions of a pose in every working mode that reaches it, without regard to joint ranges.

        The order is that of `mechanism.working_modes`; `inverse_solutions` returns the modes too.
        """
        return [solution.joints for solution in self.inverse_solutions(pose)]

    def inverse_solutions(self, pose: ArrayLike) -> list[InverseSolution]:
        """The same with the working mode, and whether the joints are within their range."""
        solutions = []
        for mode in self.mechanism.working_modes:
            try:
                q = self.inverse(pose, mode)
            except Unreachable:
                continue
            solutions.append(InverseSolution(q, mode, self._within_range(q.tolist())))
        return solutions

    def direct(self, joints: ArrayLike, assembly_mode: int | None = None) -> Array:
        """Pose (m,) of joint positions (n,), m or rad. Raises NotAssembled if no pose, or no single one, belongs to
        them, and BadInput."""
        return np.array(self.posture(joints, assembly_mode).pose)

    def direct_all(self, joints: ArrayLike) -> list[Array]:
        """Poses of joint positions in every assembly mode that exists, without regard to joint ranges.

        The order is that of `mechanism.assembly_modes`; `direct_solutions` returns the modes too.
        """
        return [solution.pose for solution in self.direct_solutions(joints)]

    def direct_solutions(self, joints: ArrayLike) -> list[DirectSolution]:
        """The same with assembly mode and working mode, and whether the joints are within their range."""
        solutions = []
        for mode in self.mechanism.assembly_modes:
            try:
                at = self.posture(joints, mode)
            except NotAssembled:
                continue
            within = self._within_range(at.joints)
            solutions.append(DirectSolution(np.array(at.pose), mode, at.working_mode, within))
        return solutions

    def posture(self, joints: ArrayLike, assembly_mode: int | None = None) -> Posture:
        """The complete posture in plain floats. Raises NotAssembled and BadInput like `direct`."""
        q = self._joints(joints)
        at = self.mechanism.posture(q, arguments.assembly_mode(self.mechanism, assembly_mode))
        if at.status == Status.UNREACHABLE:
            raise NotAssembled(q, at.gaps[0], f"the legs are {-at.gaps[0] * 1e3:.2f} mm apart")
        if at.status != Status.SOLVED:
            raise NotAssembled(q, at.gaps[0], "the pose is not determined by the joints (Type 2)")
        return at

    def posture_near(self, joints: ArrayLike, pose: ArrayLike) -> Posture:
        """The posture of joint positions whose pose is nearest to a given pose. Raises NotAssembled.

        The distance is the largest difference of a coordinate, angles modulo a turn, positions over `length_m`.
        """
        q = self._joints(joints)
        at = self._nearest(q, self._pose(pose))
        if at.status != Status.SOLVED:
            raise NotAssembled(q, at.gaps[0], "in no assembly mode")
        return at

    def _nearest(self, joints: Floats, pose: Floats) -> Posture:
        """The same for any numbers as joints: not SOLVED where no pose belongs to them."""
        task = self.mechanism.task
        found = [self.mechanism.posture(joints, mode) for mode in self.mechanism.assembly_modes]
        solved = [at for at in found if at.status == Status.SOLVED]
        if not solved:
            return max(found, key=lambda at: at.gaps[0])
        lengths = [1.0 if c.is_angle else self.mechanism.length_m for c in task]

        def away(at: Posture) -> float:
            each = zip(at.pose, pose, task, lengths, strict=True)
            return max(abs(remainder(a - b, c.turn)) / length for a, b, c, length in each)

        return min(solved, key=away)

    def jacobians(self, pose: ArrayLike, joints: ArrayLike) -> tuple[Array, Array]:
        """A (n, n) and B (n, n) of A t + B qdot = 0 at a pose and joints. Raises BadInput if they are not consistent.

        They are consistent if every leg closes to a micrometre; the same holds for the methods below.
        """
        legs = self._legs(pose, joints)
        return np.array(legs.screws), np.diag(legs.levers)

    def evaluate(
        self, joints: ArrayLike, assembly_mode: int | None = None, *, force: float = 1.0, moment: float = 0.0
    ) -> Evaluation:
        """Pose and margins of one posture. force (N), moment (N m): the load of `reaction_max`. Raises NotAssembled,
        BadInput."""
        force, moment = _load(force, moment)
        at = self.posture(joints, assembly_mode)
        return Evaluation(
            joint_position=at.joints,
            pose=at.pose,
            working_mode=at.working_mode,
            assembly_mode=at.assembly_mode,
            type1_margin=at.type1,
            type2_margin=at.type2,
            constraint_margin=at.constraint,
            limb_margin=at.limb,
            clearance=self.mechanism.clearance(at),
            pressure_angle=tuple(acos(cosine) for cosine in at.cos_pressure),
            reaction_max=statics.reaction_max(FLOATS, at.screws, force, moment, turns=bool(at.attachments)),
            closure_residual=at.residual,
        )

    def evaluate_many(
        self,
        joints: ArrayLike,
        assembly_mode: int | None = None,
        *,
        start: ArrayLike | None = None,
        force: float | None = None,
        moment: float = 0.0,
        out: Evaluations | None = None,
    ) -> Evaluations:
        """Poses and margins of many joint positions (N, n): arrays, NaN and a status where not assembled.

        Without a start every sample is solved by itself, in one assembly mode. Where the labels of the assembly modes
        do not follow a branch (`mechanism.label_is_invariant` is False), neighbouring samples may then lie on different
        branches: LabelsVary is warned of. start: pose (m,) near that of the first sample; the samples are a motion and
        are followed from there on its branch, one after the other; what comes after a sample without a pose has none.
        force (N), moment (N m): the load of `reaction_max`, which is left out without a force. out: results of an
        earlier call for as many samples; its arrays are filled anew and returned, which saves the time that new memory
        takes: with machine code about half of all. Raises BadInput.
        """
        Q = arguments.table(joints, len(self.mechanism.joints), "joints", copy=False)
        if out is not None:
            arguments.instance(out, "out", Evaluations, "results of evaluate_many")
        load = _load(0.0 if force is None else force, moment)
        asked = load if force is not None or moment else None
        assembly = arguments.assembly_mode(self.mechanism, assembly_mode)
        if start is not None:
            if assembly_mode is not None:
                raise BadInput("give an assembly mode or the pose of the start, not both")
            pose = arguments.place(start, self.mechanism.task, "start")
            first = self._nearest(tuple(Q[0].tolist()), pose) if len(Q) else None
            return batch.evaluate_motion(self.mechanism, Q, first, asked, out)
        if len(Q) > 1 and not self.mechanism.label_is_invariant:
            warnings.warn(
                f"assembly modes of {self.mechanism.kind} do not follow a branch: samples of one motion may lie on "
                "different branches; give start=pose to follow the branch of a motion",
                LabelsVary,
                stacklevel=2,
            )
        return batch.evaluate_many(self.mechanism, Q, assembly, asked, self._machine_code.get(assembly), out)

    def inverse_many(
        self, poses: ArrayLike, working_mode: str | Sequence[int] | None = None
    ) -> tuple[Array, NDArray[np.uint8], Array]:
        """Joints (N, n), status (N,) and reach (N,) in m of many poses (N, m); NaN where a pose is not reachable."""
        X = arguments.table(poses, len(self.mechanism.task), "poses")
        return batch.inverse_many(self.mechanism, X, arguments.working_mode(self.mechanism, working_mode))

    def velocity(self, pose: ArrayLike, joints: ArrayLike, joint_rates: ArrayLike) -> Array:
        """Platform twist (n,), m/s and rad/s in the base frame, of joint rates (n,), rad/s or m/s: t = -A^-1 B qdot.

        Raises NotAssembled at Type 2, BadInput.
        """
        legs = self._legs(pose, joints)
        rates = self._per_joint(joint_rates, "joint_rates")
        drive = [-lever * rate for lever, rate in zip(legs.levers, rates, strict=True)]
        return self._solve(legs.screws, drive, joints)

    def acceleration(
        self, pose: ArrayLike, joints: ArrayLike, joint_rates: ArrayLike, joint_accelerations: ArrayLike
    ) -> Array:
        """Platform acceleration (n,), m/s2 and rad/s2 in the base frame: A a + B qddot + c = 0.

        joint_rates, joint_accelerations: (n,) rad/s and rad/s2, or m/s and m/s2. Raises NotAssembled at Type 2,
        BadInput.
        """
        rates = self._per_joint(joint_rates, "joint_rates")
        accelerations = self._per_joint(joint_accelerations, "joint_accelerations")
        twist = tuple(self.velocity(pose, joints, rates).tolist())
        at = self.mechanism.at(self._joints(joints), self._pose(pose), 0, (0.0, 0.0))
        bias = self.mechanism.bias(at, rates, twist)
        drive = [-b * a - c for b, a, c in zip(at.levers, accelerations, bias, strict=True)]
        return self._solve(at.screws, drive, joints)

    def reactions(self, pose: ArrayLike, joints: ArrayLike, wrench: ArrayLike) -> Array:
        """Force of each leg on the platform (n,), N, that balances an external wrench (N, N m) at the platform point.

        Positive pushes the platform along the screw (compression of a rod). Raises NotAssembled at Type 2, BadInput.
        """
        legs = self._legs(pose, joints)
        loads = arguments.vector(wrench, len(self.mechanism.task), "wrench")
        if statics.cofactors(legs.screws)[0] == 0.0:
            raise NotAssembled(self._joints(joints), 0.0, "leg forces are not determined at Type 2")
        return np.array(statics.reactions(legs.screws, loads))

    def efforts(self, pose: ArrayLike, joints: ArrayLike, wrench: ArrayLike) -> Array:
        """Motor efforts (n,), N m or N, that hold an external wrench: tau.qdot + w.t = 0. Raises as `reactions`."""
        forces = self.reactions(pose, joints, wrench).tolist()
        return np.array(statics.efforts(self._legs(pose, joints).levers, forces))

    def reaction_max(self, pose: ArrayLike, joints: ArrayLike, force: float, moment: float = 0.0) -> Array:
        """Largest leg forces (n,), N, over all directions of a force (N) and both signs of a moment (N m).

        force: size, not negative. Infinite at Type 2. Raises BadInput. Source: [S2] (8).
        """
        force, moment = _load(force, moment)
        legs = self._legs(pose, joints)
        return np.array(statics.reaction_max(FLOATS, legs.screws, force, moment, turns=bool(legs.attachments)))

    # --- checks of what the caller gives -----------------------------------------------------------------------

    def _solve(self, screws: Sequence[Floats], drive: Sequence[float], joints: ArrayLike) -> Array:
        if statics.cofactors(screws)[0] == 0.0:
            raise NotAssembled(self._joints(joints), 0.0, "the twist is not determined at Type 2")
        return np.array(statics.twist(screws, drive))

    def _legs(self, pose: ArrayLike, joints: ArrayLike) -> Legs[float]:
        return arguments.closing_legs(self.mechanism, self._joints(joints), self._pose(pose))

    def _pose(self, pose: ArrayLike) -> Floats:
        return arguments.place(pose, self.mechanism.task, "pose")

    def _joints(self, joints: ArrayLike) -> Floats:
        return arguments.place(joints, self.mechanism.joints, "joints")

    def _per_joint(self, values: ArrayLike, what: str) -> Floats:
        return arguments.vector(values, len(self.mechanism.joints), what)

    def _within_range(self, joints: Sequence[float]) -> bool:
        return all(joint.contains(q) for joint, q in zip(self.mechanism.joints, joints, strict=True))


def _load(force: float, moment: float) -> tuple[float, float]:
    """Sizes of a force of any direction, N, and of a moment of either sign, N m."""
    return arguments.number(force, "force", 0.0), abs(arguments.number(moment, "moment"))


def _robot(stated: RobotFile) -> Robot:
    return Robot(stated.mechanism, stated.name, stated.description, stated.supervision)


def make_robot(name: str, **geometry: float | Sequence[float]) -> Robot:
    """A shipped robot by name; keywords override its geometry (SI, radians). Raises UnknownRobot, BadInput,
    InvalidGeometry."""
    return _robot(read_robot(name, geometry))


def load_robot(path: str | Path, **geometry: float | Sequence[float]) -> Robot:
    """A robot from a YAML file, see `robot_file`. Raises UnknownRobot, BadInput, InvalidGeometry."""
    return _robot(read_robot(path, geometry))


def robots() -> tuple[str, ...]:
    """Names for `make_robot`."""
    return preset_names()
