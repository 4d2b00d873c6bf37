"""The four margins of a posture: their order, names, causes and wording, and how to get them from a posture."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from irsbot_kinematics import Mechanism, Posture, Status
from irsbot_msgs_py.records import Cause, Floats

Margins = tuple[float, float, float, float]
"""Type 1 (smallest over the legs), Type 2, constraint, limb (smallest): 0..1, infinite if the robot does not have
it."""


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
        min(map(abs, at.normalised_levers)),
        min(at.cos_pressure),
        constraint if constraint == constraint else inf,
        min(limb) if limb else inf,
    )


def margins_of_legs(at: Posture) -> tuple[Floats, Floats, Floats, Floats]:
    """The same leg by leg; the constraint margin belongs to all legs. NaN or empty if the robot does not have it."""
    return tuple(map(abs, at.normalised_levers)), tuple(at.cos_pressure), (at.constraint,), tuple(at.limb)


def slopes(mechanism: Mechanism, at: Posture, kind: int) -> Floats:
    """Gradient of a margin with respect to the joints, 1/rad or 1/m; central differences. A neighbour without posture
    counts as margin 0."""

    def margin(joint: int, step: float) -> float:
        moved = tuple([q + step if j == joint else q for j, q in enumerate(at.joints)])
        near = mechanism.track(moved, at)
        return margins_of(near)[kind] if near.status == Status.SOLVED else 0.0

    return tuple([(margin(j, PROBE) - margin(j, -PROBE)) / (2.0 * PROBE) for j in range(len(at.joints))])
