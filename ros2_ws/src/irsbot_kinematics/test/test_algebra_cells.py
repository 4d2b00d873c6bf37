"""Cells, regions and areas: the numbers of the sheet, and independent methods."""

from __future__ import annotations

from fractions import Fraction
from math import asin, pi, sqrt

import numpy as np
import pytest

pytest.importorskip("flint", reason="python-flint is an optional extra")

from cusps_of_3rpr import CUSPS

from irsbot_kinematics import BadInput, algebra, make_robot
from irsbot_kinematics.algebra.model.polynomial import integer_context
from irsbot_kinematics.algebra.sizes import refuse_large_walls
from irsbot_kinematics.numerics.assembly_roots import SAMPLED_TURNS, planar_closing, trigonometric_roots

pytestmark = pytest.mark.usefixtures("own_cache")


# Regions and areas of the box [0.1, 45]^2.
CELLS = {
    "17": ({0: (41, 5), 2: (49, 3), 4: (41, 3), 6: (16, 1)}, {0: 673.7639, 2: 989.4260, 4: 283.4635, 6: 69.3565}, 22),
    "14.98": (
        {0: (46, 6), 2: (48, 4), 4: (38, 2), 6: (16, 1)},
        {0: 760.4514, 2: 919.9656, 4: 255.8282, 6: 79.7648},
        23,
    ),
}
# Section 7: slices of the Delta-like robots, number of solutions -> (cells, regions) and area.
WORKSPACE = {
    "orthoglide": ({0: (40, 24), 1: (4, 1), 8: (2, 1)}, {1: 9.42477796, 8: 0.42305387}),
    "hybridglide": (
        {0: (86, 35), 1: (4, 1), 2: (4, 2), 4: (4, 3), 8: (4, 1)},
        {1: 2.90347258, 2: 0.85178210, 4: 0.18736314, 8: 0.37055627},
    ),
    "triaglide": (
        {0: (52, 40), 1: (8, 2), 2: (8, 4), 4: (8, 6), 8: (4, 1)},
        {1: 5.80694517, 2: 1.70356419, 4: 0.37472629, 8: 0.87464339},
    ),
    "uranesx": ({0: (166, 24), 1: (8, 1), 2: (20, 3), 4: (13, 3)}, {1: 2.11438898, 2: 1.43104946, 4: 0.26233231}),
}
JOINT = {
    "orthoglide": (1, 1, 10.24754432),
    "hybridglide": (4, 1, 10.81184966),
    "triaglide": (8, 2, 8.81011280),
    "uranesx": (3, 1, 15.71659139),
}


@pytest.fixture(scope="module")
def slice_17():
    return algebra.decompose(
        algebra.predefined("3rpr"), ("rho2", "rho3"), ((0.1, 45), (0.1, 45)), {"rho1": 17}, cache=False
    )


def companion_roots(rho, b3=(13.2363732394, 16.0967084668)):
    """Turns (N, 6) of the 3-RPR from a companion matrix of Fourier samples, and how far they are from real."""
    b = [(0.0, 0.0), (17.04, 0.0), b3]
    a = [(0.0, 0.0), (15.91, 0.0), (0.0, 10.0)]
    c, s = np.cos(SAMPLED_TURNS), np.sin(SAMPLED_TURNS)
    ends = [(bx * c - by * s - ax, bx * s + by * c - ay) for (bx, by), (ax, ay) in zip(b, a, strict=True)]
    return trigonometric_roots(np.array([planar_closing(ends, lengths) for lengths in rho]))


def companion_counts(rho):
    """Direct solutions (N,)."""
    return (companion_roots(rho)[1] < 1e-6).sum(axis=1)


def test_cells_of_the_3rpr_slice(slice_17):
    counts, areas, columns = CELLS["17"]
    assert slice_17.counts() == counts
    assert slice_17.columns == columns
    assert slice_17.areas() == pytest.approx(areas, abs=5.1e-5)
    assert sum(slice_17.areas().values()) == pytest.approx(44.9**2, abs=1e-8)
    assert slice_17.rounded == {"b3x": Fraction("13.236373"), "b3y": Fraction("16.096708")}


@pytest.mark.slow
def test_cells_of_the_other_3rpr_slice():
    counts, areas, columns = CELLS["14.98"]
    found = algebra.decompose(algebra.predefined("3rpr"), ("rho2", "rho3"), ((0.1, 45), (0.1, 45)), {"rho1": "14.98"})
    assert (found.counts(), found.columns) == (counts, columns)
    assert found.areas() == pytest.approx(areas, abs=5.1e-5)


def test_counts_agree_with_a_companion_matrix_over_a_grid(slice_17):
    rng = np.random.default_rng(4)
    points = rng.uniform(0.2, 44.9, (120, 2)).round(3)
    expected = companion_counts([(17.0, *point) for point in points])
    for point, count in zip(points.tolist(), expected, strict=True):
        assert slice_17.locate(point).count == count


def test_location_knows_walls_and_the_outside(slice_17):
    cell = slice_17.locate((20, 20))
    assert cell.count == slice_17.region_of(cell).count
    assert slice_17.locate((50, 1)) is None
    plane = slice_17.plane
    assert plane.locate(plane.columns[3], plane.second.low) is None
    ortho = algebra.decompose(algebra.predefined("orthoglide"), ("x", "y"), ((-2, 2), (-2, 6)), {"z": 1})
    assert ortho.locate((0, 2)) is None  # on the cylinder D_1: y^2 + z^2 = 4 has y = sqrt 3; the line x = 0 is a wall
    assert ortho.locate(("0.5", "1.3")).count == ortho.locate(("0.501", "1.3")).count
    five_bar = algebra.decompose(algebra.predefined("rr_rrr"), ("x", "z"), ((-1.5, 1.5), (-1.5, 1.5)))
    assert five_bar.locate((0, 1)).count == 4  # the circles cross on the line x = 0, which is no wall
    assert five_bar.locate(("-0.5875", 0)) is None  # the leftmost point of an inner circle
    with pytest.raises(algebra.AlgebraError, match="two coordinates"):
        slice_17.locate((1, 2, 3))
    for wrong in (5, "20, 20", (None, 1)):
        with pytest.raises(BadInput):
            slice_17.locate(wrong)
    for wrong in (len(slice_17.cells), -1, "a"):
        with pytest.raises(BadInput):
            slice_17.region_of(wrong)


@pytest.mark.parametrize("low", ["0.5", 0])
def test_a_negative_value_lies_outside_a_box_of_positive_ones(low):
    """Of walls with even powers alone the squares are known; the signs count all the same."""
    s = algebra.System(["x^2 + y^2 = r1^2 + 1", "x = r2"], ["x", "y"], ["r1", "r2"])
    joint = algebra.decompose(s, ("r1", "r2"), ((low, 2), (low, 3)))
    assert joint.locate((1, 1)).count == 2
    for point in ((-1, 1), (1, -1), (-1, -1), (0, 1)):
        assert joint.locate(point) is None
    pose = algebra.decompose(s, ("x", "y"), (("0.1", 3), ("0.1", 3)))
    inside = algebra.pairing(s, joint, pose)[joint.locate((1, 1)).index]
    assert sorted(i is None for i in inside) == [False, True]  # (1, 1) and (1, -1), the second outside


def test_neighbours_with_equal_numbers_are_one_region(slice_17):
    for a, b in slice_17.graph:
        if slice_17.cells[a].count == slice_17.cells[b].count:
            assert slice_17.region_of(a) == slice_17.region_of(b)
    assert sorted(i for region in slice_17.regions for i in region.cells) == list(range(147))


def test_numbers_on_the_walls_lie_between_their_sides(slice_17):
    """On an arc one pair of solutions is a double one: counted by the companion matrix just beside it."""
    arcs = algebra.wall_counts(slice_17)
    assert len(arcs) == 147 - 22
    for arc in arcs:
        sides = slice_17.cells[arc.below].count, slice_17.cells[arc.above].count
        assert abs(sides[0] - sides[1]) in (0, 2)
        assert arc.count == sum(sides) // 2
    ortho = algebra.decompose(algebra.predefined("orthoglide"), ("x", "y"), ((-2, 2), (-2, 6)), {"z": 1})
    assert {arc.count for arc in algebra.wall_counts(ortho)} == {0, 1, 4}


def test_numbers_at_cusps_crossings_and_tangents_are_those_of_distinct_solutions(slice_17):
    """Counted by the companion matrix at the vertex: roots closer than its rounding there are one."""
    found = algebra.wall_vertices(slice_17)
    cusps = sorted(v.point for v in found if v.kind == "cusp")
    np.testing.assert_allclose(cusps, [row[:2] for row in CUSPS["17"]], atol=1e-6)
    assert [sum(v.kind == kind for v in found) for kind in ("crossing", "tangent", "unknown")] == [6, 3, 0]
    for vertex in found:
        turns, unreal = companion_roots([(17.0, *vertex.point)], (13.236373, 16.096708))  # as the slice was rounded
        real = np.sort(turns[unreal < 1e-2])
        assert vertex.count == np.sum(np.diff(real, append=real[0] + 2.0 * pi) > 2e-2), vertex


@pytest.mark.parametrize("name", ["orthoglide", "hybridglide", "triaglide"])
def test_numbers_at_the_vertices_of_a_workspace_are_products_over_the_legs(name):
    """rho = (P - o).u +- sqrt(D), in the open range (0, 4); one where D is 0."""
    cells = algebra.decompose(algebra.predefined(name), ("x", "y"), ((-2, 2), (-2, 6)), {"z": 1})
    found = [v for v in algebra.wall_vertices(cells) if v.count is not None]
    rails = make_robot(name).mechanism.rails
    for vertex in found:
        product = 1
        for origin, way in rails:
            to = np.array([*vertex.point, 1.0]) - origin
            along = to @ way
            square = 4.0 - to @ to + along * along
            assert abs(square) < 1e-6 or abs(square) > 1e-3, "the vertex is found to 1e-6"
            slides = [] if square < -1e-6 else {along + sign * sqrt(max(square, 0.0)) for sign in (1, -1)}
            slides = [along] if abs(square) < 1e-6 else slides
            product *= sum(1e-4 < slide < 4.0 - 1e-4 for slide in slides)
        assert vertex.count == product, vertex
    assert len({v.count for v in found}) > 1


def test_a_second_call_comes_from_the_cache_and_can_do_the_same(tmp_path):
    s = algebra.predefined("hybridglide")
    stated = []
    first = algebra.decompose(s, ("x", "y"), ((-2, 2), (-2, 6)), {"z": 1}, progress=lambda *what: stated.append(what))
    assert {what for what, _, _ in stated} >= {"critical values", "numbers of solutions", "cell graph", "areas"}
    stated.clear()
    again = algebra.decompose(s, ("x", "y"), ((-2, 2), (-2, 6)), {"z": 1}, progress=lambda *what: stated.append(what))
    assert stated == []
    assert again.regions == first.regions
    for point in ((0, 1), ("0.1", "1.7"), (-1, 5)):
        assert again.locate(point) == first.locate(point)
    for file in tmp_path.iterdir():
        file.write_bytes(b"damaged")
    assert algebra.decompose(s, ("x", "y"), ((-2, 2), (-2, 6)), {"z": 1}).regions == first.regions


@pytest.mark.parametrize("name", WORKSPACE)
def test_workspace_slices_of_the_delta_robots(name):
    found = algebra.decompose(algebra.predefined(name), ("x", "y"), ((-2, 2), (-2, 6)), {"z": 1})
    counts, areas = WORKSPACE[name]
    assert found.counts() == counts
    assert {n: a for n, a in found.areas().items() if n} == pytest.approx(areas, abs=1.1e-8)
    assert sum(found.areas().values()) == pytest.approx(32.0, abs=1e-7)
    if name == "orthoglide":
        assert found.areas()[1] == pytest.approx(3.0 * pi, abs=1e-7)


@pytest.mark.parametrize("name", JOINT)
def test_joint_slices_of_the_delta_robots(name):
    found = algebra.decompose(algebra.predefined(name), ("rho1", "rho2"), ((0, 4), (0, 4)), {"rho3": 2})
    cells, regions, area = JOINT[name]
    assert found.counts()[2] == (cells, regions)
    assert found.areas()[2] == pytest.approx(area, abs=1.1e-8)


@pytest.mark.parametrize("name", ["orthoglide", "hybridglide", "triaglide"])
def test_counts_agree_with_the_closed_forms_of_the_robots(name):
    """inverse_all and direct_all know nothing of polynomials; limits 0 < rho < 4."""
    robot, s = make_robot(name), algebra.predefined(name)
    pose = algebra.decompose(s, ("x", "y"), ((-2, 2), (-2, 6)), {"z": 1})
    joint = algebra.decompose(s, ("rho1", "rho2"), ((0, 4), (0, 4)), {"rho3": 2})
    rng = np.random.default_rng(6)
    for x, y in rng.uniform((-2, -2), (2, 6), (50, 2)).round(4).tolist():
        inside = [q for q in robot.inverse_all((x, y, 1.0)) if min(q) > 0.0 and max(q) < 4.0]
        assert pose.locate((x, y)).count == len(inside)
    for first, second in rng.uniform(0.01, 3.99, (40, 2)).round(4).tolist():
        assert joint.locate((first, second)).count == len(robot.direct_all((first, second, 2.0)))


def test_a_five_bar_joint_and_pose_cell_belong_together():
    s = algebra.predefined("rr_rrr")
    joint = algebra.decompose(s, ("q1", "q2"), ((-3, 3), (-3, 3)))
    pose = algebra.decompose(s, ("x", "z"), ((-1.5, 1.5), (-1.5, 1.5)))
    assert joint.counts() == {2: (1, 1)}  # rods longer than the crank ends are ever apart: two poses everywhere
    assert joint.areas()[2] == pytest.approx(36.0)
    by_text = algebra.decompose(s, ("q1", "q2"), (("-1/2", "1/2"), ("0", 1)))
    assert by_text.areas()[2] == pytest.approx(1.0)
    for wrong in (("a", 1), (None, 1), (0, pi), (0, 4)):
        with pytest.raises(algebra.AlgebraError):
            algebra.decompose(s, ("q1", "q2"), (wrong, (0, 1)))
    l1, l2, b = 0.375, 0.825, 0.1375
    lens = two_discs(l1 + l2, 2 * b)
    holes = 2 * pi * (l2 - l1) ** 2 - two_discs(l2 - l1, 2 * b)
    assert pose.areas()[4] == pytest.approx(lens - holes, abs=1e-7)
    assert all(
        pose.cells[i].count == 4 for row in algebra.pairing(s, joint, pose).values() for i in row if i is not None
    )
    path = algebra.image_of_path(s, [{"x": "0.1", "z": "0.5"}, {"x": "1.2", "z": "0.6"}], pose)
    assert [len(point.images) for point in path] == sorted((len(point.images) for point in path), reverse=True)
    for corners, cells in (
        ([{"q1": 1, "q2": 0}, {"q1": 2}], None),
        ([{"q1": 1}, {"q1": 2, "q2": 0}], None),
        ([{"x": "0.1", "z": "0.5"}, {"x": "1.2", "z": "0.6"}], joint),
    ):
        with pytest.raises(algebra.AlgebraError):
            algebra.image_of_path(s, corners, cells)
    leaving = max(point.values["x"] for point in path if len(point.images) == 4)
    z = 0.5 + (leaving - 0.1) / 11.0
    assert (leaving + b) ** 2 + z**2 == pytest.approx((l1 + l2) ** 2, abs=1e-6)  # bisected to the outer circle


def two_discs(radius, apart):
    """Area of the intersection of two discs of one radius."""
    half = 0.5 * apart
    return 2 * (radius**2 * (0.5 * pi - asin(half / radius)) - half * sqrt(radius**2 - half**2))


def test_a_slice_that_cannot_be_decomposed_is_refused_in_one_line():
    s = algebra.predefined("3rpr")
    for names, box, fixed, word in (
        (("rho2", "rho3"), ((1, 2), (1, 2)), {}, "rho1"),
        (("rho2", "rho3"), ((2, 1), (1, 2)), {"rho1": 17}, "empty"),
        (("rho2", "x"), ((1, 2), (1, 2)), {"rho1": 17}, "two of the joints"),
        (("rho2", "rho2"), ((1, 2), (1, 2)), {"rho1": 17}, "different"),
        (("rho2", "rho3"), ((1, 2), (1, 2)), {"rho1": 0.1 + 0.2}, "no decimal"),
        (("rho2", "rho3"), ((1, float("nan")), (1, 2)), {"rho1": 17}, "finite"),
    ):
        with pytest.raises(algebra.AlgebraError, match=word) as refused:
            algebra.decompose(s, names, box, fixed)
        assert "\n" not in str(refused.value)
    u, v = integer_context(("u", "v")).gens()
    refuse_large_walls([u**40 - v, u * v - 1])
    with pytest.raises(algebra.TooLarge, match="critical values of degree 1640"):
        refuse_large_walls([u * v - 1, u**41 - v])
    with pytest.raises(algebra.AlgebraError, match="no variable"):
        algebra.configurations(s, {"rho9": 1})
    with pytest.raises(algebra.AlgebraError, match="infinitely many"):
        algebra.configurations(s, {"rho1": 1})


def test_an_octree_encloses_the_known_volumes():
    """Volumes of the sheet of other mechanisms, section 3: joint space of the orthoglide with two solutions 35.5431."""
    found = algebra.octree(algebra.predefined("orthoglide"), ("rho1", "rho2", "rho3"), ((0, 4),) * 3, 4)
    volumes = found.volumes()
    assert volumes[2] < 35.5431 < volumes[2] + found.undecided
    assert sum(volumes.values()) + found.undecided == pytest.approx(64.0)
    pose = algebra.octree(algebra.predefined("orthoglide"), ("x", "y", "z"), ((-2, 2), (-2, 6), (-2, 6)), 4)
    assert pose.volumes()[1] < 32 * pi / 3 < pose.volumes()[1] + pose.undecided
    with pytest.raises(algebra.TooLarge, match="boxes"):
        algebra.octree(algebra.predefined("orthoglide"), ("x", "y", "z"), ((-2, 2),) * 3, 9)
    for name, names, depth in (
        ("orthoglide", ("x", "y", "z"), -1),
        ("orthoglide", ("x", "y", "y"), 1),
        ("ruu4", ("x", "y", "z"), 1),  # phi is left
        ("rpr3", ("x", "y", "phi"), 1),  # an angle
    ):
        with pytest.raises(BadInput):
            algebra.octree(algebra.of_robot(make_robot(name)), names, ((-2, 2),) * 3, depth)


def test_a_mechanism_of_ones_own():
    """A point on two cranks of different lengths: the circles of reach are known in closed form."""
    s = algebra.System(
        ["(x - a*cos(q1))^2 + (y - a*sin(q1))^2 = c^2", "(x - d - b*cos(q2))^2 + (y - b*sin(q2))^2 = c^2"],
        pose=["x", "y"], joints=["q1", "q2"], angles=["q1", "q2"],
        parameters={"a": 1, "b": "1/2", "c": 2, "d": 3},
    )  # fmt: skip
    found = algebra.decompose(s, ("x", "y"), ((-4, 6), (-4, 4)))
    assert set(found.counts()) == {0, 4}
    annuli = monte_carlo(
        lambda x, y: (
            (np.hypot(x, y) > 1) & (np.hypot(x, y) < 3) & (np.hypot(x - 3, y) > 1.5) & (np.hypot(x - 3, y) < 2.5)
        )
    )
    assert found.areas()[4] == pytest.approx(annuli, rel=0.02)


def monte_carlo(inside):
    x, y = np.meshgrid(np.linspace(-4, 6, 1500), np.linspace(-4, 4, 1200))
    return 80.0 * float(inside(x, y).mean())
