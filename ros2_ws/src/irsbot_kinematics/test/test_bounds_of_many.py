"""Bounds of many postures at once are those of each posture."""

from __future__ import annotations

import numpy as np
import pytest
from postures import NAMES, ROBOTS, random_joints

import irsbot_kinematics as irs
from irsbot_kinematics.bounds.columns import least_singular_many
from irsbot_kinematics.bounds.sizes import least_singular
from irsbot_kinematics.mechanisms.planar_pair import PlanarPair
from irsbot_kinematics.numerics.arithmetic import ARRAYS

ROUNDING = 1e-10
"""1: bounds of boxes that are not nearly too large differ by less."""
AMPLIFIED = 1e-7
"""1: and all others. Where a box is nearly too large, the bounds contain quotients of small differences."""

PAIRS = [name for name in NAMES if isinstance(ROBOTS[name].mechanism, PlanarPair)]


def boxes(robot, rng, number):
    """Joints and travel of boxes, from a point to far too large; some with one joint that moves alone."""
    travel = 10.0 ** rng.uniform(-6.0, 0.0, (number, 1)) * rng.uniform(size=(number, 2))
    travel[rng.uniform(size=number) < 0.2, rng.integers(2)] = 0.0
    return random_joints(robot, rng, number), travel


def compared(robot, joints, travel, assembly):
    """Compare both kinds of bounds row by row; returns how many boxes have a second-order bound."""
    mechanism, columns = robot.mechanism, tuple(joints.T.copy())
    with np.errstate(all="ignore"):
        pose, gaps = mechanism.direct(ARRAYS, columns, assembly)
        legs = mechanism.legs(ARRAYS, columns, pose)
        first = mechanism.certified_bounds_many(legs, gaps, tuple(travel.T))
        second = mechanism.sharp_bounds_many(columns, pose, legs, gaps, tuple(travel.T))
    promised = 0
    for row, (q, half) in enumerate(zip(joints.tolist(), travel.tolist(), strict=True)):
        at = mechanism.posture(tuple(q), assembly)
        if at.status != irs.Status.SOLVED or at.type2 < 0.01:
            continue
        bounds = mechanism.certified_bounds(at, half), mechanism.sharp_bounds(at, half)
        for one, many in zip(bounds, (first, second), strict=True):
            wanted = [*one.type1, one.type2, *([] if one.constraint != one.constraint else [one.constraint])]
            found = [*many.type1, many.type2, *([] if many.constraint is None else [many.constraint])]
            nearly = AMPLIFIED if one.type2 < 0.1 else ROUNDING
            assert [column[row] for column in found] == pytest.approx(wanted, abs=nearly, rel=0.0), (at.joints, half)
        promised += bounds[1].type2 > 0.0
    return promised


@pytest.mark.parametrize("name", PAIRS)
def test_bounds_of_many_postures_are_those_of_each(name):
    robot, rng = ROBOTS[name], np.random.default_rng(7)
    for assembly in robot.mechanism.assembly_modes:
        assert compared(robot, *boxes(robot, rng, 1000), assembly) > 100


def test_bounds_of_planar_loops_of_any_proportions_are_those_of_each():
    rng, promised = np.random.default_rng(8), 0
    for _ in range(60):
        l1, l2, b = (10.0 ** rng.uniform([-0.5, -1.5, -1.5], [0.5, 0.0, 0.5])).tolist()
        robot = irs.make_robot("five_bar", l1=l1, l2=l2, b=min(b, 0.9 * (l1 + l2)))
        promised += compared(robot, *boxes(robot, rng, 60), -1)
    assert promised > 100


@pytest.mark.parametrize("longer", [0.2, 1.2, 4.0])
def test_constraint_bounds_of_rods_of_any_length_are_those_of_each(longer):
    # The normals of rods shorter than D are extreme at other directions than those of longer rods.
    shipped = ROBOTS["irsbot2"].mechanism.geometry
    lengths = {name: getattr(shipped, name) for name in ("l1", "l2eq", "b", "p", "a1", "a2", "beta", "e")}
    apart = longer * shipped.l2eq / np.sin(shipped.beta)  # a1 - a2, so that D = longer l2eq
    lengths.update(a1=shipped.a2 + apart, b=shipped.b0 + shipped.p + (shipped.a2 + apart) * np.sin(shipped.beta))
    robot = irs.make_robot("irsbot2", **lengths)
    assert pytest.approx(longer * shipped.l2eq) == robot.mechanism.geometry.D
    assert compared(robot, *boxes(robot, np.random.default_rng(9), 1000), -1) > 100


def test_rows_of_which_nothing_can_be_said_do_not_count():
    robot, rng = ROBOTS["irsbot2"], np.random.default_rng(10)
    joints, travel = boxes(robot, rng, 200)
    travel[::4, 0], travel[1::4, 1], travel[2::4, 0] = -1e-3, np.nan, np.inf
    columns = tuple(joints.T.copy())
    with np.errstate(all="ignore"):
        pose, gaps = robot.mechanism.direct(ARRAYS, columns, -1)
        legs = robot.mechanism.legs(ARRAYS, columns, pose)
        found = robot.mechanism.sharp_bounds_many(columns, pose, legs, gaps, tuple(travel.T))
    bad = np.arange(200) % 4 < 3
    assert not (found.type2[bad] > 0.0).any()
    assert not (found.constraint[bad] > 0.0).any()
    assert (found.type2[~bad] > 0.0).any()


def test_of_a_geometry_with_errors_there_are_no_columns():
    robot, nothing = ROBOTS["irsbot2"], np.zeros(3)
    columns = (nothing, nothing)
    pose, gaps = robot.mechanism.direct(ARRAYS, columns, -1)
    legs = robot.mechanism.legs(ARRAYS, columns, pose)
    assert robot.mechanism.certified_bounds_many(legs, gaps, columns, slack_m=1e-4) is None
    assert robot.mechanism.sharp_bounds_many(columns, pose, legs, gaps, columns, slack_m=1e-4) is None


def test_singular_values_of_many_matrices_are_bounded_as_of_each():
    rng, positive = np.random.default_rng(11), 0
    sizes = 10.0 ** rng.uniform(-4.0, 0.0, (400, 3))
    matrix, ways = rng.normal(size=(400, 3, 2)), rng.normal(size=(400, 2, 3, 2)) * sizes[:, :2, None, None]
    ways[::5, 0], ways[::7, 1], rest = 0.0, 0.0, 0.1 * sizes[:, 2]
    with np.errstate(all="ignore"):
        many = least_singular_many(
            [tuple(column.T) for column in matrix.transpose(1, 0, 2)],
            [[tuple(column.T) for column in way.transpose(1, 0, 2)] for way in ways.transpose(1, 0, 2, 3)],
            rest,
        )
    for row in range(400):
        one = least_singular(matrix[row].tolist(), ways[row].tolist(), float(rest[row]))
        assert many[row] == pytest.approx(one, abs=ROUNDING)
        positive += one > 0.0
    assert 100 < positive < 400
