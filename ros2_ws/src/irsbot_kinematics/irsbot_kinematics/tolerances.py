"""Every numeric tolerance of the kinematics, with its unit and its reason."""

from __future__ import annotations

REACH_TOL_M = 1e-9
"""m: how far outside the workspace boundary a pose may lie and still be solved, clamped to the boundary.
Rounding of the reach is of order 1e-16 m; a nanometre is far below any machine and far above rounding."""

ASSEMBLY_TOL_M = 1e-9
"""m: how far apart the legs may be and still count as just assembled; the same reason as REACH_TOL_M."""

COINCIDENT_TOL_M = 1e-9
"""m: elbows of an equivalent five-bar closer than this leave the platform free on a circle: no pose is returned."""

SIGN_DEAD_BAND = 1e-9
"""1: a sine smaller than this has no sign; the working mode of that leg is reported as 0."""

CLOSURE_TOL_M = 1e-9
"""m: largest closure residual of a pose that a solver returns."""

FARTHEST = 1e6
"""m or rad: a joint position or a pose beyond this is a mistake of units. An angle of this size has ten digits left,
and a seed pose beyond it is nearer to none of the solutions than to the others, as far as digits can tell."""

SEEN_SHARE = 0.5
"""1: a pose that somebody sees tells a branch if it is at most this share as far from it as from any other. A pose in
another unit or another frame is about as far from all of them."""

SCAN_TOL_M = 1e-9
"""m: to which the boundary of a force workspace is refined along a ray; a thousandth of the last printed digit."""

FOLLOWED_TOL_M = 1e-12
"""m: closure residual at which a branch followed by Newton steps counts as met; far above
rounding, far below what a margin shows."""

SAME_POSE_TOL = 1e-7
"""m or rad: candidate poses closer than this are one. Two assembly modes that close are Type 2 to rounding."""

VANISHED_TOL = 1e-13
"""1: a closing polynomial smaller than this relative to the robot's size, to the power of its degree in lengths, is
zero for every turn: the platform can turn without the cranks."""

UNREAL_TOL = 1e-4
"""1: |log |z|| up to which a root z = e^(i phi) of a closing polynomial is tried as a real turn. Rounding splits a
double root by the square root of its 1e-15; a root farther off than this belongs to no pose."""
