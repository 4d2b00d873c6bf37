"""No sample of a fine map contradicts the Type 2 loci: between two neighbours the determinant changes its sign only
where a locus of the same working mode passes.

    ./irsbot python tests/campaigns/maps.py [--nodes 2000] [--robots irsbot2 ...]
"""

from __future__ import annotations

import argparse
import sys

import numpy as np
from scipy.spatial import cKDTree

import irsbot_kinematics as irs
from irsbot_kinematics.analysis.workspace_maps import reachable_box, workspace_map
from irsbot_kinematics.mechanism import Signs
from irsbot_kinematics.mechanisms.planar_pair import PlanarPair
from irsbot_kinematics.numerics.arithmetic import Array

CURVE_STEP_M = 0.012
"""m: half the largest distance of two published points of a locus (half a degree of a circle of 1.2 m)."""


def infeasibilities(mechanism: PlanarPair, mode: Signs, nodes: int) -> tuple[int, int, float]:
    """Sign changes of det A between neighbours, how many are away from a locus, and the largest distance, m."""
    found = workspace_map(mechanism, mode, reachable_box(mechanism), (nodes, nodes))
    step = float(np.hypot(found.first[1] - found.first[0], found.second[1] - found.second[0]))
    curves = np.concatenate([curve.points for curve in mechanism.loci(mode) if curve.kind == "type2"])
    curves = curves[np.isfinite(curves).all(axis=1)]
    sign = found.assembly
    changes = [np.nonzero(sign[:, :-1] * sign[:, 1:] < 0.0), np.nonzero(sign[:-1] * sign[1:] < 0.0)]
    places: Array = np.concatenate([np.column_stack((found.first[c], found.second[r])) for r, c in changes])
    if not len(places):
        return 0, 0, 0.0
    if not len(curves):
        return len(places), len(places), float("inf")
    away, _nearest = cKDTree(curves).query(places)
    return len(places), int((away > 3.0 * step + CURVE_STEP_M).sum()), float(away.max())


def main() -> int:
    """Print a line per robot and mode; exit code 1 if a sample contradicts the loci."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--nodes", type=int, default=2000, help="nodes along each axis")
    parser.add_argument("--robots", nargs="+", default=["irsbot2", "irsbot2_beta45", "irsbot2_csc", "five_bar"])
    given = parser.parse_args()
    wrong = 0
    for name in given.robots:
        mechanism = irs.make_robot(name).mechanism
        if not isinstance(mechanism, PlanarPair):
            parser.error(f"{name} is no planar pair")
        for mode in mechanism.working_modes:
            changes, bad, worst = infeasibilities(mechanism, mode, given.nodes)
            wrong += bad
            print(f"{name} {mode}: {changes} sign changes, {bad} away from a locus, farthest {worst:.5f} m", flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
