"""Real roots of integer polynomials: isolated, certified, comparable, with any accuracy."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from irsbot_kinematics.algebra.model.engine import AlgebraError, flint
from irsbot_kinematics.algebra.model.exact import exact
from irsbot_kinematics.algebra.model.polynomial import fraction
from irsbot_kinematics.arguments import checked

START_BITS = 64
"""bit: first precision of an isolation."""


class RealRoot:
    """One real root: a squarefree fmpz_poly, its index among the real roots, and an interval that shrinks on demand."""

    __slots__ = ("bits", "high", "index", "low", "poly")

    def __init__(self, poly: Any, index: int, ball: Any, bits: int) -> None:
        self.poly, self.index, self.bits = poly, index, bits
        self.low, self.high = ends(ball)

    @classmethod
    def restored(cls, poly: Any, index: int, low: Fraction, high: Fraction) -> RealRoot:
        """A root with known index and interval."""
        root = cls.__new__(cls)
        root.poly, root.index, root.bits, root.low, root.high = poly, index, START_BITS, low, high
        return root

    def __float__(self) -> float:
        return float((self.low + self.high) / 2)

    def __repr__(self) -> str:
        return f"RealRoot({float(self):.15g})"

    @property
    def exact(self) -> bool:
        """True if the interval is a single rational number."""
        return self.low == self.high

    def refine(self, bits: int | None = None) -> None:
        """Halve the width at least: isolate again with more bits."""
        self.bits = max(2 * self.bits, bits or 0)
        self.low, self.high = ends(real_balls(self.poly, self.bits)[self.index])

    def compare(self, value: Fraction) -> int:
        """-1, 0 or 1 as the root is below, at or above a rational number. Exact."""
        if self.low <= value <= self.high and _value(self.poly, value) == 0:
            return 0
        while self.low <= value <= self.high:
            if self.exact:
                return 0
            self.refine()
        return -1 if self.high < value else 1

    def before(self, other: RealRoot) -> bool:
        """True if this root is smaller than another one that is not the same number. Exact."""
        while not (self.high < other.low or other.high < self.low):
            self.refine()
            other.refine()
        return self.high < other.low


def ends(ball: Any) -> tuple[Fraction, Fraction]:
    """Rational end points of a real ball."""
    middle, radius = fraction(ball.mid().fmpq()), fraction(ball.rad().fmpq())
    return middle - radius, middle + radius


def real_balls(poly: Any, bits: int = START_BITS) -> list[Any]:
    """Disjoint balls, one for each real root of a squarefree fmpz_poly, in ascending order. Certified by FLINT."""
    if poly.degree() < 1:
        return []
    with flint.ctx.workprec(bits):
        balls = [root.real for root, _ in poly.complex_roots() if root.imag == 0]
        more = bits
        while True:
            balls.sort(key=lambda ball: ends(ball))
            if all(ends(a)[1] < ends(b)[0] for a, b in itertools.pairwise(balls)):
                return balls
            more *= 2
            with flint.ctx.workprec(more):
                balls = [root.real for root, _ in poly.complex_roots() if root.imag == 0]


def isolate(poly: Any) -> list[RealRoot]:
    """The real roots of a squarefree fmpz_poly, ascending."""
    return [RealRoot(poly, i, ball, START_BITS) for i, ball in enumerate(real_balls(poly))]


def merged(groups: Sequence[Sequence[RealRoot]]) -> list[RealRoot]:
    """Ascending union of roots of coprime polynomials. Exact."""
    found: list[RealRoot] = []
    for group in groups:
        rest, found = found, []
        i = 0
        for root in group:
            while i < len(rest) and rest[i].before(root):
                found.append(rest[i])
                i += 1
            found.append(root)
        found += rest[i:]
    return found


def integer_poly(coefficients: Sequence[Any]) -> Any:
    """fmpz_poly from coefficients, the constant one first: ints, strings, decimals, Fractions. Raises AlgebraError."""
    if isinstance(coefficients, str) or not len(coefficients):
        raise AlgebraError(f"coefficients must be a list of numbers, the constant one first, got {coefficients!r}")
    row = [exact(c, f"coefficient {i}") for i, c in enumerate(coefficients)]
    rational = flint.fmpq_poly([flint.fmpq(c.numerator, c.denominator) for c in row])
    if rational == 0:
        raise AlgebraError("all coefficients are 0: every number is a root")
    return rational.numer()


def squarefree_part(poly: Any) -> Any:
    """The polynomial with the same roots, each simple, primitive."""
    bare = poly // poly.gcd(poly.derivative()) if poly.degree() > 0 else poly
    content = bare.content()
    return bare // content if content > 1 else bare


@checked
def real_roots(coefficients: Sequence[Any]) -> list[RealRoot]:
    """The distinct real roots of a polynomial, ascending; coefficients from the constant one up. Certified.

    Each root converts to float; `low`, `high` enclose it by rational numbers and `refine()` narrows them.
    """
    return isolate(squarefree_part(integer_poly(coefficients)))


@checked
def is_interval_empty(coefficients: Sequence[Any], a: Any, b: Any) -> bool:
    """True if a polynomial has no real root in the open interval (a, b). Exact, by a Sturm chain over Q.

    coefficients: from the constant one up. Roots at the end points do not count. Raises AlgebraError unless a < b.
    """
    low, high = exact(a, "a"), exact(b, "b")
    if not low < high:
        raise AlgebraError(f"the interval ({low}, {high}) is empty: give a < b")
    return roots_between(integer_poly(coefficients), low, high) == 0


def roots_between(poly: Any, low: Fraction, high: Fraction) -> int:
    """Number of distinct real roots in the open interval (low, high), by Sturm's theorem."""
    bare = squarefree_part(poly)
    for end in (low, high):
        if bare.degree() > 0 and _value(bare, end) == 0:
            bare = bare // flint.fmpz_poly([-end.numerator, end.denominator])
    if bare.degree() < 1:
        return 0
    chain = [flint.fmpq_poly(bare), flint.fmpq_poly(bare.derivative())]
    while chain[-1].degree() > 0:
        rest = -(chain[-2] % chain[-1])
        if rest == 0:
            break
        size = abs(rest.leading_coefficient())
        chain.append(rest / size)
    return _variations(chain, low) - _variations(chain, high)


def _variations(chain: Sequence[Any], at: Fraction) -> int:
    where = flint.fmpq(at.numerator, at.denominator)
    signs = [1 if value > 0 else -1 for poly in chain if (value := poly(where)) != 0]
    return sum(a != b for a, b in itertools.pairwise(signs))


def _value(poly: Any, at: Fraction) -> Any:
    return poly(flint.fmpq(at.numerator, at.denominator))
