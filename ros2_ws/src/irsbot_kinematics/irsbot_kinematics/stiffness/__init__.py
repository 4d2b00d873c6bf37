"""Elastostatics of the IRSBot-2, the five-bar and mechanisms of tubes and revolutes. Needs no ROS.

from irsbot_kinematics import stiffness
design = stiffness.load("irsbot2_table2")
stiffness.matrix(design, (0.0, -0.8))                          # (6, 6) at P, base axes
stiffness.deflection(design, (0.0, -0.8), (0, 100, 0, 0, 0, 0))    # m and rad

Source: [S1] (11)-(23); elastostatic model in docs/explanation/stiffness.md.
"""

from irsbot_kinematics.arguments import checked
from irsbot_kinematics.stiffness.chains import ChainStructure, moved, turned
from irsbot_kinematics.stiffness.comparison import POSES, Row, Statistics, index, statistics, table
from irsbot_kinematics.stiffness.design_file import load, presets, text_of
from irsbot_kinematics.stiffness.errors import InvalidDesign, SingularPosture
from irsbot_kinematics.stiffness.fields import DeflectionMap, deflection_map
from irsbot_kinematics.stiffness.five_bar import FiveBarStructure
from irsbot_kinematics.stiffness.irsbot2 import Irsbot2Structure
from irsbot_kinematics.stiffness.response import (
    Design,
    Responses,
    compliance,
    deflection,
    evaluate_many,
    frequency,
    matrix,
)
from irsbot_kinematics.stiffness.sizing import Active, NoSize, Sized, Task, size
from irsbot_kinematics.stiffness.structure import Structure
from irsbot_kinematics.stiffness.supervision import ComplianceError, Load, PoseErrors, compliance_error, pose_errors
from irsbot_kinematics.stiffness.tubes import Material, Section, Tube, materials, tube_compliance


@checked
def mass(design: Design) -> float:
    """Mass of all tubes of a design, kg; without platform, joints, motors and elbow carriers."""
    return design.mass


__all__ = [
    "POSES",
    "Active",
    "ChainStructure",
    "ComplianceError",
    "DeflectionMap",
    "Design",
    "FiveBarStructure",
    "InvalidDesign",
    "Irsbot2Structure",
    "Load",
    "Material",
    "NoSize",
    "PoseErrors",
    "Responses",
    "Row",
    "Section",
    "SingularPosture",
    "Sized",
    "Statistics",
    "Structure",
    "Task",
    "Tube",
    "compliance",
    "compliance_error",
    "deflection",
    "deflection_map",
    "evaluate_many",
    "frequency",
    "index",
    "load",
    "mass",
    "materials",
    "matrix",
    "moved",
    "pose_errors",
    "presets",
    "size",
    "statistics",
    "table",
    "text_of",
    "tube_compliance",
    "turned",
]
