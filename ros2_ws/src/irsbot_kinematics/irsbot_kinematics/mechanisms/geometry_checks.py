"""Checks of a geometry. The message of a refusal names the violated inequality with both values."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from irsbot_kinematics.arguments import number
from irsbot_kinematics.errors import InvalidGeometry
from irsbot_kinematics.numerics.tolerances import FARTHEST


def require(inequality: str, holds: bool, left: float, right: float) -> None:
    """Raise InvalidGeometry unless `holds`; write the test that accepts, so that NaN is refused."""
    if not holds:
        raise InvalidGeometry(f"geometry must satisfy {inequality}, got {_against(inequality, left, right)}")


def _against(inequality: str, left: float, right: float) -> str:
    """Both values, or only the left one if the inequality itself has the right one."""
    stated = inequality.split()[-1] == f"{right:g}"
    return f"{left:.9g}" if stated else f"{left:.9g} against {right:.9g}"


def require_finite(geometry: Any) -> None:
    """Raise InvalidGeometry unless every field of the dataclass is a number of at most FARTHEST, or a tuple of them.

    Numbers of numpy become plain floats.
    """
    for field in fields(geometry):
        value, what = getattr(geometry, field.name), f"geometry: {field.name}"
        plain: float | tuple[float, ...]
        if isinstance(value, tuple) and field.type != "float":
            plain = tuple(number(entry, what, -FARTHEST, FARTHEST, InvalidGeometry) for entry in value)
        else:
            plain = number(value, what, -FARTHEST, FARTHEST, InvalidGeometry)
        object.__setattr__(geometry, field.name, plain)


def require_size(geometry: Any, size: int, *names: str) -> None:
    """Raise InvalidGeometry unless the named fields have `size` numbers."""
    for name in names:
        value = getattr(geometry, name)
        if not isinstance(value, tuple) or len(value) != size:
            raise InvalidGeometry(f"geometry: {name} must be {size} numbers, got {value!r}")
