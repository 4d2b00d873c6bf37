"""Systems of equations: exact numbers, checks at creation, substitution; roots; fibres."""

from __future__ import annotations

import subprocess
import sys
from fractions import Fraction
from math import atan2, cos, pi, sin

import numpy as np
import pytest

pytest.importorskip("flint", reason="python-flint is an optional extra")

from irsbot_kinematics import algebra, make_robot, robots
from irsbot_kinematics.algebra.model.exact import angle_pair, exact, simplest_between, square_root
from irsbot_kinematics.algebra.model.fibre import Fibre
from irsbot_kinematics.algebra.model.finite import generic_fibre
from irsbot_kinematics.algebra.model.polynomial import context
from irsbot_kinematics.algebra.model.roots import roots_between

CIRCLES = ["x^2 + y^2 = r1^2", "(x - 1)^2 + y^2 = r2^2"]


def system(equations=CIRCLES, **stated):
    return algebra.System(equations, **{"pose": ["x", "y"], "joints": ["r1", "r2"], **stated})


def test_decimals_are_taken_as_written():
    assert exact("17.04") == exact(17.04) == Fraction(426, 25)
    poly = algebra.predefined("rprrp", h="0.1").polys()[1]
    assert "1/10" in str(poly) or "1/5" in str(poly)  # (y - 1/10)^2, not the binary 0.1


@pytest.mark.parametrize("value", [0.1 + 0.2, float("nan"), float("inf"), "x", None, True, 1j])
def test_a_value_that_is_not_exact_is_refused_in_one_line(value):
    with pytest.raises(algebra.AlgebraError) as refused:
        exact(value, "rho1")
    assert "rho1" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_roots_and_angles_are_rationalised_to_the_stated_digits():
    root = square_root(Fraction(3), 40)
    assert abs(root**2 - 3) < Fraction(4, 10**40)
    assert square_root(Fraction(9, 4), 3) == Fraction(3, 2)
    c, s = angle_pair(0.7, "a")
    assert c * c + s * s == 1
    assert atan2(s, c) == pytest.approx(0.7, abs=1e-14)
    assert angle_pair(pi, "a") == (-1, 0)


@pytest.mark.parametrize(
    ("low", "high"),
    [
        (Fraction(1, 3), Fraction(1, 2)),
        (Fraction(-7, 2), Fraction(-10, 3)),
        (Fraction(2), Fraction(5, 2)),
        (Fraction(-1), Fraction(1)),
    ],
)
def test_the_simplest_fraction_between(low, high):
    found = simplest_between(low, high)
    assert low < found < high
    for q in range(1, found.denominator):
        assert not any(low < Fraction(p, q) < high for p in range(int(low * q) - 1, int(high * q) + 2))


@pytest.mark.parametrize(
    ("stated", "word"),
    [
        ({"equations": [*CIRCLES, "x = y"]}, "3 equations for 2"),
        ({"equations": ["x^2 + z = r1", "y = r2"]}, "'z' is not declared"),
        ({"joints": ["r1", "x"]}, "more than once"),
        ({"equations": ["(x^2 + y^2 - r1^2)^2", "x - r2"]}, "not radical"),
        ({"equations": ["(x + y)*(x - r1)", "(x + y)*(y - r2)"]}, "not zero-dimensional"),
        ({"equations": ["x + y = r1", "x + y = r2"]}, "contradict"),
        ({"equations": ["x^2 + y^2 = r1^2", "x ** 2.5 = r2"]}, "exponent"),
        ({"equations": ["x^2 = 2*(", "y = r2"]}, "no expression"),
        ({"equations": ["__import__('os')", "y = r2"]}, "not allowed"),
        ({"inequalities": ["r1 >= 0"]}, "strict"),
        ({"angles": ["x"]}, "is an angle"),
        ({"pose": "xy"}, "must be a list"),
        ({"joints": ["r1", "r2", "r3"]}, "redundant"),
        ({"equations": ["x^2 + y^2 = r1^2", "y/x = r2"]}, "0/0"),  # at x = y = 0
        ({"equations": ["tan(a)*x = y", "x = r1"], "joints": ["r1", "a"], "angles": ["a"]}, "0/0"),  # at a quarter turn
        ({"equations": ["x^2 + y^2 = r1^2", "x/(k - k) = r2"], "parameters": {"k": 1}}, "by zero"),
        ({"equations": ["x^2 + y^2 = r1^2", "x/k = r2"], "parameters": {"k": 0}}, "by zero"),
        ({"inequalities": ["x/k > 0"], "parameters": {"k": 0}}, "by zero"),
    ],
)
def test_a_bad_system_is_refused_in_one_line(stated, word):
    with pytest.raises(algebra.AlgebraError) as refused:
        system(**stated)
    assert word in str(refused.value)
    assert "\n" not in str(refused.value)


def test_denominators_cancel_and_keep_the_solutions():
    """Of equations of one unknown, the solutions by hand."""

    def solutions(equation, r, **more):
        s = algebra.System([equation], ["x"], ["r"], **more)
        return [c.pose["x"] for c in algebra.configurations(s, {"r": r})]

    assert solutions("x*x/x = r", 3) == [3.0]  # and not 0
    assert solutions("1/x = r", 4) == [0.25]
    assert solutions("(x^2 - 1)/(x - 1) = r/2", 6) == [2.0]  # and not 1
    assert solutions("x/k = r", 4, parameters={"k": "1/2"}) == [2.0]
    assert solutions("tan(r) = x", (Fraction(3, 5), Fraction(4, 5)), angles=["r"]) == pytest.approx([4.0 / 3.0])
    for inequality in ("1/x > 0", "r/x^3 < r", "0 < x/x^2"):
        assert solutions("x = r", -2, inequalities=[inequality]) == []
        assert solutions("x = r", 2, inequalities=[inequality]) == [2.0]
    half = algebra.System(["x/k = r"], ["x"], ["r"], parameters={"k": None})
    assert [c.pose["x"] for c in algebra.configurations(half.assign(k=2), {"r": 3})] == [6.0]
    with pytest.raises(algebra.AlgebraError, match="by zero"):
        half.assign(k=0)
    with pytest.raises(algebra.AlgebraError, match="divides by x"):
        half.expression("r/x")


def test_an_inequality_with_a_tangent_has_its_sign():
    s = algebra.System(["x = cos(a)"], ["x"], ["a"], angles=["a"], inequalities=["tan(a) > 0"])
    for sine, cosine, number in ((1, 1, 1), (1, -1, 0), (-1, 1, 0), (-1, -1, 1)):
        assert len(algebra.configurations(s, {"a": (Fraction(3 * cosine, 5), Fraction(4 * sine, 5))})) == number


def test_substitution_keeps_cosine_and_sine_together():
    one = algebra.System(["x = cos(a)", "y = sin(a)"], pose=["x", "y"], joints=["a"], angles=["a"])
    two = one.substitute({"a": "a1 + a2"})
    assert two.joints == ("a1", "a2")
    values = {"a1": (Fraction(3, 5), Fraction(4, 5)), "a2": (Fraction(5, 13), Fraction(12, 13))}
    left = two.polys(two.point(values))
    assert str(left[0]) == "x + 33/65"  # cos(a1 + a2) = 3/5 5/13 - 4/5 12/13
    assert str(left[1]) == "y - 56/65"
    fixed = system(["x = cos(a)*r1", "y = sin(a)*r2"], angles=["a"], parameters={"a": None}).substitute({"a": 0.7})
    assert fixed.joints == ("r1", "r2")
    c, s = fixed.values["a"]
    assert (float(c), float(s)) == pytest.approx((cos(0.7), sin(0.7)), abs=1e-14)


def test_parameters_are_assigned_and_released():
    s = algebra.predefined("rprrp")
    free = s.unassign("h")
    assert not free.assigned
    with pytest.raises(algebra.AlgebraError, match="assign"):
        algebra.project(free)
    assert free.assign(h="1/2").values == s.values
    assert any("h" in str(factor) for factor in algebra.singularities(free, "parallel")[0])
    with pytest.raises(algebra.AlgebraError, match="no parameter"):
        s.assign(q=1)


# Complex degrees of the direct kinematics: sheet of the algebra, section 2.
DEGREES = {
    "3rpr": 6, "3rpr_full": 6, "3prr": 6, "rpr_2prr": 6, "prp_2prr": 6, "rprrp": 2, "prrp": 2, "rr_rrr": 2,
    "3ppps": 8, "serial_3r": 1, "orthoglide": 2, "hybridglide": 2, "triaglide": 2, "uranesx": 2, "rrr3": 4,
}  # fmt: skip


@pytest.mark.parametrize("name", DEGREES)
def test_direct_kinematics_has_the_known_complex_degree(name):
    fibre = generic_fibre(algebra.predefined(name))
    assert fibre.dimension == DEGREES[name]
    assert fibre.radical


SMALL = ("linear_delta", "rpr3", "rails2", "rails3")
"""Slides of less than a metre."""


@pytest.mark.parametrize("name", robots())
def test_the_system_of_a_shipped_robot_closes_where_the_robot_does(name):
    robot = make_robot(name)
    s = algebra.of_robot(robot)
    rng = np.random.default_rng(3)
    tried = 0
    while tried < 3:
        q = rng.uniform(0.2, 0.6 if name in SMALL else 2.8, len(s.joints))
        poses = robot.direct_all(q)
        for pose in poses:
            at = {}
            for variable, value in [*zip(s.pose, pose, strict=True), *zip(s.joints, q, strict=True)]:
                at |= (
                    {f"cos_{variable}": cos(value), f"sin_{variable}": sin(value)}
                    if variable in s.angles
                    else {variable: value}
                )
            for poly in s.polys():
                names = poly.context().names()
                terms = [
                    float(c.p) / float(c.q) * np.prod([at.get(n, 0.0) ** int(k) for n, k in zip(names, m, strict=True)])
                    for m, c in zip(poly.monoms(), poly.coeffs(), strict=True)
                ]
                assert abs(sum(terms)) < 1e-9
        tried += bool(poses)


def test_unknown_names_and_lengths_are_refused():
    with pytest.raises(algebra.AlgebraError, match="known are"):
        algebra.predefined("4rpr")
    with pytest.raises(algebra.AlgebraError, match="no length 'd9'"):
        algebra.predefined("3rpr", d9=1)
    with pytest.raises(algebra.AlgebraError, match="no platform triangle"):
        algebra.predefined("3rpr", d2=100)
    for name, key in (("3rpr", "digits"), ("3ppps", "digits"), ("3prs_v", "digits"), ("uranesx", "half_root_3")):
        for value in (-1, 10**6):
            with pytest.raises(algebra.AlgebraError, match="digits"):
                algebra.predefined(name, **{key: value})
    for wrong in ("-1", "6.5", "a", None, True, float("nan")):
        with pytest.raises(algebra.AlgebraError):
            algebra.predefined("3rpr", digits=wrong)
    assert algebra.predefined("3rpr", digits="6").values == algebra.predefined("3rpr", digits=6).values
    assert set(algebra.names()) >= {*DEGREES, "3prs_v", "3prs_h", *robots()}


def test_beta_replaces_d2_and_gives_the_printed_platform():
    s = algebra.predefined("3rpr")
    assert float(s.values["b3x"]) == pytest.approx(13.2363732394, abs=1e-10)
    assert float(s.values["b3y"]) == pytest.approx(16.0967084668, abs=1e-10)
    by_angle = algebra.predefined("3rpr", beta=0.8826031098, d2=1)
    assert float(by_angle.values["b3x"]) == pytest.approx(13.2363732394, abs=1e-8)


def test_real_roots_agree_with_a_companion_matrix_and_are_enclosed():
    rng = np.random.default_rng(5)
    for _ in range(20):
        row = rng.integers(-9, 10, 8).tolist()
        row[-1] = row[-1] or 1
        found = algebra.real_roots(row)
        roots = np.roots(row[::-1])
        real = sorted(r.real for r in roots if abs(r.imag) < 1e-9)
        assert [float(r) for r in found] == pytest.approx(real, abs=1e-7)
        for root in found:
            assert root.low <= root.high
            assert root.high - root.low < Fraction(1, 10**9)


def test_multiple_and_close_roots_are_told_apart():
    assert [float(r) for r in algebra.real_roots([0, 0, 1])] == [0.0]
    near = algebra.real_roots([Fraction(1) + Fraction(1, 10**40), Fraction(-2) - Fraction(1, 10**40), 1])
    assert len(near) == 2  # 1 and 1 + 1e-40
    assert near[0].before(near[1])
    assert near[0].compare(Fraction(1)) == 0


def test_an_open_interval_does_not_count_its_ends():
    square = [-2, 0, 1]
    assert algebra.is_interval_empty(square, 0, 1)
    assert not algebra.is_interval_empty(square, 1, 2)
    assert algebra.is_interval_empty([0, -1, 1], 0, 1)  # roots 0 and 1
    assert not algebra.is_interval_empty([0, -1, 1], -1, "1/2")
    with pytest.raises(algebra.AlgebraError, match="a < b"):
        algebra.is_interval_empty(square, 1, 1)
    with pytest.raises(algebra.AlgebraError, match="every number"):
        algebra.real_roots([0, 0])


def test_a_sturm_chain_counts_as_the_isolation_does():
    rng = np.random.default_rng(8)
    from irsbot_kinematics.algebra.model.roots import integer_poly

    for _ in range(20):
        row = rng.integers(-5, 6, 7).tolist()
        row[-1] = row[-1] or 2
        inside = [
            r for r in algebra.real_roots(row) if r.compare(Fraction(-3, 2)) > 0 and r.compare(Fraction(7, 5)) < 0
        ]
        assert roots_between(integer_poly(row), Fraction(-3, 2), Fraction(7, 5)) == len(inside)


def test_multiplicities_of_a_fibre():
    ring = context(("x", "y"))
    x, y = ring.gens()
    fibre = Fibre([y - x * x, (x - 1) ** 2 * (x + 2)], ("x", "y"))
    assert (fibre.dimension, fibre.distinct, fibre.count()) == (3, 2, 2)
    assert sorted(fibre.multiplicities) == [1, 2]
    assert sorted(float(r["x"].mid()) for r in fibre.real()) == pytest.approx([-2.0, 1.0])
    assert len(fibre.accepted([x + 1])) == 1
    assert len(fibre.accepted([x - 1])) == 0  # zero is not positive


def test_without_python_flint_one_sentence_names_the_package():
    code = (
        "import sys; sys.modules['flint'] = None\n"
        "from irsbot_kinematics import algebra\n"
        "try: algebra.predefined('3rpr')\n"
        "except algebra.AlgebraUnavailable as error: print(error)\n"
    )
    import os

    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    assert "pip install python-flint" in done.stdout, done.stderr


def test_importing_the_library_does_not_load_the_algebra():
    import os

    code = "import sys, irsbot_kinematics; print([m for m in sys.modules if 'flint' in m or '.algebra' in m])"
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    assert done.stdout.strip() == "[]", done.stderr
