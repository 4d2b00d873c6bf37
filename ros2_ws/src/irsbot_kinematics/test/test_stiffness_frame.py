"""The elastostatics against 3-D frames of beam elements: random geometries, postures and loads, to 1e-6."""

from __future__ import annotations

from math import hypot

import numpy as np
import pytest
from frame import AXIS_Y, SIGMA, five_bar_frame, irsbot2_frame
from random_frames import pipes_and_sections, random_irsbot2

from irsbot_kinematics import stiffness
from irsbot_kinematics.mechanisms.five_bar import FiveBar, FiveBarGeometry
from irsbot_kinematics.stiffness import FiveBarStructure
from irsbot_kinematics.stiffness.response import postures

EXACT = 1e-6
"""1: of the issue; the frames lose digits to the stiffness of short thick tubes."""


def relative(found, expected, length):
    """Largest difference of two compliances over the largest entry, turns and moments made comparable."""
    scale = np.array([1.0] * 3 + [length] * 3)
    found, expected = (C * scale[:, None] * scale for C in (found, expected))
    return np.abs(found - expected).max() / np.abs(expected).max()


@pytest.mark.parametrize("seed", range(12))
def test_the_irsbot2_moves_as_a_frame_of_beams(seed):
    design, pose, built, *_ = random_irsbot2(np.random.default_rng(seed))
    moved = built.frame.solve(built.platform, np.eye(6))
    at_p = moved[6 * built.platform : 6 * built.platform + 6]
    C = stiffness.compliance(design, pose)
    assert relative(C, at_p, design.length_m) < EXACT
    assert relative(np.linalg.inv(stiffness.matrix(design, pose)), at_p, design.length_m) < EXACT


@pytest.mark.parametrize("seed", range(6))
def test_the_ends_of_the_rods_move_as_in_the_frame(seed):
    """What the supervision's bound is made of: near ends of the equivalent rods under loads in the plane."""
    design, pose, built, *_ = random_irsbot2(np.random.default_rng(100 + seed))
    moved = built.frame.solve(built.platform, np.eye(6)[:, [0, 2, 4]])
    twist = moved[6 * built.platform + np.array([0, 2, 4])]
    _, legs, _, _ = next(postures(design, pose[None, :]))
    for k in (0, 1):
        near = sum(moved[6 * node + np.array([0, 2])] for node in built.near[k]) / 2.0
        far = sum(moved[6 * node + np.array([0, 2])] for node in built.far[k]) / 2.0
        assert np.abs(legs.elbow[:, :, 0, k] @ twist - near).max() < EXACT * np.abs(near).max()
        gx, gz = legs.grip[:, 0, k]
        rigid = np.array([[1.0, 0.0, gz], [0.0, 1.0, -gx]])
        assert np.abs(rigid @ twist - far).max() < EXACT * np.abs(far).max()


def test_the_stiffness_of_a_frame_seen_from_another_point_is_the_moved_one():
    design, pose, built, d3, q, psi, pipes = random_irsbot2(np.random.default_rng(7))
    side = design.parallelogram * np.array([design.direction[0], 0.0, design.direction[1]])
    r = np.array([0.11, -0.07, 0.23])
    place = built.frame.places[built.platform] + r
    other = irsbot2_frame(d3, q, psi, pipes, side, design.spacing, place)
    C = other.frame.solve(other.platform, np.eye(6))[6 * other.platform : 6 * other.platform + 6]
    K = stiffness.moved(stiffness.matrix(design, pose), r)
    assert relative(np.linalg.inv(K), C, design.length_m) < EXACT


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("joint", ["revolute", "spherical"])
def test_the_five_bar_moves_as_a_frame_of_beams(seed, joint):
    rng = np.random.default_rng(seed)
    while True:
        g = FiveBarGeometry(rng.uniform(0.2, 0.5), rng.uniform(0.5, 1.0), rng.uniform(0.05, 0.4))
        robot = FiveBar(g)
        pipes, sections = pipes_and_sections(rng, FiveBarStructure.kinds)
        design = FiveBarStructure("random", "", robot, sections, (1, -1), {}, (), joint)
        pose = rng.uniform((-0.3, -0.9), (0.3, -0.4))
        if stiffness.evaluate_many(design, pose[None, :]).status[0] == 0:
            break
    q = []
    for sigma, w in zip(SIGMA, (1, -1), strict=True):
        X, Z = pose[0] + sigma * g.b, pose[1]
        r = hypot(X, Z)
        q.append(np.arctan2(-Z, X) + w * np.arccos((r * r + g.l1**2 - g.l2**2) / (2.0 * g.l1 * r)))
    released = np.array([AXIS_Y]) if joint == "revolute" else np.eye(3)
    built = five_bar_frame(g.l1, g.b, q, np.array([pose[0], 0.0, pose[1]]), pipes, released)
    held = [i for i in range(6) if i not in design.free]
    moved = built.frame.solve(built.platform, np.eye(6)[:, held])
    at_p = moved[6 * built.platform : 6 * built.platform + 6][held]
    C = stiffness.compliance(design, pose)[np.ix_(held, held)]
    scale = np.array([1.0] * 3 + [g.l2] * 3)[held]
    C, at_p = C * np.outer(scale, scale), at_p * np.outer(scale, scale)
    assert np.abs(C - at_p).max() < EXACT * np.abs(at_p).max()
    _, legs, _, _ = next(postures(design, pose[None, :]))
    planar = built.frame.solve(built.platform, np.eye(6)[:, [0, 2]])
    twist = planar[6 * built.platform + np.array([0, 2])]
    for k in (0, 1):
        near = planar[6 * built.near[k][0] + np.array([0, 2])]
        assert np.abs(legs.elbow[:, :2, 0, k] @ twist - near).max() < EXACT * np.abs(near).max()
