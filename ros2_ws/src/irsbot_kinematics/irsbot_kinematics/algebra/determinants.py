"""Determinants of matrices of polynomials, by cofactors with memory, because the matrices of mechanisms are sparse."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any


def determinant(rows: Sequence[Sequence[Any]]) -> Any:
    """Determinant of a square matrix of flint polynomials; the sparsest rows are expanded first."""
    n = len(rows)
    order = sorted(range(n), key=lambda i: sum(entry != 0 for entry in rows[i]))
    sign = _parity(order)
    known: dict[int, Any] = {}

    def minor(depth: int, used: int) -> Any:
        if depth == n:
            return None
        if used in known:
            return known[used]
        total, place = 0, 0
        for column in range(n):
            if used >> column & 1:
                continue
            entry = rows[order[depth]][column]
            if entry != 0:
                below = minor(depth + 1, used | 1 << column)
                term = entry if below is None else (entry * below if below != 0 else 0)
                if not (isinstance(term, int) and term == 0):
                    total = total + term if place % 2 == 0 else total - term
            place += 1
        known[used] = total
        return total

    return sign * minor(0, 0)


def _parity(order: Sequence[int]) -> int:
    sign = 1
    for i in range(len(order)):
        for j in range(i):
            if order[j] > order[i]:
                sign = -sign
    return sign


def jacobian(polys: Sequence[Any], names: Sequence[str]) -> list[list[Any]]:
    """Matrix of the derivatives of flint polynomials by generators."""
    return [[poly.derivative(name) for name in names] for poly in polys]
