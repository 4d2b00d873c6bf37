"""Numbers with units, as they stand in design files: `60 mm`, `70 GPa`, `2700 kg/m3`, `45 deg`."""

from __future__ import annotations

from math import isfinite, pi
from typing import Any

from irsbot_kinematics.numerics.tolerances import LARGEST
from irsbot_kinematics.stiffness.errors import InvalidDesign

UNITS: dict[str, dict[str, float]] = {
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
    "pressure": {"Pa": 1.0, "MPa": 1e6, "GPa": 1e9},
    "density": {"kg/m3": 1.0, "g/cm3": 1e3},
    "mass": {"kg": 1.0, "g": 1e-3},
    "angle": {"rad": 1.0, "deg": pi / 180.0},
    "ratio": {"1": 1.0},
}
"""SI value of each unit, by dimension. A ratio may be written without its unit."""


def quantity(stated: Any, dimension: str, what: str) -> float:
    """SI value of a number with its unit. Raises InvalidDesign for a missing or wrong unit, and for what is no number.

    stated: text such as `60 mm`. dimension: key of UNITS. what: name of the entry, for the message.
    """
    units = UNITS[dimension]
    parts = str(stated).split()
    if dimension == "ratio" and len(parts) == 1:
        parts = [*parts, "1"]
    try:
        value = float(parts[0])
    except (ValueError, IndexError):
        raise InvalidDesign(f"{what} must be a number with a unit ({', '.join(units)}), got {stated!r}") from None
    if len(parts) == 1:
        raise InvalidDesign(f"{what} has no unit: {stated!r}; write for example '{parts[0]} {next(reversed(units))}'")
    if len(parts) != 2 or parts[1] not in units:
        raise InvalidDesign(f"{what} must have a unit of {dimension} ({', '.join(units)}), got {stated!r}")
    if not isfinite(value) or not abs(value) <= LARGEST:
        raise InvalidDesign(f"{what} must be finite and at most {LARGEST:g}, got {stated!r}")
    return value * units[parts[1]]
