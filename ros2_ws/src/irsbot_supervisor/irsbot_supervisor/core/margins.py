"""The four margins of a posture: their order, names, causes and wording, and how to get them from a posture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf
from typing import NamedTuple

from irsbot_kinematics import Mechanism, Posture, Status
from irsbot_msgs_py.records import Cause, Floats

Margins = tuple[float, float, float, float]
"""Type 1 (smallest over the legs), Type 2, constraint, limb (smallest): 0..1, the constraint margin also above;
infinite if the robot does not have it."""


class MarginKind(NamedTuple):
    """One of the margins. name: as in settings (`type1_stop`) and columns. text: as in sentences."""

    name: str
    cause: Cause
    text: str


MARGIN_KINDS = (
    MarginKind("type1", Cause.TYPE1, "Type 1 margin"),
    MarginKind("type2", Cause.TYPE2, "Type 2 margin"),
    MarginKind("constraint", Cause.CONSTRAINT, "constraint margin"),
    MarginKind("limb", Cause.LIMB, "limb margin"),
)
"""In the order of `Margins`."""

MARGIN_NAMES = tuple(kind.name for kind in MARGIN_KINDS)
MARGIN_CAUSES = tuple(kind.cause for kind in MARGIN_KINDS)
MARGIN_TEXTS = {kind.cause: kind.text for kind in MARGIN_KINDS}

ANY_MARGIN = sum(map(int, MARGIN_CAUSES))
"""All margin causes as a plain number: arithmetic on flags takes a microsecond each."""

PROBE = 1e-4
"""rad or m: step of the differences that give the slope of a margin; margins are smooth far beyond it."""


def margins_of(at: Posture) -> Margins:
    """The four margins of a solved posture."""
    constraint, limb = at.constraint, at.limb
    return (
        least_of([abs(sine) for sine in at.normalised_levers]),
        least_of(at.cos_pressure),
        constraint if constraint == constraint else inf,
        least_of(limb) if limb else inf,
    )


def least_of(values: Sequence[float]) -> float:
    """The smallest value, as `min` finds it; a compiler makes this loop native."""
    least = values[0]
    for value in values:
        if value < least:
            least = value
    return least


def margins_of_legs(at: Posture) -> tuple[Floats, Floats, Floats, Floats]:
    """The same leg by leg; the constraint margin belongs to all legs. NaN or empty if the robot does not have it."""
    return tuple(map(abs, at.normalised_levers)), tuple(at.cos_pressure), (at.constraint,), tuple(at.limb)


def neighbours(mechanism: Mechanism, at: Posture) -> list[tuple[Posture, Posture]]:
    """Per joint the postures a small step ahead and back."""

    def moved(joint: int, step: float) -> Posture:
        return mechanism.track(tuple([q + step if j == joint else q for j, q in enumerate(at.joints)]), at)

    return [(moved(joint, PROBE), moved(joint, -PROBE)) for joint in range(len(at.joints))]


def gradient(
    value: Callable[[Posture], float], at: Posture, around: list[tuple[Posture, Posture]], beyond: float | None
) -> Floats:
    """Gradient of a value of postures with respect to the joints, 1/rad or 1/m, from the `neighbours`.

    beyond: the value of a neighbour without posture. None: the difference between the posture and the other neighbour
    counts, and the slope is 0 if neither has a posture.
    """
    here, found = value(at), []
    for up, down in around:
        ahead = value(up) if up.status == Status.SOLVED else beyond
        behind = value(down) if down.status == Status.SOLVED else beyond
        steps = (ahead is not None) + (behind is not None)
        change = (here if ahead is None else ahead) - (here if behind is None else behind)
        found.append(change / (PROBE * steps) if steps else 0.0)
    return tuple(found)


def slopes(mechanism: Mechanism, at: Posture, kind: int) -> Floats:
    """Gradient of a margin with respect to the joints, 1/rad or 1/m. It falls towards where there is no posture."""
    return slopes_among(neighbours(mechanism, at), at, kind)


def slopes_among(around: list[tuple[Posture, Posture]], at: Posture, kind: int) -> Floats:
    """The same from the `neighbours`, which serve all margins."""
    return gradient(lambda posture: margins_of(posture)[kind], at, around, 0.0)
