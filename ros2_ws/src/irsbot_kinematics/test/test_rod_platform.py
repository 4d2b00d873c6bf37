"""The base class of planar platforms on rods, with cranks: it keeps every law and says what our 3-RRR says."""

from __future__ import annotations

import numpy as np
import pytest

import irsbot_kinematics as irs
from irsbot_kinematics.conformance import conformance
from irsbot_kinematics.mechanisms.rod_platform import RodPlatform
from irsbot_kinematics.mechanisms.rrr3_base import Rrr3BaseGeometry

OURS = irs.make_robot("rrr3_base").mechanism


class CrankRods(RodPlatform):
    """The 3-RRR with motors at the base: its pose equations are borrowed, everything else is the base class."""

    kind = "crank_rods"
    geometry: Rrr3BaseGeometry
    label_is_invariant = False

    def __init__(self, geometry):
        g = self.geometry = geometry
        super().__init__((g.l2,) * 3, (g.b1, g.b2, g.b3), (g.l1,) * 3, (g.l1,) * 3)
        self.joints = OURS.joints
        self.working_modes, self.assembly_modes = OURS.working_modes, OURS.assembly_modes
        self.usual_working_mode, self.usual_assembly_mode = OURS.usual_working_mode, OURS.usual_assembly_mode

    def near_end(self, k, leg, joint):
        l, (fx, fy) = self.geometry.l1, (self.geometry.a1, self.geometry.a2, self.geometry.a3)[leg]
        c, s = l * k.cos(joint), l * k.sin(joint)
        return (fx + c, fy + s), (-s, c), (-c, -s)

    def inverse(self, k, pose, mode):
        return OURS.inverse(k, pose, mode)

    def direct(self, k, joints, assembly):
        return OURS.direct(k, joints, assembly)

    def track(self, joints, previous):
        met = OURS.track(joints, previous)
        return self.at(met.joints, met.pose, met.assembly_mode, met.gaps) if met.status == irs.Status.SOLVED else met


MINE = CrankRods(OURS.geometry)


def test_a_crank_robot_on_the_base_class_keeps_every_law():
    checks = list(conformance(irs.Robot(MINE), joints=30))
    assert [f"{check.law}: {check.broken}" for check in checks if check.broken] == []


@pytest.mark.parametrize("slack", [0.0, 1e-4])
def test_its_bounds_lie_near_those_written_by_hand(slack):
    """Neither is the exact bound; one that is far below the other stops robots for nothing."""
    rng = np.random.default_rng(3)
    shares = []
    for q in rng.uniform(-np.pi, np.pi, (60, 3)).tolist():
        at, ours = MINE.posture(tuple(q), 1), OURS.posture(tuple(q), 1)
        if at.status != irs.Status.SOLVED or at.type2 < 0.3:
            continue
        mine, theirs = (one.certified_bounds(of, (2e-3,) * 3, slack).type2 for one, of in ((MINE, at), (OURS, ours)))
        shares.append((at.type2 - mine) / (at.type2 - theirs))
    assert len(shares) > 3
    assert max(shares) < 1.5


def test_a_crank_along_its_rod_moves_the_rods_end_along_it_to_second_order_alone():
    """l (1 - cos t) is the way of the end of a crank of length l."""
    at = MINE.posture((0.3, 2.4, -1.7), 1)
    travel = np.array([1e-3, 0.02, 0.1])
    drives = MINE.travel_of(at._replace(levers=(0.0, 0.0, 0.0)), travel.tolist(), 0.0).drives
    ways = OURS.geometry.l1 * (1.0 - np.cos(travel))
    assert np.all(drives >= ways)
    np.testing.assert_allclose(drives, ways, rtol=1e-3)


@pytest.mark.parametrize("turn_rad", [0.0, 0.3, 0.9, 1.2, 1.5, 1.6, 2.5, 3.2, 4.0, 5.5, 6.2])
def test_the_floor_of_a_sine_is_what_the_worst_turn_leaves(turn_rad):
    """The smallest |sin| of all angles that are no farther off than the turn."""
    at = MINE.posture((0.3, 2.4, -1.7), 1)._replace(normalised_levers=(0.2, -0.97, 1.0))
    angles = np.arcsin(at.type1)[:, None] + np.linspace(-turn_rad, turn_rad, 20001)
    least = np.abs(np.sin(angles)).min(axis=1)
    np.testing.assert_allclose(MINE.sine_floors(at, (0.0,) * 3, turn_rad), least, atol=5e-4)


@pytest.mark.parametrize("turn_rad", [np.inf, np.nan])
def test_no_sine_is_left_of_a_turn_that_is_no_number(turn_rad):
    at = MINE.posture((0.3, 2.4, -1.7), 1)
    assert MINE.sine_floors(at, (0.0,) * 3, turn_rad) == (0.0,) * 3
