"""Design space of the IRSBot-2: which designs are free of which singularities, and why."""

from irsbot_kinematics.design.cells import Cells, cells
from irsbot_kinematics.design.check import Verdict, check
from irsbot_kinematics.design.designs import PARAMETERS, Designs
from irsbot_kinematics.design.distal import Bounds, Counts, Kind, bounds, counts, distal_free, table_3
from irsbot_kinematics.design.errata import ERRATA
from irsbot_kinematics.design.moves import Move, moves
from irsbot_kinematics.design.postures import Placement, Reach, SingularPosture, reach, singular_postures
from irsbot_kinematics.design.proximal import QUESTIONS, ZONES, answers, in_zone, printed, seats
from irsbot_kinematics.design.rectangle import Limits, Rectangle, largest_rectangle
from irsbot_kinematics.design.search import Task, search
from irsbot_kinematics.design.sweep import Plan, Range, judge, sweep

__all__ = [
    "ERRATA",
    "PARAMETERS",
    "QUESTIONS",
    "ZONES",
    "Bounds",
    "Cells",
    "Counts",
    "Designs",
    "Kind",
    "Limits",
    "Move",
    "Placement",
    "Plan",
    "Range",
    "Reach",
    "Rectangle",
    "SingularPosture",
    "Task",
    "Verdict",
    "answers",
    "bounds",
    "cells",
    "check",
    "counts",
    "distal_free",
    "in_zone",
    "judge",
    "largest_rectangle",
    "moves",
    "printed",
    "reach",
    "search",
    "seats",
    "singular_postures",
    "sweep",
    "table_3",
]
