"""All solutions of a system with finitely many: Groebner basis, quotient algebra, rational univariate representation.

Exact up to the last step; the real solutions are enclosed by balls (F. Rouillier 1999). No solution is lost at angle
pi, because angles are pairs (cos, sin).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

from irsbot_kinematics.algebra.model.engine import AlgebraError, TooLarge, flint
from irsbot_kinematics.algebra.model.polynomial import integer_context, primitive

Monomial = tuple[int, ...]

BASIS_LIMITS = (400, 4000, 20_000)
"""1, 1, bit: elements, terms and coefficients beyond which Buchberger's algorithm gives up."""

FORMS = ((1, 3, -2, 7, 5, -11, 13, 17, -19, 23, 29, -31), (2, -5, 9, 4, -7, 15, 1, -6, 11, 8, -3, 10))
"""Coefficients of the linear forms that are tried in turn as separating elements."""

BITS = 128
"""bit: first precision of the enclosures of solutions; doubled while a sign is undecided."""

SHARP = 2.0**-56
"""1: relative radius of an enclosure that determines all digits of a float."""

MOST_BITS = 8192
"""bit: a value whose sign is still undecided at this precision counts as zero; it was zero in every known case."""


class NotFinite(AlgebraError):
    """A system with infinitely many solutions."""


class Fibre:
    """The solutions of polynomials in Q[names]; `dimension` counts all complex ones with multiplicity."""

    def __init__(self, polys: Sequence[Any], names: Sequence[str]) -> None:
        """polys: flint polynomials in which only `names` occur. Raises NotFinite, TooLarge."""
        self.names = tuple(names)
        ring = integer_context(self.names)
        whole = [primitive(poly, self.names) for poly in polys]
        basis, done = flint.fmpz_mpoly_vec([p for p in whole if p != 0], ring).buchberger_naive(limits=BASIS_LIMITS)
        if not done:
            raise TooLarge(f"{len(polys)} equations in {', '.join(names)}: the Groebner basis grows beyond all use")
        reduced = basis.autoreduction()
        self._heads: dict[Monomial, Any] = {tuple(p.monoms()[0]): p for p in reduced}
        if any(sum(head) == 0 for head in self._heads):
            self.basis: list[Monomial] = []
            return
        for i, name in enumerate(self.names):
            if not any(sum(head) == head[i] for head in self._heads):
                raise NotFinite(f"infinitely many solutions: {name} is not determined by {len(polys)} equations")
        self.basis = self._staircase()

    @property
    def dimension(self) -> int:
        """Number of complex solutions with multiplicity."""
        return len(self.basis)

    @cached_property
    def squarefree(self) -> Any:
        """Squarefree polynomial over Z whose roots are the distinct solutions."""
        return self._separated[1]

    @property
    def distinct(self) -> int:
        """Number of distinct complex solutions."""
        return int(self.squarefree.degree()) if self.basis else 0

    @property
    def radical(self) -> bool:
        """True if every solution is simple."""
        return self.distinct == self.dimension

    @cached_property
    def multiplicities(self) -> tuple[int, ...]:
        """Multiplicities of the distinct real solutions, in the order of `real`."""
        if not self.basis:
            return ()
        by_power = [(factor, int(power)) for factor, power in self._separated[0].factor_squarefree()[1]]
        return tuple(
            next(power for factor, power in by_power if flint.arb_poly(factor)(root).contains(0))
            for root in self._real_roots(512)
        )

    def count(self) -> int:
        """Number of distinct real solutions. Certified."""
        return len(self._real_roots(BITS)) if self.basis else 0

    def real(self, bits: int = BITS) -> list[dict[str, Any]]:
        """The real solutions, each name -> real ball (flint arb) that holds the value."""
        if not self.basis:
            return []
        with flint.ctx.workprec(bits):
            found = []
            for root in self._real_roots(bits):
                bottom = flint.arb_poly(self._representation[0])(root)
                tops = self._representation[1]
                found.append(
                    {name: flint.arb_poly(top)(root) / bottom for name, top in zip(self.names, tops, strict=True)}
                )
        return found

    def sharp(self, positive: Sequence[Any] = ()) -> list[dict[str, Any]]:
        """The accepted solutions in enclosures that determine all digits of a float."""
        bits = BITS
        while True:
            found = self.accepted(positive, bits)
            wide = any(ball.rad() > (1 + abs(ball).lower()) * SHARP for row in found for ball in row.values())
            if not wide or bits >= MOST_BITS:
                return found
            bits *= 2

    def accepted(self, positive: Sequence[Any], bits: int = BITS) -> list[dict[str, Any]]:
        """The real solutions at which all of `positive` (flint polynomials in names) are positive. Certified."""
        conditions = [terms_over(poly, self.names) for poly in positive]
        solutions = self.real(bits)
        if not conditions:
            return solutions
        kept = []
        for i, solution in enumerate(solutions):
            held, precision = self._signs(conditions, solution), bits
            while held is None and precision < MOST_BITS:
                precision *= 2
                held = self._signs(conditions, self.real(precision)[i], precision)
            if held:
                kept.append(solution)
        return kept

    # --- quotient algebra ----------------------------------------------------------------------------------------

    def _staircase(self) -> list[Monomial]:
        unit = (0,) * len(self.names)
        found, front = [unit], [unit]
        seen = {unit}
        while front:
            ahead = []
            for monomial in front:
                for i in range(len(self.names)):
                    above = _times(monomial, i)
                    if above in seen or any(_divides(head, above) for head in self._heads):
                        continue
                    seen.add(above)
                    ahead.append(above)
            found += ahead
            front = ahead
        return found

    @cached_property
    def _matrices(self) -> list[Any]:
        """Multiplication by each name, columns are images of the basis."""
        place = {monomial: i for i, monomial in enumerate(self.basis)}
        size, zero = len(self.basis), flint.fmpq(0)
        forms: dict[Monomial, list[Any]] = {}

        def unit(i: int) -> list[Any]:
            row = [zero] * size
            row[i] = flint.fmpq(1)
            return row

        def normal(monomial: Monomial) -> list[Any]:
            known = forms.get(monomial)
            if known is not None:
                return known
            if monomial in place:
                row = unit(place[monomial])
            elif monomial in self._heads:
                head, *tail = zip(self._heads[monomial].monoms(), self._heads[monomial].coeffs(), strict=True)
                row = [zero] * size
                for power, coefficient in tail:
                    row[place[tuple(power)]] = flint.fmpq(-coefficient, head[1])
            else:
                i = next(
                    i for i in range(len(monomial)) if monomial[i] and (below := _times(monomial, i, -1)) not in place
                )
                below = _times(monomial, i, -1)
                row = [zero] * size
                for k, coefficient in enumerate(normal(below)):
                    if coefficient != 0:
                        for j, part in enumerate(normal(_times(self.basis[k], i))):
                            if part != 0:
                                row[j] += coefficient * part
            forms[monomial] = row
            return row

        columns = [[normal(_times(b, i)) for b in self.basis] for i in range(len(self.names))]
        return [flint.fmpq_mat(size, size, [row[j] for j in range(size) for row in rows]) for rows in columns]

    @cached_property
    def _separated(self) -> tuple[Any, Any, Any]:
        """Characteristic polynomial and squarefree part of the separating form, and its matrix."""
        best: tuple[Any, Any, Any] | None = None
        for weights in FORMS:
            size = len(self.basis)
            form = flint.fmpq_mat(size, size)
            for weight, matrix in zip(weights, self._matrices, strict=False):
                form = form + flint.fmpq(weight) * matrix
            whole = form.charpoly().numer()
            bare = whole // whole.gcd(whole.derivative())
            bare = bare // bare.content()
            if best is None or bare.degree() > best[1].degree():
                best = (whole, bare, form)
            if bare.degree() == size:
                break
        assert best is not None
        return best

    @cached_property
    def _representation(self) -> tuple[Any, list[Any]]:
        """g_1 and g_x for each name: x = g_x(root)/g_1(root)."""
        _, bare, form = self._separated
        size, degree = len(self.basis), int(bare.degree())
        identity = flint.fmpq_mat(size, size, [int(i == j) for i in range(size) for j in range(size)])
        traces = self._traces()
        rows = [traces]
        for _ in range(degree - 1):
            rows.append(rows[-1] * form)
        coefficients = [bare[degree - k] for k in range(degree + 1)]
        horner = [flint.fmpq_poly([coefficients[j - k] for k in range(j + 1)]) for j in range(degree)]
        tops = []
        for matrix in (identity, *self._matrices):
            top = flint.fmpq_poly(0)
            for i in range(degree):
                trace = (rows[i] * matrix)[0, 0]
                top = top + horner[degree - 1 - i] * trace
            tops.append(top)
        return tops[0], tops[1:]

    def _traces(self) -> Any:
        """Row of the traces of multiplication by the basis: trace(v) = row . v."""
        size = len(self.basis)
        products: dict[Monomial, Any] = {
            self.basis[0]: flint.fmpq_mat(size, size, [int(i == j) for i in range(size) for j in range(size)])
        }
        for monomial in self.basis[1:]:
            i = next(i for i, power in enumerate(monomial) if power)
            products[monomial] = products[_times(monomial, i, -1)] * self._matrices[i]
        sums = [sum((products[m][k, k] for k in range(size)), flint.fmpq(0)) for m in self.basis]
        return flint.fmpq_mat(1, size, sums)

    def _real_roots(self, bits: int) -> list[Any]:
        from irsbot_kinematics.algebra.model.roots import real_balls

        return real_balls(self.squarefree, bits)

    @staticmethod
    def _signs(
        conditions: Sequence[list[tuple[Monomial, Any]]], solution: Mapping[str, Any], bits: int = BITS
    ) -> bool | None:
        """True if all are positive, False if one is not, None if a ball is too wide to decide."""
        with flint.ctx.workprec(bits):
            open_ = False
            values = list(solution.values())
            for terms in conditions:
                total = flint.arb(0)
                for powers, coefficient in terms:
                    term = flint.arb(coefficient)
                    for value, power in zip(values, powers, strict=True):
                        if power:
                            term = term * value**power
                    total = total + term
                if total > 0:
                    continue
                if total < 0 or total == 0:
                    return False
                open_ = True
            return None if open_ else True


def terms_over(poly: Any, names: Sequence[str]) -> list[tuple[Monomial, Any]]:
    """Terms of a rational polynomial, exponents in the order of `names`."""
    own = tuple(poly.context().names())
    place = [own.index(name) for name in names]
    return [(tuple(int(m[i]) for i in place), c) for m, c in zip(poly.monoms(), poly.coeffs(), strict=True)]


def _times(monomial: Monomial, i: int, by: int = 1) -> Monomial:
    return (*monomial[:i], monomial[i] + by, *monomial[i + 1 :])


def _divides(head: Monomial, monomial: Monomial) -> bool:
    return all(a <= b for a, b in zip(head, monomial, strict=True))
