"""Design space of the IRSBot-2: which designs are free of which singularities, and why."""

from irsbot_kinematics.analysis.rectangle import Limits, Rectangle, largest_rectangle
from irsbot_kinematics.design.cells import Cells, cells
from irsbot_kinematics.design.check import Verdict, check
from irsbot_kinematics.design.errata import ERRATA
from irsbot_kinematics.design.moves import Move, moves
from irsbot_kinematics.design.proximal import (
    QUESTIONS,
    ZONES,
    evaluate_printed_zones,
    evaluate_questions,
    find_seats,
    in_zone,
)
from irsbot_kinematics.design.search import Task, search
from irsbot_kinematics.design.sweep import Plan, Range, judge, sweep
from irsbot_kinematics.mechanisms.irsbot2_space.designs import PARAMETERS, Designs
from irsbot_kinematics.mechanisms.irsbot2_space.distal import Bounds, Counts, Kind, bounds, counts, distal_free, table_3
from irsbot_kinematics.mechanisms.irsbot2_space.singular_postures import (
    Placement,
    Reachability,
    SingularPosture,
    reachability,
    singular_postures,
)

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
    "Reachability",
    "Rectangle",
    "SingularPosture",
    "Task",
    "Verdict",
    "bounds",
    "cells",
    "check",
    "counts",
    "distal_free",
    "evaluate_printed_zones",
    "evaluate_questions",
    "find_seats",
    "in_zone",
    "judge",
    "largest_rectangle",
    "moves",
    "reachability",
    "search",
    "singular_postures",
    "sweep",
    "table_3",
]
