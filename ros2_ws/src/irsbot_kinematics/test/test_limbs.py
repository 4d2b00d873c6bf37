"""Limb singularities: the superbracket in exact integers, its factors, and margins that vanish where the limb does."""

from __future__ import annotations

from fractions import Fraction
from math import cos, sin

import numpy as np
import pytest

from irsbot_kinematics import BadInput, limbs
from irsbot_kinematics.numerics.arithmetic import ARRAYS, FLOATS

Z = np.array([0.0, 0.0, 1.0])
ROUNDING = 1e-12
"""Relative to lengths of order 1."""


def exact_determinant(rows):
    """By elimination in fractions."""
    m = [[Fraction(value) for value in row] for row in rows]
    det = Fraction(1)
    for i in range(len(m)):
        pivot = next((j for j in range(i, len(m)) if m[j][i] != 0), None)
        if pivot is None:
            return Fraction(0)
        if pivot != i:
            m[i], m[pivot], det = m[pivot], m[i], -det
        det *= m[i][i]
        for j in range(i + 1, len(m)):
            factor = m[j][i] / m[i][i]
            m[j] = [a - factor * b for a, b in zip(m[j], m[i], strict=True)]
    return det


def lines(points):
    return [limbs.line(p, q) for p, q in zip(points[::2], points[1::2], strict=True)]


def test_the_superbracket_of_the_printed_points():
    first = [(-4, -2, -1), (-1, -3, 4), (-3, 2, -5), (-3, -2, -1), (-3, 1, -1), (4, 6, -4)]
    second = [(6, 5, 5), (-2, -3, 4), (2, 0, 5), (-2, -1, 1), (-1, 0, 2), (-5, -5, -1)]
    points = [limbs.finite(point) for point in (*first, *second)]
    assert exact_determinant(lines(points)) == -82452
    assert limbs.superbracket(points) == 82452


def test_the_superbracket_is_minus_the_determinant_of_the_six_lines_in_exact_integers():
    rng = np.random.default_rng(1)
    for _ in range(200):
        points = [
            (*p, int(w)) for p, w in zip(rng.integers(-9, 10, (12, 3)).tolist(), rng.integers(0, 2, 12), strict=True)
        ]
        assert limbs.superbracket(points) == -exact_determinant(lines(points))


def test_a_superbracket_needs_twelve_points():
    with pytest.raises(BadInput, match="12 points"):
        limbs.superbracket([(0, 0, 0, 1)] * 11)


def unit(vector):
    return vector / np.linalg.norm(vector)


def random_ruu(rng):
    """A, B, C, z, m, E of an R U U limb: AB horizontal, BC normal to m."""
    a, turn = rng.normal(size=3), rng.uniform(0, 2 * np.pi, 2)
    b = a + rng.uniform(0.2, 2) * np.array([cos(turn[0]), sin(turn[0]), 0])
    m = np.array([cos(turn[1]), sin(turn[1]), 0])
    c = b + rng.uniform(0.2, 2) * unit(np.cross(m, rng.normal(size=3)))
    return a, b, c, Z, m, rng.normal(size=3)


def random_prpir(rng):
    """A, C, x, z, n, E of a P R Pi R limb in a random frame."""
    z, a = unit(rng.normal(size=3)), rng.normal(size=3)
    x = unit(np.cross(z, rng.normal(size=3)))
    c = a + rng.normal(size=3)
    return a, c, x, z, unit(np.cross(z, c - a)), rng.normal(size=3)


def test_ruu_jacobian_superbracket_and_factors_agree():
    """|det| = |AB| |BC|^2 |f1 f2|, whatever E."""
    rng = np.random.default_rng(2)
    for _ in range(200):
        a, b, c, z, m, e = random_ruu(rng)
        det = np.linalg.det(limbs.ruu_jacobian(a, b, c, z, m, e))
        points = limbs.ruu_points(*(v.tolist() for v in (a, b, c, z, m, e)))
        A, _, B, _, _, M, C, _, _, _, E, N = points
        zz = limbs.infinite(z.tolist())
        factored = limbs.bracket(A, zz, B, C) * limbs.bracket(zz, B, M, C) * limbs.bracket(zz, M, E, N)
        f1, f2 = limbs.ruu_factors(FLOATS, unit(b - a).tolist(), unit(c - b).tolist(), (0.0, 0.0, 1.0))
        ab, bc = np.linalg.norm(b - a), np.linalg.norm(c - b)
        scale = 1 + np.linalg.norm(np.concatenate([a, b, c, e])) ** 4
        assert factored == pytest.approx(det, abs=ROUNDING * scale)
        assert abs(limbs.superbracket(points)) == pytest.approx(abs(det), abs=ROUNDING * scale)
        assert ab * bc**2 * f1 * f2 == pytest.approx(abs(det), abs=ROUNDING * scale)
        assert f1 <= f2 + ROUNDING, "u_AB x u_BC . z is a part of u_BC x z: the first factor is never the larger one"


def test_prpir_jacobian_superbracket_and_factors_agree():
    """|det| = |AC| |l.x| |(z x l).n|, whatever E."""
    rng = np.random.default_rng(3)
    for _ in range(200):
        a, c, x, z, n, e = random_prpir(rng)
        det = np.linalg.det(limbs.prpir_jacobian(a, c, x, z, n, e))
        l = unit(c - a)
        across, flat = limbs.prpir_factors(FLOATS, l.tolist(), x.tolist(), z.tolist())
        ac = np.linalg.norm(c - a)
        scale = 1 + np.linalg.norm(np.concatenate([a, c, e])) ** 4
        assert ac * across * flat == pytest.approx(abs(det), abs=ROUNDING * scale)
        assert flat == pytest.approx(abs(np.dot(np.cross(z, l), n)), abs=ROUNDING)
        points = limbs.prpir_points(a.tolist(), c.tolist(), x.tolist(), z.tolist(), n.tolist(), e.tolist())
        assert abs(limbs.superbracket(points)) == pytest.approx(ac * abs(det), abs=ROUNDING * scale * (1 + ac))


def test_both_factors_of_an_ruu_limb_vanish_with_the_rod_upright_and_the_second_tells_how_far_it_is():
    """AB at 0.3 rad, m at 1.9 rad, unit lengths, BC off the vertical by 0.01 rad."""
    ab, m = (cos(0.3), sin(0.3), 0.0), np.array([cos(1.9), sin(1.9), 0.0])
    bc = cos(0.01) * Z + sin(0.01) * np.cross(m, Z)
    f1, f2 = limbs.ruu_factors(FLOATS, ab, bc.tolist(), (0.0, 0.0, 1.0))
    assert f2 == pytest.approx(0.00999983, rel=0, abs=5e-9)  # all to the last printed digit
    assert f1 == pytest.approx(2.91990e-4, rel=0, abs=5e-10)
    det = np.linalg.det(limbs.ruu_jacobian(np.zeros(3), ab, ab + bc, Z, m, (0.3, 0.2, 0.1)))
    assert abs(det) == pytest.approx(2.919855e-6, rel=0, abs=5e-13)


@pytest.mark.parametrize(
    ("psi", "f2", "det"), [(0.1, 0.0998, 9.8e-3), (0.01, 0.0100, 9.8e-5)], ids=["0.1 rad", "0.01 rad"]
)
def test_the_determinant_falls_with_the_square_of_the_angle_from_the_vertical(psi, f2, det):
    """Sheet: AB at 0.3 rad, m at 0.5 rad, unit lengths; BC leaves the vertical across m."""
    ab, m = np.array([cos(0.3), sin(0.3), 0.0]), np.array([cos(0.5), sin(0.5), 0.0])
    bc = sin(psi) * np.cross(Z, m) + cos(psi) * Z
    stated = limbs.ruu_factors(FLOATS, ab.tolist(), bc.tolist(), (0.0, 0.0, 1.0))[1]
    value = abs(np.linalg.det(limbs.ruu_jacobian(np.zeros(3), ab, ab + bc, Z, m, (0.0, 0.0, 0.0))))
    assert stated == pytest.approx(f2, abs=5e-5)
    assert value == pytest.approx(det, rel=0.01)


def ruu_rank(a, b, c, m):
    return np.linalg.matrix_rank(limbs.ruu_twists(a, b, c, Z, m), tol=1e-9)


RUU_SINGULAR = {  # B relative to A, C relative to B, m; the words that must come first or second
    "the plane ABC contains z": ((1.0, 0.0, 0.0), (0.6, 0.0, 0.8), (0.0, 1.0, 0.0)),
    "A, B, C in line": ((1.0, 0.0, 0.0), (-1.5, 0.0, 0.0), (0.0, 1.0, 0.0)),
    "AC parallel to z": ((1.0, 0.0, 0.0), (-1.0, 0.0, 0.7), (0.0, 1.0, 0.0)),
    "BC parallel to z": ((1.0, 0.0, 0.0), (0.0, 0.0, -1.2), (cos(0.4), sin(0.4), 0.0)),
}


@pytest.mark.parametrize("words", RUU_SINGULAR)
def test_an_ruu_limb_is_singular_under_each_listed_condition(words):
    ab, bc, m = (np.array(vector) for vector in RUU_SINGULAR[words])
    a = np.array([0.3, -0.2, 0.1])
    assert ruu_rank(a, a + ab, a + ab + bc, m) == 4
    assert limbs.limb_margin(limbs.ruu_twists(a, a + ab, a + ab + bc, Z, m), 1.0, a) < ROUNDING
    stated = {c.words: c.value for c in limbs.ruu_conditions(a, a + ab, a + ab + bc, Z)}
    assert stated[words] < ROUNDING
    assert min(limbs.ruu_factors(FLOATS, unit(ab).tolist(), unit(bc).tolist(), (0.0, 0.0, 1.0))) < ROUNDING


def test_an_ruu_limb_is_singular_nowhere_else():
    """The margins and the smallest singular value are positive together and bound each other."""
    rng = np.random.default_rng(4)
    for _ in range(300):
        a, b, c, z, m, _ = random_ruu(rng)
        margin = min(limbs.ruu_factors(FLOATS, unit(b - a).tolist(), unit(c - b).tolist(), (0.0, 0.0, 1.0)))
        length = max(np.linalg.norm(b - a), np.linalg.norm(c - b))
        sigma = limbs.limb_margin(limbs.ruu_twists(a, b, c, z, m), length, b)
        assert (sigma > 1e-4) == (margin > 1e-4) or margin < 0.01
        values = [condition.value for condition in limbs.ruu_conditions(a, b, c, z)]
        assert values == sorted(values)
        assert all(0 <= value <= 1 + ROUNDING for value in values)
        assert values[0] == pytest.approx(margin, abs=ROUNDING), "no listed condition is nearer than the margin says"


PRPIR_SINGULAR = {  # l in the frame (x, y, z)
    "AC at right angles to the slide": ((0.0, 0.6, 0.8), 3),
    "AC parallel to y = z x slide": ((0.0, 1.0, 0.0), 3),
}


@pytest.mark.parametrize("words", PRPIR_SINGULAR)
def test_a_prpir_limb_is_singular_under_each_listed_condition(words):
    l, rank = PRPIR_SINGULAR[words]
    x, a = np.array([1.0, 0.0, 0.0]), np.array([0.4, 0.1, -0.3])
    c = a + 1.7 * np.array(l)
    twists = limbs.prpir_twists(a, c, x, Z, np.cross(Z, l))
    assert np.linalg.matrix_rank(twists, tol=1e-9) == rank
    assert limbs.limb_margin(twists, 1.7, a) < ROUNDING
    stated = {condition.words: condition.value for condition in limbs.prpir_conditions(a, c, x, Z)}
    assert stated[words] < ROUNDING


def test_a_flat_parallelogram_is_singular_too_and_its_rank_depends_on_the_normal():
    """l parallel to z: the normal may be any direction across z; rank 3, or 2 if it is parallel to y (sheet)."""
    x, a, c = np.array([1.0, 0.0, 0.0]), np.zeros(3), np.array([0.0, 0.0, 0.9])
    for n, rank in (((1.0, 0.0, 0.0), 3), ((0.0, 1.0, 0.0), 2)):
        assert np.linalg.matrix_rank(limbs.prpir_twists(a, c, x, Z, n), tol=1e-9) == rank
    across, flat = limbs.prpir_factors(FLOATS, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    assert across == flat == 0.0
    assert limbs.prpir_conditions(a, c, x, Z)[0].value == 0.0


def test_a_prpir_limb_is_singular_nowhere_else():
    rng = np.random.default_rng(5)
    for _ in range(300):
        a, c, x, z, n, _ = random_prpir(rng)
        l = unit(c - a)
        margin = min(limbs.prpir_factors(FLOATS, l.tolist(), x.tolist(), z.tolist()))
        sigma = limbs.limb_margin(limbs.prpir_twists(a, c, x, z, n), np.linalg.norm(c - a), a)
        assert (sigma > 1e-4) == (margin > 1e-4) or margin < 0.01
        conditions = limbs.prpir_conditions(a, c, x, z)
        assert conditions[0].value == pytest.approx(margin, abs=ROUNDING)


def test_the_margin_of_a_limb_by_its_joints_depends_on_the_unit_of_length_only_through_its_length():
    """The same limb in millimetres, moved away, with its length in millimetres, has the same margin."""
    rng = np.random.default_rng(6)
    a, b, c, z, m, _ = random_ruu(rng)
    away = np.array([3.0, -5.0, 2.0])
    here = limbs.limb_margin(limbs.ruu_twists(a, b, c, z, m), 0.8, b)
    twists = limbs.ruu_twists(*(1000 * (p + away) for p in (a, b, c)), z, m)
    assert limbs.limb_margin(twists, 800.0, 1000 * (b + away)) == pytest.approx(here, rel=1e-9)


def test_a_limb_of_any_joints_has_the_smallest_singular_value_as_margin():
    """Two parallel revolutes 0.5 apart: twists (z; 0) and (z; 0.5 along -y) about the first, divided by 0.5."""
    twists = [limbs.revolute((0, 0, 2), (0, 0, 0)), limbs.revolute((0, 0, 1), (0.5, 0, 0))]
    rows = np.array([[1.0, 0.0], [1.0, -1.0]])
    assert limbs.limb_margin(twists, 0.5) == pytest.approx(np.linalg.svd(rows)[1][-1])
    assert limbs.limb_margin([limbs.prismatic((1, 0, 0)), limbs.prismatic((0, 3, 0))], 0.5) == pytest.approx(1.0)


@pytest.mark.parametrize(
    "call",
    [
        lambda: limbs.revolute((0, 0, 0), (0, 0, 0)),
        lambda: limbs.prismatic((np.nan, 0, 0)),
        lambda: limbs.limb_margin(np.ones((7, 6)), 1.0),
        lambda: limbs.limb_margin(np.ones((2, 6)), 0.0),
        lambda: limbs.limb_margin(np.ones((2, 6)), float("nan")),
        lambda: limbs.limb_margin(np.ones((2, 6)), "1"),
        lambda: limbs.limb_margin([[float("nan")] * 6], 1.0),
        lambda: limbs.limb_margin([["a"] * 6], 1.0),
        lambda: limbs.limb_margin("abc", 1.0),
        lambda: limbs.limb_margin(np.ones((2, 6)), 1.0, (1, 2)),
        lambda: limbs.limb_margin(np.ones((2, 6)), 1.0, (float("nan"), 0, 0)),
        lambda: limbs.revolute((0, 0, 1), (1, 2)),
        lambda: limbs.revolute((0, 0, 1), (float("inf"), 0, 0)),
        lambda: limbs.revolute(("a", 0, 1), (0, 0, 0)),
        lambda: limbs.prismatic("xyz"),
    ],
)
def test_nonsense_is_refused(call):
    with pytest.raises(BadInput):
        call()


def test_factors_of_arrays_are_those_of_floats():
    rng = np.random.default_rng(7)
    limb = [random_ruu(rng) for _ in range(20)]
    ab, bc = (np.array([unit(l[j] - l[i]) for l in limb]) for i, j in ((0, 1), (1, 2)))
    many = limbs.ruu_factors(ARRAYS, tuple(ab.T), tuple(bc.T), (0.0, 0.0, 1.0))
    each = [limbs.ruu_factors(FLOATS, p.tolist(), q.tolist(), (0.0, 0.0, 1.0)) for p, q in zip(ab, bc, strict=True)]
    np.testing.assert_allclose(np.transpose(many), each, atol=ROUNDING)
