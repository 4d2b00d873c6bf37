"""Singularities and their projections: Tables 3 and 4 of [S4], closed forms of the sheet, sampled postures."""

from __future__ import annotations

from fractions import Fraction
from math import cos, sin, sqrt

import numpy as np
import pytest

pytest.importorskip("flint", reason="python-flint is an optional extra")

from irsbot_kinematics import algebra, make_robot
from irsbot_kinematics.algebra.delta_forms import delta_projection
from irsbot_kinematics.algebra.elimination import eliminate
from irsbot_kinematics.algebra.model.polynomial import context, irreducible, moved, primitive, public

# (degree, degrees, terms, bits) as printed in [S4], Tables 3 and 4, corrected as docs/explanation/sources.md lists.
TABLES = {
    ("orthoglide", "parallel", "pose"): (18, (10, 10, 10), 97, 15),
    ("orthoglide", "parallel", "joint"): (6, (4, 4, 4), 10, 4),
    ("orthoglide", "serial", "pose"): (6, (4, 4, 4), 17, 6),
    ("orthoglide", "serial", "joint"): (18, (12, 12, 12), 62, 12),
    ("hybridglide", "parallel", "pose"): (20, (16, 8, 12), 119, 17),
    ("hybridglide", "parallel", "joint"): (6, (4, 4, 4), 25, 6),
    ("hybridglide", "serial", "pose"): (6, (6, 2, 4), 15, 6),
    ("hybridglide", "serial", "joint"): (18, (12, 12, 12), 281, 17),
    ("triaglide", "parallel", "pose"): (3, (0, 0, 3), 2, 2),
    ("triaglide", "parallel", "joint"): (6, (4, 4, 4), 41, 6),
    ("triaglide", "serial", "pose"): (6, (6, 0, 6), 10, 6),
    ("triaglide", "serial", "joint"): (6, (6, 6, 6), 42, 7),
    ("uranesx", "parallel", "pose"): (6, (6, 4, 0), 15, 45),
    ("uranesx", "parallel", "joint"): (6, (4, 4, 4), 41, 59),
    ("uranesx", "serial", "pose"): (6, (6, 6, 0), 13, 42),
    ("uranesx", "serial", "joint"): (12, (12, 12, 12), 252, 175),
}


@pytest.mark.parametrize(("name", "kind", "space"), TABLES)
def test_tables_3_and_4(name, kind, space):
    found = algebra.project(algebra.predefined(name), kind, space)
    assert (found.degree, found.degrees, found.terms, found.height_bits) == TABLES[name, kind, space]


def test_another_rational_root_of_3_gives_the_heights_of_the_sheet():
    s = algebra.predefined("uranesx", half_root_3="84/97")
    heights = [algebra.project(s, k, p).height_bits for k in ("parallel", "serial") for p in ("pose", "joint")]
    assert heights == [35, 50, 36, 135]


def test_factors_of_the_delta_robots():
    ortho = algebra.project(algebra.predefined("orthoglide"), "parallel", "pose")
    assert [(p.degree, p.terms) for p in ortho] == [(2, 4), (14, 33)]
    assert {str(p) for p in algebra.project(algebra.predefined("triaglide"), "parallel", "pose")} == {
        "z",
        "z - 2",
        "z + 2",
    }
    assert len(algebra.project(algebra.predefined("hybridglide"), "parallel", "pose")) == 1


@pytest.mark.parametrize("name", ["orthoglide", "hybridglide", "triaglide", "uranesx"])
def test_the_closed_forms_agree_with_a_cascade_of_resultants(name):
    """The same hypersurface by another way, in the slice x = 1/3 (rho1 = 1/3), up to real factors."""
    s = algebra.predefined(name)
    for kind, space, first in (("parallel", "pose", "x"), ("parallel", "joint", "rho1"), ("serial", "pose", "x")):
        names = s.pose if space == "pose" else s.joints
        keep, drop = [n for n in names if n != first], list(s.joints if space == "pose" else s.pose)
        fixed = s.point({first: "1/3"})
        det = primitive(s.evaluated(s.reader.polynomial(str(algebra.singularities(s, kind)[0][-1]), "det"), fixed))
        if len(algebra.singularities(s, kind)) > 1:
            continue
        ring = context((*keep, *drop))
        again = {public(p) for p in eliminate([*(moved(p, ring) for p in s.polys(fixed)), det], keep, drop)}
        closed = delta_projection(s.structure, kind, space, names)
        there = {public(f) for f, _ in irreducible(_slice(closed, first))}
        assert again <= there
        assert again


def _slice(poly, first):
    whole = context(poly.context().names()).from_dict({m: int(c) for m, c in poly.to_dict().items()})
    from irsbot_kinematics.algebra.model.polynomial import rational

    names = [n for n in poly.context().names() if n != first]
    return primitive(moved(whole.subs({first: rational(Fraction(1, 3))}), context(names)))


def test_projections_vanish_at_singular_postures_found_by_bisection():
    """Orthoglide, a parallel singularity inside the limits (sheet of other mechanisms, section 8)."""
    pose, joints = (0.2313434865, 1.027998437, 1.276673092), (1.377347426, 2.550031947, 2.97658468)
    s = algebra.predefined("orthoglide")
    at_pose = [abs(p.values(np.array([pose]))[0]) for p in algebra.project(s, "parallel", "pose")]
    at_joints = [abs(p.values(np.array([joints]))[0]) for p in algebra.project(s, "parallel", "joint")]
    assert min(at_pose) < 1e-8
    assert max(at_joints) < 1e-8


def test_five_bar_is_a_sextic_and_two_circles():
    l1, l2, b = 0.375, 0.825, 0.1375
    circles, sextic = algebra.project(algebra.predefined("rr_rrr"), "parallel", "pose")
    assert (circles.degree, sextic.degree, sextic.terms) == (4, 6, 9)
    h = sqrt(l1**2 - b**2)
    angle = np.linspace(0.0, 6.0, 9)
    for side in (h, -h):
        points = np.stack([l2 * np.cos(angle), side + l2 * np.sin(angle)], axis=1)
        assert np.abs(circles.values(points)).max() < 1e-12
    # Crank ends 2 l2 apart, P in the middle: only complex with these lengths, so an ellipse of small base is not met.
    rng = np.random.default_rng(1)
    points = rng.uniform(-1.5, 1.5, (4000, 2))
    assert (sextic.values(points) > 0).all() or (sextic.values(points) < 0).all()


def test_five_bar_serial_singularities_are_four_circles():
    l1, l2, b = 0.375, 0.825, 0.1375
    found = algebra.project(algebra.predefined("rr_rrr"), "serial", "pose")
    assert len(found) == 4
    for centre in (-b, b):
        for radius in (l2 - l1, l2 + l1):
            points = np.array([[centre + radius * cos(a), radius * sin(a)] for a in (0.3, 1.7, 4.0)])
            assert min(np.abs(p.values(points)).max() for p in found) < 1e-12


def test_determinants_of_the_sheet():
    def last(name, kind):
        return {str(c[-1]) for c in algebra.singularities(algebra.predefined(name), kind)}

    assert last("3rpr", "serial") == {"rho1", "rho2", "rho3"}
    assert last("rprrp", "parallel") <= {"2*y*r2 - x", "-2*y*r2 + x", "-x + 2*y*r2", "x - 2*y*r2"}
    assert last("prrp", "parallel") <= {"5*y - 3*r", "-3*r + 5*y", "3*r - 5*y", "-5*y + 3*r"}
    assert last("3ppps", "serial") == set()
    assert len(last("3ppps", "parallel")) == 2
    assert any(text == "sin_phi" for text in last("prp_2prr", "serial"))
    assert len(last("rpr_2prr", "serial")) == 3


def test_3ppps_determinant_is_e_x_times_n_z():
    factors = [c[-1] for c in algebra.singularities(algebra.predefined("3ppps"), "parallel")]
    rng = np.random.default_rng(2)
    for _ in range(20):
        a, b, c, d = (float(v) for v in rng.normal(size=4))
        e_x, n_z = a * a + b * b - c * c - d * d, a * a - b * b - c * c + d * d
        values = sorted(abs(p.at({"a": a, "b": b, "c": c, "d": d})) for p in factors)
        assert values == pytest.approx(sorted([abs(e_x), abs(n_z)]))


def test_the_determinant_vanishes_where_the_robot_has_no_type_2_margin():
    """rrr3: det A = 0 on the circle |p|^2 = K for every turn (sheet of other mechanisms, section 1)."""
    robot, s = make_robot("rrr3"), algebra.predefined("rrr3")
    factors = [c[-1] for c in algebra.singularities(s, "parallel")]
    rb, rp, phi = robot.mechanism.geometry.rb, robot.mechanism.geometry.rp, 0.7
    r = sqrt(rb**2 + rp**2 - 2 * rb * rp * cos(phi))
    for angle in (0.2, 2.0, 5.0):
        at = {"x": r * cos(angle), "y": r * sin(angle), "cos_phi": cos(phi), "sin_phi": sin(phi)}
        scale = max(map(abs, factors[1].coefficients.values()))
        assert min(abs(p.at(at)) / scale for p in factors if "x" in str(p)) < 1e-12


def test_two_operation_modes_of_the_3prs():
    for name in ("3prs_v", "3prs_h"):
        components = algebra.constraint_equations(algebra.predefined(name))
        assert [str(c[0]) for c in components] == ["a", "d"]
        assert len(components[0]) == 4
    assert algebra.constraint_equations(algebra.predefined("orthoglide")) == []


def test_infinite_equations():
    assert algebra.infinite_equations(algebra.predefined("3rpr", digits=4)) == []
    assert algebra.infinite_equations(algebra.predefined("rprrp")) == []
    assert algebra.infinite_equations(algebra.predefined("rprrp", h=0)) != []
    five_bar = algebra.infinite_equations(algebra.predefined("rr_rrr"))
    l1, b = 0.375, 0.1375
    c = b / l1  # crank ends coincide at (0, +-sqrt(l1^2 - b^2))
    for side in (1.0, -1.0):
        at = {"cos_q1": c, "sin_q1": side * sqrt(1 - c * c), "cos_q2": -c, "sin_q2": side * sqrt(1 - c * c)}
        assert all(abs(p.at(at)) < 1e-6 * max(map(abs, p.coefficients.values())) for p in five_bar[0])


def test_work_that_takes_hours_is_refused_with_its_size():
    with pytest.raises(algebra.TooLarge, match="terms"):
        algebra.project(algebra.predefined("3rpr"))
    with pytest.raises(algebra.AlgebraError, match="cannot be fixed"):
        algebra.project(algebra.predefined("3rpr"), fixed={"x": 1})
    with pytest.raises(algebra.AlgebraError, match="kind"):
        algebra.project(algebra.predefined("3rpr"), "diagonal")
