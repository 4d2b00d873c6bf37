"""Kinematics, singularity margins and statics of parallel robots. Needs no ROS.

import irsbot_kinematics as irs
robot = irs.make_robot("irsbot2")
q = robot.inverse((0.3, -0.75))
robot.evaluate(q).type2_margin
"""

from irsbot_kinematics import compiled

compiled.prefer()  # before anything else of the suite is imported

# ruff: noqa: E402
from irsbot_kinematics.analysis.loops import LoopResult, certify_loop
from irsbot_kinematics.batch import Evaluations
from irsbot_kinematics.errors import (
    BadInput,
    InvalidGeometry,
    KinematicsError,
    NotAssembled,
    NotCompiled,
    UnknownRobot,
    Unreachable,
)
from irsbot_kinematics.mechanism import CertifiedBounds, Coordinate, Cuspidal, Mechanism, Posture, Status
from irsbot_kinematics.robot import Robot, load_robot, make_robot, robots
from irsbot_kinematics.solutions import DirectSolution, Evaluation, InverseSolution, LabelsVary

__all__ = [
    "BadInput",
    "CertifiedBounds",
    "Coordinate",
    "Cuspidal",
    "DirectSolution",
    "Evaluation",
    "Evaluations",
    "InvalidGeometry",
    "InverseSolution",
    "KinematicsError",
    "LabelsVary",
    "LoopResult",
    "Mechanism",
    "NotAssembled",
    "NotCompiled",
    "Posture",
    "Robot",
    "Status",
    "UnknownRobot",
    "Unreachable",
    "certify_loop",
    "load_robot",
    "make_robot",
    "robots",
]
