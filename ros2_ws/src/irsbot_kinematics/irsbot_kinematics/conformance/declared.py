"""Laws of the numbers that a mechanism declares for the bounds of its base class, each tried at every posture."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from math import acos, dist, hypot, inf

import numpy as np

from irsbot_kinematics.conformance.samples import Case, Machine, numbers, place
from irsbot_kinematics.mechanism import Floats, Posture
from irsbot_kinematics.mechanisms.turning_platform import TurningPlatform
from irsbot_kinematics.numerics.arithmetic import FLOATS, Array

NOTHING = Case(0.0, "nothing is declared")
"""Result for mechanisms that compute their own bounds."""
SHARES = (1e-3, 0.3, 0.999)
"""Displacements of the platform, as shares of the range for which the rate is declared."""
WAYS = 4
"""Number of directions per posture."""


def sizes_declared(machine: Machine) -> Iterator[Case]:
    """No attachment of a turning platform is farther from P than `radius`, no two are farther apart than `diameter`."""
    mechanism = machine.mechanism
    if not isinstance(mechanism, TurningPlatform):
        yield NOTHING
        return
    for at in machine.postures:
        far = max([hypot(*arm) for arm in at.attachments])
        apart = max([dist(a, b) for a, b in combinations(at.attachments, 2)])
        for name, size, declared in (("radius", far, mechanism.radius), ("span", apart, mechanism.diameter)):
            stated = f"{place(at)}: {name} is {declared:.6g} m, the arms ask for {size:.6g} m"
            yield Case((size - declared) / mechanism.length_m, stated)


def turn_rate_declared(machine: Machine) -> Iterator[Case]:
    """No rod turns faster than `turn_rate` says while no rod end moves farther than its radius, nor leaves its leg."""
    mechanism, rng = machine.mechanism, machine.random()
    if not isinstance(mechanism, TurningPlatform):
        yield NOTHING
        return
    for at in machine.regular:
        ball, rate = mechanism.turn_rate(at)
        if not (ball > 0.0 and rate < inf):
            yield Case(0.0 if ball == 0.0 else inf, f"{place(at)}: turn_rate says {ball:.6g} m, {rate:.6g} rad/m")
            continue
        for _ in range(WAYS):
            way = rng.normal(size=len(at.pose)) * ([*[1.0] * (len(at.pose) - 1), 1.0 / mechanism.radius])
            way /= hypot(*way[:-1]) + mechanism.radius * abs(way[-1])
            for share in SHARES:
                yield _turned(machine, at, share * ball * way, ball, rate)


def _turned(machine: Machine, at: Posture, way: Array, ball: float, rate: float) -> Case:
    """Largest turn of the rods for a motion of the platform: no rod end moves farther than |d| + radius |turn|."""
    mechanism = machine.mechanism
    assert isinstance(mechanism, TurningPlatform)
    moved = hypot(*way[:-1]) + mechanism.radius * abs(way[-1])
    pose = tuple((np.array(at.pose) + way).tolist())
    stated = f"{place(at)}, rate {rate:.6g} rad/m up to {ball:.6g} m: at pose {numbers(pose)}"
    joints, reach = mechanism.inverse(FLOATS, pose, at.working_mode)
    if not min(reach) > 0.0:
        return Case(inf, f"{stated} the reach is {min(reach):.6g} m")
    legs = mechanism.legs(FLOATS, joints, pose)
    turns = [_angle(a, b) for a, b in zip(at.screws, legs.screws, strict=True)]
    return Case(max(turns) / moved / rate - 1.0, f"{stated} rods have turned by {numbers(turns)} rad in {moved:.6g} m")


def _angle(a: Floats, b: Floats) -> float:
    """Between the forces of two screws, rad."""
    cosine = sum([x * y for x, y in zip(a[:-1], b[:-1], strict=True)])
    chord = dist(a[:-1], b[:-1])  # the cosine of a small angle has no digits left
    return chord if chord < 1e-4 else acos(min(max(cosine, -1.0), 1.0))
