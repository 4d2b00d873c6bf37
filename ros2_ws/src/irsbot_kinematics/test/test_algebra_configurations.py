"""Configurations: all real solutions of direct and inverse problem, against printed numbers and closed forms."""

from __future__ import annotations

from fractions import Fraction
from math import cos, pi, sin, sqrt

import numpy as np
import pytest

pytest.importorskip("flint", reason="python-flint is an optional extra")


from irsbot_kinematics import algebra
from irsbot_kinematics.algebra.upright_rods import eliminant

pytestmark = pytest.mark.usefixtures("own_cache")


def test_six_configurations_of_the_3rpr():
    found = algebra.configurations(algebra.predefined("3rpr"), {"rho1": 14.98, "rho2": 15.38, "rho3": 12}, order="phi")
    printed = [-0.9869742378, -0.0473313694, 0.245309531, 0.5856727833, 1.00203854, 2.132904365]
    assert [c.pose["phi"] for c in found] == pytest.approx(printed, abs=1e-9)
    for c in found:
        x, y, phi = c.pose.values()
        assert x * x + y * y == pytest.approx(14.98**2)
        assert (x + 17.04 * cos(phi) - 15.91) ** 2 + (y + 17.04 * sin(phi)) ** 2 == pytest.approx(15.38**2)
        assert c.radius < 1e-12
    full = algebra.configurations(
        algebra.predefined("3rpr_full"), {"rho1": 14.98, "rho2": 15.38, "rho3": 12}, order="phi"
    )
    assert [c.pose["phi"] for c in full] == pytest.approx(printed, abs=1e-9)


def test_inverse_solutions_of_the_orthoglide():
    found = algebra.configurations(algebra.predefined("orthoglide"), {"x": 1.3, "y": 1.1, "z": 1.2})
    assert len(found) == 8
    printed = [(0.1381049961, 2.461895004), (0.1672620947, 2.032737905), (0.1511911518, 2.248808848)]
    for name, values in zip(("rho1", "rho2", "rho3"), printed, strict=True):
        assert sorted({round(c.joints[name], 9) for c in found}) == pytest.approx(values, abs=1e-9)
    triaglide = algebra.predefined("triaglide")
    pose = {"x": 0.2, "y": 1.5, "z": 0.7}
    assert len(algebra.configurations(triaglide, pose)) == 2  # within the limits
    assert len(algebra.configurations(triaglide, pose, constraints=False)) == 8


def test_direct_solutions_of_the_uranesx():
    s = algebra.predefined("uranesx", half_root_3=20)
    found = algebra.configurations(s, {"rho1": "3.64237861", "rho2": "1.765621668", "rho3": "2.497069354"})
    printed = [(-0.8827320687, 0.6704222753, 3.718889591), (1.189953517, -0.1984848357, 1.661338118)]
    assert np.array([list(c.pose.values()) for c in found]) == pytest.approx(np.array(printed), abs=1e-8)


def test_eight_solutions_of_the_uranesx_that_the_paper_misses():
    """P = (0, 0, 2): rho_i = 2 +- sqrt 3, all within (0, 4)."""
    found = algebra.configurations(algebra.predefined("uranesx", half_root_3=30), {"x": 0, "y": 0, "z": 2})
    assert len(found) == 8
    assert {round(v, 6) for c in found for v in c.joints.values()} == {round(2 - sqrt(3), 6), round(2 + sqrt(3), 6)}


@pytest.mark.parametrize(
    ("name", "joints", "real"), [("3prs_v", ("0.5", 1, "0.7"), 8), ("3prs_h", ("0.5", 1, "0.7"), 16)]
)
def test_3prs_has_sixteen_solutions(name, joints, real):
    s = algebra.predefined(name)
    values = dict(zip(s.joints, joints, strict=True))
    assert eliminant(s, s.point(values))[0].degree() == 16
    found = algebra.configurations(s, values)
    assert len(found) == real
    for c in found:  # rods, and the planes in which the points stay
        a, b, cc, d = (c.pose[k] for k in "abcd")
        assert min(abs(a), abs(d)) < 1e-9
        rotation = np.array(
            [
                [a * a + b * b - cc * cc - d * d, 2 * (b * cc - a * d), 2 * (b * d + a * cc)],
                [2 * (b * cc + a * d), a * a - b * b + cc * cc - d * d, 2 * (cc * d - a * b)],
                [2 * (b * d - a * cc), 2 * (cc * d + a * b), a * a - b * b - cc * cc + d * d],
            ]
        )
        for k, rho in enumerate(map(float, map(Fraction, joints))):
            turn = 2 * pi * k / 3
            way = np.array([cos(turn), sin(turn), 0.0])
            point = np.array([c.pose["x"], c.pose["y"], c.pose["z"]]) + rotation @ way
            slide = 3.0 * way + [0, 0, rho] if name == "3prs_v" else rho * way
            assert abs(-sin(turn) * point[0] + cos(turn) * point[1]) < 1e-9
            assert np.linalg.norm(point - slide) == pytest.approx(4.0, abs=1e-9)


def test_four_rotations_of_the_3ppps():
    s = algebra.predefined("3ppps")
    joints = {"y1": "-0.1", "z1": "0.05", "y2": "0.3", "z2": "-0.2", "x3": "0.1", "z3": "0.2"}
    found = algebra.configurations(s, joints)
    assert len(found) == 8  # each rotation as two quaternions
    rotations = {tuple(round(v * w, 6) for v in c.pose.values() for w in [np.sign(c.pose["a"])])[3:] for c in found}
    assert len(rotations) == 4
