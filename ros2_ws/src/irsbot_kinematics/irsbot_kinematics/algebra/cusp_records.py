"""Cusps as records, and the arithmetic on balls that encloses them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from irsbot_kinematics.algebra.model.engine import flint
from irsbot_kinematics.algebra.model.polynomial import fraction
from irsbot_kinematics.algebra.model.system import System

BITS = 200
"""bit: precision of the enclosures of cusps."""


@dataclass(frozen=True)
class Cusp:
    """One real cusp. radius: error of a value before it was rounded to a float; infinite if the cusp is numeric
    only."""

    pose: dict[str, float]
    joints: dict[str, float]
    radius: float


class Cusps(list[Cusp]):
    """Real cusps. status: 'certified' (all of them, enclosed) or 'numeric' (found from many starts, without a proof).

    complex_count: cusps over the complex numbers, if known.
    """

    def __init__(self, found: list[Cusp], status: str, complex_count: int | None) -> None:
        super().__init__(found)
        self.status = status
        self.complex_count = complex_count

    def __reduce__(self) -> tuple[Any, ...]:
        return Cusps, (list(self), self.status, self.complex_count)


def constant(system: System, text: str, known: Mapping[str, Fraction]) -> Fraction:
    poly = system.evaluated(system.expression(text), known)
    return fraction(poly.leading_coefficient()) if poly != 0 else Fraction(0)


def ball_roots(row: list[Any]) -> list[Any]:
    """Complex roots of a polynomial whose coefficients are balls, as accurate as the balls allow."""
    return list(flint.acb_poly(row).roots(tol=flint.arb(2) ** (-BITS // 2), maxprec=4 * BITS))


def tangent_pair(t: Any) -> tuple[Any, Any]:
    return (1 - t * t) / (1 + t * t), 2 * t / (1 + t * t)


def ball_value(poly: Any, point: Mapping[str, Any]) -> Any:
    names = poly.context().names()
    total = flint.arb(0)
    for powers, coefficient in zip(poly.monoms(), poly.coeffs(), strict=True):
        term = flint.arb(coefficient)
        for name, power in zip(names, powers, strict=True):
            if power:
                term = term * point[name] ** int(power)
        total = total + term
    return total
