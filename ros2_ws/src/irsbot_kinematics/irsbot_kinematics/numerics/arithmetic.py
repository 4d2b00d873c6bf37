"""One formula for two kinds of numbers: plain floats for one sample, arrays for many.

A mechanism writes each equation once, on numbers of type `N`, with an `Arithmetic[N]`. With `FLOATS` the equations run
on Python floats, about twenty times faster for one sample than small arrays; with `ARRAYS` they run on whole columns.
Equations do not branch on values: the caller handles undefined cases.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]
N = TypeVar("N", float, Array)
"""A float, or an array with one entry per sample."""


@dataclass(frozen=True)
class Arithmetic(Generic[N]):
    """The elementary functions on one kind of number."""

    sin: Callable[[N], N]
    cos: Callable[[N], N]
    cos_sin: Callable[[N], tuple[N, N]]
    """Cosine and sine of an angle; of arrays faster than one of them alone."""
    acos: Callable[[N], N]
    atan2: Callable[[N, N], N]
    hypot: Callable[[N, N], N]
    """Length of a vector. Of arrays from the sum of squares: infinite over 1e154, and it counts as 0 below 1e-162."""
    sqrt: Callable[[N], N]
    """Square root of a sum of squares."""
    safe_sqrt: Callable[[N], N]
    """Square root, 0 for arguments that rounding has made negative; NaN stays NaN."""
    abs: Callable[[N], N]
    """Absolute value."""
    minimum: Callable[[N, N], N]
    """The smaller one; NaN if either is NaN."""
    maximum: Callable[[N, N], N]
    """The larger one; NaN if either is NaN."""
    ratio: Callable[[N, N], N]
    """Quotient of a part and a whole that is not smaller, both not negative: 0..1, and 0 for 0/0."""
    quotient: Callable[[N, N], N]
    """Quotient of two numbers that are not negative; infinite if the second is 0."""
    wrap: Callable[[N], N]
    """An angle, moved by whole turns into -pi..pi."""


def _cos_sin(angle: float) -> tuple[float, float]:
    return math.cos(angle), math.sin(angle)


def _safe_sqrt(value: float) -> float:
    return math.sqrt(value) if value > 0.0 else 0.0 * value


def _minimum(a: float, b: float) -> float:
    return a if a < b or a != a else b


def _maximum(a: float, b: float) -> float:
    return a if a > b or a != a else b


def _ratio(part: float, whole: float) -> float:
    if whole > 0.0:
        quotient = part / whole
        return quotient if quotient < 1.0 or quotient != quotient else 1.0
    return 0.0 * whole


def _quotient(above: float, below: float) -> float:
    return above / below if below > 0.0 else math.inf if below == 0.0 else math.nan


def _wrap(angle: float) -> float:
    return math.remainder(angle, math.tau) if math.isfinite(angle) else math.nan


def _array_cos_sin(angle: Array) -> tuple[Array, Array]:
    """From the tangent of half the angle: with AVX-512 numpy has vector instructions for it, and none for sine and
    cosine. Errors are below 4e-16."""
    tangent = np.tan(0.5 * angle)
    share = 2.0 / (1.0 + tangent * tangent)
    return share - 1.0, tangent * share


def _array_hypot(x: Array, y: Array) -> Array:
    """Several times as fast as np.hypot, which has no vector instructions."""
    hypot: Array = np.sqrt(x * x + y * y)
    return hypot


def _array_root(value: Array) -> Array:
    safe_sqrt: Array = np.sqrt(np.maximum(value, 0.0))
    return safe_sqrt


def _array_ratio(part: Array, whole: Array) -> Array:
    ratio: Array = np.minimum(np.divide(part, whole, out=0.0 * whole, where=whole > 0.0), 1.0)
    return ratio


def _array_quotient(above: Array, below: Array) -> Array:
    quotient: Array = np.divide(above, below, out=np.where(below == 0.0, np.inf, np.nan), where=below > 0.0)
    return quotient


def _array_wrap(angle: Array) -> Array:
    inner = np.fmod(angle, math.tau)  # exact however many turns there are, as math.remainder is
    wrapped: Array = inner - math.tau * np.round(inner / math.tau)
    return wrapped


def _fast(function: Any) -> Any:
    """A numpy function with the signature of `Arithmetic`."""
    return function


FLOATS: Arithmetic[float] = Arithmetic(
    sin=math.sin,
    cos=math.cos,
    cos_sin=_cos_sin,
    acos=math.acos,
    atan2=math.atan2,
    hypot=math.hypot,
    sqrt=math.sqrt,
    safe_sqrt=_safe_sqrt,
    abs=abs,
    minimum=_minimum,
    maximum=_maximum,
    ratio=_ratio,
    quotient=_quotient,
    wrap=_wrap,
)
ARRAYS: Arithmetic[Array] = Arithmetic(
    sin=_fast(np.sin),
    cos=_fast(np.cos),
    cos_sin=_array_cos_sin,
    acos=_fast(np.arccos),
    atan2=_fast(np.arctan2),
    hypot=_array_hypot,
    sqrt=_fast(np.sqrt),
    safe_sqrt=_array_root,
    abs=_fast(np.abs),
    minimum=_fast(np.minimum),
    maximum=_fast(np.maximum),
    ratio=_array_ratio,
    quotient=_array_quotient,
    wrap=_array_wrap,
)
