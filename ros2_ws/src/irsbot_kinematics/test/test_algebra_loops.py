"""Loops about cusps: the platform changes its assembly mode, and every step is proved. Sheet, section 6."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("flint", reason="python-flint is an optional extra")

import irsbot_kinematics as irs
from irsbot_kinematics import algebra
from irsbot_kinematics.analysis.loops import circle

# robot, centre, joints, radius, start, pose before, pose after, smallest |det A| of halved closure rows.
ROBOTS = [
    (
        "rrr3_base",
        (-0.750995, 3.180521, -0.321021),
        (2, 3),
        0.1,
        5.235988,
        (0.08076, 0.03511, 1.22907),
        (0.21813, -0.10313, 1.77226),
        0.000955,
    ),
    (
        "rrr3_base",
        (2.031052, -3.267024, -1.354753),
        (2, 3),
        0.05,
        0.698132,
        (-0.15123, 0.16819, 1.67494),
        (-0.00948, 0.24278, 0.25145),
        0.000777,
    ),
    (
        "ruu4",
        (-2.717861, -0.60295, -0.667693, 1.369466),
        (3, 4),
        0.01,
        1.22173,
        (0.19034, -0.12772, -0.56058, -0.06029),
        (0.18093, -0.09871, -0.56312, 0.30774),
        1.86e-05,
    ),
]
RPR = [
    ((17, 2.834794, 5.789814), 0.349066, (4.92415, -16.27122, 0.88233), (7.51525, -15.24864, 0.88760), 168.19),
    ((17, 15.922556, 6.285145), 1.745329, (-16.98527, -0.70761, 0.00079), (-16.28993, 4.86193, -0.28980), 429.74),
]

CUSPIDAL = ("rrr3_base", "ruu4", "rpr3", "rails2", "rails3")
PRINTED = 1.5e-5
"""rad or length: poses are printed with 5 digits, centres with 6; near a cusp a pose moves farther than the joints."""


@pytest.mark.parametrize(("name", "centre", "joints", "radius", "start", "before", "after", "det"), ROBOTS)
def test_a_shipped_robot_changes_its_assembly_mode(name, centre, joints, radius, start, before, after, det):
    found = irs.certify_loop(circle(centre, joints, radius, start), name, before)
    assert found.certified
    assert found.closed
    assert found.changed
    assert found.working_mode_kept
    assert found.start == pytest.approx(before, abs=PRINTED)
    assert found.end == pytest.approx(after, abs=PRINTED)
    rods = irs.make_robot(name).mechanism.geometry.l2 ** len(centre)  # unit screws against halved closure rows
    assert found.smallest_det * rods == pytest.approx(det, rel=3e-3)  # three digits are printed
    assert found.smallest_type2 > 0.0
    assert irs.make_robot(name).cuspidal.answer == "yes"


@pytest.mark.parametrize(("centre", "start", "before", "after", "det"), RPR)
def test_the_3rpr_changes_its_assembly_mode(centre, start, before, after, det):
    s = algebra.predefined("3rpr")
    found = irs.certify_loop(circle(centre, (2, 3), 0.3, start), s, before)
    assert found.certified
    assert found.changed
    assert found.start == pytest.approx(before, abs=PRINTED)
    assert found.end == pytest.approx(after, abs=PRINTED)
    assert found.smallest_det / 8.0 == pytest.approx(det, abs=0.006)  # three rows, each twice the halved one
    ends = algebra.configurations(
        s, dict(zip(s.joints, circle(centre, (2, 3), 0.3, start)[0].round(9).tolist(), strict=True))
    )
    rows = np.array([list(c.pose.values()) for c in ends])
    assert min(np.abs(rows - found.start).max(axis=1)) < 1e-5
    assert min(np.abs(rows - found.end).max(axis=1)) < 1e-5


def test_a_loop_about_no_cusp_comes_back():
    s = algebra.predefined("3rpr")
    start = algebra.configurations(s, {"rho1": 17, "rho2": 20, "rho3": 20})[0].pose
    found = irs.certify_loop(circle((17, 19.5, 20), (2, 3), 0.5, 0.0, 90), s, start)
    assert (found.certified, found.closed, found.changed) == (True, True, False)


def test_a_path_through_a_singularity_is_not_certified():
    """From 6 solutions to none: every branch ends."""
    s = algebra.predefined("3rpr")
    for start in algebra.configurations(s, {"rho1": 17, "rho2": 15, "rho3": 15})[:2]:
        found = irs.certify_loop([(17, 15, 15), (17, 15, 44)], s, start.pose)
        assert not found.certified
        assert found.lost_at == 0


@pytest.mark.parametrize(("centre", "start", "before", "after", "det"), RPR)
def test_the_robot_with_struts_follows_the_loops_of_the_3rpr(centre, start, before, after, det):
    """1 cm instead of 1; the screws of the robot are unit, those of the system as long as the struts."""
    path = circle([0.01 * value for value in centre], (2, 3), 0.003, start)
    found = irs.certify_loop(path, "rpr3", (0.01 * before[0], 0.01 * before[1], before[2]))
    assert found.certified
    assert found.changed
    for pose, printed in ((found.start, before), (found.end, after)):
        assert pose * (100.0, 100.0, 1.0) == pytest.approx(printed, abs=PRINTED)
    # |det| of halved rows in cm is that of unit rows times the struts, 1 cm for each moment
    wide = irs.certify_loop(circle(centre, (2, 3), 0.3, start), algebra.predefined("3rpr"), before)
    assert wide.smallest_det / 8.0 == pytest.approx(det, abs=0.006)
    sizes = np.prod(100.0 * path, axis=1)
    assert sizes.min() < det / (100.0 * found.smallest_det) < sizes.max()


@pytest.mark.parametrize(
    ("name", "centre", "start", "before", "after"),
    [
        ("rails2", (0.45, 0.708893, 0.459114), 3.403392, (0.44980, 0.01330, -0.06292), (0.41221, 0.18050, -0.86229)),
        ("rails3", (0.1, 0.350085, -0.051394), 0.349066, (-0.07378, 0.24454, -0.43538), (-0.08769, 0.23404, 0.65516)),
    ],
)
def test_carriages_come_back_and_the_platform_does_not(name, centre, start, before, after):
    """Circles of 40 mm in joints 2 and 3. Both poses are among those of the algebra at the same joints."""
    path = circle(centre, (2, 3), 0.04, start)
    found = irs.certify_loop(path, name, before)
    assert found.certified
    assert found.changed
    assert found.working_mode_kept
    assert found.smallest_type2 > 0.1
    assert found.start == pytest.approx(before, abs=PRINTED)
    assert found.end == pytest.approx(after, abs=PRINTED)
    s = algebra.of_robot(irs.make_robot(name))
    ends = algebra.configurations(s, dict(zip(s.joints, path[0].round(9).tolist(), strict=True)))
    rows = np.array([list(c.pose.values()) for c in ends])
    for pose in (found.start, found.end):
        assert min(np.abs(rows - pose).max(axis=1)) < 1e-6


@pytest.mark.parametrize(
    ("name", "lengths", "path"),
    [
        # The motors of the first robot turn past each other, beyond its reach; both ends are in reach.
        ("five_bar", {"l1": 0.4, "l2": 0.3, "b": 0.3}, [(1.0, np.pi - 1.0), (2.0 * np.pi - 1.0, 1.0 - np.pi)]),
        # A crank of the second cannot turn all the way round; a turn ends at the joints at which it begins.
        ("rrr3_base", {}, [(-0.750995, 3.230521, -0.401021), (2.0 * np.pi - 0.750995, 3.230521, -0.401021)]),
    ],
)
def test_a_segment_that_leaves_the_workspace_between_its_ends_is_not_certified(name, lengths, path):
    robot = irs.make_robot(name, **lengths)
    found = irs.certify_loop([path[0], *path], robot)
    assert not found.certified
    assert not found.closed
    assert found.lost_at == 1
    lost_in_parts = irs.certify_loop(np.linspace(*path, 2000), robot)
    assert not lost_in_parts.certified
    # Before a singularity the pose goes with the root of what is left of the joints, a turn over 2^16: 0.01 rad.
    assert found.end == pytest.approx(lost_in_parts.end, abs=0.03)


def test_a_long_segment_goes_the_way_that_was_asked_for():
    """Cranks so short that they turn all the way round; 1.5 turns to one side are half a turn to the other."""
    robot = irs.make_robot("rrr3_base", l1=0.03, l2=0.3)
    pose = (0.0, 0.0, 1.0)
    first = robot.inverse(pose)
    for turn in (2.0 * np.pi, 3.0 * np.pi, -3.5 * np.pi):
        last = np.add(first, (turn, 0.0, 0.0))
        found = irs.certify_loop([first, last], robot, pose)
        assert found.certified
        assert found.closed == (turn == 2.0 * np.pi)
        assert not found.changed
        in_parts = irs.certify_loop(np.linspace(first, last, 100), robot, pose)
        assert found.end == pytest.approx(in_parts.end, abs=1e-9)
        assert found.steps > abs(turn) / (2.0 * np.pi)  # one step is at most one turn


def test_robots_of_two_mirror_modes_are_not_cuspidal():
    for name in irs.robots():
        expected = "yes" if name in CUSPIDAL else "no"
        assert irs.make_robot(name).cuspidal.answer == expected
        assert irs.make_robot(name).cuspidal.reason
    assert irs.make_robot("rrr3_base", l1=0.5).cuspidal.answer == "unknown"


@pytest.mark.parametrize("name", CUSPIDAL)
def test_a_mechanism_derived_from_a_cuspidal_one_is_not_known_to_be_cuspidal(name):
    mechanism = irs.make_robot(name).mechanism
    mine = type("Mine", (type(mechanism),), {"kind": "mine"})
    assert irs.Robot(mine(mechanism.geometry)).cuspidal.answer == "unknown"


def test_bad_paths_are_refused():
    for path in ([], [(1, 2)], [(1, 2, 3)], [(1, 2, 3), (1, 2, float("nan"))], "x", [("a", "b", "c")] * 2):
        with pytest.raises(irs.BadInput):
            irs.certify_loop(path, "rrr3_base")
    with pytest.raises(irs.BadInput, match="start pose"):
        irs.certify_loop([(1, 2, 3), (1, 2, 4)], algebra.predefined("3rpr"))
    with pytest.raises(irs.BadInput, match="lacks"):
        irs.certify_loop([(17, 15, 15), (17, 15, 16)], algebra.predefined("3rpr"), {"x": 1.0})
    for start in (3, (1, 2), (1, 2, 3, 4), "xyz", (1, 2, float("nan")), {"x": "a", "y": 1, "alpha": 0}):
        with pytest.raises(irs.BadInput):
            irs.certify_loop([(17, 15, 15), (17, 15, 16)], algebra.predefined("3rpr"), start)
