"""The Python interface: values, statuses and refusals; one sample and many agree."""

from __future__ import annotations

import dataclasses
import itertools
import pickle
import resource
import subprocess
import sys
from math import inf, nan

import numpy as np
import pytest
from closures import CLOSURES, gradients
from postures import NAMES, ROBOTS, apart, random_joints

import irsbot_kinematics as irs
from irsbot_kinematics.batch import CHUNK
from irsbot_kinematics.numerics.arithmetic import FLOATS

pytestmark = pytest.mark.slow

EQUAL = 1e-12
every_robot = pytest.mark.parametrize("name", NAMES)


@pytest.fixture
def robot():
    return irs.make_robot("irsbot2")


# --- one and many ---


@every_robot
def test_many_postures_equal_the_single_ones_in_every_field(name):
    """Also where nothing is assembled, where numbers are not finite, and in angles beyond a turn."""
    robot, rng = ROBOTS[name], np.random.default_rng(11)
    Q = random_joints(robot, rng, 100 if robot.mechanism.label_is_invariant else 40)
    far = 1e3  # rad or m: where joints still have their digits
    odd = np.tile(Q[0], (6, 1))
    odd[0, 0], odd[1, -1], odd[2, 0], odd[3], odd[4], odd[5, 0] = nan, inf, -inf, far, -far, 7.0
    Q = np.concatenate([Q, odd])
    met = set()
    for assembly in robot.mechanism.assembly_modes:
        evs = robot.evaluate_many(Q, assembly)
        poses, status, gap = irs.batch.direct_many(robot.mechanism, Q, assembly)
        assert (status == evs.status).all()
        assert np.array_equal(poses, evs.pose, equal_nan=True)
        met = met if not robot.mechanism.label_is_invariant else set()  # not every label has a pose somewhere
        for i, q in enumerate(Q):
            at = robot.mechanism.posture(tuple(q.tolist()), assembly)
            met.add(at.status)
            assert evs.status[i] == at.status
            if at.status != irs.Status.SOLVED:
                assert np.isnan([*evs.pose[i], *evs.type1_margin[i], evs.type2_margin[i], evs.reach[i]]).all()
                assert np.isnan([*evs.limb_margin[i], *evs.pressure_angle[i], evs.constraint_margin[i]]).all()
                assert not evs.working_mode[i].any()
                assert np.isnan([*at.pose, at.type2, *at.type1, at.constraint]).all()
                continue
            ev = robot.evaluate(q, assembly)
            # near Type 2 the last bit of a gap shows in everything, far away the last bit of a slide
            scale = EQUAL / at.type2 * (1.0 if robot.mechanism.joints[0].is_angle else 1.0 + np.abs(q).max())
            close = {"rtol": 0, "atol": scale, "equal_nan": True}
            np.testing.assert_allclose(evs.pose[i], ev.pose, **close)
            np.testing.assert_allclose(evs.type1_margin[i], ev.type1_margin, **close)
            np.testing.assert_allclose(evs.type2_margin[i], ev.type2_margin, **close)
            np.testing.assert_allclose(evs.constraint_margin[i], ev.constraint_margin, **close)
            np.testing.assert_allclose(evs.limb_margin[i], ev.limb_margin, **close)
            np.testing.assert_allclose(np.cos(evs.pressure_angle[i]), np.cos(ev.pressure_angle), **close)
            np.testing.assert_allclose(evs.reach[i], min(at.reach), **close)
            np.testing.assert_allclose(gap[i], at.gaps[0], **close)
            assert tuple(evs.working_mode[i]) == ev.working_mode
            assert evs.closure_residual[i] < scale
        assert {irs.Status.SOLVED, irs.Status.INVALID} <= met


@every_robot
def test_answers_do_not_depend_on_what_was_asked_before(name):
    """In every order of joints and labels, at zeros of both signs, and in an array that was filled anew."""
    robot, modes = ROBOTS[name], ROBOTS[name].mechanism.assembly_modes[:4]
    Q = random_joints(robot, np.random.default_rng(12), 3)
    Q = np.concatenate([Q, 0.0 * np.abs(Q[:1]), -0.0 * np.abs(Q[:1])])
    fresh = {
        (i, label): repr(irs.make_robot(name).mechanism.posture(tuple(q), label))
        for i, q in enumerate(Q.tolist())
        for label in modes
    }
    for asked in (fresh, sorted(fresh, key=lambda one: one[1])):
        for i, label in asked:
            assert repr(robot.mechanism.posture(tuple(Q[i].tolist()), label)) == fresh[i, label]
    filled = Q.copy()
    robot.evaluate_many(filled, modes[0])
    filled[:] = Q[::-1]
    expected = irs.make_robot(name).evaluate_many(Q[::-1].copy(), modes[0])
    assert repr(robot.evaluate_many(filled, modes[0]).pose) == repr(expected.pose)


@every_robot
def test_no_pose_is_returned_that_does_not_close_whatever_the_assembly_mode(name):
    """A label that no robot has, for example of a foreign record."""
    robot = ROBOTS[name]
    for seed in range(10):
        q = np.random.default_rng(seed).uniform(0.1, 2.6, len(robot.mechanism.joints))
        at = robot.mechanism.posture(tuple(q.tolist()), 77)
        assert at.status != irs.Status.SOLVED or at.residual <= 1e-9


@every_robot
@pytest.mark.parametrize("size", [1e6, 1e9, 1e12, 1e155, 1e300, -1e308])
def test_no_pose_is_returned_that_does_not_close_however_large_the_joints(name, size):
    """Slides a thousand million metres away, angles of 1e300 rad: what is left of their digits may not close."""
    robot = ROBOTS[name]
    n = len(robot.mechanism.joints)
    Q = size * np.array([np.ones(n), np.linspace(0.3, 1.0, n)])
    for assembly in robot.mechanism.assembly_modes:
        evs = robot.evaluate_many(Q, assembly)
        poses, status, _ = irs.batch.direct_many(robot.mechanism, Q, assembly)
        assert (status == evs.status).all()
        for i, q in enumerate(Q.tolist()):
            at = robot.mechanism.posture(tuple(q), assembly)
            if at.status == irs.Status.SOLVED:
                assert at.residual <= 1e-9
            else:
                assert np.isnan([*at.pose, at.type2]).all()
            if evs.status[i] == irs.Status.SOLVED:
                assert evs.closure_residual[i] <= 1e-9
            else:
                assert np.isnan([*poses[i], *evs.pose[i], evs.type2_margin[i], *evs.type1_margin[i]]).all()
            if abs(size) < 1e8 or abs(size) > 1e14:  # between, rounding decides
                assert evs.status[i] == at.status


@every_robot
def test_many_poses_equal_the_single_ones_in_every_mode(name):
    robot, rng = ROBOTS[name], np.random.default_rng(12)
    on = robot.evaluate_many(random_joints(robot, rng, 100))
    X = on.pose[on.status == irs.Status.SOLVED]
    X = np.concatenate([X, 1.7 * X, np.full((1, X.shape[1]), nan), np.full((1, X.shape[1]), inf)])
    for mode in robot.mechanism.working_modes:
        Q, status, reach = robot.inverse_many(X, mode)
        for x, q, stated, far in zip(X, Q, status, reach, strict=True):
            if not np.isfinite(x).all():
                assert (stated, np.isnan(q).all()) == (irs.Status.INVALID, True)
                with pytest.raises(irs.BadInput):
                    robot.inverse(x, mode)
                continue
            if stated == irs.Status.UNREACHABLE:
                assert np.isnan(q).all()
                with pytest.raises(irs.Unreachable) as raised:
                    robot.inverse(x, mode)
                assert far == pytest.approx(raised.value.reach_m, abs=EQUAL)
            else:
                assert stated == irs.Status.SOLVED
                assert far >= -EQUAL
                assert apart(robot, q, robot.inverse(x, mode), joints=True).max() < 1e-7
        assert set(status) == {irs.Status.SOLVED, irs.Status.UNREACHABLE, irs.Status.INVALID}


def test_chunks_do_not_show(robot):
    Q = np.random.default_rng(13).uniform(-3.0, 3.0, (2 * CHUNK + 7, 2))
    whole = robot.evaluate_many(Q)
    parts = [robot.evaluate_many(part) for part in (Q[: CHUNK - 1], Q[CHUNK - 1 :])]
    for field in dataclasses.fields(whole):
        if field.name != "assembly_mode":
            joined = np.concatenate([getattr(part, field.name) for part in parts])
            assert np.array_equal(getattr(whole, field.name), joined, equal_nan=True), field.name


PAGES = """
import resource
import numpy as np
from irsbot_kinematics import make_robot

robot, joints = make_robot("irsbot2"), np.random.default_rng(13).uniform(-3.0, 3.0, (20_000, 2))
for _ in range(3):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    robot.evaluate_many(joints)
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def test_batches_use_the_memory_of_earlier_ones_again():
    """Pages that the system has to clear, in a process that has freed no large block itself."""
    done = subprocess.run([sys.executable, "-c", PAGES], capture_output=True, text=True, check=True)
    columns = 20_000 * 8 * 50 // resource.getpagesize()
    assert int(done.stdout) < columns // 10


def test_no_samples_give_empty_columns(robot):
    evs = robot.evaluate_many(np.empty((0, 2)))
    assert evs.pose.shape == (0, 2)
    assert evs.limb_margin.shape == (0, 0)
    assert robot.inverse_many(np.empty((0, 2)))[0].shape == (0, 2)


# --- statuses and refusals ---


@pytest.mark.parametrize("pose", [(nan, -0.7), (inf, 0.0), (0.3,), (0.3, -0.7, 0.0), "ab", None, [[1.0], [2.0, 3.0]]])
def test_a_pose_that_is_no_pose_is_refused(robot, pose):
    for ask in (robot.inverse, robot.inverse_all):
        with pytest.raises(irs.BadInput):
            ask(pose)


@pytest.mark.parametrize("joints", [(nan, 0.0), (0.0, -inf), (0.0,), (1.0, 2.0, 3.0), ["x", "y"]])
def test_joints_that_are_no_joints_are_refused(robot, joints):
    for ask in (robot.direct, robot.direct_all, robot.evaluate, robot.posture):
        with pytest.raises(irs.BadInput):
            ask(joints)


@pytest.mark.parametrize("mode", [(1,), (1, 1, 1), (0, 1), (1, 2), (1.5, -1), (nan, 1), "++-", 1])
def test_a_working_mode_that_does_not_exist_is_refused(robot, mode):
    with pytest.raises(irs.BadInput, match="working mode"):
        robot.inverse((0.3, -0.75), mode)
    with pytest.raises(irs.BadInput, match="working mode"):
        robot.inverse_many([(0.3, -0.75)], mode)


@pytest.mark.parametrize("mode", [0, 2, -3, 1.5, nan, "+"])
def test_an_assembly_mode_that_does_not_exist_is_refused(robot, mode):
    for ask in (robot.direct, robot.evaluate):
        with pytest.raises(irs.BadInput, match="assembly mode"):
            ask((0.3, 0.4), mode)
    with pytest.raises(irs.BadInput, match="assembly mode"):
        robot.evaluate_many([(0.3, 0.4)], mode)


def test_modes_may_come_as_arrays_and_floats(robot):
    expected = robot.inverse((0.3, -0.75), (-1, 1))
    for mode in (np.array([-1, 1], np.int8), [-1.0, 1.0]):
        assert (robot.inverse((0.3, -0.75), mode) == expected).all()
    assert type(robot.posture(expected, np.int8(1)).assembly_mode) is int


@pytest.mark.parametrize("values", [[["a", "b"]], [[1.0, 2.0], [3.0]], None, {}])
def test_batches_that_are_no_numbers_are_refused(robot, values):
    for ask in (robot.evaluate_many, robot.inverse_many):
        with pytest.raises(irs.BadInput):
            ask(values)


@pytest.mark.parametrize("shape", [(2,), (3, 3), (1, 2, 2), (0,)])
def test_batches_of_another_shape_are_refused(robot, shape):
    for ask in (robot.evaluate_many, robot.inverse_many):
        with pytest.raises(irs.BadInput, match="shape"):
            ask(np.zeros(shape))


def test_a_wrench_of_the_wrong_size_is_refused(robot):
    with pytest.raises(irs.BadInput, match="wrench"):
        robot.reactions((0.3, -0.75), robot.inverse((0.3, -0.75)), (1.0, 2.0, 3.0))


def test_nothing_is_solved_where_both_rods_pull_along_one_line():
    """q = (0, 0) and motors two rods apart: all on the x axis, det A = 0 exactly."""
    robot = irs.make_robot("five_bar", b=0.825)
    pose, joints = (0.375, 0.0), (0.0, 0.0)
    asked = {
        "velocity": (1.0, 1.0),
        "reactions": (1.0, 0.0),
        "efforts": (1.0, 0.0),
    }
    for name, given in asked.items():
        with pytest.raises(irs.NotAssembled, match="not determined at Type 2"):
            getattr(robot, name)(pose, joints, given)
    with pytest.raises(irs.NotAssembled, match="not determined at Type 2"):
        robot.acceleration(pose, joints, (1.0, 1.0), (0.0, 0.0))
    assert robot.reaction_max(pose, joints, 1.0).tolist() == [inf, inf]


def test_legs_that_do_not_meet_say_how_far_they_are_apart():
    robot = irs.make_robot("five_bar", b=0.7)  # C_1C_2 up to 2 (b + l1) = 2.15 > 2 l2 = 1.65
    with pytest.raises(irs.NotAssembled, match=r"500\.00 mm apart") as raised:
        robot.direct((np.pi, 0.0))
    assert raised.value.gap_m == pytest.approx(-0.5)
    assert robot.mechanism.posture((np.pi, 0.0), 1).status == irs.Status.UNREACHABLE
    assert robot.direct_all((np.pi, 0.0)) == []


def test_the_pose_at_the_very_boundary_is_solved_and_has_no_type_1_margin(robot):
    b0 = robot.mechanism.geometry.b0
    pose = (-b0 + 1.2 * np.cos(1.0), -1.2 * np.sin(1.0))
    q = robot.inverse(pose)
    at = robot.posture(q)
    assert at.type1[0] < 1e-6
    assert at.pose == pytest.approx(pose, abs=1e-9)
    with pytest.raises(irs.Unreachable):
        robot.inverse((-b0 + (1.2 + 1e-6) * np.cos(1.0), -(1.2 + 1e-6) * np.sin(1.0)))


def test_a_leg_straight_to_rounding_has_no_working_mode_alone_and_among_many(robot):
    """q_1 fixed, q_2 bisected until leg I is straight: its sine changes sign there."""
    q1 = -1.0

    def sine(q2):
        return robot.posture((q1, q2), 1).normalised_levers[0]

    grid = np.linspace(-3.0, 3.0, 61)
    low, high = next((a, b) for a, b in itertools.pairwise(grid) if sine(a) * sine(b) < 0.0)
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if sine(middle) * sine(high) < 0.0 else (low, middle)
    at = robot.posture((q1, low), 1)
    assert abs(at.normalised_levers[0]) < 1e-12
    assert at.working_mode[0] == 0
    assert tuple(robot.evaluate_many([(q1, low)], 1).working_mode[0]) == at.working_mode
    assert robot.evaluate((q1, low), 1).clearance < 1e-9


def test_outside_the_workspace_the_joints_stretch_or_fold_the_leg_towards_the_pose(robot):
    """Joints and reach of the equations themselves; the interface raises instead."""
    b0 = robot.mechanism.geometry.b0
    (q1, _), (far, _) = robot.mechanism.inverse(FLOATS, (-b0 + 2.0 * np.cos(1.0), -2.0 * np.sin(1.0)), (1, -1))
    assert q1 == pytest.approx(1.0)
    assert far == pytest.approx(1.2 - 2.0)
    (q1, _), (far, _) = robot.mechanism.inverse(FLOATS, (-b0 + 0.1 * np.cos(1.0), -0.1 * np.sin(1.0)), (1, -1))
    assert abs(q1) == pytest.approx(np.pi - 1.0)  # folded: the crank points away from the pose
    assert far == pytest.approx(0.1 - 0.45)


def test_perpendicular_rods_have_a_pressure_angle_of_zero_in_spite_of_rounding():
    """|C_1C_2| = sqrt(2) l2: |sin(psi_I - psi_II)| may round to more than 1."""
    robot, wanted = irs.make_robot("five_bar", b=0.4), np.sqrt(2) * 0.825

    def elbows_apart(q1, q2):
        return np.hypot(0.8 + 0.375 * (np.cos(q2) - np.cos(q1)), 0.375 * (np.sin(q1) - np.sin(q2)))

    q1 = np.linspace(-2.0, 2.0, 400)
    low, high = np.zeros(400), np.full(400, np.pi)
    on = (elbows_apart(q1, low) > wanted) & (elbows_apart(q1, high) < wanted)
    for _ in range(60):
        middle = 0.5 * (low + high)
        wide = elbows_apart(q1, middle) > wanted
        low, high = np.where(wide, middle, low), np.where(wide, high, middle)
    found = np.stack([q1, low], axis=1)[on]
    assert len(found) > 50
    evs = robot.evaluate_many(found)
    assert np.abs(evs.pressure_angle).max() < 1e-6
    assert evs.type2_margin.max() <= 1.0
    for q in found:
        assert max(robot.evaluate(q).pressure_angle) < 1e-6


@pytest.mark.parametrize("name", NAMES)
def test_a_pickled_robot_keeps_its_name_and_lengths(name):
    robot = pickle.loads(pickle.dumps(ROBOTS[name]))
    assert robot.mechanism.geometry == ROBOTS[name].mechanism.geometry
    assert repr(robot) == repr(ROBOTS[name])
    assert name in repr(robot)


def test_everything_the_package_offers_is_there():
    assert sorted(irs.__all__, key=str.lower) == sorted(set(irs.__all__), key=str.lower)
    for name in irs.__all__:
        assert getattr(irs, name) is not None


@every_robot
def test_angles_of_the_inverse_kinematics_lie_within_half_a_turn_of_zero(name):
    robot, rng = ROBOTS[name], np.random.default_rng(14)
    evs = robot.evaluate_many(random_joints(robot, rng, 300))
    X = evs.pose[evs.status == irs.Status.SOLVED]
    angles = [i for i, joint in enumerate(robot.mechanism.joints) if joint.is_angle]
    for mode in robot.mechanism.working_modes:
        Q, status, _ = robot.inverse_many(X, mode)
        assert (np.abs(Q[status == irs.Status.SOLVED][:, angles]) <= np.pi).all()
        x = X[status == irs.Status.SOLVED][0]
        assert (np.abs(robot.inverse(x, mode)[angles]) <= np.pi).all()


@every_robot
def test_the_closure_residual_is_by_how_much_a_wrong_pose_misses(name):
    """To first order the closure over the size of its gradient by the platform point: |P - C| - L."""
    robot, rng = ROBOTS[name], np.random.default_rng(15)
    mechanism, closure = robot.mechanism, CLOSURES[robot.mechanism.kind]
    evs = robot.evaluate_many(random_joints(robot, rng, 200))
    fine = (evs.status == irs.Status.SOLVED) & (evs.type2_margin > 0.1) & (evs.type1_margin.min(axis=1) > 0.1)
    off, seen = 1e-5 * mechanism.length_m, 0
    forces = len(mechanism.task) - mechanism.task[-1].is_angle
    for q, x in zip(evs.joint_position[fine][:20], evs.pose[fine][:20], strict=True):
        wrong = x + np.insert(rng.normal(size=forces) * off, forces, np.zeros(len(x) - forces))
        by_x, _ = gradients(closure, mechanism.geometry, q, wrong)
        expected = closure(mechanism.geometry, q, wrong) / np.linalg.norm(by_x[:, :forces], axis=1)
        at = mechanism.at(tuple(q), tuple(wrong), 1, (0.0, 0.0))
        assert at.residual == pytest.approx(np.abs(expected).max(), rel=1e-3)
        assert at.residual > 0.01 * off
        seen += 1
    assert seen > 5


def test_elbows_at_exactly_the_same_point_are_refused_like_those_a_nanometre_apart():
    for l1 in np.linspace(0.31, 0.39, 200):
        robot = irs.make_robot("five_bar", b=0.3, l1=float(l1))
        q = tuple(np.array([np.arccos(0.3 / l1), np.pi - np.arccos(0.3 / l1)]))
        _, gaps = robot.mechanism.direct(FLOATS, q, 1)
        if gaps[1] == 0.0:
            break
    assert gaps[1] == 0.0, "no exact coincidence among these lengths: the fixture proves nothing"
    assert robot.mechanism.posture(q, 1).status == irs.Status.SINGULAR
    assert robot.evaluate_many([q], 1).status[0] == irs.Status.SINGULAR
