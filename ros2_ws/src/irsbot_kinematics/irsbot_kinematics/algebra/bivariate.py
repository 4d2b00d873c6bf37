"""Discriminants and resultants of polynomials in two names, by evaluation at integers and exact interpolation."""

from __future__ import annotations

from typing import Any

from irsbot_kinematics.algebra.model.engine import flint
from irsbot_kinematics.algebra.model.polynomial import univariate

SMALL_DEGREE = 24
"""1: up to this product of degrees, flint's own resultant is faster."""


class Curve:
    """A polynomial of Z[u, v] as rows of coefficients: powers of v, each a polynomial in u."""

    def __init__(self, poly: Any) -> None:
        self.poly = poly
        self.u, self.v = poly.context().names()
        self.du, self.dv = (int(d) for d in poly.degrees())
        table = [[0] * (self.du + 1) for _ in range(self.dv + 1)]
        for (i, k), c in poly.to_dict().items():
            table[int(k)][int(i)] = int(c)
        self.rows = [flint.fmpz_poly(row) for row in table]
        self.columns = [flint.fmpz_poly([table[k][i] for k in range(self.dv + 1)]) for i in range(self.du + 1)]

    def at_u(self, p: int, q: int = 1) -> Any:
        """The polynomial in v at u = p/q, times q^du: fmpz_poly."""
        return flint.fmpz_poly([_homogeneous(row, p, q, self.du) for row in self.rows])

    def at_v(self, p: int, q: int = 1) -> Any:
        """The polynomial in u at v = p/q, times q^dv."""
        return flint.fmpz_poly([_homogeneous(column, p, q, self.dv) for column in self.columns])

    def leading(self) -> Any:
        """Coefficient of the highest power of v, a polynomial in u."""
        return self.rows[-1]


def _homogeneous(poly: Any, p: int, q: int, degree: int) -> int:
    if q == 1:
        return int(poly(p))
    total, power = 0, q ** (degree - int(poly.degree())) if poly.degree() >= 0 else 1
    for k in range(int(poly.degree()), -1, -1):
        total = total * p + int(poly[k]) * power
        power *= q
    return total


def discriminant(curve: Curve) -> Any:
    """Discriminant in v, a polynomial in u; leading coefficients may add factors."""
    if curve.du * curve.dv <= SMALL_DEGREE:
        return univariate(curve.poly.discriminant(curve.v), curve.u)
    m, total = curve.dv, int(curve.poly.total_degree())
    degree = min(2 * (m - 1) * curve.du, 2 * (m - 1) * total - m * (m - 1))  # it is isobaric
    return _interpolated(lambda at: int(curve.at_u(at).discriminant()), curve.leading(), degree)


def resultant(first: Curve, second: Curve) -> Any:
    """Resultant in v, a polynomial in u."""
    if (first.du + second.du) * (first.dv + second.dv) <= 4 * SMALL_DEGREE:
        return univariate(first.poly.resultant(second.poly, first.v), first.u)
    m, n = first.dv, second.dv
    totals = int(first.poly.total_degree()), int(second.poly.total_degree())
    degree = min(m * second.du + n * first.du, m * totals[1] + n * totals[0] - m * n)
    lead = first.leading() * second.leading()
    return _interpolated(lambda at: int(first.at_u(at).resultant(second.at_u(at))), lead, degree)


def _interpolated(value: Any, leading: Any, degree: int) -> Any:
    """The integer polynomial of at most that degree with given values at integers where `leading` is not 0.

    Newton's divided differences; they are integers times rationals, so fmpq. Stops early only at the full degree.
    """
    points: list[int] = []
    at = 0
    while len(points) <= degree:
        if leading(at) != 0:
            points.append(at)
        at = -at if at > 0 else -at + 1
    row = [flint.fmpq(value(p)) for p in points]
    for step in range(1, len(points)):
        for i in range(len(points) - 1, step - 1, -1):
            row[i] = (row[i] - row[i - 1]) / (points[i] - points[i - step])
    total = flint.fmpq_poly(0)
    for coefficient, p in zip(reversed(row), reversed(points), strict=True):
        total = total * flint.fmpq_poly([-p, 1]) + coefficient
    return total.numer()
