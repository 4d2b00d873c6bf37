"""Distal design space: printed tables and numbers, polynomials solved another way, and the robot in space."""

from __future__ import annotations

import irsbot2_3d as space
import numpy as np
import pytest

from irsbot_kinematics.design import (
    PARAMETERS,
    Designs,
    Kind,
    bounds,
    cells,
    counts,
    distal_free,
    singular_postures,
    table_3,
)
from irsbot_kinematics.mechanisms.irsbot2_space.distal import case_1_roots, shared_root
from irsbot_kinematics.mechanisms.irsbot2_space.geometry import Irsbot2Geometry

SHEET = 5e-9
"""Numbers printed with nine digits."""
SHEET_SIX = 5e-7
ROUNDING = 1e-9
"""Constraint margin of a posture in closed form: roots of roots lose half the digits of their argument at worst."""


def geometry(**lengths):
    return Irsbot2Geometry(**{"l1": 1.0, "b": 0.1, **lengths})


W3 = geometry(a1=0.2, a2=0.03, beta=np.pi / 4, p=0.05, l2eq=0.2)


def w4(l2eq):
    return geometry(a1=0.2, a2=0.05, beta=np.pi / 4, p=0.01, l2eq=l2eq)


def w3_with(**lengths):
    return geometry(**{"a1": 0.2, "a2": 0.03, "beta": np.pi / 4, "p": 0.05, "l2eq": 0.2, **lengths})


def random_designs(number, seed=1):
    rng = np.random.default_rng(seed)
    beta = rng.uniform(0.05, 1.5, number)
    a1 = rng.uniform(0.1, 0.5, number)
    a2 = a1 * rng.uniform(0.05, 0.95, number)
    p = a2 * np.sin(beta) * 10.0 ** rng.uniform(-2.0, 2.0, number)
    l2eq = (a1 - a2) * np.sin(beta) * 10.0 ** rng.uniform(-1.0, 1.5, number)
    return Designs(np.ones(number), l2eq, np.ones(number), p, a1, a2, beta)


def space_design(g):
    return space.Design(g.l1, g.l2eq, g.b, g.p, g.a1, g.a2, g.beta, g.e)


def of_kind(g, kind):
    return [posture for posture in singular_postures(g) if posture.kind is kind]


def geometries(d):
    for row in zip(d.l2eq, d.p, d.a1, d.a2, d.beta, strict=True):
        l2eq, p, a1, a2, beta = map(float, row)
        yield Irsbot2Geometry(l1=1.0, b=a1 * np.sin(beta) + p + 0.1, l2eq=l2eq, p=p, a1=a1, a2=a2, beta=beta)


# --- numbers of the sheet and of the paper ---


def test_the_bounds_of_the_papers_example_are_those_of_its_corrected_table():
    t = bounds(Designs.of(W3))
    assert [t.p2[0], t.p3[0], t.p4[0], t.p5[0], t.p6[0]] == pytest.approx(
        [0.003640, 0.007071, 0.021213, 0.063640, 0.123640], abs=SHEET_SIX
    )
    assert [t.l2eq1[0], t.l2eq2[0], t.l2eq3[0]] == pytest.approx([0.283333, 0.120208, 0.117061], abs=SHEET_SIX)


def test_the_papers_example_has_one_root_and_two_mirrored_postures_of_case_1():
    assert case_1_roots(Designs.of(W3))[0, 0] == pytest.approx(-0.738850464, abs=SHEET)
    assert np.isnan(case_1_roots(Designs.of(W3))[1, 0])
    one, other = of_kind(W3, Kind.CASE_1)
    assert one.psi == pytest.approx((-0.739433441, 2.402159212), abs=SHEET)
    assert one.theta == pytest.approx((-0.465987623, 2.675605030), abs=SHEET)
    assert one.lam == pytest.approx((0.299960564, 0.299960564), abs=SHEET)
    assert other.psi == pytest.approx((0.739433441, -2.402159212), abs=SHEET)


def test_the_margin_vanishes_in_the_papers_example_and_rises_at_the_sheets_rate():
    psi_1, psi_2 = of_kind(W3, Kind.CASE_1)[0].psi
    assert space.kappa(space_design(W3), psi_1, psi_2) < ROUNDING
    assert space.kappa(space_design(W3), psi_1 + 1e-3, psi_2) == pytest.approx(6.739e-4, abs=5e-8)


def test_case_2_of_the_sheet():
    g = w4(0.09)
    t = bounds(Designs.of(g))
    assert t.p8[0] == pytest.approx(0.035355339, abs=SHEET)
    assert t.l2eq4[0] == pytest.approx(0.056409, abs=SHEET_SIX)
    assert shared_root(Designs.of(g))[0] == pytest.approx(0.717157288, abs=SHEET)
    assert t.l2eq2[0] == pytest.approx(0.106066017, abs=SHEET)
    assert counts(Designs.of(g))[:3] == (2, 4, 0)
    posture = of_kind(g, Kind.CASE_2)[0]
    assert posture.theta == pytest.approx((-0.560759565, 2.580833089), abs=SHEET)
    assert posture.lam == pytest.approx((0.159950747, 0.019693562), abs=SHEET)
    assert posture.psi == pytest.approx((-1.238156960, 0.116637830), abs=SHEET)
    assert np.sin(posture.psi[0] - posture.psi[1]) == pytest.approx(-0.9768, abs=5e-5)


def test_case_3_of_the_sheet():
    g = w4(0.30)
    assert counts(Designs.of(g))[:3] == (0, 0, 4)
    posture = of_kind(g, Kind.CASE_3)[0]
    assert posture.theta == pytest.approx((0.560759565, 0.560759565), abs=SHEET)
    assert posture.lam == pytest.approx((0.384471131, 0.204826822), abs=SHEET)
    assert posture.psi == pytest.approx((0.749915706, 0.371603424), abs=SHEET)


# --- the printed tables ---

PRINTED_CASE_1 = [  # Table 1: cell of p, cell of l2eq, postures
    (("p1", "p2"), ("l2eq1", "l2eq2"), 2),
    (("p2", "p3"), ("l2eq1", "l2eq2"), 2),
    (("p3", "p4"), ("l2eq1", "l2eq2"), 2),
    (("p4", "p5"), ("l2eq2", "l2eq1"), 2),
    (("p5", "p6"), ("l2eq2", "l2eq1"), 2),
    (("p6", "p7"), ("l2eq2", "l2eq1"), 2),
    (("p3", "p4"), ("l2eq3", "l2eq1"), 4),
    (("p4", "p5"), ("l2eq3", "l2eq2"), 4),
]
PRINTED_TABLE_3 = {  # beta from, below: cells of p and lower bound of l2eq
    ("beta1", "beta2"): [("p8", "p3", 2), ("p3", "p4", 2), ("p4", "p5", 1), ("p5", "p7", 1)],
    ("beta2", "beta3"): [("p8", "p4", 2), ("p4", "p5", 1), ("p5", "p7", 1)],
    ("beta3", "beta4"): [("p8", "p5", 1), ("p5", "p7", 1)],
}
BETA = {"beta1": 0.0, "beta2": np.arcsin(1.0 / np.sqrt(3.0)), "beta3": np.pi / 4, "beta4": np.pi / 2}


def named(t):
    number = len(t.p2)
    return {**t._asdict(), "p1": np.zeros(number), "p7": np.full(number, np.inf)}


def test_the_counts_of_case_1_are_those_of_the_printed_cells():
    d = random_designs(20_000)
    at = named(bounds(d))
    expected = np.zeros(d.p.size, dtype=int)
    for (p_low, p_high), (l_low, l_high), number in PRINTED_CASE_1:
        inside = (at[p_low] < d.p) & (d.p < at[p_high]) & (at[l_low] < d.l2eq) & (d.l2eq < at[l_high])
        assert inside.any(), "the sample misses a printed cell"
        expected[inside] = number
    assert np.array_equal(counts(d).case_1, expected)


def test_the_freedom_test_is_the_union_of_the_printed_cells_of_table_3():
    d = random_designs(20_000)
    at = named(bounds(d))
    expected = np.zeros(d.p.size, dtype=bool)
    for (from_, below), rows in PRINTED_TABLE_3.items():
        for low, high, length in rows:
            inside = (BETA[from_] <= d.beta) & (d.beta < BETA[below]) & (at[low] < d.p) & (d.p < at[high])
            inside &= d.l2eq > at[f"l2eq{length}"]
            assert inside.any(), "the sample misses a printed cell"
            expected |= inside
    assert np.array_equal(table_3(d), expected)


@pytest.mark.parametrize(("beta", "other"), [("beta2", "p3"), ("beta3", "p4")])
def test_p8_passes_the_other_bounds_at_the_values_of_table_2(beta, other):
    below, above = (bounds(Designs.of(w3_with(beta=BETA[beta] + side))) for side in (-1e-6, 1e-6))
    assert below.p8 < getattr(below, other)
    assert above.p8 > getattr(above, other)


# --- roots and counts, solved another way ---


def test_the_roots_of_case_1_are_those_of_numpys_companion_matrix():
    d = random_designs(500)
    for index, row in enumerate(case_1_roots(d).T):
        l, s, c2, mu = d.l2eq[index], d.s[index], d.c[index] ** 2, d.mu[index]
        p, a2 = d.p[index], d.a2[index]
        polynomial = [-l * l * s * s * mu, l * c2 * (p - a2 * s), -p * (d.a1[index] - a2) * c2 * s + l * l * mu]
        roots = np.roots(polynomial)
        real = np.sort(roots[np.isreal(roots)].real)
        expected = real[np.abs(real) <= 1.0]
        assert row[~np.isnan(row)] == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_there_are_as_many_roots_and_postures_as_table_1_counts():
    d = random_designs(2000)
    number = counts(d)
    assert np.array_equal(2 * np.sum(~np.isnan(case_1_roots(d)), axis=0), number.case_1)
    assert np.array_equal(distal_free(d), (number.case_1 == 0) & (number.case_2 == 0) & (number.case_3 == 0))
    kinds = list(Kind)
    for index, g in enumerate(geometries(d)):
        listed = [posture.kind for posture in singular_postures(g)]
        assert [listed.count(kind) for kind in kinds] == [int(column[index]) for column in number]


def test_table_3_leaves_out_only_bulky_designs():
    d = random_designs(5000)
    free = distal_free(d)
    assert np.array_equal(free & (d.l2eq > d.D), table_3(d))
    assert (free & ~table_3(d)).any()


def test_a_design_on_a_bound_is_not_free():
    on_l2eq1 = w3_with(l2eq=0.05 * 0.17 / 0.03)
    assert not distal_free(Designs.of(on_l2eq1))[0]
    assert distal_free(Designs.of(w3_with(l2eq=on_l2eq1.l2eq + 1e-9)))[0]
    vanishing_leg = w3_with(p=0.01, l2eq=W3.D)
    assert not distal_free(Designs.of(vanishing_leg))[0]


# --- the robot in space ---


def test_the_margin_of_the_robot_in_space_vanishes_in_every_posture_of_random_designs():
    d = random_designs(400, seed=2)
    seen = set()
    for g in geometries(d):
        postures = singular_postures(g)
        if not postures or abs(g.l2eq / g.D - 1.0) < 0.02:  # close to a vanishing leg, where angles mean little
            continue
        psi = np.array([posture.psi for posture in postures])
        assert space.kappa(space_design(g), psi[:, 0], psi[:, 1]).max() < ROUNDING
        seen |= {posture.kind for posture in postures}
    assert seen == set(Kind)


@pytest.mark.parametrize(
    ("g", "kind", "freedoms"),
    [
        (W3, Kind.CASE_1, 3),
        (w4(0.09), Kind.CASE_2, 3),
        (w4(0.30), Kind.CASE_3, 3),
        (W3, Kind.C1A, 4),
        (W3, Kind.C1B, 3),
    ],
)
def test_the_platform_gains_the_stated_rotation(g, kind, freedoms):
    for posture in of_kind(g, kind):
        d = space_design(g)
        legs = [space.leg(d, k, 0.0, posture.psi[k]) for k in (0, 1)]
        shift = space.platform_point(d, 0, legs[0]) - space.platform_point(d, 1, legs[1])
        legs[1] = space.Leg(
            *(field + shift if name in "ABGHEF" else field for name, field in legs[1]._asdict().items())
        )
        left = space.freedom(d, tuple(legs), 1e-7, motors_locked=False)
        assert left.shape[0] == freedoms
        x, z = posture.axis_point
        axis = np.array(posture.axis)
        twist = np.concatenate([axis, np.cross(np.array([x, 0.0, z]), axis) / float(d.Lc)])
        missed = twist - left.T @ (left @ twist)
        assert np.linalg.norm(missed) < 1e-7 * np.linalg.norm(twist)


def test_only_case_1_and_c1b_are_also_of_type_2():
    for g in (W3, w4(0.09), w4(0.30)):
        for posture in singular_postures(g):
            sine = np.sin(posture.psi[0] - posture.psi[1])
            assert (abs(sine) < ROUNDING) == posture.is_type_2 == (posture.kind in (Kind.CASE_1, Kind.C1B))


# --- cells ---


def test_the_cells_around_the_papers_example():
    found = cells(W3)
    assert found.beta.name == "]beta3, beta4["
    assert [cell.name for cell in found.p if cell.here] == ["]p4, p5["]
    rows = {row.name: row for row in found.l2eq}
    assert rows["]l2eq3, l2eq2["].counts["I"] == 4
    assert rows["]l2eq2, l2eq1["].counts["I"] == 2
    assert rows["]l2eq2, l2eq1["].here
    assert rows["]l2eq1, l2eq5["].table_3
    assert rows["]l2eq1, l2eq5["].counts == {"I": 0, "II": 0, "III": 0, "C1a": 2, "C1b": 2}


def test_no_count_changes_inside_a_cell_of_l2eq():
    for g in [W3, w4(0.09), *geometries(random_designs(40, seed=5))]:
        for row in cells(g).l2eq:
            high = row.high.value if np.isfinite(row.high.value) else 10.0 * row.low.value
            inside = row.low.value + (high - row.low.value) * np.linspace(1e-6, 1.0 - 1e-6, 50)
            number = counts(Designs.columns({name: getattr(g, name) for name in PARAMETERS} | {"l2eq": inside}))
            for kind, column in zip(Kind, number, strict=True):
                assert set(column.tolist()) == {row.counts[kind.value]}
