"""Coordinates in which walls are polynomials: a length itself, its square, or tan(angle/2) of an angle."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import atan, isqrt, pi, sqrt, tan
from typing import Any

from irsbot_kinematics.algebra.model.engine import AlgebraError
from irsbot_kinematics.algebra.model.exact import exact, pair_of_tangent, simplest_between, tangent
from irsbot_kinematics.algebra.model.parse import cosine_of, sine_of
from irsbot_kinematics.algebra.tangents import tangent_of
from irsbot_kinematics.arguments import shown

MARGIN = Fraction(1, 2**40)
"""1: relative distance that a sample keeps from the ends of its interval where the chart is not rational."""


@dataclass(frozen=True)
class Axis:
    """One parameter of a slice. kind: 'plain', 'square' (value^2, with the sign of the value) or 'tangent'
    (tan(value/2)): charts increase with the value."""

    name: str
    kind: str
    low: Fraction
    """Lower end of the box, in the chart."""
    high: Fraction
    box: tuple[float, float]
    """The box as the user gave it."""

    @property
    def gen(self) -> str:
        """Name of the generator in the walls."""
        return tangent_of(self.name) if self.kind == "tangent" else self.name

    def chart(self, value: object) -> Fraction:
        """Chart value of a user's value; exact except for angles."""
        if self.kind == "tangent":
            return tangent(value if isinstance(value, float) else float(exact(value, self.name)))
        number = value if isinstance(value, Fraction) else exact(value, self.name)
        return number * abs(number) if self.kind == "square" else number

    def chart_float(self, value: float) -> Fraction:
        """Chart value of a float, taken as its exact binary value."""
        if self.kind == "tangent":
            return Fraction(tan(0.5 * value))
        number = Fraction(value)
        return number * abs(number) if self.kind == "square" else number

    def user(self, chart: float) -> float:
        """User's value of a chart value."""
        if self.kind == "tangent":
            return 2.0 * atan(chart)
        return sqrt(max(chart, 0.0)) if self.kind == "square" else chart

    def sample(self, low: Fraction, high: Fraction) -> Fraction:
        """A simple chart value strictly between two, whose user's value is rational (a rational half tangent)."""
        if self.kind != "square":
            return simplest_between(low, high)
        digits = 12
        while True:
            scale = 10**digits
            bottom = Fraction(_root_up(low * scale * scale), scale) if low > 0 else Fraction(0)
            top = Fraction(isqrt(int(high * scale * scale)), scale)
            if bottom < top:
                return simplest_between(bottom, top) ** 2
            digits *= 2

    def exact_user(self, chart: Fraction) -> Fraction | float:
        """User's value of a sample: rational, or an angle as a float."""
        if self.kind == "square":
            return Fraction(isqrt(chart.numerator), isqrt(chart.denominator))
        return 2.0 * atan(chart) if self.kind == "tangent" else chart

    def values(self, chart: Fraction) -> dict[str, Fraction]:
        """Values of the system's generators at a sample."""
        if self.kind == "tangent":
            c, s = pair_of_tangent(chart)
            return {cosine_of(self.name): c, sine_of(self.name): s}
        root = self.exact_user(chart)
        assert isinstance(root, Fraction)
        return {self.name: root}


def _root_up(value: Fraction) -> int:
    whole = -((-value.numerator) // value.denominator)
    root = isqrt(whole)
    return root if root * root == whole else root + 1


def _radians(value: Any, name: str) -> float:
    """An end of the box of an angle: a float as it is, else an exact number."""
    return value if isinstance(value, float) else float(exact(value, f"the box of {name}"))


def axis(name: str, box: Any, turned: bool, even: bool) -> Axis:
    """The chart of a parameter over a box. Raises AlgebraError for an empty box or a value that is not a pair."""
    low: Any
    high: Any
    try:
        low, high = box
    except (TypeError, ValueError):
        raise AlgebraError(f"the box of {name} must be a pair (low, high), got {shown(box)}") from None
    if turned:
        ends = _radians(low, name), _radians(high, name)
        if not -pi < ends[0] < ends[1] < pi:
            raise AlgebraError(f"the box of the angle {name} must satisfy -pi < low < high < pi, got {ends}")
        return Axis(name, "tangent", tangent(ends[0]), tangent(ends[1]), ends)
    bottom, top = exact(low, f"the box of {name}"), exact(high, f"the box of {name}")
    if not bottom < top:
        raise AlgebraError(f"the box of {name} is empty: {low} is not below {high}")
    ends = (float(bottom), float(top))
    if even and bottom >= 0:
        return Axis(name, "square", bottom * bottom, top * top, ends)
    return Axis(name, "plain", bottom, top, ends)
