"""Bounds of machines that are their own mirror image, or look alike from every leg, do not depend on names of legs."""

from __future__ import annotations

import numpy as np
import pytest

import irsbot_kinematics as irs
from irsbot_kinematics import Status

ROUNDING = 1e-9
BOUNDS = ("certified_bounds", "sharp_bounds")
slacks = pytest.mark.parametrize("slack", [0.0, 1e-4])


@slacks
@pytest.mark.parametrize("shift", [1, 2])
def test_the_orthoglide_turned_about_its_diagonal(slack: float, shift: int) -> None:
    """Its rails are the axes."""
    mechanism, rng, promised = irs.make_robot("orthoglide").mechanism, np.random.default_rng(7), 0
    limits = np.array([(joint.lower, joint.upper) for joint in mechanism.joints]).T
    while promised < 60:
        q = rng.uniform(*limits)
        at, turned = (mechanism.posture(tuple(np.roll(q, k).tolist()), 1) for k in (0, shift))
        if at.status != Status.SOLVED:
            continue
        travel = 10.0 ** rng.uniform(-4.0, -1.5) * rng.uniform(0.0, 1.0, 3)
        for name in BOUNDS:
            here = getattr(mechanism, name)(at, travel.tolist(), slack)
            there = getattr(mechanism, name)(turned, np.roll(travel, shift).tolist(), slack)
            promised += here.type2 > 0.0
            assert there.type2 == pytest.approx(here.type2, abs=ROUNDING)
            assert there.type1 == pytest.approx(np.roll(here.type1, shift), abs=ROUNDING)


@slacks
@pytest.mark.parametrize("name", ["irsbot2", "irsbot2_beta45", "five_bar"])
def test_two_planar_legs_in_a_mirror(slack: float, name: str) -> None:
    mechanism, rng, promised = irs.make_robot(name).mechanism, np.random.default_rng(7), 0
    while promised < 60:
        q = rng.uniform(-np.pi, np.pi, 2)
        at = mechanism.posture(tuple(q.tolist()), 1)
        if at.status != Status.SOLVED:
            continue
        image = tuple((np.pi - q[::-1]).tolist())
        (mirrored,) = [
            found
            for found in (mechanism.posture(image, label) for label in mechanism.assembly_modes)
            if np.allclose(found.pose, (-at.pose[0], at.pose[1]), atol=1e-6)
        ]
        travel = 10.0 ** rng.uniform(-4.0, -1.5) * rng.uniform(0.0, 1.0, 2)
        for which in BOUNDS:
            here = getattr(mechanism, which)(at, travel.tolist(), slack)
            there = getattr(mechanism, which)(mirrored, travel[::-1].tolist(), slack)
            promised += here.type2 > 0.0
            assert there.type2 == pytest.approx(here.type2, abs=ROUNDING)
            assert there.type1 == pytest.approx(here.type1[::-1], abs=ROUNDING)
            assert there.constraint == pytest.approx(here.constraint, abs=ROUNDING, nan_ok=True)
