"""The way out of a stop: a direction in joint space in which all margins grow that stopped the robot."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf, sqrt
from operator import mul, sub
from typing import NamedTuple

from irsbot_kinematics import Mechanism, Posture, Status
from irsbot_msgs_py.records import Cause, Finding, Floats, Level
from irsbot_supervisor.core.margins import MARGIN_CAUSES, PROBE, gradient, margins_of, margins_of_legs, neighbours

LEAST_GROWTH = 0.05
"""1: in a common direction every margin grows at least by this share of its steepest growth. It is 0 if the directions
of two causes are opposite."""

NEARLY = 0.1
"""1: a leg counts if its margin is above the smallest by less than this share: a robot that moves along the direction
for a while would meet it."""

TURNS = 200
"""Largest number of steps towards the common direction: of two causes it is known after one."""


class Escape(NamedTuple):
    """direction: unit vector in joint space, robot order; empty: none is known. causes: the Cause bits of the limits
    that it leads away from; 0 if there is no direction."""

    direction: Floats
    causes: int


NO_ESCAPE = Escape((), 0)


def escape_of(mechanism: Mechanism, at: Posture, found: Sequence[Finding], into_range: Floats) -> Escape:
    """The way out of a stop: every margin that stops grows along it, and the smallest share of a margin's own steepest
    growth is as large as it can be. A cause that has no direction in common with those that have a smaller margin is
    left out. Margins come before joint ranges: a joint beyond its range still has a drive, a platform at a singularity
    has none. A margin is named only if it is larger a small step ahead.

    into_range: per joint the sign of the motion back into its range.
    """
    stops = [finding.cause for finding in found if finding.level == Level.STOP]
    here = margins_of(at)
    kinds = [kind for kind in range(len(here)) if any(cause & MARGIN_CAUSES[kind] for cause in stops)]
    kinds.sort(key=here.__getitem__)
    around = neighbours(mechanism, at) if kinds else []
    candidates = [_steepest(at, around, kind) for kind in kinds]
    out_of_range = any(cause & Cause.POSITION for cause in stops)
    if out_of_range:
        candidates.append([into_range])
    served: list[Floats] = []
    direction: Floats = ()
    for ways in candidates:
        units = [unit for way in ways if (unit := _unit(way))]
        for more in (units, units[:1]):
            if more and (common := _common([*served, *more])):
                served, direction = [*served, *more], common
                break
    if not direction:
        return NO_ESCAPE
    ahead = mechanism.track(tuple([q + PROBE * part for q, part in zip(at.joints, direction, strict=True)]), at)
    then = margins_of(ahead) if ahead.status == Status.SOLVED else here
    causes = sum([int(MARGIN_CAUSES[kind]) for kind in kinds if then[kind] > here[kind]])
    if out_of_range and sum(map(mul, into_range, direction)) > 0.0:
        causes |= int(Cause.POSITION)
    return Escape(direction, causes) if causes else NO_ESCAPE


def _steepest(at: Posture, around: list[tuple[Posture, Posture]], kind: int) -> list[Floats]:
    """Gradients, 1/rad or 1/m, of a margin in those legs whose margin is the smallest or nearly so, the smallest
    first."""
    here = margins_of_legs(at)[kind]
    legs = sorted([leg for leg, one in enumerate(here) if one <= (1.0 + NEARLY) * min(here)], key=here.__getitem__)

    def margin(leg: int) -> Callable[[Posture], float]:
        return lambda posture: margins_of_legs(posture)[kind][leg]

    return [gradient(margin(leg), at, around, None) for leg in legs]


def _unit(vector: Sequence[float]) -> Floats:
    """The vector with length 1; empty if it has no length."""
    size = sqrt(sum([part * part for part in vector]))
    return tuple([part / size for part in vector]) if 0.0 < size < inf else ()


def _common(ways: list[Floats]) -> Floats:
    """The direction whose least share along any of these unit vectors is largest; empty if that is at most
    LEAST_GROWTH. It is that of the shortest vector in their convex hull: weight goes from the vector with the largest
    share to the one with the smallest, after Mitchell, Demyanov and Malozemov."""
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
    found = _unit(shortest)
    return found if found and min([sum(map(mul, way, found)) for way in ways]) > LEAST_GROWTH else ()
