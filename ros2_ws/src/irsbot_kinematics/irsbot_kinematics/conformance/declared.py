"""Laws of what a mechanism declares for the bounds of its base class, each tried by itself at every posture."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from math import acos, dist, hypot, inf

import numpy as np

from irsbot_kinematics.arithmetic import FLOATS, Array
from irsbot_kinematics.conformance.samples import Case, Machine, numbers, place
from irsbot_kinematics.mechanism import Floats, Posture
from irsbot_kinematics.mechanisms.turning_platform import TurningPlatform

NOTHING = Case(0.0, "nothing is declared")
"""Of mechanisms that state their bounds themselves."""
SHARES = (1e-3, 0.3, 0.999)
"""How far a platform moves, as shares of what the rate is declared for."""
WAYS = 4
"""Directions per posture."""


def sizes_declared(machine: Machine) -> Iterator[Case]:
    """No holding point of a turning platform is farther from P than `radius`, no two are farther apart than `span`."""
    mechanism = machine.mechanism
    if not isinstance(mechanism, TurningPlatform):
        yield NOTHING
        return
    for at in machine.postures:
        far = max([hypot(*arm) for arm in at.arms])
        apart = max([dist(a, b) for a, b in combinations(at.arms, 2)])
        for name, size, declared in (("radius", far, mechanism.radius), ("span", apart, mechanism.span)):
            said = f"{place(at)}: {name} is {declared:.6g} m, the arms ask for {size:.6g} m"
            yield Case((size - declared) / mechanism.length_m, said)


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
    """How far the rods turn when the platform goes a way: no rod end moves farther than |d| + radius |turn|."""
    mechanism = machine.mechanism
    assert isinstance(mechanism, TurningPlatform)
    moved = hypot(*way[:-1]) + mechanism.radius * abs(way[-1])
    pose = tuple((np.array(at.pose) + way).tolist())
    said = f"{place(at)}, rate {rate:.6g} rad/m up to {ball:.6g} m: at pose {numbers(pose)}"
    joints, reach = mechanism.inverse(FLOATS, pose, at.working_mode)
    if not min(reach) > 0.0:
        return Case(inf, f"{said} the reach is {min(reach):.6g} m")
    legs = mechanism.legs(FLOATS, joints, pose)
    turns = [_angle(a, b) for a, b in zip(at.screws, legs.screws, strict=True)]
    return Case(max(turns) / moved / rate - 1.0, f"{said} rods have turned by {numbers(turns)} rad in {moved:.6g} m")


def _angle(a: Floats, b: Floats) -> float:
    """Between the forces of two screws, rad."""
    cosine = sum([x * y for x, y in zip(a[:-1], b[:-1], strict=True)])
    chord = dist(a[:-1], b[:-1])  # the cosine of a small angle has no digits left
    return chord if chord < 1e-4 else acos(min(max(cosine, -1.0), 1.0))
