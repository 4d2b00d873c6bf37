"""Loads of any direction: the force workspace of [S2], instantaneous centres, and its corrected cases."""

from __future__ import annotations

import numpy as np
import pytest

import irsbot_kinematics as irs
from irsbot_kinematics import BadInput
from irsbot_kinematics.analysis import force_workspace as forces
from irsbot_kinematics.analysis.force_workspace import Load
from irsbot_kinematics.numerics.arithmetic import FLOATS

RRR3 = irs.make_robot("rrr3").mechanism
MODE = (1, 1, 1)
TURNED = {"15 deg": np.deg2rad(15), "45 deg": np.deg2rad(45), "acos(rp/rb)": np.arccos(0.1 / 0.35)}
TABLE = [  # phi, R_adm, area, radii at 0, 15, 30, 47, 60, 90 deg (sheet, f = 100 N, m = 5 N m)
    ("15 deg", 200, 0.06502, (0.116279, 0.113930, 0.118655, 0.133023, 0.152500, 0.162387)),
    ("15 deg", 130, 0.007355, (0.038287, 0.038568, 0.041542, 0.049299, 0.060131, 0.047193)),
    ("45 deg", 200, 0.16875, (0.205773, 0.204717, 0.212430, 0.231521, 0.253496, 0.241765)),
    ("45 deg", 130, 0.1116, (0.151438, 0.154169, 0.166416, 0.194234, 0.228289, 0.180276)),
    ("acos(rp/rb)", 200, 0.24606, (0.255410, 0.251612, 0.257492, 0.276536, 0.300941, 0.294092)),
    ("acos(rp/rb)", 130, 0.18178, (0.208751, 0.206469, 0.210415, 0.230284, 0.263289, 0.253124)),
]


@pytest.mark.parametrize(("turn", "limit", "area", "radii"), TABLE, ids=[f"{row[0]}, {row[1]} N" for row in TABLE])
def test_the_force_workspace_has_the_radii_and_the_area_of_the_table(turn, limit, area, radii):
    load = Load(100.0, 5.0, limit)
    found = forces.force_workspace(RRR3, (0.0, 0.0, TURNED[turn]), MODE, load, rays=360, step_m=2e-3)
    np.testing.assert_allclose(found.radius_m[[0, 15, 30, 47, 60, 90]], radii, rtol=0, atol=6e-7)
    assert found.area_m2 == pytest.approx(area, rel=2e-3)  # the spikes at the base corners limit the area to that
    thirds = found.radius_m.reshape(3, 120)
    np.testing.assert_allclose(thirds[0], thirds[1], atol=1e-7)
    circle = np.sqrt(0.35**2 + 0.1**2 - 2 * 0.35 * 0.1 * np.cos(TURNED[turn]))
    assert found.radius_m.max() < circle, "inside the circle of Type 2"


@pytest.mark.parametrize(("turn", "newton"), list(zip(TURNED, (113.5326, 86.0684, 83.3333), strict=True)))
def test_the_reaction_at_the_centre_is_the_printed_one_in_all_legs(turn, newton):
    sizes = forces.reaction_max_many(RRR3, [(0.0, 0.0, TURNED[turn])], MODE, Load(100.0, 5.0, 1.0))
    np.testing.assert_allclose(sizes, [[newton] * 3], rtol=0, atol=5e-5)


def test_the_map_is_the_reaction_at_every_pose_of_its_grid_and_carries_what_the_scan_encloses():
    load, centre, robot = Load(100.0, 5.0, 200.0), (0.0, 0.0, TURNED["45 deg"]), irs.make_robot("rrr3")
    first, second = np.linspace(-0.24, 0.24, 13), np.linspace(-0.2, 0.22, 11)
    sizes = forces.reaction_map(RRR3, centre, MODE, load, first_m=first, second_m=second)
    assert sizes.shape == (11, 13, 3)
    scan = forces.force_workspace(RRR3, centre, MODE, load, rays=720, step_m=2e-3)
    enclosed = 0
    for j, y in enumerate(second):
        for i, x in enumerate(first):
            pose = (x, y, centre[2])
            np.testing.assert_allclose(
                sizes[j, i], robot.reaction_max(pose, robot.inverse(pose), 100.0, 5.0), rtol=1e-9
            )
            nearest = np.argmin(np.abs(np.angle(np.exp(1j * (scan.angle_rad - np.arctan2(y, x))))))
            if np.hypot(x, y) < scan.radius_m[nearest] - 5e-3:
                enclosed += 1
                assert sizes[j, i].max() <= 200.0
    assert 20 < enclosed < 120


def test_the_five_bar_carries_the_printed_load():
    """psi = 1 and 2, f = 80 N: R_max = f/|sin(psi_1 - psi_2)| = 95.07160846 N; a moment does not matter."""
    legs = irs.mechanism.Legs(tuple((np.cos(p), -np.sin(p)) for p in (1.0, 2.0)), (), (), (), ())
    for leg in forces.pressure(legs):
        assert leg.reaction_max(80.0, 3.0) == pytest.approx(95.07160846, rel=1e-10)
        assert leg.distance_m == np.inf
        assert leg.gamma == pytest.approx(1.0)


def random_legs(rng, name):
    robot = irs.make_robot(name)
    while True:
        lower = [max(j.lower, -3.0) for j in robot.mechanism.joints]
        upper = [min(j.upper, 3.0) for j in robot.mechanism.joints]
        at = robot.mechanism.posture(tuple(rng.uniform(lower, upper)), robot.mechanism.usual_assembly_mode)
        if at.status == 0 and at.type2 > 0.02:
            return robot, at


@pytest.mark.parametrize("name", ["rrr3", "five_bar", "orthoglide", "irsbot2"])
def test_equation_8_with_pressure_angle_and_centre_gives_the_same_as_cofactors(name):
    rng = np.random.default_rng(1)
    for _ in range(30):
        robot, at = random_legs(rng, name)
        legs = robot.mechanism.legs(FLOATS, at.joints, at.pose)
        f, m = rng.uniform(0, 100), rng.uniform(-10, 10)
        sizes = [leg.reaction_max(f, m) for leg in forces.pressure(legs)]
        np.testing.assert_allclose(sizes, robot.reaction_max(at.pose, at.joints, f, m), rtol=1e-9)


def test_the_instantaneous_centre_is_where_the_lines_of_the_other_legs_meet():
    rng = np.random.default_rng(2)
    for _ in range(30):
        robot, at = random_legs(rng, "rrr3")
        legs = robot.mechanism.legs(FLOATS, at.joints, at.pose)
        for i, leg in enumerate(forces.pressure(legs)):
            (a, ra), (b, rb) = (
                (np.array(legs.attachments[j]), np.array(legs.screws[j][:2])) for j in range(3) if j != i
            )
            s, _ = np.linalg.solve(np.stack([ra, -rb], axis=1), b - a)
            meeting = a + s * ra
            scale = 1 + np.linalg.norm(meeting)
            np.testing.assert_allclose(leg.centre_m, meeting, atol=1e-9 * scale**2)
            arm, r = np.array(legs.attachments[i]), np.array(legs.screws[i][:2])
            assert leg.distance_m == pytest.approx(np.linalg.norm(meeting - arm), rel=1e-8)
            assert leg.gamma == pytest.approx(np.linalg.norm(meeting) / leg.distance_m, rel=1e-8)
            lever = abs((meeting - arm)[0] * r[1] - (meeting - arm)[1] * r[0])  # simplest geometry of the sheet
            assert leg.reaction_max(100.0, 5.0) == pytest.approx((100 * np.linalg.norm(meeting) + 5) / lever, rel=1e-7)


def leg(cosine, d, beta_cosine, b):
    """A leg of [S2] by its pressure angle, d, beta and b; gamma from (8)."""
    gamma = np.sqrt(1 + (b / d) ** 2 - 2 * (b / d) * beta_cosine)
    return forces.LegPressure(float(np.arccos(cosine)), (np.nan, np.nan), d, float(gamma))


def test_poses_that_table_1_as_printed_accepts_are_refused():
    assert leg(0.5, 0.2, 0.2, 0.1).reaction_max(100.0, 5.0) == pytest.approx(254.94, abs=5e-3)  # u = 0
    assert leg(0.12, 0.08, 0.99997, 0.1).reaction_max(100.0, 0.6) == pytest.approx(270.96, abs=5e-3)  # u < 0
    pose, load = (-0.214, -0.05, np.deg2rad(15)), Load(100.0, 5.0, 200.0)
    assert not forces.admissible(RRR3, [pose], MODE, load)[0]


def corrected_table_1(cosine, d, beta_cosine, b, f, m, limit):
    """The sheet's corrected Table 1, for u != 0."""
    u = (limit * cosine) ** 2 - f * f
    v = -2 * (m * limit * cosine - beta_cosine * b * f * f)
    w = m * m - f * f * b * b
    root = np.sqrt(v * v - 4 * u * w) if v * v >= 4 * u * w else np.nan
    d1, d2 = (-v + root) / (2 * u), (-v - root) / (2 * u)
    dmin = m / (limit * cosine)
    if u > 0:
        return d >= d1
    least = (m * beta_cosine + np.sqrt(max(1 - beta_cosine**2, 0)) * np.sqrt(max(-w, 0))) / (limit * b)
    if w > 0 or beta_cosine <= 0 or cosine < least:
        return False
    return max(dmin, d1) <= d <= d2


def test_the_direct_test_is_the_corrected_table_1():
    rng, accepted = np.random.default_rng(3), 0
    for _ in range(20_000):
        cosine, d, b = rng.uniform(0.01, 1), 10 ** rng.uniform(-2, 1), 10 ** rng.uniform(-2, 0)
        beta_cosine, f, limit = rng.uniform(-1, 1), rng.uniform(1, 300), 200.0
        m = rng.uniform(0, 2) * f * b
        size = leg(cosine, d, beta_cosine, b).reaction_max(f, m)
        if abs(size / limit - 1) > 1e-9 and abs((limit * cosine / f) ** 2 - 1) > 1e-6:
            assert (size <= limit) == corrected_table_1(cosine, d, beta_cosine, b, f, m, limit)
            accepted += size <= limit
    assert 1000 < accepted < 19_000


def test_a_load_is_not_carried_out_of_reach_and_at_type_2():
    load = Load(100.0, 5.0, 1e9)
    poses = [(2.0, 0.0, 0.5), (0.1, 0.0, 0.0), (0.1, 0.0, 0.5), (np.nan, 0.0, 0.5)]
    assert forces.admissible(RRR3, poses, MODE, load).tolist() == [False, False, True, False]
    assert (forces.force_workspace(RRR3, (0.0, 0.0, 0.0), MODE, load, rays=8).radius_m == 0.0).all()
    with pytest.raises(BadInput, match="Type 2"):
        forces.pressure(irs.mechanism.Legs(((1.0, 0.0), (1.0, 0.0)), (), (), (), ()))


def test_the_force_workspace_of_a_robot_that_cannot_turn_is_a_cone_of_pressure_angles():
    """IRSBot-2: f/cos alpha <= R_adm is cos alpha >= f/R_adm, whatever the moment."""
    robot = irs.make_robot("irsbot2")
    found = forces.force_workspace(robot.mechanism, (0.0, -0.8), (1, -1), Load(10.0, 99.0, 14.0), rays=24)
    for angle, radius in zip(found.angle_rad, found.radius_m, strict=True):
        inside = np.array([0.0, -0.8]) + (radius - 1e-6) * np.array([np.cos(angle), np.sin(angle)])
        outside = np.array([0.0, -0.8]) + (radius + 1e-6) * np.array([np.cos(angle), np.sin(angle)])
        assert np.cos(robot.evaluate(robot.inverse(inside)).pressure_angle[0]) >= 10 / 14
        q, status, _ = robot.inverse_many([outside])
        assert status[0] != 0 or np.cos(robot.evaluate(q[0]).pressure_angle[0]) < 10 / 14


@pytest.mark.parametrize("bad", [(-1.0, 0.0, 1.0), (1.0, float("nan"), 1.0), (1.0, 0.0, float("inf"))])
def test_nonsense_loads_are_refused(bad):
    with pytest.raises(BadInput):
        Load(*bad)
    with pytest.raises(BadInput, match="step_m"):
        forces.force_workspace(RRR3, (0.0, 0.0, 0.5), MODE, Load(1.0, 1.0, 1.0), step_m=float("nan"))
