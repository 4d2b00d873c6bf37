"""The elastostatics against the numbers of the paper and of its verified sheet, and against laws of mechanics."""

from __future__ import annotations

from dataclasses import replace
from math import cos, radians

import numpy as np
import pytest

import irsbot_kinematics as irs
from irsbot_kinematics import stiffness
from irsbot_kinematics.mechanism import Status
from irsbot_kinematics.stiffness import SingularPosture

SIDE = (0.0, 100.0, 0.0, 0.0, 0.0, 0.0)
"""N: the load of [S1] Tables 1, 3 and 5."""
G20 = np.array([(x, z) for z in (-0.7, -0.76667, -0.83333, -0.9) for x in (-0.4, -0.2, 0.0, 0.2, 0.4)])
PRESETS = ("irsbot2_table2", "irsbot2_table4", "five_bar_table1")
RANKS = {"irsbot2_table2": 6, "irsbot2_table4": 6, "five_bar_table1": 5}


def sideways_mm(design, pose):
    return stiffness.deflection(design, pose, SIDE)[..., 1] * 1e3


def test_a_tube_gives_way_as_the_sheet_computes():
    C = stiffness.tube_compliance(stiffness.Tube(0.06, 0.05, 0.375, "aluminium"))
    printed = {(0, 0): 6.2008e-09, (1, 1): 7.6240e-07, (5, 5): 1.6265e-05, (3, 3): 2.1632e-05, (1, 5): 3.0495e-06}
    for at, value in printed.items():
        assert C[at] == pytest.approx(value, rel=5e-5)  # the last printed digit
    assert C[2, 2] == C[1, 1]
    assert C[4, 4] == C[5, 5]
    assert C[2, 4] == -C[1, 5]
    assert np.array_equal(C, C.T)
    assert np.count_nonzero(C) == 10


def test_the_worked_examples_of_the_sheet():
    """Sheet section 10, printed digits."""
    five_bar = stiffness.load("five_bar_table1")
    table2, table4 = stiffness.load("irsbot2_table2"), stiffness.load("irsbot2_table4")
    rigid = stiffness.load("irsbot2_table4", rigid=("elbow",))
    for design, pose, printed in (
        (five_bar, (0.0, -0.8), 0.906905),
        (five_bar, (0.25, -0.7), 0.861961),
        (five_bar, (-0.4, -0.9), 1.072214),
        (table2, (0.0, -0.8), 1.142578),
        (table2, (0.3, -0.75), 1.042774),
        (table4, (0.0, -0.8), 10.613428),
        (rigid, (0.0, -0.8), 0.969275),
    ):
        assert sideways_mm(design, pose) == pytest.approx(printed, abs=0.6e-6)
    assert table2.geometry.l2 == pytest.approx(0.869871, abs=0.6e-6)
    assert stiffness.load("irsbot2_table2", beta=radians(30.0)).geometry.l2 == pytest.approx(0.891459, abs=0.6e-6)
    q = irs.make_robot("irsbot2", beta=radians(45.0)).inverse((0.0, -0.8), table2.working_mode)
    assert np.mod(q, 2.0 * np.pi) == pytest.approx(np.mod([3.163581, -0.021988], 2.0 * np.pi), abs=0.6e-6)


def apart(beta):
    """m: bars at the tips of the elbow, s = 2 a1 cos(beta)."""
    return 2.0 * 0.42 * cos(radians(beta))


@pytest.mark.parametrize(
    ("name", "changes", "printed"),
    [
        ("five_bar_table1", {}, (1.072, 0.953, 0.071, 5.598)),
        ("five_bar_table1", {"platform_joint": "spherical"}, (1.229, 1.133, 0.065, 5.598)),
        ("irsbot2_table2", {"beta": 30.0}, (0.838, 0.718, 0.056, 10.97)),
        ("irsbot2_table2", {"beta": 40.0}, (1.047, 0.930, 0.062, 10.95)),
        ("irsbot2_table2", {"beta": 45.0}, (1.232, 1.121, 0.080, 10.93)),
        ("irsbot2_table2", {"beta": 50.0}, (1.604, 1.429, 0.123, 10.92)),
        ("irsbot2_table4", {}, (10.91, 10.15, 0.463, 4.533)),
        ("irsbot2_table4", {"rigid": ("elbow",)}, (1.280, 1.022, 0.180, 4.533)),
        ("irsbot2_table4", {"rigid": ("elbow",), "spacing": 0.4}, (0.970, 0.791, 0.122, 4.533)),
        ("irsbot2_table4", {"rigid": ("elbow",), "spacing": apart(45)}, (0.764, 0.640, 0.086, 4.533)),
        ("irsbot2_table4", {"rigid": ("elbow",), "spacing": apart(40), "beta": 40.0}, (0.629, 0.521, 0.071, 4.547)),
        ("irsbot2_table4", {"rigid": ("elbow",), "spacing": apart(30), "beta": 30.0}, (0.468, 0.383, 0.053, 4.573)),
    ],
)
def test_the_table_of_the_sheet_row_by_row(name, changes, printed):
    """Sheet section 8: largest, mean and standard deviation over the 20 assumed poses in mm, and mass."""
    changes = {key: radians(value) if key == "beta" else value for key, value in changes.items()}
    design = stiffness.load(name, **changes)
    found = sideways_mm(design, G20)
    for value, figure in zip((found.max(), found.mean(), found.std(), stiffness.mass(design)), printed, strict=True):
        digits = len(str(figure).split(".")[1])
        assert value == pytest.approx(figure, abs=0.501 * 10.0**-digits)


def test_the_sensitivities_of_the_sheet():
    """Sheet section 8, last lines: mean over the 20 poses of Table 2 with beta = 45 deg."""
    for changes, printed in (
        ({"direction": (1.0, 0.0)}, 1.198),
        ({"direction": (0.0, -1.0)}, 1.042),
        ({"e": 0.05}, 1.117),
    ):
        assert sideways_mm(stiffness.load("irsbot2_table2", **changes), G20).mean() == pytest.approx(printed, abs=6e-4)


def softened(design, kind, share):
    """The design with the modulus of one kind of tube multiplied by 1 - share."""
    section = design.sections[kind]
    soft = replace(section, material=replace(section.material, young=(1.0 - share) * section.material.young))
    return replace(design, sections={**design.sections, kind: soft})


@pytest.mark.parametrize(
    ("name", "changes", "printed"),
    [
        ("five_bar_table1", {}, {"proximal": 64, "distal": 36}),
        ("irsbot2_table2", {}, {"distal": 62, "proximal": 20, "parallel": 13, "elbow": 5}),
        (
            "irsbot2_table4",
            {"rigid": ("elbow",), "spacing": apart(45)},
            {"distal": 63, "proximal": 35, "parallel": 2, "elbow": 0},
        ),
    ],
)
def test_the_shares_of_the_tubes_are_those_of_the_sheet(name, changes, printed):
    """%: of delta_y at (0, -0.8). A deflection is of first degree in the compliances, so their logarithmic derivatives
    are its shares and add up to 1."""
    design, step = stiffness.load(name, **changes), 1e-4
    soft, stiff = ({kind: softened(design, kind, sign * step) for kind in printed} for sign in (1.0, -1.0))
    shares = {
        kind: 100.0
        * np.log(sideways_mm(soft[kind], (0.0, -0.8)) / sideways_mm(stiff[kind], (0.0, -0.8)))
        / np.log((1.0 + step) / (1.0 - step))
        for kind in printed
    }
    assert sum(shares.values()) == pytest.approx(100.0, abs=1e-3)
    assert shares == pytest.approx(printed, abs=0.6)


def test_the_other_findings_of_the_sheet():
    """Sheet sections 7 and 8, figure by figure."""
    five_bar, table2 = stiffness.load("five_bar_table1"), stiffness.load("irsbot2_table2")
    # Other materials do not meet the printed 5.6 kg; steel there with 7860 kg/m3.
    per_density = stiffness.mass(five_bar) / 2700.0
    assert [per_density * 7860.0, per_density * 1600.0] == pytest.approx([16.3, 3.3], abs=0.05)
    # The binding constraints (22).
    at_44_9, at_45_3 = (sideways_mm(stiffness.load("irsbot2_table2", beta=radians(b)), G20) for b in (44.9, 45.3))
    assert at_44_9.max() == pytest.approx(1.228, abs=6e-4)
    assert at_45_3.mean() == pytest.approx(1.135, abs=6e-4)
    # A lower nu, and a deep rectangle for the five-bar that the IRSBot-2 does not reach.
    softer = table2
    for kind in table2.kinds:
        section = softer.sections[kind]
        material = replace(section.material, poisson=0.3)
        softer = replace(softer, sections={**softer.sections, kind: replace(section, material=material)})
    assert sideways_mm(softer, G20).mean() == pytest.approx(1.103, abs=6e-4)
    deep = np.array([(x, z) for z in np.linspace(-0.95, -1.15, 4) for x in (-0.2, -0.1, 0.0, 0.1, 0.2)])
    found = sideways_mm(five_bar, deep)
    assert (found.max(), found.mean(), found.std()) == pytest.approx((1.217, 1.126, 0.059), abs=6e-4)
    reach = stiffness.evaluate_many(table2, [(0.2, -1.12), (0.2, -1.13), (0.2, -1.15)]).reach
    assert reach[0] > 0.0 > reach[1] > reach[2]
    # "Twice as stiff" needs more than the elbow of the text.
    for beta in np.radians(np.arange(15.0, 81.0, 5.0)):
        for spacing in (0.05, 0.4, 0.8):
            assert sideways_mm(stiffness.load("irsbot2_table4", beta=beta, spacing=spacing), G20).mean() > 5.0
    elbow = stiffness.load("irsbot2_table4")
    whole, rigid = (
        sideways_mm(elbow, (0.0, -0.8)),
        sideways_mm(stiffness.load("irsbot2_table4", rigid=("elbow",)), (0.0, -0.8)),
    )
    assert 100.0 * (whole - rigid) / whole == pytest.approx(91.0, abs=0.5)
    # With a rigid elbow half the printed values are met from 39 (largest) to 42 deg (mean); the deviation below 37 deg.
    limits = {
        beta: sideways_mm(
            stiffness.load("irsbot2_table4", beta=radians(beta), spacing=apart(beta), rigid=("elbow",)), G20
        )
        for beta in (36.0, 37.5, 39.0, 39.5, 42.0, 42.5)
    }
    assert limits[39.0].max() < 0.5 * 1.227 < limits[39.5].max()
    assert limits[42.0].mean() < 0.5 * 1.135 < limits[42.5].mean()
    assert limits[36.0].std() < 0.064 < limits[37.5].std()


def test_shear_would_add_the_share_of_the_sheet(monkeypatch):
    """The tubes as Timoshenko beams with the shear coefficient of thin tubes, about 0.53: 2 % and 0.5 %."""
    names = ("irsbot2_table2", "five_bar_table1")
    slender = [sideways_mm(stiffness.load(name), G20).mean() for name in names]
    terms = stiffness.Tube.terms.fget

    def with_shear(tube):
        t = terms(tube)
        return replace(t, bend=t.bend + tube.length / (0.53 * tube.material.shear * tube.area))

    monkeypatch.setattr(stiffness.Tube, "terms", property(with_shear))
    sheared = [sideways_mm(stiffness.load(name), G20).mean() for name in names]
    assert sheared[0] / slender[0] == pytest.approx(1.02, abs=5e-3)
    assert sheared[1] / slender[1] == pytest.approx(1.005, abs=1e-3)


@pytest.mark.parametrize("name", PRESETS)
def test_stiffness_is_symmetric_semidefinite_and_of_the_derived_rank(name):
    design = stiffness.load(name)
    K = stiffness.matrix(design, G20)
    assert K.shape == (20, 6, 6)
    assert np.abs(K - np.swapaxes(K, 1, 2)).max() <= 1e-12 * np.abs(K).max()
    scale = np.array([1.0] * 3 + [design.length_m] * 3)
    values = np.linalg.eigvalsh(K / np.outer(scale, scale))
    assert (values > -1e-12 * values[:, -1:]).all()
    assert ((values > 1e-12 * values[:, -1:]).sum(axis=1) == RANKS[name]).all()
    assert RANKS[name] == 6 - len(design.free)


@pytest.mark.parametrize("name", PRESETS)
def test_one_posture_is_a_row_of_many(name):
    design = stiffness.load(name)
    many = stiffness.matrix(design, G20)
    moved = stiffness.deflection(design, G20, (3.0, 4.0, 5.0, 0.0, 0.0, 0.0))
    for pose, K, t in zip(G20, many, moved, strict=True):
        assert np.allclose(stiffness.matrix(design, pose), K, rtol=1e-12, atol=0.0)
        assert np.allclose(stiffness.deflection(design, pose, (3.0, 4.0, 5.0, 0.0, 0.0, 0.0)), t, rtol=1e-10, atol=0.0)
        assert np.allclose(K @ t, (3.0, 4.0, 5.0, 0.0, 0.0, 0.0), atol=1e-8)


def test_a_stiffness_is_the_same_body_from_any_frame():
    design = stiffness.load("irsbot2_table2")
    K = stiffness.matrix(design, (0.2, -0.8))
    rng = np.random.default_rng(3)
    r, w = rng.normal(size=3), rng.normal(size=6)
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    R *= np.sign(np.linalg.det(R))
    there = np.concatenate([w[:3], w[3:] - np.cross(r, w[:3])])  # the same wrench about Q = P + r
    energy = w @ np.linalg.solve(K, w)
    assert there @ np.linalg.solve(stiffness.moved(K, r), there) == pytest.approx(energy, rel=1e-9)
    seen = np.concatenate([R @ w[:3], R @ w[3:]])
    assert seen @ np.linalg.solve(stiffness.turned(K, R), seen) == pytest.approx(energy, rel=1e-9)


def test_the_robot_mirrors_itself():
    design = stiffness.load("irsbot2_table2")
    mirror = np.array([-1.0, 1.0, 1.0, 1.0, -1.0, -1.0])  # x -> -x: a twist's turns are axial vectors
    left, right = (stiffness.matrix(design, (x, -0.8)) for x in (-0.23, 0.23))
    assert np.abs(left - mirror[:, None] * right * mirror).max() < 1e-9 * np.abs(right).max()


def test_a_pose_without_an_answer_is_named_and_of_many_it_is_nan():
    design = stiffness.load("irsbot2_table2")
    with pytest.raises(irs.Unreachable):
        stiffness.matrix(design, (0.0, -2.0))
    with pytest.raises(irs.BadInput):
        stiffness.matrix(design, (0.0, float("nan")))
    with pytest.raises(irs.BadInput):
        stiffness.matrix(design, (0.0, 1.0, 2.0))
    found = stiffness.evaluate_many(design, [(0.0, -0.8), (0.0, -2.0), (0.0, np.nan)])
    assert found.status.tolist() == [Status.SOLVED, Status.UNREACHABLE, Status.INVALID]
    assert np.isfinite(found.compliance[0]).all()
    assert np.isnan(found.stiffness[1:]).all()
    assert np.isnan(found.compliance[1:]).all()


def test_a_flat_parallelogram_is_named():
    """The short side points along arm I: the elbow carrier turns about its bar."""
    q = irs.make_robot("irsbot2", beta=radians(45.0)).inverse((0.1, -0.8))
    flat = stiffness.load("irsbot2_table2", direction=(float(np.cos(q[0])), float(-np.sin(q[0]))))
    with pytest.raises(SingularPosture, match="parallelogram is flat"):
        stiffness.matrix(flat, (0.1, -0.8))
    assert np.isfinite(stiffness.matrix(flat, (0.2, -0.8))).all()


def test_type_2_postures_are_singular_and_the_free_motion_is_named():
    """Five-bar with both rods in line, horizontal: nothing holds the platform along z."""
    robot = stiffness.load("five_bar_table1", l1=0.375, l2=0.8, b=0.8 - 0.375 * cos(1.2))
    # Cranks at 1.2 rad below the horizontal, outward: elbows at x = -+0.8, so that P lies between them.
    pose = (0.0, -0.375 * np.sin(1.2))
    K = stiffness.matrix(robot, pose)
    scale = np.array([1.0] * 3 + [robot.length_m] * 3)
    held = [0, 1, 2, 3, 5]
    values = np.linalg.eigvalsh((K / np.outer(scale, scale))[np.ix_(held, held)])
    assert abs(values[0]) < 1e-9 * values[-1]
    with pytest.raises(SingularPosture, match="dz 1"):
        stiffness.deflection(robot, pose, (0.0, 0.0, -10.0, 0.0, 0.0, 0.0))
    assert stiffness.evaluate_many(robot, [pose]).status[0] == Status.SINGULAR


def test_where_the_legs_lose_a_constraint_the_elastic_robot_is_singular_too():
    """The constraint singularities that the kinematics finds, by rank of the stiffness; 1 mm aside it has all."""
    design = stiffness.load("irsbot2_table2", robot="irsbot2_csc")
    points = np.array(design.mechanism.constraint_points((1, -1)))
    assert len(points) > 2
    assert (stiffness.evaluate_many(design, points).status == Status.SINGULAR).all()
    assert (stiffness.evaluate_many(design, points + 1e-3).status == Status.SOLVED).all()
    with pytest.raises(SingularPosture, match=r"free to move by rx 1, rz -0\.994"):
        stiffness.compliance(design, points[0])
    assert np.isfinite(stiffness.matrix(design, points)).all()


def test_a_wrench_that_nothing_balances_is_refused():
    design = stiffness.load("five_bar_table1")
    with pytest.raises(SingularPosture, match="ry free"):
        stiffness.deflection(design, (0.0, -0.8), (0.0, 0.0, 0.0, 0.0, 1.0, 0.0))
    assert stiffness.deflection(design, (0.0, -0.8), SIDE)[4] == 0.0
    C = stiffness.compliance(design, (0.0, -0.8))
    assert not C[4].any()
    assert not C[:, 4].any()
    with pytest.raises(irs.BadInput):
        stiffness.deflection(design, (0.0, -0.8), (0.0, 1.0))


def test_the_platform_swings_as_a_mass_on_its_softest_spring():
    """By hand for an axial mass on a spring; for the robots by stiffness against acceleration on the softest mode."""
    design = stiffness.load("irsbot2_table2")
    pose, mass = (0.0, -0.8), 1.5
    by_hand = np.sqrt(np.linalg.eigvalsh(np.linalg.inv(stiffness.compliance(design, pose)[:3, :3]))[0] / mass)
    assert stiffness.frequency(design, pose, mass) == pytest.approx(by_hand / (2.0 * np.pi), rel=1e-9)
    inertia = np.diag([0.002, 0.003, 0.004])
    M = np.diag([mass] * 3 + [0.002, 0.003, 0.004])
    squares = np.linalg.eigvals(np.linalg.solve(M, stiffness.matrix(design, pose))).real
    full = stiffness.frequency(design, pose, mass, inertia)
    assert full == pytest.approx(np.sqrt(squares.min()) / (2.0 * np.pi), rel=1e-6)
    assert full < stiffness.frequency(design, pose, mass)
    assert stiffness.frequency(design, [pose, (0.0, -3.0)], mass, inertia)[0] == pytest.approx(full)
    with pytest.raises(irs.BadInput):
        stiffness.frequency(design, pose, 0.0)
    with pytest.raises(irs.BadInput):
        stiffness.frequency(design, pose, 1.0, -inertia)


def test_presets_mark_assumed_numbers():
    assert set(PRESETS) <= set(stiffness.presets())
    assert {"beta", "e", "direction"} == set(stiffness.load("irsbot2_table2").assumed)
    assert {"beta", "e", "direction", "spacing"} == set(stiffness.load("irsbot2_table4").assumed)
    assert {"platform_joint", "distal section"} == set(stiffness.load("five_bar_table1").assumed)
    for name in PRESETS:
        design = stiffness.load(name)
        assert all(design.sources.values())
        assert all(section.source and section.material.source for section in design.sections.values())
