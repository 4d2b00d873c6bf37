"""Results of `Robot`: solutions with their labels, and margins of one posture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from irsbot_kinematics.mechanism import Floats, Signs
from irsbot_kinematics.numerics.arithmetic import Array


class LabelsVary(UserWarning):
    """Warning: samples were judged in one assembly mode of a robot whose labels are not invariant; see
    `Robot.evaluate_many`."""


class InverseSolution(NamedTuple):
    """Joint positions of a pose in one working mode.

    joints: (n,) rad or m.
    working_mode: sign per leg.
    within_range: every joint is within the range of the mechanism's `joints`, angles by whole turns.
    """

    joints: Array
    working_mode: Signs
    within_range: bool


class DirectSolution(NamedTuple):
    """Pose of joint positions in one assembly mode.

    pose: (m,) m or rad.
    assembly_mode: its label.
    working_mode: sign per leg, 0 where it has none.
    within_range: the joints are within the range of the mechanism's `joints`, angles by whole turns.
    """

    pose: Array
    assembly_mode: int
    working_mode: Signs
    within_range: bool


@dataclass(frozen=True)
class Evaluation:
    """Margins of one posture; the fields and units of SingularityState.msg.

    joint_position: (n,) joint positions, rad or m.
    pose: (m,) task coordinates, m or rad.
    working_mode: sign per leg, 0 where it has none.
    assembly_mode: label of the assembly mode.
    type1_margin: (n,) of every leg, 0..1: 0 where it is straight or folded.
    type2_margin: 0..1: 0 where the legs do not hold the platform.
    constraint_margin: at least 0, may exceed 1: 0 where the legs lose a constraint together; NaN where they cannot.
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
