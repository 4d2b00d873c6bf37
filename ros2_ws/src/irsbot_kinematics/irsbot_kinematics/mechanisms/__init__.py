"""The registry: topology name -> geometry class and mechanism class, written out, no discovery."""

from __future__ import annotations

from typing import Any, NamedTuple

from irsbot_kinematics.mechanism import Mechanism
from irsbot_kinematics.mechanisms.delta_kinematics import DeltaGeometry
from irsbot_kinematics.mechanisms.five_bar import FiveBar, FiveBarGeometry
from irsbot_kinematics.mechanisms.hybridglide import Hybridglide
from irsbot_kinematics.mechanisms.irsbot2 import Irsbot2
from irsbot_kinematics.mechanisms.irsbot2_space.geometry import Irsbot2Geometry
from irsbot_kinematics.mechanisms.linear_delta import LinearDelta, LinearDeltaGeometry
from irsbot_kinematics.mechanisms.orthoglide import Orthoglide
from irsbot_kinematics.mechanisms.rails2 import Rails2, Rails2Geometry
from irsbot_kinematics.mechanisms.rails3 import Rails3, Rails3Geometry
from irsbot_kinematics.mechanisms.rpr3 import Rpr3, Rpr3Geometry
from irsbot_kinematics.mechanisms.rrr3 import Rrr3, Rrr3Geometry
from irsbot_kinematics.mechanisms.rrr3_base import Rrr3Base, Rrr3BaseGeometry
from irsbot_kinematics.mechanisms.ruu4 import Ruu4, Ruu4Geometry
from irsbot_kinematics.mechanisms.triaglide import Triaglide
from irsbot_kinematics.mechanisms.uranesx import UraneSX


class Topology(NamedTuple):
    """The parts of a mechanism: `mechanism(geometry(**lengths))` makes one."""

    geometry: Any
    mechanism: type[Mechanism]


TOPOLOGIES: dict[str, Topology] = {
    "irsbot2": Topology(Irsbot2Geometry, Irsbot2),
    "five_bar": Topology(FiveBarGeometry, FiveBar),
    "rrr3": Topology(Rrr3Geometry, Rrr3),
    "rrr3_base": Topology(Rrr3BaseGeometry, Rrr3Base),
    "orthoglide": Topology(DeltaGeometry, Orthoglide),
    "hybridglide": Topology(DeltaGeometry, Hybridglide),
    "triaglide": Topology(DeltaGeometry, Triaglide),
    "uranesx": Topology(DeltaGeometry, UraneSX),
    "ruu4": Topology(Ruu4Geometry, Ruu4),
    "linear_delta": Topology(LinearDeltaGeometry, LinearDelta),
    "rpr3": Topology(Rpr3Geometry, Rpr3),
    "rails3": Topology(Rails3Geometry, Rails3),
    "rails2": Topology(Rails2Geometry, Rails2),
}
