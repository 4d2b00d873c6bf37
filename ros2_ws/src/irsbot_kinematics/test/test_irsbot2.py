"""The IRSBot-2 against worked numbers, computed once with 40 digits from the corrected equations."""

from __future__ import annotations

from math import hypot, inf, isnan, pi, sqrt

import numpy as np
import pytest
from irsbot2_3d import Design
from singular_points import constraint_points, distal_postures, held_by_arms, parallel_rods, rods_in_line

import irsbot_kinematics as irs
from irsbot_kinematics.analysis import planar_indices as measures
from irsbot_kinematics.mechanisms.planar_loop import coincident_elbows
from irsbot_kinematics.numerics.arithmetic import ARRAYS

PRINTED = 1e-8
"""Half a unit of the last printed place, and some rounding."""

P = (0.3, -0.75)
W1_MODES = [
    # mode, q_I, q_II, psi_I, psi_II, sin(q_I-psi_I), sin(q_II-psi_II), sin(psi_I-psi_II)
    ((1, -1), 2.544003124, -0.190028776, 0.711988228, 1.671350318, 0.966075990, -0.958077069, -0.818825547),
    ((-1, 1), -0.196686461, 2.604320414, 1.635328434, 0.742941321, -0.966075990, 0.958077069, 0.778572010),
    ((1, 1), 2.544003124, 2.604320414, 0.711988228, 0.742941321, 0.966075990, 0.958077069, -0.030948150),
    ((-1, -1), -0.196686461, -0.190028776, 1.635328434, 1.671350318, -0.966075990, -0.958077069, -0.036014094),
]


@pytest.fixture
def robot():
    return irs.make_robot("irsbot2")


@pytest.fixture
def at(robot):
    """W1: the usual posture at P."""
    return robot.posture(robot.inverse(P))


def near(expected, tolerance=PRINTED):
    return pytest.approx(expected, rel=0, abs=tolerance)


def at_pose(robot, pose, mode):
    """Posture of a pose in one working mode, in the assembly mode that the pose has."""
    q = robot.inverse(pose, mode)
    A, _ = robot.jacobians(pose, q)
    return robot.posture(q, 1 if np.linalg.det(A) > 0.0 else -1)


@pytest.mark.parametrize(("mode", "q1", "q2", "psi1", "psi2", "s1", "s2", "s12"), W1_MODES)
def test_each_working_mode_of_the_worked_pose(robot, mode, q1, q2, psi1, psi2, s1, s2, s12):
    assert robot.inverse(P, mode) == near([q1, q2])
    at = at_pose(robot, P, mode)
    assert at.pose == near(P)
    assert robot.mechanism.rod_angles(at) == near((psi1, psi2))
    assert at.normalised_levers == near((s1, s2))
    assert at.det == near(s12)
    assert at.type2 == near(abs(s12))
    assert (at.working_mode, at.assembly_mode) == (mode, 1 if s12 > 0 else -1)


def test_inverse_all_lists_the_four_modes_in_the_order_of_the_table(robot):
    assert [tuple(q) for q in robot.inverse_all(P)] == [near(row[1:3]) for row in W1_MODES]


def test_both_assembly_modes_of_the_worked_joints(robot):
    minus, plus = robot.direct_all(W1_MODES[0][1:3])
    assert minus == near(P)
    assert plus == near([-0.241760801, 0.609838412])


def test_gaps_and_conditioning_of_the_worked_posture(robot, at):
    assert at.gaps == near((0.888531203, 0.761468797))
    assert measures.inverse_condition_of_rods(at) == near(0.520205508)
    assert measures.inverse_condition_of_jacobian(at) == near(0.520174189)


def test_jacobian_of_the_worked_posture(robot, at):
    A, B = robot.jacobians(at.pose, at.joints)
    assert np.linalg.det(B) / np.linalg.det(A) == near(0.158958182)
    J = np.array([robot.velocity(at.pose, at.joints, rates) for rates in np.eye(2)]).T
    assert near(np.array([[-0.440201850, -0.286668360], [0.044413845, -0.332179743]])) == J


def test_constraint_margin_of_the_worked_posture(robot, at):
    assert at.constraint == near(0.197526998)
    assert at.parts[:2] == near((0.197526998, 1.027159255))  # sigma_y, sigma_xz
    assert robot.evaluate(at.joints).constraint_margin == at.constraint


def test_distal_legs_of_the_worked_posture(robot, at):
    one, two = measures.distal_legs(robot.mechanism, at)
    assert (one.theta, two.theta) == near((0.661537506, 1.752179881))
    assert (one.lam, two.lam) == near((0.877386871, 0.834522987))
    assert measures.rod_line_points_apart(robot.mechanism, at) == near((0.045584967, -0.021678996))


def test_distances_of_the_worked_posture(robot, at):
    pair = robot.mechanism
    assert min(at.reach) == near(0.352478386)
    assert robot.evaluate(at.joints).clearance == near(0.352478386)
    assert measures.distance_to_parallel_rods(pair, P, (1, -1)) == near(1.22922, 1e-5)  # dense scan of the circles
    assert measures.distance_to_parallel_rods(pair, P) == near(0.3390, 5e-5)
    assert measures.joint_distance_to_parallel_rods(pair, at.joints) == near(2.064734766)
    # |b0| + l1 < l2eq: the rods are never in line, only gap_col counts
    bounds = measures.type2_joint_bounds(pair, at)
    assert bounds.sum == near(0.761468797 / 0.375)
    assert (bounds.norm, bounds.largest) == near((bounds.sum / sqrt(2.0), bounds.sum / 2.0))


def test_rates_of_the_worked_posture(robot, at):
    rates = (2.0, -1.0)
    v = robot.velocity(at.pose, at.joints, rates)
    assert v == near([-0.593735340, 0.421007433])
    assert robot.acceleration(at.pose, at.joints, rates, (10.0, 5.0)) == near([-5.285017570, -1.043773175])
    assert measures.rod_rates(robot.mechanism, at, rates, v) == near((0.318636315, 0.637039277))
    assert measures.gap_rate(robot.mechanism, at, rates) == near(0.233036671)


def test_forces_of_the_worked_posture(robot, at):
    R = robot.reactions(at.pose, at.joints, (10.0, -20.0))
    assert near([-14.602841340, -10.512477193]) == R
    assert measures.rod_forces(robot.mechanism, R) == near((-8.053876070, -5.797925659))
    tau = robot.efforts(at.pose, at.joints, (10.0, -20.0))
    assert tau == near([5.290295404, -3.776911253])
    assert measures.leg_forces_from_efforts(at, tau, 0.05) == near(R)
    assert robot.reaction_max(at.pose, at.joints, hypot(10.0, 20.0)) == near([27.308234150] * 2)


def test_a_stretched_leg_does_not_tell_its_force(robot):
    """On the boundary |A_I P| = l1 + l2eq leg I is straight: its motor feels nothing, whatever it carries."""
    b0 = robot.mechanism.geometry.b0
    at = robot.posture(robot.inverse((-b0 + 1.2 * np.cos(1.0), -1.2 * np.sin(1.0))))
    first, second = measures.leg_forces_from_efforts(at, (1.0, 1.0), 0.05)
    assert isnan(first)
    assert not isnan(second)
    assert measures.inverse_condition_of_jacobian(at) == near(0.0, 1e-6)


def test_derived_lengths_of_the_default_robot(robot):
    g = robot.mechanism.geometry
    assert (g.b0, g.D, g.ell, g.Lc, g.l2) == near((0.014567765, 0.067722789, 0.063461538, 0.226923077, 0.910021222))


def test_coincident_elbows_leave_the_platform_on_a_circle_and_no_pose_is_returned(robot):
    """W2, and its mirror image: the circle centres are (0, +-0.374716933)."""
    q = (1.531939174925, 1.609653478665)
    found = sorted(coincident_elbows(robot.mechanism.loop))
    assert found == [near((-q[0], -q[1])), near(q)]
    for joints in found:
        with pytest.raises(irs.NotAssembled, match="not determined"):
            robot.direct(joints)
        assert robot.direct_all(joints) == []
        evs = robot.evaluate_many([joints])
        assert evs.status[0] == irs.Status.SINGULAR
        assert np.isnan([*evs.pose[0], evs.type2_margin[0], evs.constraint_margin[0]]).all()
        elbow = -robot.mechanism.geometry.b0 + 0.375 * np.cos(joints[0]), -0.375 * np.sin(joints[0])
        assert elbow == near((0.0, -np.sign(joints[0]) * 0.374716933))


def test_a_pose_out_of_reach_has_its_distance(robot):
    """W2: P = (0, -1.25) is 50.084885 mm outside, for both legs and in every mode."""
    for mode, *_ in W1_MODES:
        with pytest.raises(irs.Unreachable, match=r"unreachable by 50\.08 mm") as raised:
            robot.inverse((0.0, -1.25), mode)
        assert raised.value.reach_m == near(-0.050084885, 1e-9)
    assert robot.inverse_all((0.0, -1.25)) == []
    q, status, reach = robot.inverse_many([(0.0, -1.25), P])
    assert status.tolist() == [irs.Status.UNREACHABLE, irs.Status.SOLVED]
    assert reach == near([-0.050084885, 0.352478386])
    assert np.isnan(q[0]).all()


def test_case_1_posture_of_the_paper_is_reached_and_singular():
    """W3: reached at P = (.106562932, -.189123749), where Type 2 and the constraint fail together."""
    robot = irs.make_robot("irsbot2_csc")
    pose, q, psi2 = (0.106562932, -0.189123749), (1.959445438, 0.155916281), 2.402159212
    psi1 = -0.739433441
    mechanism = robot.mechanism
    assert robot.inverse(pose, (1, -1)) == near(q)
    at = mechanism.at(q, pose, -1, (0.0, 0.0))
    assert mechanism.rod_angles(at) == near((psi1, psi2))
    assert at.constraint == near(0.0)
    assert at.type2 == near(0.0)
    one, two = measures.distal_legs(mechanism, at)
    assert (one.theta, two.theta) == near((-0.465987623, 2.675605030))
    assert one.lam == near(0.299960564)
    assert np.cos(psi2) == near(-0.738850464)
    turned = held(robot, psi1 + 1e-3, psi2)
    assert turned.constraint == near(6.739e-4, 5e-8)


def design_of(robot):
    g = robot.mechanism.geometry
    return Design(g.l1, g.l2eq, g.b, g.p, g.a1, g.a2, g.beta, g.e)


def held(robot, psi1, psi2):
    """The posture with given rods; also where it is of Type 2, so it is not asked from the direct kinematics."""
    q1, q2, x, z = held_by_arms(design_of(robot), psi1, psi2)[0]
    return robot.mechanism.at((q1, q2), (x, z), -1, (0.0, 0.0))


CASES = [
    # l2eq, theta, lambda, psi, sin(psi_I - psi_II)
    (0.09, (-0.560759565, 2.580833089), (0.159950747, 0.019693562), (-1.238156960, 0.116637830), -0.9768),
    (0.30, (0.560759565, 0.560759565), (0.384471131, 0.204826822), (0.749915706, 0.371603424), 0.3694),
]


@pytest.mark.parametrize(("l2eq", "theta", "lam", "psi", "s12"), CASES, ids=["Case II", "Case III"])
def test_case_2_and_3_postures_are_singular_although_the_pressure_angle_is_good(l2eq, theta, lam, psi, s12):
    """W4. sin(psi_I - psi_II) of Case III is sin(0.749915706 - 0.371603424) = 0.3694."""
    robot = irs.make_robot("irsbot2", l1=0.2, l2eq=l2eq, b=0.1, p=0.01, a1=0.2, a2=0.05, beta=pi / 4)
    at = held(robot, *psi)
    legs = measures.distal_legs(robot.mechanism, at)
    assert tuple(leg.theta for leg in legs) == near(theta)
    assert tuple(leg.lam for leg in legs) == near(lam)
    assert at.det == near(s12, 5e-5)
    assert at.constraint == near(0.0)
    assert at.residual == near(0.0)


@pytest.mark.parametrize(("span", "holds"), [(0.104706350, False), (0.104706354, True)])
def test_the_arms_hold_case_2_and_3_postures_from_the_printed_length_on(span, holds):
    """W4: both reachable iff 2 l1 >= .104706352 when b = .1."""
    for l2eq, *_, psi, _ in CASES:
        design = Design(span / 2.0, l2eq, 0.1, 0.01, 0.2, 0.05, pi / 4)
        assert bool(held_by_arms(design, *psi)) is holds


SECTION_11 = [
    # beta in deg, b0, least cos alpha, least kappa over the rectangle
    (5, 0.0509, 0.721, 0.082),
    (10, 0.0146, 0.675, 0.161),
    (15, -0.0212, 0.625, 0.236),
    (20, -0.0561, 0.570, 0.304),
    (30, -0.1225, 0.453, 0.411),
    (45, -0.2095, 0.272, 0.479),
]


@pytest.mark.parametrize(("degrees", "b0", "cosine", "kappa"), SECTION_11)
def test_least_margins_over_the_pick_and_place_rectangle(degrees, b0, cosine, kappa):
    """|x| <= .35, -.95 <= z <= -.75, mode (+,-): to the three printed decimals."""
    robot = irs.make_robot("irsbot2", beta=np.deg2rad(degrees))
    x, z = np.meshgrid(np.linspace(-0.35, 0.35, 141), np.linspace(-0.95, -0.75, 81))
    q, status, _ = robot.inverse_many(np.stack([x.ravel(), z.ravel()], axis=1), (1, -1))
    evs = robot.evaluate_many(q)
    assert (status == irs.Status.SOLVED).all()
    assert robot.mechanism.geometry.b0 == near(b0, 5e-5)
    assert evs.type2_margin.min() == near(cosine, 6e-4)
    assert evs.constraint_margin.min() == near(kappa, 6e-4)


def test_the_half_plane_below_the_default_robot_is_free_of_parallel_singularities(robot):
    """Mode (+,-), z < 0: worst at the boundary, cos alpha .026 and kappa .032."""
    x, z = np.meshgrid(np.linspace(-1.22, 1.22, 600), np.linspace(-1.21, -1e-6, 300))
    q, status, reach = robot.inverse_many(np.stack([x.ravel(), z.ravel()], axis=1), (1, -1))
    evs = robot.evaluate_many(q[(status == irs.Status.SOLVED) & (reach > 0.0)])
    assert (evs.status == irs.Status.SOLVED).all()
    assert evs.type2_margin.min() > 0.026
    assert evs.constraint_margin.min() > 0.032


def test_a_strict_design_has_good_margins_in_every_mode():
    """Sheet section 9: cos alpha >= .236 and kappa >= .21 wherever the robot can be assembled."""
    robot = irs.make_robot("irsbot2_strict")
    turn = np.linspace(-pi, pi, 360, endpoint=False)
    q = np.stack([angle.ravel() for angle in np.meshgrid(turn, turn)], axis=1)
    for assembly in (-1, 1):
        evs = robot.evaluate_many(q, assembly)
        assert (evs.status == irs.Status.SOLVED).all()
        assert np.nanmin(evs.type2_margin) == near(0.236, 2e-3)
        assert np.nanmin(evs.constraint_margin) == near(0.21, 6e-3)


def test_parallel_rods_are_infinitely_far_where_the_cranks_cannot_meet():
    robot = irs.make_robot("irsbot2_strict")  # |b0| = .295 > l1 = .2
    at = robot.posture((0.3, 2.0))
    assert measures.joint_distance_to_parallel_rods(robot.mechanism, at.joints) == inf
    assert measures.distance_to_parallel_rods(robot.mechanism, at.pose) == inf
    assert measures.type2_joint_bounds(robot.mechanism, at).sum == inf


@pytest.mark.parametrize("preset", ["irsbot2", "irsbot2_beta45", "irsbot2_csc", "irsbot2_strict"])
def test_clearance_is_never_larger_than_the_distance_to_a_constraint_singularity_of_the_same_mode(preset):
    robot, rng = irs.make_robot(preset), np.random.default_rng(3)
    points = constraint_points(design_of(robot))
    assert bool(points) is (preset != "irsbot2_strict")
    for point in points:
        for distance in 10.0 ** rng.uniform(-4.0, -1.0, 60):
            way = rng.uniform(-pi, pi)
            pose = point.x + distance * np.cos(way), point.z + distance * np.sin(way)
            try:
                at = at_pose(robot, pose, point.working_mode)
            except irs.KinematicsError:
                continue
            assert robot.mechanism.clearance(at) <= distance + 1e-9


@pytest.mark.parametrize("preset", ["irsbot2", "irsbot2_beta45", "irsbot2_csc", "irsbot2_strict"])
def test_clearance_is_never_larger_than_the_distance_to_a_type_2_locus_of_the_same_mode(preset):
    """Points of both curves; in `csc` the rods come in line too, where the bound is far from exact."""
    robot, rng = irs.make_robot(preset), np.random.default_rng(8)
    places: dict[tuple[int, ...], list[tuple[float, float]]] = {mode: [] for mode in robot.mechanism.working_modes}
    for curve in (parallel_rods(design_of(robot), 1500), rods_in_line(design_of(robot), 3000)):
        legs = robot.mechanism.legs(ARRAYS, tuple(curve.q.T), (curve.x, curve.z))
        for signs, place in zip(
            np.sign(np.array(legs.normalised_levers).T), zip(curve.x, curve.z, strict=True), strict=True
        ):
            places.get(tuple(signs.astype(int)), []).append(place)
    compared, tight = 0, inf
    for q in rng.uniform(-pi, pi, (600, 2)).tolist():
        at = robot.mechanism.posture(tuple(q), int(rng.choice((-1, 1))))
        if at.status == irs.Status.SOLVED and places.get(at.working_mode):
            distance = np.hypot(*(np.array(places[at.working_mode]) - at.pose).T).min()
            assert robot.mechanism.clearance(at) <= distance + 1e-9
            compared += 1
            tight = min(tight, distance / robot.mechanism.clearance(at))
    assert compared > 100 or preset == "irsbot2_strict"
    assert tight < 1.01 or preset == "irsbot2_strict"


def test_clearance_knows_constraint_singularities_that_fill_a_circle():
    """Elbow frames as far apart as the motors (b = s2g): the arms hold the upright legs of C1a at every q_I = q_II."""
    default = irs.make_robot("irsbot2").mechanism.geometry
    robot = irs.make_robot("irsbot2", b=default.p + default.a2 * np.sin(default.beta))
    d, rng = design_of(robot), np.random.default_rng(4)
    upright = [(psi1, psi2) for kind, psi1, psi2 in distal_postures(d) if kind == "C1a"]
    asked = 0
    for psi1, psi2 in upright:
        for q in rng.uniform(-pi, pi, 100):
            mode = (int(np.sign(np.sin(q - psi1))), int(np.sign(np.sin(q - psi2))))
            distance = 10.0 ** rng.uniform(-4.0, -1.5)
            away = d.l1 + distance
            x, z = -d.b0 + away * np.cos(q) + d.l2eq * np.cos(psi1), -d.e - away * np.sin(q) - d.l2eq * np.sin(psi1)
            try:
                at = at_pose(robot, (x, z), mode)
            except irs.KinematicsError:
                continue
            asked += 1
            assert robot.mechanism.clearance(at) <= distance + 1e-9
    assert asked > 100


def test_clearance_knows_parallel_rods_where_the_cranks_just_reach_each_other():
    """Half base = crank: the elbows meet only at the origin, with q = (0, pi), and P runs on a circle around them."""
    robot, rng = irs.make_robot("five_bar", b=0.375, l1=0.375), np.random.default_rng(5)
    assert {tuple(np.abs(np.round(q, 12))) for q in coincident_elbows(robot.mechanism.loop)} == {(0.0, round(pi, 12))}
    asked = 0
    for psi in rng.uniform(-pi, pi, 200):
        distance = 10.0 ** rng.uniform(-4.0, -2.0)
        pose = (0.825 + distance) * np.cos(psi), -(0.825 + distance) * np.sin(psi)
        mode = int(np.sign(np.sin(-psi))), int(np.sign(np.sin(pi - psi)))
        try:
            at = at_pose(robot, pose, mode)
        except irs.KinematicsError:
            continue
        asked += 1
        assert robot.mechanism.clearance(at) <= distance + 1e-9
    assert asked > 50
