"""All imports for your own mechanism; docs/how_to/own_mechanism.md describes their use.

These names are stable. The modules from which they are re-exported may change.

The class: `Mechanism`, if it computes its own bounds, or a base class that derives them from rods: `TurningPlatform`,
`RodPlatform`, `BranchedPlatform`, `CrankPlatform`, `SlidingPlatform` (planar) and `DeltaFamily` (space). Values of its
methods: `Coordinate`, `Legs`, `Posture`, `Status`, `CertifiedBounds`, `Cuspidal`, `Floats`, `Signs`, `Point`, `Pair`.
Its equations: `Arithmetic`, `FLOATS`, `ARRAYS`, `N`, `Array`. Its rods: `Travel`, `Rod`, `Errors`, `EXACT`, `Rail`,
`RailInSpace`. Bounds: `displacement`, `lowered`, `level_after`. Its assembly modes: `planar_closing`,
`planar_meetings`, `SAMPLED_TURNS`, `trigonometric_roots`. Its lengths: `InvalidGeometry`, `require`, `require_finite`,
`require_size`. Its laws: `conformance`.
"""

from irsbot_kinematics.bounds.boxes import Rod
from irsbot_kinematics.bounds.displacement import EXACT, Errors, displacement, level_after, lowered
from irsbot_kinematics.conformance import conformance
from irsbot_kinematics.errors import InvalidGeometry
from irsbot_kinematics.mechanism import (
    CertifiedBounds,
    Coordinate,
    Cuspidal,
    Floats,
    Legs,
    Mechanism,
    Posture,
    Signs,
    Status,
)
from irsbot_kinematics.mechanisms.branched_platform import BranchedPlatform, Point
from irsbot_kinematics.mechanisms.crank_platform import CrankPlatform
from irsbot_kinematics.mechanisms.delta_family import DeltaFamily
from irsbot_kinematics.mechanisms.delta_kinematics import DeltaGeometry
from irsbot_kinematics.mechanisms.delta_kinematics import Rail as RailInSpace
from irsbot_kinematics.mechanisms.geometry_checks import require, require_finite, require_size
from irsbot_kinematics.mechanisms.rod_platform import Pair, RodPlatform
from irsbot_kinematics.mechanisms.sliding_platform import Rail, SlidingPlatform
from irsbot_kinematics.mechanisms.turning_platform import Travel, TurningPlatform
from irsbot_kinematics.numerics.arithmetic import ARRAYS, FLOATS, Arithmetic, Array, N
from irsbot_kinematics.numerics.assembly_roots import (
    SAMPLED_TURNS,
    planar_closing,
    planar_meetings,
    trigonometric_roots,
)

__all__ = [
    "ARRAYS",
    "EXACT",
    "FLOATS",
    "SAMPLED_TURNS",
    "Arithmetic",
    "Array",
    "BranchedPlatform",
    "CertifiedBounds",
    "Coordinate",
    "CrankPlatform",
    "Cuspidal",
    "DeltaFamily",
    "DeltaGeometry",
    "Errors",
    "Floats",
    "InvalidGeometry",
    "Legs",
    "Mechanism",
    "N",
    "Pair",
    "Point",
    "Posture",
    "Rail",
    "RailInSpace",
    "Rod",
    "RodPlatform",
    "Signs",
    "SlidingPlatform",
    "Status",
    "Travel",
    "TurningPlatform",
    "conformance",
    "displacement",
    "level_after",
    "lowered",
    "planar_closing",
    "planar_meetings",
    "require",
    "require_finite",
    "require_size",
    "trigonometric_roots",
]
