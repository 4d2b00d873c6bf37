"""Laws of the numbers that a turning platform declares for its rods: travels, errors, sines; compared with the rods of
`legs`."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from math import sqrt
from typing import NamedTuple

import numpy as np

from irsbot_kinematics.bounds.boxes import Rod
from irsbot_kinematics.conformance.declared import NOTHING
from irsbot_kinematics.conformance.rods import ALIKE, Rods, moved, rods_at, units
from irsbot_kinematics.conformance.samples import Case, Machine, numbers, place
from irsbot_kinematics.mechanism import Posture
from irsbot_kinematics.mechanisms.turning_platform import TurningPlatform
from irsbot_kinematics.numerics.arithmetic import Array

SHARES: Array = np.array([-1.0, -0.7, -0.4, 0.4, 0.7, 1.0])
"""1: shares of the travel at which the rods are evaluated."""
TURNS = (0.0, 0.02, 0.2)
"""rad by which rods are turned."""


class _Asked(NamedTuple):
    """One posture, a travel of its joints and a slack, and the motion of the rods."""

    mechanism: TurningPlatform
    at: Posture
    rods: Rods
    travel: Array
    slack: float
    ways: Array
    """(S, n, d) m by which the near ends move at SHARES of the travel."""
    growth: Array
    """(S, n) m by which the rods grow there."""

    @property
    def stated(self) -> str:
        return f"{place(self.at)}, travel {numbers(self.travel)}, slack {self.slack:.6g} m"


def drives_declared(machine: Machine) -> Iterator[Case]:
    """`travel_of` asks of every rod at least what its joint and the errors do to it lengthwise; paths and the shortest
    rod likewise."""
    for asked in _asked(machine):
        if asked is None:
            yield NOTHING
            continue
        r, size = asked.rods.directions, asked.mechanism.length_m
        demand = np.abs((r * asked.ways).sum(axis=2) + asked.growth).max(axis=0) + _lengthwise(asked)
        path = float(np.linalg.norm(asked.ways[:, None] + _corner_errors(asked), axis=3).max())
        drives, longest, rod = asked.mechanism.travel_of(asked.at, asked.travel.tolist(), asked.slack)
        stated = f"{asked.stated}: rods are asked for {numbers(demand)} m, travel_of says {numbers(drives)}"
        yield Case(float((demand - drives).max()) / size, stated)
        stated = f"{asked.stated}: near ends move by {path:.6g} m, travel_of says {longest:.6g}"
        yield Case((path - longest) / size, stated)
        least = float(asked.rods.length.min())
        yield Case((rod - least) / size, f"{asked.stated}: shortest rod {least:.6g} m, travel_of says {rod:.6g}")


def rods_declared(machine: Machine) -> Iterator[Case]:
    """`rods_of` describes near ends and lengths of the rods within a travel, errors of the geometry included."""
    for asked in _asked(machine):
        if asked is None:
            yield NOTHING
            continue
        declared: list[Rod] = asked.mechanism.rods_of(asked.at, asked.travel.tolist(), asked.slack)
        corners = _corner_errors(asked)
        for leg, rod in enumerate(declared):
            share, d = SHARES, len(rod.near)
            near = share[:, None] * rod.near + (share**2)[:, None] * (rod.curve or (0.0,) * d)
            near += (share**3)[:, None] * (rod.third or (0.0,) * d)
            aside = np.linalg.norm((asked.ways[:, leg] - near)[:, None] + corners[:, leg], axis=2).max()
            growth = share * rod.growth + share**2 * rod.growth_curve + share**3 * rod.growth_third
            longer = np.abs(asked.growth[:, leg] - growth).max() + asked.slack * asked.rods.measured[leg]
            length = float(asked.rods.length[leg])
            over = max(aside - rod.aside, longer - rod.growth_aside, abs(rod.length - length))
            yield Case(
                float(over) / asked.mechanism.length_m,
                f"{asked.stated}: rod {leg + 1} is {length:.6g} m long, aside by {aside:.6g} m, longer by {longer:.6g} "
                f"m than said; rods_of says {numbers((rod.length, rod.aside, rod.growth_aside))}",
            )


def errors_declared(machine: Machine) -> Iterator[Case]:
    """`geometry_errors` is at least what errors of places and lengths do to one leg."""
    for asked in _asked(machine):
        if asked is None:
            yield NOTHING
            continue
        slack = asked.slack or asked.mechanism.length_m * ALIKE
        declared = asked.mechanism.geometry_errors(slack)
        ends, length = (
            float(np.linalg.norm(_corner_errors(asked._replace(slack=slack)), axis=2).max()),
            slack * max(asked.rods.measured),
        )
        needed = (ends, length, sqrt(2.0) * slack)
        over = float(np.subtract(needed, declared).max()) / slack
        stated = f"{asked.stated}: ends, length and arm of a leg may be off by {numbers(needed)} m"
        yield Case(over, f"{stated}, geometry_errors({slack:.3g}) says {numbers(declared)}")


def sines_declared(machine: Machine) -> Iterator[Case]:
    """`sine_floors` is no more than the Type 1 sines after a travel, with rails that are off and rods that turn."""
    for asked in _asked(machine):
        if asked is None:
            yield NOTHING
            continue
        rods = asked.rods
        own = np.abs((rods.directions * rods.tangents).sum(axis=1))
        counted = np.abs(own - asked.at.type1) < ALIKE
        for turn in TURNS:
            met = np.array([_least_sine(asked, leg, turn) for leg in range(len(own))])
            floors = np.array(asked.mechanism.sine_floors(asked.at, asked.travel.tolist(), turn, asked.slack))
            over = float(np.where(counted, floors - met, 0.0).max())
            stated = f"{asked.stated}: rods that turn by {turn} rad have the sines {numbers(met)}"
            yield Case(over, f"{stated}, sine_floors says {numbers(floors)}")


# --- what rods do --------------------------------------------------------------------------------------------------


def _asked(machine: Machine) -> Iterator[_Asked | None]:
    """Random travels and slacks at every regular posture; a single None for a mechanism that declares nothing."""
    mechanism, rng = machine.mechanism, machine.random()
    lower, upper = machine.ranges
    found = 0
    for at in machine.regular if isinstance(mechanism, TurningPlatform) else ():
        rods = rods_at(mechanism, at)
        if rods is None:
            continue
        found += 1
        travel = (upper - lower) * 10.0 ** rng.uniform(-4.0, -1.5) * rng.uniform(0.1, 1.0, len(lower))
        slack = float(found % 3 > 0) * mechanism.length_m * 10.0 ** rng.uniform(-5.0, -2.5)
        there = moved(mechanism, at, np.array(at.joints) + SHARES[:, None] * travel)
        if there is not None:
            yield _Asked(mechanism, at, rods, travel, slack, there[0] - rods.near, there[1] - rods.length)  # type: ignore[arg-type]
    if not found:
        yield None


def _axes(asked: _Asked) -> Array:
    """(d, d) axes of the platform as columns, along which its places have errors."""
    turned, d = np.eye(asked.rods.near.shape[1]), asked.at.pose[-1]
    turned[:2, :2] = [[np.cos(d), -np.sin(d)], [np.sin(d), np.cos(d)]]
    return turned


def _lengthwise(asked: _Asked) -> Array:
    """(n,) m: elongation demand of the rods by errors of the geometry."""
    r, crank = asked.rods.directions, _cranks(asked.rods)
    places = np.abs(r).sum(axis=1) + np.abs(r @ _axes(asked)).sum(axis=1)
    return np.asarray(asked.slack * (places + np.abs((r * crank).sum(axis=1)) + asked.rods.measured))


def _corner_errors(asked: _Asked) -> Array:
    """(M, n, d) m: largest relative errors of the ends of the rods."""
    d, crank = asked.rods.near.shape[1], _cranks(asked.rods)
    signs = np.array(list(product((-1.0, 1.0), repeat=d)))
    both = (signs[:, None] + signs @ _axes(asked).T).reshape(-1, 1, d)
    return np.asarray(asked.slack * np.concatenate([both + crank, both - crank]))


def _cranks(rods: Rods) -> Array:
    """(n, d) unit vectors along the cranks, 0 where there is none."""
    sizes = np.linalg.norm(rods.cranks, axis=1, keepdims=True)
    return np.asarray(rods.cranks / np.where(sizes > 0.0, sizes, 1.0))


def _least_sine(asked: _Asked, leg: int, turn: float) -> float:
    """|r.t| of a leg when r turns; t is the tangent of its near end within the travel, on a rail whose ends are off."""
    rods = asked.rods
    r, tangents = rods.directions[leg], rods.tangents[leg][None]
    if rods.rails[leg]:
        signs = np.array([*product((-1.0, 0.0, 1.0), repeat=len(r))])
        tangents = units(rods.rails[leg] * tangents + 2.0 * asked.slack * signs)
    elif rods.cranks[leg].any():
        x, y = tangents[0, :2]
        angle = asked.travel[leg] * np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
        tangents = np.tile(tangents, (len(angle), 1))
        tangents[:, 0], tangents[:, 1] = np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y
    sine = float(np.abs(tangents @ r).min())
    return float(np.sin(max(np.arcsin(min(sine, 1.0)) - turn, 0.0)))
