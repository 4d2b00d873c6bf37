"""A robot as a library user holds it: arrays in, arrays out, exceptions for what does not exist."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import acos, isfinite
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from irsbot_kinematics import batch, statics
from irsbot_kinematics.arithmetic import FLOATS, Array
from irsbot_kinematics.batch import Evaluations
from irsbot_kinematics.errors import BadInput, NotAssembled, Unreachable
from irsbot_kinematics.forces import Load
from irsbot_kinematics.mechanism import Cuspidal, Floats, Mechanism, Posture, Signs, Status
from irsbot_kinematics.robot_file import RobotFile, preset_names, read_robot
from irsbot_kinematics.tolerances import FARTHEST, REACH_TOL_M


@dataclass(frozen=True)
class Evaluation:
    """Margins of one posture; the fields and units of SingularityState.msg.

    joint_position: (n,) joint positions, rad or m.
    pose: (m,) task coordinates, m or rad.
    working_mode: sign per leg, 0 where it has none.
    assembly_mode: label of the assembly mode.
    type1_margin: (n,) of every leg, 0..1: 0 where it is straight or folded.
    type2_margin: 0..1: 0 where the legs do not hold the platform.
    constraint_margin: 0..1: 0 where the legs lose a constraint together; NaN where they cannot.
    limb_margin: of every limb that can lose a constraint of its own, 0..1.
    clearance: m the platform may move in any direction before the nearest singularity: a lower bound.
    pressure_angle: (n,) rad, of every leg.
    reaction_max: (n,) N: largest force of every leg under the load of the question, in its worst direction.
    closure_residual: m: largest error of closure.
    """

    joint_position: Floats
    pose: Floats
    working_mode: Signs
    assembly_mode: int
    type1_margin: Floats
    type2_margin: float
    constraint_margin: float
    limb_margin: Floats
    clearance: float
    pressure_angle: Floats
    reaction_max: Floats
    closure_residual: float


class Robot:
    """One machine. Poses are (m,) task coordinates, joints (n,) joint positions, SI units and radians.

    Modes left out mean the robot's usual ones.

    mechanism: the equations, and `joints`, `task`, `working_modes`, `assembly_modes`, `geometry`, see `Mechanism`.
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
        """supervision: settings of the supervisor that belong to this machine; nothing here reads them."""
        self.mechanism = mechanism
        self.name = name or mechanism.kind
        self.description = description
        self.supervision = dict(supervision or {})

    @property
    def cuspidal(self) -> Cuspidal:
        """Whether the assembly mode can change without a singularity: yes, no or unknown, and why."""
        said = self.mechanism.cuspidal
        if said.lengths and self.mechanism.geometry != read_robot(self.mechanism.kind).mechanism.geometry:
            return Cuspidal("unknown", "the shipped lengths are cuspidal; for others look for a loop about a cusp")
        return said

    def __repr__(self) -> str:
        return f"Robot('{self.name}', {self.mechanism.geometry})"

    def inverse(self, pose: ArrayLike, working_mode: Sequence[int] | None = None) -> Array:
        """Joint positions (n,) of a pose. Raises Unreachable outside the workspace, BadInput for nonsense."""
        x, mode = self._pose(pose), self._mode(working_mode)
        q, reach = self.mechanism.inverse(FLOATS, x, mode)
        if not min(reach) >= -REACH_TOL_M:
            raise Unreachable(x, reach)
        return np.array(q)

    def inverse_all(self, pose: ArrayLike) -> list[Array]:
        """Joint positions of a pose in every working mode that reaches it, ordered as `mechanism.working_modes`."""
        solutions = []
        for mode in self.mechanism.working_modes:
            try:
                solutions.append(self.inverse(pose, mode))
            except Unreachable:
                continue
        return solutions

    def direct(self, joints: ArrayLike, assembly_mode: int | None = None) -> Array:
        """Pose (m,) of joint positions. Raises NotAssembled where no pose, or no single one, belongs to them."""
        return np.array(self.posture(joints, assembly_mode).pose)

    def direct_all(self, joints: ArrayLike) -> list[Array]:
        """Poses of joint positions in every assembly mode that exists, in the order of `mechanism.assembly_modes`."""
        solutions = []
        for mode in self.mechanism.assembly_modes:
            try:
                solutions.append(self.direct(joints, mode))
            except NotAssembled:
                continue
        return solutions

    def posture(self, joints: ArrayLike, assembly_mode: int | None = None) -> Posture:
        """Everything about one posture in plain floats. Raises NotAssembled like `direct`."""
        q = self._joints(joints)
        at = self.mechanism.posture(q, self._assembly(assembly_mode))
        if at.status == Status.UNREACHABLE:
            raise NotAssembled(q, at.gaps[0], f"the legs are {-at.gaps[0] * 1e3:.2f} mm apart")
        if at.status != Status.SOLVED:
            raise NotAssembled(q, at.gaps[0], "the pose is not determined by the joints (Type 2)")
        return at

    def jacobians(self, pose: ArrayLike, joints: ArrayLike) -> tuple[Array, Array]:
        """A (n, n) and B (n, n) of A t + B qdot = 0 at a pose and joints that belong together."""
        legs = self.mechanism.legs(FLOATS, self._joints(joints), self._pose(pose))
        return np.array(legs.screws), np.diag(legs.levers)

    def evaluate(
        self, joints: ArrayLike, assembly_mode: int | None = None, *, force: float = 1.0, moment: float = 0.0
    ) -> Evaluation:
        """Pose and margins of one posture. force (N), moment (N m): the load of `reaction_max`. Raises NotAssembled."""
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
            reaction_max=self._reaction_max(at.screws, bool(at.arms), force, moment),
            closure_residual=at.residual,
        )

    def evaluate_many(
        self,
        joints: ArrayLike,
        assembly_mode: int | None = None,
        *,
        force: float | None = None,
        moment: float = 0.0,
    ) -> Evaluations:
        """Poses and margins of many joint positions (N, n): arrays, NaN and a status where not assembled.

        force (N), moment (N m): the load of `reaction_max`, which is left out without a force. Raises BadInput.
        """
        Q = _table(joints, len(self.mechanism.joints), "joints")
        load = None if force is None else (Load(force, moment, 0.0).force_n, moment)
        return batch.evaluate_many(self.mechanism, Q, self._assembly(assembly_mode), load)

    def inverse_many(
        self, poses: ArrayLike, working_mode: Sequence[int] | None = None
    ) -> tuple[Array, NDArray[np.uint8], Array]:
        """Joints (N, n), status (N,) and reach (N,) in m of many poses (N, m); NaN where not reachable."""
        X = _table(poses, len(self.mechanism.task), "poses")
        return batch.inverse_many(self.mechanism, X, self._mode(working_mode))

    def velocity(self, pose: ArrayLike, joints: ArrayLike, joint_rates: ArrayLike) -> Array:
        """Platform twist (n,) of joint rates: t = -A^-1 B qdot. Raises NotAssembled at Type 2."""
        legs = self.mechanism.legs(FLOATS, self._joints(joints), self._pose(pose))
        drive = [-lever * rate for lever, rate in zip(legs.levers, self._joints(joint_rates), strict=True)]
        return self._solve(legs.screws, drive, joints)

    def acceleration(
        self, pose: ArrayLike, joints: ArrayLike, joint_rates: ArrayLike, joint_accelerations: ArrayLike
    ) -> Array:
        """Platform acceleration (n,): A a + B qddot + c = 0. Raises NotAssembled at Type 2."""
        q, x, rates = self._joints(joints), self._pose(pose), self._joints(joint_rates)
        at = self.mechanism.at(q, x, 0, (0.0, 0.0))
        bias = self.mechanism.bias(at, rates, tuple(self.velocity(pose, joints, joint_rates)))
        accelerations = self._joints(joint_accelerations)
        drive = [-b * a - c for b, a, c in zip(at.levers, accelerations, bias, strict=True)]
        return self._solve(at.screws, drive, joints)

    def reactions(self, pose: ArrayLike, joints: ArrayLike, wrench: ArrayLike) -> Array:
        """Force of each leg on the platform (n,), N, that balances an external wrench (N, N m) at the platform point.

        Positive pushes the platform along the screw (compression of a rod). Raises NotAssembled at Type 2.
        """
        legs = self.mechanism.legs(FLOATS, self._joints(joints), self._pose(pose))
        if statics.cofactors(legs.screws)[0] == 0.0:
            raise NotAssembled(self._joints(joints), 0.0, "leg forces are not determined at Type 2")
        return np.array(statics.reactions(legs.screws, self._wrench(wrench)))

    def efforts(self, pose: ArrayLike, joints: ArrayLike, wrench: ArrayLike) -> Array:
        """Motor efforts (n,), N m or N, that hold an external wrench: tau.qdot + w.t = 0."""
        legs = self.mechanism.legs(FLOATS, self._joints(joints), self._pose(pose))
        return np.array(statics.efforts(legs.levers, self.reactions(pose, joints, wrench).tolist()))

    def reaction_max(self, pose: ArrayLike, joints: ArrayLike, force: float, moment: float = 0.0) -> Array:
        """Largest leg forces (n,), N, over all directions of a force (N) and both signs of a moment (N m)."""
        legs = self.mechanism.legs(FLOATS, self._joints(joints), self._pose(pose))
        return np.array(self._reaction_max(legs.screws, bool(legs.arms), force, moment))

    # --- checks of what the caller gives -----------------------------------------------------------------------

    def _reaction_max(self, screws: Sequence[Floats], turns: bool, force: float, moment: float) -> Floats:
        return statics.reaction_max(FLOATS, screws, force, moment, turns=turns)

    def _solve(self, screws: Sequence[Floats], drive: Sequence[float], joints: ArrayLike) -> Array:
        if statics.cofactors(screws)[0] == 0.0:
            raise NotAssembled(self._joints(joints), 0.0, "the twist is not determined at Type 2")
        return np.array(statics.twist(screws, drive))

    def _pose(self, pose: ArrayLike) -> Floats:
        return _near(_vector(pose, len(self.mechanism.task), "pose"), "pose")

    def _joints(self, joints: ArrayLike) -> Floats:
        return _near(_vector(joints, len(self.mechanism.joints), "joints"), "joints")

    def _wrench(self, wrench: ArrayLike) -> Floats:
        return _vector(wrench, len(self.mechanism.task), "wrench")

    def _mode(self, mode: Sequence[int] | None) -> Signs:
        known = self.mechanism.working_modes
        chosen = self.mechanism.usual_working_mode if mode is None else tuple(np.ravel(mode).tolist())
        if chosen not in known:
            raise BadInput(f"working mode {chosen} is not one of {known}")
        return known[known.index(chosen)]

    def _assembly(self, mode: int | None) -> int:
        known = self.mechanism.assembly_modes
        chosen = self.mechanism.usual_assembly_mode if mode is None else mode
        if chosen not in known:
            raise BadInput(f"assembly mode {chosen} is not one of {known}")
        return known[known.index(chosen)]


def _vector(values: ArrayLike, length: int, what: str) -> Floats:
    try:
        vector = tuple(float(value) for value in np.asarray(values, dtype=float).ravel())
    except (TypeError, ValueError):
        raise BadInput(f"{what} must be {length} numbers, got {values!r}") from None
    if len(vector) != length:
        raise BadInput(f"{what} must have {length} numbers, got {len(vector)}")
    if not all(map(isfinite, vector)):
        raise BadInput(f"{what} must be finite, got {vector}")
    return vector


def _near(vector: Floats, what: str) -> Floats:
    if not max(map(abs, vector)) <= FARTHEST:
        raise BadInput(f"{what} must be at most {FARTHEST:g} rad or m in size, got {vector}")
    return vector


def _table(values: ArrayLike, columns: int, what: str) -> Array:
    try:
        table = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise BadInput(f"{what} must be numbers of shape (N, {columns}), got {values!r}") from None
    if table.ndim != 2 or table.shape[1] != columns:
        raise BadInput(f"{what} must have shape (N, {columns}), got {table.shape}")
    return table


def _robot(said: RobotFile) -> Robot:
    return Robot(said.mechanism, said.name, said.description, said.supervision)


def make_robot(name: str, **geometry: float | Sequence[float]) -> Robot:
    """A shipped robot by name; keywords override its geometry (SI, radians). Raises UnknownRobot, InvalidGeometry."""
    return _robot(read_robot(name, geometry))


def load_robot(path: str | Path, **geometry: float | Sequence[float]) -> Robot:
    """A robot from a YAML file, see `robot_file`. Raises UnknownRobot, BadInput, InvalidGeometry."""
    return _robot(read_robot(path, geometry))


def robots() -> tuple[str, ...]:
    """Names that `make_robot` knows."""
    return preset_names()
