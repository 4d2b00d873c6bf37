"""Public polynomials with integer coefficients, and their conversion to python-flint's."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from math import lcm
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from irsbot_kinematics.algebra.model.engine import flint


@dataclass(frozen=True)
class Polynomial:
    """Primitive polynomial with integer coefficients. coefficients: exponents of `names` -> integer, not zero."""

    names: tuple[str, ...]
    coefficients: Mapping[tuple[int, ...], int] = field(hash=False)

    def __hash__(self) -> int:
        return hash((self.names, frozenset(self.coefficients.items())))

    @cached_property
    def degree(self) -> int:
        """Total degree."""
        return max((sum(powers) for powers in self.coefficients), default=0)

    @cached_property
    def degrees(self) -> tuple[int, ...]:
        """Degree in each name, in the order of `names`."""
        return tuple(max((p[i] for p in self.coefficients), default=0) for i in range(len(self.names)))

    @cached_property
    def terms(self) -> int:
        """Number of terms."""
        return len(self.coefficients)

    @cached_property
    def height_bits(self) -> int:
        """Smallest b with all |coefficients| <= 2^b ("Binary" of [S4], Tables 3 and 4)."""
        return max(((abs(c) - 1).bit_length() for c in self.coefficients.values()), default=0)

    def at(self, values: Mapping[str, Any]) -> Any:
        """Value at a point: exact for ints and Fractions, floats and complex numbers otherwise."""
        total: Any = 0
        for powers, coefficient in self.coefficients.items():
            term: Any = coefficient
            for name, power in zip(self.names, powers, strict=True):
                if power:
                    term = term * values[name] ** power
            total = total + term
        return total

    def values(self, points: ArrayLike) -> NDArray[np.float64]:
        """Values (N,) over points (N, len(names)) relative to the sum of the sizes of the terms: -1..1, no unit."""
        table = np.asarray(points)
        total = np.zeros(table.shape[:-1], dtype=table.dtype)
        size = np.zeros(table.shape[:-1])
        scale = max(map(abs, self.coefficients.values()), default=1)
        for powers, coefficient in self.coefficients.items():
            term = np.prod(table ** np.array(powers), axis=-1) * (Fraction(coefficient, scale) + 0.0)
            total, size = total + term, size + np.abs(term)
        return np.asarray(total / np.where(size > 0.0, size, 1.0))

    def __str__(self) -> str:
        if not self.coefficients:
            return "0"
        text = ""
        for powers, coefficient in sorted(self.coefficients.items(), key=lambda item: (-sum(item[0]), item[0])):
            named = [
                name if power == 1 else f"{name}^{power}"
                for name, power in zip(self.names, powers, strict=True)
                if power
            ]
            size = abs(coefficient)
            part = "*".join([str(size), *named] if size != 1 or not named else named)
            sign = "-" if coefficient < 0 else "+"
            text += f" {sign} {part}" if text else ("-" if coefficient < 0 else "") + part
        return text


def context(names: Sequence[str]) -> Any:
    """flint's ring Q[names], graded reverse lexicographic."""
    return flint.fmpq_mpoly_ctx.get(tuple(names), flint.Ordering.degrevlex)


def integer_context(names: Sequence[str]) -> Any:
    """flint's ring Z[names], graded reverse lexicographic."""
    return flint.fmpz_mpoly_ctx.get(tuple(names), flint.Ordering.degrevlex)


def rational(value: Fraction | int) -> Any:
    """A Fraction as flint's fmpq."""
    return flint.fmpq(value.numerator, value.denominator)


def fraction(value: Any) -> Fraction:
    """flint's fmpq or fmpz as a Fraction."""
    if isinstance(value, flint.fmpz):
        return Fraction(int(value))
    return Fraction(int(value.p), int(value.q))


def primitive(poly: Any, names: Sequence[str] | None = None) -> Any:
    """The primitive integer multiple of a rational or integer polynomial in Z[names], leading coefficient positive.

    names: must hold every generator that occurs; the polynomial's own ring if left out.
    """
    own = tuple(poly.context().names())
    wanted = own if names is None else tuple(names)
    terms = {tuple(m): c for m, c in zip(poly.monoms(), poly.coeffs(), strict=True)}
    if poly.context().__class__.__name__ == "fmpq_mpoly_ctx":
        common = lcm(*(int(c.q) for c in terms.values())) if terms else 1
        terms = {m: int(c.p) * (common // int(c.q)) for m, c in terms.items()}
    if wanted != own:
        place = [own.index(name) if name in own else None for name in wanted]
        lost = [own[i] for i in range(len(own)) if own[i] not in wanted and any(m[i] for m in terms)]
        if lost:
            raise ValueError(f"{', '.join(lost)} still occur")
        terms = {tuple(0 if i is None else m[i] for i in place): c for m, c in terms.items()}
    ring = integer_context(wanted)
    whole = ring.from_dict({m: int(c) for m, c in terms.items()})
    if whole == 0:
        return whole
    whole = whole.primitive()[1]
    return -whole if int(whole.leading_coefficient()) < 0 else whole


def moved(poly: Any, ring: Any) -> Any:
    """A rational polynomial in another ring Q[names] that has all generators that occur, not scaled."""
    own, wanted = tuple(poly.context().names()), tuple(ring.names())
    place = [(i, wanted.index(name)) for i, name in enumerate(own) if name in wanted]
    terms = {}
    for m, c in zip(poly.monoms(), poly.coeffs(), strict=True):
        full = [0] * len(wanted)
        for i, k in place:
            full[k] = int(m[i])
        if sum(full) != sum(int(power) for power in m):
            raise ValueError(f"{poly} holds generators that {wanted} lacks")
        terms[tuple(full)] = c
    return ring.from_dict(terms)


def renamed(poly: Any, name: str, new: str, power: int) -> Any:
    """An integer polynomial with name^power replaced by `new`; every exponent of name must be a multiple of power."""
    names = tuple(new if n == name else n for n in poly.context().names())
    i = names.index(new)
    ring = integer_context(names)
    return ring.from_dict({(*m[:i], int(m[i]) // power, *m[i + 1 :]): c for m, c in poly.to_dict().items()})


def is_even(poly: Any, name: str) -> bool:
    """True if only even powers of `name` occur."""
    i = poly.context().variable_to_index(name)
    return all(int(m[i]) % 2 == 0 for m in poly.monoms())


def public(poly: Any, names: Sequence[str] | None = None) -> Polynomial:
    """A flint polynomial as a Polynomial, primitive."""
    whole = primitive(poly, names)
    return Polynomial(
        tuple(whole.context().names()),
        {tuple(map(int, m)): int(c) for m, c in zip(whole.monoms(), whole.coeffs(), strict=True)},
    )


def ring_of(poly: Polynomial, names: Sequence[str] | None = None) -> Any:
    """A Polynomial as flint's fmpz_mpoly over `names`."""
    wanted = tuple(names or poly.names)
    place = [wanted.index(name) for name in poly.names]
    terms = {}
    for powers, coefficient in poly.coefficients.items():
        full = [0] * len(wanted)
        for i, power in zip(place, powers, strict=True):
            full[i] = power
        terms[tuple(full)] = coefficient
    return integer_context(wanted).from_dict(terms)


def univariate(poly: Any, name: str) -> Any:
    """A polynomial in which only `name` occurs as a primitive fmpz_poly."""
    whole = primitive(poly, (name,))
    row = [0] * (whole.total_degree() + 1) if whole != 0 else [0]
    for (power,), coefficient in zip(whole.monoms(), whole.coeffs(), strict=True):
        row[int(power)] = coefficient
    return flint.fmpz_poly(row)


def irreducible(poly: Any) -> list[tuple[Any, int]]:
    """Irreducible factors with multiplicities, constants left out, the smallest first."""
    if poly == 0:
        return []
    try:
        found = [(factor, int(power)) for factor, power in poly.factor()[1]]
    except OverflowError:  # python-flint 0.9 sorts factors over Z by a key that large coefficients overflow
        ring = context(poly.context().names())
        same = ring.from_dict({m: int(c) for m, c in poly.to_dict().items()})
        found = [(primitive(factor), int(power)) for factor, power in same.factor()[1]]
    return sorted(found, key=lambda item: (int(item[0].total_degree()), len(item[0]), str(item[0])))


def product(factors: Iterable[Any], ring: Any) -> Any:
    """Their product; 1 for none."""
    total = ring.constant(1)
    for factor in factors:
        total = total * factor
    return total
