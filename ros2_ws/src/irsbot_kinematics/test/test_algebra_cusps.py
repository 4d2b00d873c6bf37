"""Cusps: the numbers of the sheet, and independent methods."""

from __future__ import annotations

from fractions import Fraction
from math import cos, inf, sin, sqrt

import numpy as np
import pytest

pytest.importorskip("flint", reason="python-flint is an optional extra")

from cusps_of_3rpr import CUSPS

from irsbot_kinematics import algebra
from irsbot_kinematics.algebra.cusps_numeric import numeric_cusps
from irsbot_kinematics.numerics.assembly_roots import planar_closing

pytestmark = pytest.mark.usefixtures("own_cache")


@pytest.mark.parametrize("rho1", CUSPS)
def test_cusps_of_the_3rpr(rho1):
    found = algebra.cusps(algebra.predefined("3rpr"), {"rho1": rho1})
    assert (found.status, found.complex_count) == ("certified", 24)
    rows = [(c.joints["rho2"], c.joints["rho3"], c.pose["phi"]) for c in found]
    for row, printed in zip(rows, CUSPS[rho1], strict=True):
        assert row == pytest.approx(printed, abs=6e-9)
    assert max(c.radius for c in found) < 1e-20


@pytest.mark.parametrize("rho1", ["5", "10", "12.5", "20", "26"])
def test_other_slices_have_six_cusps_too(rho1):
    assert len(algebra.cusps(algebra.predefined("3rpr"), {"rho1": rho1})) == 6


def test_a_cusp_is_a_triple_root_of_the_closing_equation():
    """Independent of the plane map: roots of the companion matrix come together three by three."""
    for rho2, rho3, phi in CUSPS["17"]:
        b = [(0.0, 0.0), (17.04, 0.0), (13.2363732394, 16.0967084668)]
        a = [(0.0, 0.0), (15.91, 0.0), (0.0, 10.0)]

        def closing(turn, lengths=(17.0, rho2, rho3), b=b, a=a):
            c, s = np.cos(turn), np.sin(turn)
            ends = [(bx * c - by * s - ax, bx * s + by * c - ay) for (bx, by), (ax, ay) in zip(b, a, strict=True)]
            return planar_closing(ends, lengths)

        h = 1e-3
        f = closing(phi + h * np.arange(-2, 3))
        scale = np.abs(closing(np.linspace(-3, 3, 50))).max()
        slope = (f[3] - f[1]) / (2 * h)
        bend = (f[3] - 2 * f[2] + f[1]) / h**2
        third = (f[4] - 2 * f[3] + 2 * f[1] - f[0]) / (2 * h**3)
        assert abs(f[2]) < 1e-7 * scale
        assert abs(slope) < 1e-5 * scale
        assert abs(bend) < 1e-3 * abs(third)


@pytest.mark.slow
def test_newton_from_many_starts_finds_the_same_cusps():
    s = algebra.predefined("3rpr")
    found = numeric_cusps(s, "joint", ["rho2", "rho3"], s.point({"rho1": 17}))
    assert found.status == "numeric"
    assert all(cusp.radius == inf for cusp in found)
    rows = sorted((c.joints["rho2"], c.joints["rho3"]) for c in found)
    assert np.array(rows) == pytest.approx(np.array([row[:2] for row in CUSPS["17"]]), abs=1e-7)


def test_cusps_of_the_orthogonal_3r():
    found = algebra.cusps(algebra.predefined("serial_3r"), space="pose")
    rows = sorted({(round(c.pose["x"], 9), round(abs(c.pose["z"]), 9)) for c in found})
    assert np.array(rows) == pytest.approx(
        np.array([(1.355493789, 0.5046704936), (2.465550009, 1.998718695)]), abs=2e-9
    )
    assert len(found) == 4
    for cusp in found:  # the posture closes
        d2, d3, d4, r2 = 1.0, 2.0, 1.5, 1.0
        q = cusp.joints
        A, B = d3 + d4 * cos(q["th3"]), r2 + d4 * sin(q["th3"])
        reach = d2 + A * cos(q["th2"])
        assert reach * cos(q["th1"]) - B * sin(q["th1"]) == pytest.approx(cusp.pose["x"], abs=1e-12)
        assert reach * sin(q["th1"]) + B * cos(q["th1"]) == pytest.approx(0.0, abs=1e-12)
        assert -A * sin(q["th2"]) == pytest.approx(cusp.pose["z"], abs=1e-12)


@pytest.mark.parametrize("d3", [Fraction(2), Fraction(1, 2)])
def test_number_of_cusps_of_orthogonal_3r_on_both_sides_of_every_limit(d3):
    r2, x = 1.0, float(d3)
    a, b = sqrt((x + 1) ** 2 + r2**2), sqrt((x - 1) ** 2 + r2**2)
    m = x * x + r2 * r2
    c1 = sqrt((m - (m * m - x * x + r2 * r2) / (a * b)) / 2)
    c2, c3 = x * a / (1 + x), x * b / abs(x - 1)
    numbers = [(c1, 0, 4), (c2, 4, 2), (c3, 2, 4 if x > 1 else 0)]
    for limit, below, above in numbers:
        for d4, expected in ((limit - 1e-3, below), (limit + 1e-3, above)):
            s = algebra.predefined("serial_3r", d3=d3, d4=f"{d4:.8f}")
            assert len(algebra.cusps(s, space="pose")) == expected
