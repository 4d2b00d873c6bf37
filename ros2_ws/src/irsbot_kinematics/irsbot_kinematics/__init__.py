"""Kinematics, singularity margins and statics of parallel robots. Needs no ROS.

import irsbot_kinematics as irs
robot = irs.make_robot("irsbot2")
q = robot.inverse((0.3, -0.75))
robot.evaluate(q).type2_margin
"""

from irsbot_kinematics.batch import Evaluations
from irsbot_kinematics.errors import (
    BadInput,
    InvalidGeometry,
    KinematicsError,
    NotAssembled,
    UnknownRobot,
    Unreachable,
)
from irsbot_kinematics.loops import LoopResult, certify_loop
from irsbot_kinematics.mechanism import Coordinate, Cuspidal, Guarantee, Mechanism, Posture, Status
from irsbot_kinematics.robot import Evaluation, Robot, load_robot, make_robot, robots

__all__ = [
    "BadInput",
    "Coordinate",
    "Cuspidal",
    "Evaluation",
    "Evaluations",
    "Guarantee",
    "InvalidGeometry",
    "KinematicsError",
    "LoopResult",
    "Mechanism",
    "NotAssembled",
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
