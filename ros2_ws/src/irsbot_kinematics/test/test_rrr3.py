"""The 3-RRR of [S2]: printed numbers, all assembly modes, the exact locus of Type 2, and bounds that turns respect."""

from __future__ import annotations

import numpy as np
import pytest
from postures import apart, random_joints

import irsbot_kinematics as irs
from irsbot_kinematics import Status
from irsbot_kinematics.branches import tells_apart
from irsbot_kinematics.mechanism import Mechanism
from irsbot_kinematics.numerics.arithmetic import FLOATS
from irsbot_kinematics.requests import solve_direct

ROBOT = irs.make_robot("rrr3")
RB, RP, LINK = 0.35, 0.10, 0.40
CORNERS = np.array([[np.cos(a), np.sin(a)] for a in np.deg2rad([210.0, 330.0, 90.0])])
PRINTED = 6e-10
"""m or rad: half a unit of the tenth digit printed in the sheet, and of the tenth digit of what it belongs to."""


def rotation(phi):
    return np.array([[np.cos(phi), -np.sin(phi)], [np.sin(phi), np.cos(phi)]])


def spokes(x, rp=RP):
    """A_iB_i (3, 2), from the drawing."""
    return x[:2] + rp * CORNERS @ rotation(x[2]).T - RB * CORNERS


def test_the_printed_pose_has_the_printed_elbows():
    q = ROBOT.inverse((0.1774130022, -0.05623158666, 1.480988142), (-1, -1, -1))
    np.testing.assert_allclose(q, (-1.715527384, -2.605716775, -2.080474774), rtol=0, atol=PRINTED)
    assert len(ROBOT.inverse_all((0.1774130022, -0.05623158666, 1.480988142))) == 8


def test_the_printed_elbows_have_the_four_printed_poses():
    """Two pairs of poses lie near the circle of Type 2, where the tenth digit of the elbows moves a pose fifty times as
    much. So the poses are asked for their elbows as well, which loses nothing."""
    elbows = (2.452984431, 1.640177996, 2.437247862)
    found = sorted(map(tuple, ROBOT.direct_all(elbows)), key=lambda x: x[2])
    printed = [
        (-0.2569054808, 0.0763744436, -0.658290239),
        (-0.2632825908, 0.0883715010, -0.5223190698),
        (-0.2127136979, 0.1785500701, 0.5223190698),
        (-0.1991515702, 0.1793659214, 0.658290239),
    ]
    np.testing.assert_allclose(found, printed, rtol=0, atol=50 * PRINTED)
    for x in printed:
        np.testing.assert_allclose(ROBOT.inverse(x, (1, 1, 1)), elbows, rtol=0, atol=PRINTED)


@pytest.mark.parametrize(
    ("x", "printed", "digits"),
    [
        ((0.1, 0.05, np.pi / 4), (95.44046757, 89.49204356, 101.7484569), 5e-8),
        ((-0.214, -0.05, np.deg2rad(15)), (311.1670, 142.4244, 231.6942), 5e-5),
    ],
)
def test_the_printed_largest_reactions(x, printed, digits):
    """The second pose is one that Table 1 as printed in [S2] accepts for 200 N."""
    q = ROBOT.inverse(x)
    np.testing.assert_allclose(ROBOT.reaction_max(x, q, 100.0, 5.0), printed, rtol=0, atol=digits)


@pytest.mark.parametrize(
    ("degrees", "radius"), [(15.0, 0.254726), (45.0, 0.288102), (np.rad2deg(np.arccos(RP / RB)), 0.335410)]
)
def test_the_circle_of_type_2_has_the_radii_of_the_force_workspace_table(degrees, radius):
    """Found by bisection of the sign of det A along rays, not by the formula of the circle."""
    phi = np.deg2rad(degrees)
    assert degrees == pytest.approx(73.398, abs=5e-4) or degrees in (15.0, 45.0)

    def det(away, turn):
        x = (away * np.cos(turn), away * np.sin(turn), phi)
        A, _ = ROBOT.jacobians(x, ROBOT.inverse(x))
        return np.linalg.det(A)

    for turn in (0.1, 1.3, 2.9, 4.4):
        low, high = radius - 0.05, radius + 0.05
        assert det(low, turn) * det(high, turn) < 0.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if det(low, turn) * det(middle, turn) > 0.0 else (low, middle)
        assert low == pytest.approx(radius, abs=6e-7)


def test_the_determinant_is_the_exact_product_and_its_sign_is_the_sign_of_the_label():
    """det A = (3 sqrt 3/2) rb rp sin(phi) (K - |p|^2)/(rho_1 rho_2 rho_3), K = rb^2 + rp^2 - 2 rb rp cos phi."""
    rng, seen = np.random.default_rng(1), set()
    for q in random_joints(ROBOT, rng, 400):
        for assembly in ROBOT.mechanism.assembly_modes:
            at = ROBOT.mechanism.posture(tuple(q), assembly)
            if at.status != Status.SOLVED:
                continue
            x = np.array(at.pose)
            K = RB**2 + RP**2 - 2 * RB * RP * np.cos(x[2])
            rho = np.linalg.norm(spokes(x), axis=1)
            exact = 1.5 * np.sqrt(3) * RB * RP * np.sin(x[2]) * (K - x[:2] @ x[:2]) / rho.prod()
            assert at.det == pytest.approx(exact, abs=1e-12 / rho.min())
            assert np.sign(assembly) == np.sign(exact)
            assert abs(assembly) == (1 if x[:2] @ x[:2] < K else 2)
            seen.add(assembly)
    assert seen == {1, -1, 2, -2}


def poses_by_scan(rho, steps=20_000):
    """All poses of three distances: for every phi two distances differences fix p, the third is a residual."""
    phi = np.linspace(-np.pi, np.pi, steps)
    c, s = np.cos(phi), np.sin(phi)
    k = np.stack([np.stack([RP * (c * x - s * y) - RB * x, RP * (s * x + c * y) - RB * y], -1) for x, y in CORNERS])
    D = k[1:] - k[0]
    h = 0.5 * (rho[1:, None] ** 2 - rho[0] ** 2 - np.sum(k[1:] ** 2, -1) + np.sum(k[0] ** 2, -1))
    det = D[0, :, 0] * D[1, :, 1] - D[0, :, 1] * D[1, :, 0]
    p = np.stack([h[0] * D[1, :, 1] - h[1] * D[0, :, 1], h[1] * D[0, :, 0] - h[0] * D[1, :, 0]], -1) / det[:, None]
    residual = np.sum((p + k[0]) ** 2, -1) - rho[0] ** 2
    crossing = np.flatnonzero(np.diff(np.sign(residual)) != 0)
    share = residual[crossing] / (residual[crossing] - residual[crossing + 1])
    return phi[crossing] + share * (phi[1] - phi[0])


def test_no_pose_is_missed_and_none_is_invented():
    rng, counts = np.random.default_rng(2), []
    for q in random_joints(ROBOT, rng, 60):
        rho = 2 * LINK * np.abs(np.cos(0.5 * q))
        poses = ROBOT.direct_all(q)
        for x in poses:
            np.testing.assert_allclose(np.linalg.norm(spokes(x), axis=1), rho, atol=1e-9)
        turns = [x[2] for x in poses]
        near_type2 = any(ROBOT.mechanism.posture(tuple(q), mode).gaps[0] < 1e-5 for mode in (1, -1, 2, -2) if poses)
        if not near_type2:
            np.testing.assert_allclose(sorted(turns), sorted(poses_by_scan(rho)), atol=1e-3)
        counts.append(len(turns))
    assert {0, 2} <= set(counts), "the fixture sees elbows with and without poses"


def test_four_poses_exist_where_the_scan_finds_four():
    rho = 2 * LINK * np.abs(np.cos(0.5 * np.array([2.452984431, 1.640177996, 2.437247862])))
    assert len(poses_by_scan(rho)) == 4


@pytest.mark.parametrize("lengths", [{}, {"rb": 0.2, "rp": 0.2, "l": 0.5}, {"rb": 0.1, "rp": 0.3, "l": 0.25}])
def test_the_posture_in_one_piece_is_the_posture_of_the_shared_equations_and_of_the_batch(lengths):
    robot, rng = irs.make_robot("rrr3", **lengths), np.random.default_rng(3)
    Q, solved = random_joints(robot, rng, 200), 0
    for assembly in robot.mechanism.assembly_modes:
        evs = robot.evaluate_many(Q, assembly)
        for i, q in enumerate(Q.tolist()):
            at, plain = robot.mechanism.posture(tuple(q), assembly), Mechanism.posture(robot.mechanism, q, assembly)
            assert at.status == plain.status == evs.status[i]
            if at.status != Status.SOLVED or at.type2 < 1e-3 or min(at.gaps) < 1e-3:
                continue
            solved += 1
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
                "attachments",
            ):
                np.testing.assert_allclose(getattr(at, field), getattr(plain, field), atol=1e-10, err_msg=field)
            np.testing.assert_allclose(at.pose, evs.pose[i], atol=1e-10)
            assert at.type2 == pytest.approx(evs.type2_margin[i], abs=1e-10)
            assert max(at.residual, plain.residual) < 1e-12
    assert solved > 50


def test_a_folded_leg_leaves_the_platform_undetermined():
    x = np.array([*(RB - RP) * CORNERS[1], 0.0])  # B_2 on A_2 ...
    x = np.array([*(RB * CORNERS[1] - RP * rotation(0.7) @ CORNERS[1]), 0.7])  # ... and turned by 0.7 rad about it
    q = ROBOT.inverse(x)
    assert q[1] == pytest.approx(np.pi)
    at = ROBOT.mechanism.posture((q[0], np.pi, q[2]), 1)
    assert at.status == Status.SINGULAR
    with pytest.raises(irs.NotAssembled):
        ROBOT.direct((q[0], np.pi, q[2]), 1)
    assert ROBOT.mechanism.posture((np.nan, 1.0, 1.0), 1).status == Status.INVALID
    assert ROBOT.mechanism.posture((0.1, 0.1, 3.0), 1).status == Status.UNREACHABLE


def test_the_limb_margin_is_the_length_of_a_leg_over_that_of_the_stretched_leg():
    """Measured on the drawing; the only number that tells of a leg about to be folded."""
    rng = np.random.default_rng(6)
    for q in random_joints(ROBOT, rng, 40):
        for at in (ROBOT.mechanism.posture(tuple(q), mode) for mode in (1, -1, 2, -2)):
            if at.status == Status.SOLVED:
                lengths = np.linalg.norm(spokes(np.array(at.pose)), axis=1)
                np.testing.assert_allclose(at.limb, lengths / (2 * LINK), atol=1e-9)
    turn = 0.7
    for away in (1e-2, 1e-4, 1e-6):
        x = (*(RB * CORNERS[1] - RP * rotation(turn) @ CORNERS[1] + [away, 0.0]), turn)  # B_2 beside A_2
        at = ROBOT.posture(ROBOT.inverse(x), 1)
        assert at.limb[1] == pytest.approx(away / (2 * LINK), rel=1e-6)
        assert min(at.type1) > 0.3


def test_elbow_angles_a_whole_turn_apart_are_the_same_robot():
    q = ROBOT.inverse((0.1, 0.05, 0.9))
    here, there = ROBOT.posture(q, 1), ROBOT.posture(q + 2 * np.pi * np.array([1, -1, 2]), 1)
    np.testing.assert_allclose(here.pose, there.pose, atol=1e-12)
    np.testing.assert_allclose(here.normalised_levers, there.normalised_levers, atol=1e-12)
    np.testing.assert_allclose(here.levers, there.levers, atol=1e-12)


def test_the_guarantee_with_slack_holds_on_machines_whose_legs_are_that_wrong():
    """Base corners off by part of the slack, links by the rest; poses by Newton steps from the posture."""
    rng, number, promised = np.random.default_rng(4), 40, 0
    for q in random_joints(ROBOT, rng, 180):
        for assembly in ROBOT.mechanism.assembly_modes:
            at = ROBOT.mechanism.posture(tuple(q), assembly)
            if at.status != Status.SOLVED:
                continue
            slack, travel = 10.0 ** rng.uniform(-5, -2.5), 10.0 ** rng.uniform(-5, -2, 3)
            bound = ROBOT.mechanism.certified_bounds(at, travel.tolist(), slack)
            if not bound.type2 > 0.0:
                continue
            promised += 1
            part = rng.uniform(0, 1, (number, 3, 1))
            way = rng.normal(size=(number, 3, 2))
            off = slack * part * way / np.linalg.norm(way, axis=2, keepdims=True)
            longer = slack * (1 - part) * np.sign(rng.uniform(-1, 1, (number, 3, 2)))
            signs = np.sign(rng.uniform(-1, 1, (number, 3)))
            x = np.tile(np.array(at.pose), (number, 1))
            for share in (0.25, 0.5, 0.75, 1.0):
                first, second = np.moveaxis(LINK + share * longer, 2, 0)
                elbows = np.cos(q + share * travel * signs)
                want = np.sqrt(first**2 + second**2 + 2 * first * second * elbows)
                for _ in range(5):
                    c, s = np.cos(x[:, 2]), np.sin(x[:, 2])
                    arm = RP * np.einsum("ijn,kj->nki", np.array([[c, -s], [s, c]]), CORNERS)
                    d = x[:, None, :2] + arm - RB * CORNERS - share * off
                    rho = np.linalg.norm(d, axis=2)
                    r = d / rho[..., None]
                    A = np.concatenate([r, (arm[..., 0] * r[..., 1] - arm[..., 1] * r[..., 0])[..., None]], axis=2)
                    x = x - np.linalg.solve(A, (rho - want)[..., None])[..., 0]
            inverse = np.linalg.inv(A)  # columns: twists at P with one leg yielding
            held_x = inverse[:, 0] - inverse[:, 2] * arm[..., 1]
            held_y = inverse[:, 1] + inverse[:, 2] * arm[..., 0]
            assert (1 / np.hypot(held_x, held_y) >= bound.type2 - 1e-9).all()
            levers = first * second * np.abs(np.sin(q + travel * signs)) / rho
            assert (levers / np.minimum(first, second) >= np.array(bound.type1) - 1e-9).all()
            assert (rho / (first + second) >= np.array(bound.limb) - 1e-9).all()
    assert promised > 50


def test_no_move_with_turn_within_the_clearance_meets_a_singularity():
    """|d| + rp |t| below the clearance: straight in (d, t), the sign of det A stays and no leg gets out of reach."""
    rng, useful = np.random.default_rng(5), 0
    for q in random_joints(ROBOT, rng, 60):
        for assembly in ROBOT.mechanism.assembly_modes:
            at = ROBOT.mechanism.posture(tuple(q), assembly)
            if at.status != Status.SOLVED:
                continue
            clearance = ROBOT.mechanism.clearance(at)
            useful += clearance > 1e-3
            for _ in range(20):
                turn = rng.uniform(-1, 1)
                way = rng.normal(size=2)
                way *= (1 - abs(turn)) / np.linalg.norm(way)
                for share in np.linspace(0, 1, 12):
                    x = np.array(at.pose) + clearance * share * np.array([*way, turn / RP])
                    legs = ROBOT.mechanism.legs(FLOATS, at.joints, x.tolist())
                    assert min(legs.reach) >= -1e-12
                    assert np.linalg.det(legs.screws) * at.det > -1e-15
    assert useful > 25


def test_a_pose_that_is_seen_a_turn_away_is_the_same_pose():
    """Of the four printed poses each is found again from a look at it, whatever turn the angle is given in."""
    elbows = (2.452984431, 1.640177996, 2.437247862)
    for label in ROBOT.mechanism.assembly_modes:
        x, y, phi = ROBOT.direct(elbows, label)
        for turns in (-3, -1, 0, 1, 2):
            seen = (x + 0.001, y - 0.001, phi + 0.01 + 2 * np.pi * turns)
            assert solve_direct(ROBOT, elbows, 0, seen).assembly_mode == [label]
            assert tells_apart(ROBOT.mechanism, elbows, seen)
    assert not tells_apart(ROBOT.mechanism, elbows, (9.0, 9.0, 9.0))
    assert not tells_apart(ROBOT.mechanism, elbows, (np.nan, 0.0, 0.0))
    assert not tells_apart(ROBOT.mechanism, (0.1, 0.1, 3.0), (0.0, 0.0, 0.0)), "out of reach"


def test_wrong_lengths_are_refused_with_both_values():
    with pytest.raises(irs.InvalidGeometry, match=r"rp > 0, got 0"):
        irs.make_robot("rrr3", rp=0.0)
    with pytest.raises(irs.InvalidGeometry, match=r"\|rb - rp\| <= 2 l .*, got 0.9 against 0.8"):
        irs.make_robot("rrr3", rb=1.0)


def test_poses_of_many_joints_are_those_of_each():
    rng = np.random.default_rng(6)
    Q = random_joints(ROBOT, rng, 200)
    for assembly in ROBOT.mechanism.assembly_modes:
        evs = ROBOT.evaluate_many(Q, assembly)
        back, status, _ = ROBOT.inverse_many(np.nan_to_num(evs.pose), (1, 1, 1))
        good = (evs.status == Status.SOLVED) & (status == Status.SOLVED) & (evs.type2_margin > 1e-3)
        np.testing.assert_allclose(np.abs(Q[good]), back[good], atol=1e-6)
        assert apart(ROBOT, evs.pose[good], evs.pose[good]).max(initial=0.0) == 0.0
