"""The Delta family of [S4]: printed numbers, factors and counts, and what the legs do at the edges."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from postures import random_joints

import irsbot_kinematics as irs
from irsbot_kinematics import Status
from irsbot_kinematics.limbs import prpir_factors
from irsbot_kinematics.mechanism import Mechanism
from irsbot_kinematics.numerics.arithmetic import FLOATS
from irsbot_kinematics.numerics.tolerances import FARTHEST

FAMILY = ("orthoglide", "hybridglide", "triaglide", "uranesx")
ROBOTS = {name: irs.make_robot(name) for name in (*FAMILY, "linear_delta")}
PRINTED = 5e-10
"""Relative: half a unit of the tenth digit printed in the sheet."""
SURE = 1e-9
"""What is computed twice in different ways agrees to this, away from singularities."""

every_robot = pytest.mark.parametrize("name", ROBOTS)


def slides(robot, q):
    """C_i from the table of the sheet, written down once more."""
    m = robot.mechanism
    return np.array([np.array(o) + rho * np.array(u) for (o, u), rho in zip(m.rails, q, strict=True)])


def inside(robot, solutions):
    lower, upper = robot.mechanism.joints[0].lower, robot.mechanism.joints[0].upper
    return [q for q in solutions if ((q > lower) & (q < upper)).all()]


def test_the_slides_move_between_the_limits_of_the_paper():
    for name in FAMILY:
        assert {(joint.unit, joint.lower, joint.upper) for joint in ROBOTS[name].mechanism.joints} == {("m", 0.0, 4.0)}


def test_orthoglide_reaches_the_printed_pose_in_eight_ways():
    solutions = inside(ROBOTS["orthoglide"], ROBOTS["orthoglide"].inverse_all((1.3, 1.1, 1.2)))
    printed = [(0.1381049961, 2.461895004), (0.1672620947, 2.032737905), (0.1511911518, 2.248808848)]
    np.testing.assert_allclose(sorted(map(tuple, solutions)), sorted(product(*printed)), rtol=PRINTED)


def test_hybridglide_reaches_the_printed_pose_in_eight_ways_and_triaglide_in_two():
    solutions = inside(ROBOTS["hybridglide"], ROBOTS["hybridglide"].inverse_all((0.2, 1.9, 1.4)))
    assert len(solutions) == 8
    first = sorted({round(float(q[0]), 10) for q in solutions})
    np.testing.assert_allclose(first, (0.7167840434, 3.083215957), rtol=PRINTED)
    triaglide = ROBOTS["triaglide"]
    assert len(inside(triaglide, triaglide.inverse_all((0.2, 1.5, 0.7)))) == 2


def test_uranesx_reaches_a_pose_on_its_axis_in_eight_ways():
    """rho_i = 2 +- sqrt 3: against Table 5 of [S4], which has no cell with more than two solutions."""
    solutions = inside(ROBOTS["uranesx"], ROBOTS["uranesx"].inverse_all((0.0, 0.0, 2.0)))
    expected = product((2 - 3**0.5, 2 + 3**0.5), repeat=3)
    np.testing.assert_allclose(sorted(map(tuple, solutions)), sorted(expected), atol=SURE)


@pytest.mark.parametrize(
    ("name", "rho", "poses"),
    [
        (
            "orthoglide",
            (1.783768345, 3.152029536, 0.9754601843),
            [(0.3263847789, 1.255992412, -0.5463663617), (1.074944542, 1.679610654, 0.8224821378)],
        ),
        (
            "uranesx",
            (3.64237861, 1.765621668, 2.497069354),
            [(-0.8827320687, 0.6704222753, 3.718889591), (1.189953517, -0.1984848357, 1.661338118)],
        ),
    ],
)
def test_the_printed_poses_belong_to_the_printed_slides(name, rho, poses):
    found = sorted(map(tuple, ROBOTS[name].direct_all(rho)))
    np.testing.assert_allclose(found, sorted(poses), rtol=0, atol=6e-10)  # the tenth digit


def test_orthoglide_has_a_parallel_singularity_inside_its_limits():
    P, rho = (0.2313434865, 1.027998437, 1.276673092), (1.377347426, 2.550031947, 2.97658468)
    legs = ROBOTS["orthoglide"].mechanism.legs(FLOATS, rho, P)
    assert max(map(abs, legs.closure)) < 1e-8
    assert abs(np.linalg.det(legs.screws)) < 1e-8
    at = ROBOTS["orthoglide"].mechanism.posture(tuple(value + 1e-6 for value in rho), -1)
    assert at.status == Status.UNREACHABLE or at.type2 < 0.01  # cos alpha ~ sqrt of the distance from the locus


def test_hybridglide_has_the_printed_pressure_angles():
    P, rho = (0.7912813851, 0.7818001581, 0.1200987896), (2.76725044, 1.663212252, 1.782224622)
    robot = ROBOTS["hybridglide"]
    near = min(robot.mechanism.assembly_modes, key=lambda mode: np.abs(robot.direct(rho, mode) - P).max())
    printed = (0.7735694478, 0.8736484748, 0.8177887281)
    np.testing.assert_allclose(np.cos(robot.evaluate(rho, near).pressure_angle), printed, rtol=0, atol=6e-10)
    np.testing.assert_allclose(robot.direct(rho, near), P, rtol=0, atol=6e-10)


def printed_determinant(name, P, rho):
    """[S4] (8), UraneSX corrected and at its scale of 2."""
    x, y, z = P
    a, b, c = rho
    if name == "orthoglide":
        return -a * b * c + a * b * z + a * c * y + b * c * x
    if name == "hybridglide":
        return -a * c * x + b * c * x - a * c + a * z - b * c + b * z + 2 * c * y
    if name == "triaglide":
        return a * z + b * z - 2 * c * z
    return (3**0.5 * (3 * z - a - b - c + c * x + b * x - 2 * a * x) + 3 * c * y - 3 * b * y) / 2


@pytest.mark.parametrize("name", FAMILY)
def test_the_determinant_is_the_printed_polynomial(name):
    rng = np.random.default_rng(1)
    for q, P in zip(rng.uniform(0, 4, (50, 3)), rng.uniform(-2, 2, (50, 3)), strict=True):
        A = np.array(ROBOTS[name].mechanism.legs(FLOATS, q, P).screws)  # of any joints and pose, as the polynomial is
        assert 8 * np.linalg.det(A) == pytest.approx(printed_determinant(name, P, q), abs=1e-12 * 100)


def test_triaglide_is_singular_in_parallel_only_in_the_plane_of_its_rails():
    robot, rng = ROBOTS["triaglide"], np.random.default_rng(2)
    for q in random_joints(robot, rng, 400):
        for x in robot.direct_all(q):
            C = slides(robot, q)
            height = 8 * abs(np.linalg.det(robot.jacobians(x, q)[0]))
            assert height == pytest.approx(abs(x[2]) * abs(C[0, 1] + C[1, 1] - 2 * C[2, 1]), abs=1e-9)


@pytest.mark.parametrize("name", FAMILY)
def test_two_poses_exist_exactly_where_the_circumcircle_is_smaller_than_the_rods(name):
    """Sign of a^2 b^2 c^2 - 4 L^2 |N|^2 over the joint space, with the sides measured here."""
    robot, rng = ROBOTS[name], np.random.default_rng(3)
    counts = []
    for q in random_joints(robot, rng, 600):
        C = slides(robot, q)
        a, b, c = (np.linalg.norm(C[i] - C[j]) for i, j in ((0, 1), (1, 2), (2, 0)))
        N = np.cross(C[1] - C[0], C[2] - C[0])
        counts.append(len(robot.direct_all(q)))
        assert counts[-1] == (2 if a * b * c < 2 * robot.mechanism.rod * np.linalg.norm(N) else 0)
    assert 0 < counts.count(2) < len(counts), "the fixture sees both cases"


VOLUMES = {  # m^3 with 1, 2, 4, 8 solutions inside the limits; Tables 5 and 6 as the sheet computes them
    "orthoglide": (33.5104, 0.0, 0.0, 0.4974),
    "hybridglide": (10.4720, 2.8711, 0.5583, 0.4090),
    "triaglide": (20.9440, 5.7422, 1.4314, 2.0088),
    "uranesx": (15.6354, 3.4771, 3.2500, 0.6872),
}
JOINT_VOLUMES = {"orthoglide": 35.5431, "hybridglide": 37.1358, "triaglide": 44.9778, "uranesx": 61.6224}


@pytest.mark.parametrize("name", FAMILY)
def test_volumes_by_number_of_solutions_are_those_of_the_sheet(name):
    robot, rng = ROBOTS[name], np.random.default_rng(4)
    number = 200_000
    poses = rng.uniform((-2, -2, -2), (2, 6, 6), (number, 3))
    count = np.zeros(number, int)
    for mode in robot.mechanism.working_modes:
        q, status, _ = robot.inverse_many(poses, mode)
        count += (status == Status.SOLVED) & ((q > 0) & (q < 4)).all(axis=1)
    box = 4 * 8 * 8
    for solutions, volume in zip((1, 2, 4, 8), VOLUMES[name], strict=True):
        share = np.mean(count == solutions)
        assert share * box == pytest.approx(volume, abs=5 * box * np.sqrt(volume / box / number) + 2e-3)
    evs = robot.evaluate_many(rng.uniform(0, 4, (number, 3)), 1)
    share = np.mean(evs.status == Status.SOLVED)
    assert share * 64 == pytest.approx(JOINT_VOLUMES[name], abs=5 * 64 * 0.5 / np.sqrt(number) + 2e-3)


@every_robot
def test_the_posture_in_one_piece_is_the_posture_of_the_shared_equations_and_of_the_batch(name):
    robot, rng = ROBOTS[name], np.random.default_rng(5)
    Q = random_joints(robot, rng, 300)
    for assembly in (-1, 1):
        evs = robot.evaluate_many(Q, assembly)
        for i, q in enumerate(Q.tolist()):
            at = robot.mechanism.posture(tuple(q), assembly)
            plain = Mechanism.posture(robot.mechanism, q, assembly)
            assert at.status == plain.status == evs.status[i]
            if at.status != Status.SOLVED or at.type2 < 1e-3:
                continue
            assert at.working_mode == plain.working_mode == tuple(evs.working_mode[i])
            for field in (
                "pose",
                "screws",
                "levers",
                "normalised_levers",
                "reach",
                "gaps",
                "cos_pressure",
                "det",
                "limb",
            ):
                np.testing.assert_allclose(getattr(at, field), getattr(plain, field), atol=1e-11, err_msg=field)
            np.testing.assert_allclose(at.pose, evs.pose[i], atol=1e-11)
            np.testing.assert_allclose(at.type1, evs.type1_margin[i], atol=1e-11)
            assert at.type2 == pytest.approx(evs.type2_margin[i], abs=1e-11)
            np.testing.assert_allclose(at.limb, evs.limb_margin[i], atol=1e-11)
            assert at.residual < 1e-12


@every_robot
def test_the_reach_is_the_distance_to_where_a_rod_stands_across_its_rail(name):
    """Moved away from rail i by its reach, the platform is on the boundary: rod normal to rail."""
    robot, rng = ROBOTS[name], np.random.default_rng(6)
    for q in random_joints(robot, rng, 100):
        for x in robot.direct_all(q):
            at = robot.mechanism.at(tuple(q), tuple(x), 1, (1.0, 1.0))
            for (origin, along), reach in zip(robot.mechanism.rails, at.reach, strict=True):
                across = x - origin - np.dot(x - origin, along) * np.array(along)
                edge = x + reach * across / np.linalg.norm(across)
                away = edge - origin - np.dot(edge - origin, along) * np.array(along)
                assert np.linalg.norm(away) == pytest.approx(robot.mechanism.rod, abs=1e-9)


def test_orthoglide_limbs_have_the_margin_of_their_factors_for_every_revolute_axis():
    """The parallelogram can only be flat where the leg is of Type 1 already."""
    robot, rng = ROBOTS["orthoglide"], np.random.default_rng(7)
    for q in random_joints(robot, rng, 100):
        for x in robot.direct_all(q):
            at = robot.mechanism.at(tuple(q), tuple(x), 1, (1.0, 1.0))
            for rod, (_, u), margin in zip(at.screws, robot.mechanism.rails, at.limb, strict=True):
                v, w = np.linalg.svd(np.array([u]))[2][1:]
                for angle in rng.uniform(0, np.pi, 3):
                    z = np.cos(angle) * v + np.sin(angle) * w
                    assert min(prpir_factors(FLOATS, rod, u, z.tolist())) == pytest.approx(margin, abs=1e-12)


def test_slides_in_line_and_slides_in_one_point_have_no_pose():
    assert (
        ROBOTS["triaglide"].mechanism.posture((1.0, 3.0, 2.0), 1).status == Status.UNREACHABLE
    )  # rho1 + rho2 = 2 rho3
    assert ROBOTS["orthoglide"].mechanism.posture((0.0, 0.0, 0.0), 1).status == Status.SINGULAR
    assert ROBOTS["orthoglide"].mechanism.posture((0.0, 0.0, 1.0), 1).status == Status.SINGULAR
    assert ROBOTS["orthoglide"].mechanism.posture((np.nan, 1.0, 1.0), 1).status == Status.INVALID
    evs = ROBOTS["orthoglide"].evaluate_many(
        [(0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (np.nan, 1.0, 1.0), (2.0, 2.0, 2.0)], -1
    )
    assert evs.status.tolist() == [Status.SINGULAR, Status.SINGULAR, Status.INVALID, Status.SOLVED]
    with pytest.raises(irs.NotAssembled, match="apart"):
        ROBOTS["triaglide"].direct((1.0, 3.0, 2.0))


@every_robot
def test_the_guarantee_with_slack_holds_on_machines_whose_slides_are_that_wrong(name):
    """Every slide off by the slack in any direction, which covers rods of wrong length; poses by Newton steps."""
    robot, rng = ROBOTS[name], np.random.default_rng(8)
    L, number, promised = robot.mechanism.rod, 40, 0
    O = np.array([o for o, _ in robot.mechanism.rails])
    U = np.array([u for _, u in robot.mechanism.rails])
    for q in random_joints(robot, rng, 60):
        for assembly in (-1, 1):
            at = robot.mechanism.posture(tuple(q), assembly)
            if at.status != Status.SOLVED:
                continue
            slack, travel = L * 10.0 ** rng.uniform(-4, -1.7), L * 10.0 ** rng.uniform(-4, -1.5, 3)
            bound = robot.mechanism.certified_bounds(at, travel.tolist(), slack)
            if not bound.type2 > 0.0:
                continue
            promised += 1
            off = rng.normal(size=(number, 3, 3))
            off *= slack / np.linalg.norm(off, axis=2, keepdims=True)
            end = q + travel * np.sign(rng.uniform(-1, 1, (number, 3)))
            X = np.tile(np.array(at.pose), (number, 1))
            for share in np.linspace(0.2, 1.0, 5):  # followed from the posture, so that the branch is the one promised
                C = O + (q + share * (end - q))[..., None] * U + share * off
                for _ in range(4):
                    rods = X[:, None, :] - C
                    error = 0.5 * (np.sum(rods * rods, axis=2) - L * L)
                    X = X - np.linalg.solve(rods, error[..., None])[..., 0]
            rods = (X[:, None, :] - C) / L
            normals = np.cross(np.roll(rods, -1, axis=1), np.roll(rods, -2, axis=1))
            cosines = np.abs(np.sum(rods * normals, axis=2)) / np.linalg.norm(normals, axis=2)
            assert (cosines.min(axis=1) >= bound.type2 - SURE).all()
            assert (np.abs(np.sum(rods * U, axis=2)) >= np.array(bound.type1) - SURE).all()
    assert promised > 30


def test_wrong_lengths_are_refused_with_both_values():
    with pytest.raises(irs.InvalidGeometry, match=r"L > 0, got -1"):
        irs.make_robot("orthoglide", L=-1.0)
    with pytest.raises(irs.InvalidGeometry, match=r"limits\[0\] < limits\[1\], got 4 against 0"):
        irs.make_robot("triaglide", limits=(4.0, 0.0))
    with pytest.raises(irs.InvalidGeometry, match="limits must be 2 numbers"):
        irs.make_robot("uranesx", limits=(0.0, 1.0, 4.0))
    with pytest.raises(irs.InvalidGeometry, match="limits"):
        irs.make_robot("uranesx", limits=4.0)
    with pytest.raises(irs.InvalidGeometry, match="must be finite"):
        irs.make_robot("hybridglide", L=float("nan"))
    with pytest.raises(irs.InvalidGeometry, match=r"\|u2\| > 0"):
        irs.make_robot("linear_delta", u2=(0.0, 0.0, 0.0))


def test_rails_of_ones_own_make_the_robots_of_the_family():
    """The Triaglide as a linear_delta, with directions that are not unit vectors."""
    own = irs.make_robot(
        "linear_delta",
        **{"L": 2.0, "limits": (0.0, 4.0), "o1": (1.0, 0.0, 0.0), "o2": (-1.0, 0.0, 0.0), "o3": (0.0, 0.0, 0.0)},
        **{f"u{i}": (0.0, 3.0, 0.0) for i in (1, 2, 3)},
    )
    q = (2.3, 2.5, 0.4)
    np.testing.assert_array_equal(own.direct_all(q), ROBOTS["triaglide"].direct_all(q))


@pytest.mark.parametrize("name", ["orthoglide", "linear_delta"])
def test_the_clearance_does_not_depend_on_which_leg_is_the_first(name):
    """Rails that are turned into each other: joints in turn give the turned pose."""
    robot, m = ROBOTS[name], ROBOTS[name].mechanism
    compared = 0
    for q in random_joints(robot, np.random.default_rng(8), 400).tolist():
        a, b, c = q
        turned = [m.posture(joints, m.usual_assembly_mode) for joints in ((a, b, c), (b, c, a), (c, a, b))]
        if all(at.status == Status.SOLVED for at in turned):
            first, *others = map(m.clearance, turned)
            assert others == pytest.approx([first] * 2, rel=SURE, abs=SURE)
            compared += first > 0.01
    assert compared > 20


@pytest.mark.parametrize("name", ["linear_delta", "triaglide", "uranesx"])
def test_slides_beyond_the_farthest_place_have_no_pose_also_where_their_rails_are_parallel(name):
    """All three are about as far: their loops close."""
    mechanism = irs.make_robot(name).mechanism
    assert mechanism.posture((FARTHEST + 0.7, FARTHEST + 0.9, FARTHEST - 0.1), -1).status == Status.INVALID


@pytest.mark.parametrize("name", ["hybridglide", "linear_delta", "orthoglide", "triaglide", "uranesx"])
def test_a_regular_posture_takes_the_short_way(name, monkeypatch):
    mechanism, rng = irs.make_robot(name).mechanism, np.random.default_rng(0)
    ends = np.array([(joint.lower, joint.upper) for joint in mechanism.joints]).T
    found = (Mechanism.posture(mechanism, tuple(rng.uniform(*ends).tolist()), -1) for _ in range(1000))
    regular = next(at for at in found if at.status == Status.SOLVED and min(at.cos_pressure) > 0.3)
    monkeypatch.setattr(Mechanism, "posture", None)
    np.testing.assert_allclose(mechanism.posture(regular.joints, -1).pose, regular.pose, atol=1e-12)
