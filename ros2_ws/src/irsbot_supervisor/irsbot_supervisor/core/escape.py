"""The way out of a stop: a direction in joint space in which all margins grow that stopped the robot."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, sqrt
from operator import add, mul, sub
from typing import NamedTuple

from irsbot_kinematics import Mechanism, Posture, Status
from irsbot_msgs_py.records import Cause, Finding, Floats, Level
from irsbot_supervisor.core.margins import MARGIN_CAUSES, PROBE, margins_of, margins_of_legs

LEAST_GROWTH = 0.05
"""1: in a common direction every margin grows at least by this share of its steepest growth. It is 0 if the directions
of two causes are opposite."""

NEARLY = 0.1
"""1: a leg counts if its margin is above the smallest by less than this share: a robot that moves along the direction
for a while would meet it."""

TURNS = 64
"""Largest number of steps towards the common direction: of two causes it is known after one."""


class Escape(NamedTuple):
    """direction: unit vector in joint space, robot order; empty: none is known. causes: the Cause bits of the limits
    that it leads away from; 0 if there is no direction."""

    direction: Floats
    causes: int


NO_ESCAPE = Escape((), 0)


def escape_of(mechanism: Mechanism, at: Posture, found: Sequence[Finding], into_range: Floats) -> Escape:
    """The way out of a stop: the direction in which the least growth of all margins that stop is largest. A cause that
    has no direction in common with those that have a smaller margin is left out. Margins come before joint ranges: a
    joint beyond its range still has a drive, a platform at a singularity has none.

    into_range: per joint the sign of the motion back into its range.
    """
    stops = [finding.cause for finding in found if finding.level == Level.STOP]
    here = margins_of(at)
    kinds = [kind for kind in range(len(here)) if any(cause & MARGIN_CAUSES[kind] for cause in stops)]
    kinds.sort(key=here.__getitem__)
    around = _neighbours(mechanism, at) if kinds else []
    candidates = [(int(MARGIN_CAUSES[kind]), _steepest(at, around, kind)) for kind in kinds]
    if any(cause & Cause.POSITION for cause in stops):
        candidates.append((int(Cause.POSITION), [into_range]))
    causes = 0
    served: list[Floats] = []
    direction: Floats = ()
    for bit, ways in candidates:
        units = [unit for way in ways if (unit := _unit(way))]
        for more in (units, units[:1]):
            if more and (common := _unit(_common([*served, *more]), LEAST_GROWTH)):
                causes, served, direction = causes | bit, [*served, *more], common
                break
    return Escape(direction, causes)


def _neighbours(mechanism: Mechanism, at: Posture) -> list[tuple[Posture, Posture]]:
    """Per joint the postures a small step ahead and back."""
    steps = [tuple([PROBE if j == joint else 0.0 for j in range(len(at.joints))]) for joint in range(len(at.joints))]
    ends = [(tuple(map(add, at.joints, step)), tuple(map(sub, at.joints, step))) for step in steps]
    return [(mechanism.track(ahead, at), mechanism.track(back, at)) for ahead, back in ends]


def _steepest(at: Posture, around: list[tuple[Posture, Posture]], kind: int) -> list[Floats]:
    """Gradients, 1/rad or 1/m, of a margin in those legs whose margin is the smallest or nearly so, the smallest first.
    A neighbour without posture counts as margin 0."""

    def margin(near: Posture, leg: int) -> float:
        return margins_of_legs(near)[kind][leg] if near.status == Status.SOLVED else 0.0

    here = margins_of_legs(at)[kind]
    legs = sorted([leg for leg, one in enumerate(here) if one <= (1.0 + NEARLY) * min(here)], key=here.__getitem__)
    return [tuple([(margin(up, leg) - margin(down, leg)) / (2.0 * PROBE) for up, down in around]) for leg in legs]


def _unit(vector: Sequence[float], least: float = 0.0) -> Floats:
    """The vector with length 1; empty if its length is at most `least`, or no number."""
    size = sqrt(sum([part * part for part in vector]))
    return tuple([part / size for part in vector]) if least < size < inf else ()


def _common(ways: list[Floats]) -> Floats:
    """The shortest vector in the convex hull of unit vectors: its length is the least share of it along any of them,
    and no other direction has a larger one. Weight goes from the vector with the largest share to the one with the
    smallest, after Mitchell, Demyanov and Malozemov."""
    shortest, weights = ways[0], [1.0] + [0.0] * (len(ways) - 1)
    for _ in range(TURNS):
        along = [sum(map(mul, way, shortest)) for way in ways]
        least = along.index(min(along))
        most = max([k for k, weight in enumerate(weights) if weight > 0.0], key=along.__getitem__)
        gap, side = along[most] - along[least], tuple(map(sub, ways[least], ways[most]))
        if not gap > 1e-9:
            break
        moved = min(gap / sum(map(mul, side, side)), weights[most])
        weights[most] -= moved
        weights[least] += moved
        shortest = tuple([a + moved * b for a, b in zip(shortest, side, strict=True)])
    return shortest
