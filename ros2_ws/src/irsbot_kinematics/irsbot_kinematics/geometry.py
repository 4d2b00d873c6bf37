"""Checks that a geometry has to pass. The message of a refusal names the broken inequality with both values."""

from __future__ import annotations

from dataclasses import fields
from math import isfinite
from typing import Any

from irsbot_kinematics.errors import InvalidGeometry


def require(inequality: str, holds: bool, left: float, right: float) -> None:
    """Raise InvalidGeometry unless `holds`; write the test that accepts, so that NaN is refused."""
    if not holds:
        raise InvalidGeometry(f"geometry must satisfy {inequality}, got {_against(inequality, left, right)}")


def _against(inequality: str, left: float, right: float) -> str:
    """Both values, or the left one alone where the inequality itself says the right one."""
    said = inequality.split()[-1] == f"{right:g}"
    return f"{left:.9g}" if said else f"{left:.9g} against {right:.9g}"


def require_finite(geometry: Any) -> None:
    """Raise InvalidGeometry unless every field of the dataclass is a finite number, or a tuple of them."""
    for field in fields(geometry):
        value = getattr(geometry, field.name)
        for number in value if isinstance(value, tuple) and field.type != "float" else (value,):
            if isinstance(number, bool) or not isinstance(number, (int, float)) or not isfinite(number):
                raise InvalidGeometry(f"geometry: {field.name} must be finite, got {value!r}")


def require_size(geometry: Any, size: int, *names: str) -> None:
    """Raise InvalidGeometry unless the named fields have `size` numbers."""
    for name in names:
        value = getattr(geometry, name)
        if not isinstance(value, tuple) or len(value) != size:
            raise InvalidGeometry(f"geometry: {name} must be {size} numbers, got {value!r}")
