"""Exact numbers: decimals taken as written; roots and angles rationalised to a stated number of digits."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction
from math import isfinite, isqrt, pi, tan
from typing import Any

from irsbot_kinematics.algebra.model.engine import AlgebraError
from irsbot_kinematics.arguments import shown

Number = int | str | float | Fraction | Decimal
"""Types that are accepted as an exact number."""

DECIMAL_DIGITS = 15
"""1: a float with at most this number of significant digits counts as the decimal that prints it."""

ANGLE_DIGITS = 15
"""1: digits after the point of tan(angle/2) when an angle in radians is made rational."""


MOST_DIGITS = 100
"""1: digits after the point of a rationalised root, at most."""


def exact(value: Any, what: str = "the number") -> Fraction:
    """A rational number; a float counts as the decimal that prints it. Raises AlgebraError if that is not possible."""
    if isinstance(value, bool):
        raise AlgebraError(f"{what} must be a number, got {value}")
    if isinstance(value, float):
        value = float(value)  # of numpy, whose text is another one
        if not isfinite(value):
            raise AlgebraError(f"{what} must be finite, got {value}")
        digits = len(Decimal(repr(value)).as_tuple().digits)
        if digits > DECIMAL_DIGITS:
            raise AlgebraError(
                f"{what} is the float {value!r}, which is no decimal of at most {DECIMAL_DIGITS} digits; "
                "give it as a string or a Fraction"
            )
        return Fraction(repr(value))
    try:
        return Fraction(value)
    except (TypeError, ValueError, ZeroDivisionError, OverflowError):
        raise AlgebraError(
            f"{what} must be a number such as 17, '17.04' or Fraction(426, 25), got {shown(value)}"
        ) from None


def stored(value: float) -> Fraction:
    """A length of a robot's file: the shortest decimal that prints the float."""
    return Fraction(repr(float(value)))


def digits_of(value: Any, what: str) -> int:
    """A number of digits after the point, 0 to MOST_DIGITS, from a whole number or its text. Raises AlgebraError."""
    number = exact(value, what)
    if number.denominator != 1 or not 0 <= number <= MOST_DIGITS:
        raise AlgebraError(f"{what} must be a whole number of digits from 0 to {MOST_DIGITS}, got {shown(value)}")
    return int(number)


def square_root(value: Fraction, digits: int) -> Fraction:
    """sqrt(value) rounded to `digits` digits after the point; exact if the root is rational."""
    if value < 0:
        raise AlgebraError(f"no real square root of {value}")
    p, q = isqrt(value.numerator), isqrt(value.denominator)
    if p * p == value.numerator and q * q == value.denominator:
        return Fraction(p, q)
    scale = 10**digits
    scaled = value * scale * scale
    return Fraction((isqrt(4 * scaled.numerator // scaled.denominator) + 1) // 2, scale)


def angle_pair(value: Any, what: str) -> tuple[Fraction, Fraction]:
    """(cos, sin) with cos^2 + sin^2 = 1 exactly: a pair as given, or an angle in rad with tan(angle/2) rounded."""
    if isinstance(value, (tuple, list)):
        if len(value) != 2:
            raise AlgebraError(f"{what} must be an angle in rad or a pair (cos, sin), got {shown(value)}")
        c, s = (exact(part, what) for part in value)
        if c * c + s * s != 1:
            raise AlgebraError(f"{what}: {c}^2 + {s}^2 is not 1; a pair (cos, sin) must lie on the unit circle")
        return c, s
    if isinstance(value, float) and isfinite(value):
        angle = value
    else:
        angle = float(exact(value, what))
    angle -= 2.0 * pi * round(angle / (2.0 * pi))
    if abs(abs(angle) - pi) < 10.0**-ANGLE_DIGITS:
        return Fraction(-1), Fraction(0)
    return pair_of_tangent(tangent(angle))


def tangent(angle_rad: float) -> Fraction:
    """tan(angle/2), rounded to ANGLE_DIGITS digits. Raises AlgebraError at half turns."""
    if not abs(angle_rad) < pi:
        raise AlgebraError(f"an angle must lie between -pi and pi, got {angle_rad:g} rad")
    return Fraction(f"{tan(0.5 * angle_rad):.{ANGLE_DIGITS}f}")


def pair_of_tangent(t: Fraction) -> tuple[Fraction, Fraction]:
    """(cos, sin) of the angle with tan(angle/2) = t."""
    return (1 - t * t) / (1 + t * t), 2 * t / (1 + t * t)


def simplest_between(low: Fraction, high: Fraction) -> Fraction:
    """The fraction of smallest denominator, and then of smallest size, strictly between two numbers."""
    if not low < high:
        raise ValueError(f"nothing lies between {low} and {high}")
    if low < 0 < high:
        return Fraction(0)
    if high <= 0:
        return -simplest_between(-high, -low)
    whole = low.numerator // low.denominator
    if whole + 1 < high:
        return Fraction(whole + 1)
    above = simplest_between(1 / (high - whole), 1 / (low - whole)) if low > whole else None
    if above is not None:
        return whole + 1 / above
    rest = 1 / (high - whole)
    return whole + Fraction(1, rest.numerator // rest.denominator + 1)
