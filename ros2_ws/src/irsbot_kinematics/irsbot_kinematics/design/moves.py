"""Smallest change of each single parameter that changes the verdict on a design."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from irsbot_kinematics.arguments import checked, one_of
from irsbot_kinematics.design import proximal
from irsbot_kinematics.design.proximal import ZONES
from irsbot_kinematics.mechanisms.irsbot2_space.designs import PARAMETERS, Designs, Flags
from irsbot_kinematics.mechanisms.irsbot2_space.geometry import Irsbot2Geometry
from irsbot_kinematics.numerics.arithmetic import Array

_STEPS = 400
"""Trial values per parameter and direction, in geometric steps; a thinner strip may be missed."""
_SMALLEST, _LARGEST = 1e-6, 10.0
"""Relative changes that are tried; downwards to 0, beta up to pi/2."""
_REFINEMENTS, _PIECES = 8, 100
"""Each bracket is cut into pieces so many times: 100^-8 of it is far below rounding."""


@dataclass(frozen=True)
class Move:
    """The nearest value of one parameter beyond which the verdict changes."""

    parameter: str
    now: float
    then: float
    """The first value, to rounding, on the other side. m or rad."""
    question: str
    """Name of the question whose answer changes there."""

    @property
    def relative(self) -> float:
        return (self.then - self.now) / self.now


@checked
def moves(g: Irsbot2Geometry, zone: str) -> tuple[Move, ...]:
    """Nearest change of each parameter, the other six as they are, the smallest relative one first.

    Parameters whose change alone does nothing are left out. Designs that no machine can have are not crossed.
    """
    one_of(zone, tuple(ZONES), "zone")
    now = np.array([getattr(g, name) for name in PARAMETERS])
    free = bool(_member(zone, Designs.of(g))[0])
    found: dict[str, Move] = {}
    for column, name in enumerate(PARAMETERS):
        for sign in (-1.0, 1.0):
            bracket = _first_change(zone, free, now, column, _trials(name, float(now[column]), sign))
            if bracket is None:
                continue
            for _ in range(_REFINEMENTS):
                pieces = np.linspace(bracket[0], bracket[1], _PIECES + 1)
                bracket = _first_change(zone, free, now, column, pieces) or bracket
            outside = bracket[1] if free else bracket[0]
            question = _decisive(zone, _vary(now, column, np.array([outside])))
            move = Move(name, float(now[column]), bracket[1], question)
            if name not in found or abs(move.relative) < abs(found[name].relative):
                found[name] = move
    return tuple(sorted(found.values(), key=lambda move: abs(move.relative)))


def _trials(name: str, value: float, sign: float) -> Array:
    """The value itself, then increasing changes."""
    span = 1.0 if sign < 0.0 else pi / (2.0 * value) - 1.0 if name == "beta" else _LARGEST
    return np.concatenate([[value], value * (1.0 + sign * np.geomspace(_SMALLEST * min(span, 1.0), span, _STEPS))])


def _first_change(zone: str, free: bool, now: Array, column: int, tried: Array) -> tuple[float, float] | None:
    """The two neighbouring trial values between which the verdict changes first; None if it does not."""
    d = _vary(now, column, tried)
    changed = np.flatnonzero((_member(zone, d) != free) | ~d.valid)
    if not changed.size or not d.valid[changed[0]]:
        return None
    return float(tried[changed[0] - 1]), float(tried[changed[0]])


def _vary(now: Array, column: int, values: Array) -> Designs:
    return Designs.columns({name: values if i == column else now[i] for i, name in enumerate(PARAMETERS)})


def _member(zone: str, d: Designs) -> Flags:
    flags: NDArray[np.bool_] = np.zeros(d.b.shape, dtype=bool)
    flags[d.valid] = proximal.in_zone(zone, proximal.evaluate_questions(d.where(d.valid)))
    return flags


def _decisive(zone: str, d: Designs) -> str:
    """The question that fails by the least: just outside the zone, it decides."""
    found = proximal.evaluate_questions(d)
    failing = {name: found[name] for name in ZONES[zone] if not proximal.holds(name, found[name])[0]}
    return max(failing, key=lambda name: float(failing[name].slack[0]))
