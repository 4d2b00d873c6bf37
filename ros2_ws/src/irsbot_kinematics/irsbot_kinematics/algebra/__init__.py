"""Algebraic analysis of manipulators: singular curves, cells, cusps. Needs python-flint (pip install python-flint).

from irsbot_kinematics import algebra
s = algebra.predefined("3rpr")
algebra.configurations(s, {"rho1": 14.98, "rho2": 15.38, "rho3": 12})
cells = algebra.decompose(s, ("rho2", "rho3"), box=((0.1, 45), (0.1, 45)), fixed={"rho1": 17})
"""

from irsbot_kinematics.algebra.cells import Cell, Cells, Region
from irsbot_kinematics.algebra.constraints import constraint_equations, infinite_equations
from irsbot_kinematics.algebra.cusp_records import Cusp, Cusps
from irsbot_kinematics.algebra.cusps import cusps
from irsbot_kinematics.algebra.decompose import decompose
from irsbot_kinematics.algebra.images import image_of_path, pairing, wall_counts
from irsbot_kinematics.algebra.manipulators import names, predefined
from irsbot_kinematics.algebra.manipulators.shipped import of_robot
from irsbot_kinematics.algebra.model.engine import AlgebraError, AlgebraUnavailable, TooLarge
from irsbot_kinematics.algebra.model.polynomial import Polynomial
from irsbot_kinematics.algebra.model.roots import RealRoot, is_interval_empty, real_roots
from irsbot_kinematics.algebra.model.system import Drawing, System
from irsbot_kinematics.algebra.octree import Octree, octree
from irsbot_kinematics.algebra.singular import Projection, project, singularities
from irsbot_kinematics.algebra.solving import Configuration, configurations
from irsbot_kinematics.algebra.vertices import WallVertex, wall_vertices

__all__ = [
    "AlgebraError",
    "AlgebraUnavailable",
    "Cell",
    "Cells",
    "Configuration",
    "Cusp",
    "Cusps",
    "Drawing",
    "Octree",
    "Polynomial",
    "Projection",
    "RealRoot",
    "Region",
    "System",
    "TooLarge",
    "WallVertex",
    "configurations",
    "constraint_equations",
    "cusps",
    "decompose",
    "image_of_path",
    "infinite_equations",
    "is_interval_empty",
    "names",
    "octree",
    "of_robot",
    "pairing",
    "predefined",
    "project",
    "real_roots",
    "singularities",
    "wall_counts",
    "wall_vertices",
]
