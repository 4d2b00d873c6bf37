"""Every numeric tolerance of the kinematics, with its unit and its reason."""

from __future__ import annotations

REACH_TOL_M = 1e-9
"""m: how far outside the workspace boundary a pose may lie and still be solved, at the boundary. Rounding of the reach
is of order 1e-16 m; a nanometre is far below any machine and far above rounding."""

ASSEMBLY_TOL_M = 1e-9
"""m: gap between the legs that still counts as assembled; the same reason as REACH_TOL_M."""

COINCIDENT_TOL_M = 1e-9
"""m: if the elbows of an equivalent five-bar are closer than this, the platform is free on a circle: no pose is
returned."""

SIGN_DEAD_BAND = 1e-9
"""1: a sine smaller than this has no sign; the working mode of that leg is reported as 0."""

CLOSURE_TOL_M = 1e-9
"""m: largest closure residual of a pose that a solver returns."""

PAIR_TOL_M = 1e-6
"""m: closure residual up to which a given pose and given joint positions are consistent. Numbers printed with seven
decimals are; the effect of the residual on a margin is far below the resolution of a margin."""

LARGEST = 1e15
"""1: no number of a machine or of its load is larger in its unit; powers of it stay finite."""

FARTHEST = 1e6
"""m or rad: a larger joint position or pose is an error of units. An angle of this size has ten digits left, and a
larger seed pose cannot distinguish the solutions."""

SEEN_SHARE = 0.5
"""1: a seed pose determines a branch if its distance is at most this share of its distance to any other. A pose in
another unit or frame is about as far from all branches."""

SCAN_TOL_M = 1e-9
"""m: accuracy of the boundary of a force workspace along a ray; a thousandth of the last printed digit."""

FOLLOWED_TOL_M = 1e-12
"""m: closure residual at which a branch followed by Newton steps counts as reached; far above rounding, far below the
resolution of a margin."""

SAME_POSE_TOL = 1e-7
"""m or rad: candidate poses closer than this are equal. Two assembly modes that close together are Type 2 up to
rounding."""

VANISHED_TOL = 1e-13
"""1: a closing polynomial smaller than this relative to the robot's size, to the power of its degree in lengths, is
zero for every turn: the platform can turn without the cranks."""

UNREAL_TOL = 1e-4
"""1: |log |z|| up to which a root z = e^(i phi) of a closing polynomial is tried as a real turn. Rounding splits a
double root by the square root of its 1e-15; a root farther off than this belongs to no pose."""
