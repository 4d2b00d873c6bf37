"""`evaluate_many` into the arrays of an earlier call."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

import irsbot_kinematics as irs

ARRAYS = [field.name for field in fields(irs.Evaluations) if field.name != "assembly_mode"]


def samples(robot: irs.Robot, seed: int, number: int = 200) -> np.ndarray:
    """Joint positions in and out of the workspace, and one that is none."""
    joints = robot.mechanism.joints
    low, high = [max(j.lower, -4.0) for j in joints], [min(j.upper, 4.0) for j in joints]
    Q = np.random.default_rng(seed).uniform(low, high, (number, len(joints)))
    Q[number // 2] = np.nan
    return Q


def assert_same(found: irs.Evaluations, expected: irs.Evaluations) -> None:
    assert found.assembly_mode == expected.assembly_mode
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name), err_msg=name)


@pytest.mark.parametrize("name", ["irsbot2", "five_bar", "orthoglide", "rrr3", "uranesx", "rpr3", "ruu4"])
@pytest.mark.filterwarnings("ignore::irsbot_kinematics.LabelsVary")
def test_arrays_are_filled_anew_with_the_same_results(name: str) -> None:
    robot = irs.make_robot(name)
    first, second, modes = samples(robot, 1), samples(robot, 2), robot.mechanism.assembly_modes
    for asked in ({}, {"force": 3.0}):
        before = robot.evaluate_many(first, modes[0], **asked)
        expected = robot.evaluate_many(second, modes[-1], **asked)
        found = robot.evaluate_many(second, modes[-1], out=before, **asked)
        assert_same(found, expected)
        for array in ARRAYS:
            assert getattr(found, array) is getattr(before, array)


@pytest.mark.parametrize("name", ["irsbot2", "orthoglide", "rrr3"])
@pytest.mark.filterwarnings("ignore::irsbot_kinematics.LabelsVary")
def test_a_motion_fills_them_too(name: str) -> None:
    robot = irs.make_robot(name)
    Q = samples(robot, 1)
    out = robot.evaluate_many(Q)
    first = int(np.flatnonzero(out.status == irs.Status.SOLVED)[0])
    start = out.pose[first].copy()
    motion = Q[first] + 0.05 * np.sin(np.linspace(0.0, 6.0, len(Q)))[:, np.newaxis]
    expected = robot.evaluate_many(motion, start=start)
    assert (expected.status == irs.Status.SOLVED).any()
    assert_same(robot.evaluate_many(motion, start=start, out=out), expected)


def test_machine_code_fills_them_too() -> None:
    robot = irs.make_robot("irsbot2")
    robot.compile(threads=2)
    first, second = samples(robot, 1), samples(robot, 2)
    out, expected = robot.evaluate_many(first), robot.evaluate_many(second)
    assert_same(robot.evaluate_many(second, out=out), expected)


def test_margins_of_another_kind_of_robot_do_not_stay() -> None:
    one, other = irs.make_robot("irsbot2"), irs.make_robot("five_bar")
    out = one.evaluate_many(samples(one, 1))
    assert np.isfinite(out.constraint_margin).any()
    Q = samples(other, 2)
    expected = other.evaluate_many(Q)
    assert_same(other.evaluate_many(Q, out=out), expected)


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("of", ["joint_position", "pose", "pressure_angle"])
def test_joints_may_be_taken_from_the_arrays_that_are_filled(of: str, compiled: bool) -> None:
    robot = irs.make_robot("irsbot2")
    if compiled:
        robot.compile()
    out = robot.evaluate_many(samples(robot, 1))
    Q = getattr(out, of)[::-1]
    expected = robot.evaluate_many(Q.copy())
    assert_same(robot.evaluate_many(Q, out=out), expected)


def test_the_joints_of_the_caller_are_not_kept() -> None:
    robot = irs.make_robot("irsbot2")
    Q = samples(robot, 1)
    found = robot.evaluate_many(Q)
    given = Q.copy()
    Q[:] = 0.0
    np.testing.assert_array_equal(found.joint_position, given)


def test_arrays_that_do_not_fit_are_refused_and_keep_their_values() -> None:
    robot = irs.make_robot("irsbot2")
    Q = samples(robot, 1)
    good = robot.evaluate_many(Q)
    kept = {name: getattr(good, name).copy() for name in ARRAYS}
    locked = good.pose.copy()
    locked.flags.writeable = False
    wrong = [
        (robot.evaluate_many(Q[:-1]), "out must be evaluations of 200 samples.*got status uint8 \\(199,\\)"),
        (irs.make_robot("orthoglide").evaluate_many(np.ones((200, 3))), "got joint_position float64 \\(200, 3\\)"),
        (robot.evaluate_many(Q, force=1.0), "reaction_max"),
        (replace(good, pose=np.asfortranarray(good.pose)), "pose.*contiguous"),
        (replace(good, pose=locked), "pose.*writeable"),
        (replace(good, reach=good.reach.astype(np.float32)), "reach float32"),
        (replace(good, reach=good.reach.tolist()), "reach list"),
    ]
    for out, message in wrong:
        with pytest.raises(irs.BadInput, match=message):
            robot.evaluate_many(Q[::-1], out=out)
    with pytest.raises(irs.BadInput, match="out must be results of evaluate_many"):
        robot.evaluate_many(Q, out=good.pose)
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(good, name), kept[name], err_msg=name)
