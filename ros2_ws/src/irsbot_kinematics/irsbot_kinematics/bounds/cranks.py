"""Type 1 of rods on cranks over a box of joint positions: bounds of the levers, of second order.

Crank i turns about z by q_i; u_i is its direction, w_i its rod as a vector. Its lever is (w_i x u_i).z, over its length
the sine of the Type 1 margin. Over the box u_i = u + t s_i u' - t^2 s_i^2 u/2 and a remainder of at most t^3/6 in every
coordinate, with t its travel: the lever is a product of quadratics.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from irsbot_kinematics.bounds.box_code import codes_for
from irsbot_kinematics.bounds.quadratics import Quadratic, effects, least, minus, multiplied, scaled


class Crank(NamedTuple):
    """A crank within the box."""

    cosine: float  # of its angle in the middle
    sine: float
    travel: float  # rad, not negative
    side: float  # 1.0 or -1.0: sign of the lever in the middle


def levers_over(rods: Sequence[Sequence[Quadratic]], cranks: Sequence[Crank]) -> list[float]:
    """(n,) m: lower bounds of the levers times `side`; NaN if a number is not finite.

    rods: m, as vectors, seen from the base: `boxes.Reached.rods`. Machine code answers where there is some.
    """
    n = len(rods)
    code = codes_for(n, len(rods[0]), effects(n, rods[0][0])).get("levers")
    return (code and code(numbers_of(rods, cranks))) or by_equations(rods, cranks)


def by_equations(rods: Sequence[Sequence[Quadratic]], cranks: Sequence[Crank]) -> list[float]:
    """The same without machine code, which is made from this."""
    n, found = len(rods), []
    for i, ((x, y, *_), (cosine, sine, travel, side)) in enumerate(zip(rods, cranks, strict=True)):
        along = _direction(i, n, len(x), cosine, -sine, travel)
        up = _direction(i, n, len(x), sine, cosine, travel)
        lever = minus(multiplied(n, x, up), multiplied(n, y, along))
        found.append(least(n, scaled(lever, side)))
    return found


def numbers_of(rods: Sequence[Sequence[Quadratic]], cranks: Sequence[Crank]) -> list[float]:
    """What machine code takes."""
    found: list[float] = []
    for rod, crank in zip(rods, cranks, strict=True):
        found += rod[0]
        found += rod[1]
        found += crank
    return found


def _direction(joint: int, n: int, size: int, value: float, slope: float, travel: float) -> Quadratic:
    """A coordinate of the direction of a crank over the travel of its joint."""
    found = [0.0] * size
    found[0], found[1 + joint], found[1 + n + joint] = value, travel * slope, -0.5 * travel * travel * value
    found[-1] = travel * travel * travel / 6.0
    return found
