"""Parts of kinematics.py: certified bounds of the margins, attacked at corners, inner points and by wrong geometry."""

from __future__ import annotations

from itertools import product

import irsbot2_3d as space
import numpy as np
import wrong_geometry as wrong
from kinematics_cases import LIMIT, Array, Result, Tick, assembled, random_design  # type: ignore[import-not-found]
from numpy.typing import NDArray
from postures import joint_range

import irsbot_kinematics as irs

LEAST_TYPE2 = 1e-3
"""1: where less is promised, a machine may come so near to Type 2 that Newton's method does not close it."""

ROUNDS = 3
"""How often the search for the worst point of a box goes on from the worst points found."""


def guarantees(designs: int, postures: int, samples: int, seed: int, tick: Tick) -> Result:
    """Corners and inner points of random boxes. `worst` stays 0: what counts is that no promise is broken."""
    result, rng = Result("guarantees"), np.random.default_rng(seed)
    for _ in range(designs):
        robot, d = random_design(rng)
        for assembly, q in assembled(d, postures, rng):
            for centre in q:
                at = robot.mechanism.posture(tuple(centre.tolist()), assembly)
                travel = 10.0 ** rng.uniform(-5.0, -0.5) * rng.uniform(0.0, 1.0, 2)
                points = centre + travel * _corners_and_inner(rng, samples, 2)
                for promise in (robot.mechanism.certified_bounds, robot.mechanism.sharp_bounds):
                    bound = promise(at, travel.tolist())
                    if bound.type2 > 0.0:
                        result.boxes += 1
                        result.count(samples, np.empty(0), _broken(d, points, assembly, bound))
        tick(1)
    return result


def _corners_and_inner(rng: np.random.Generator, samples: int, size: int) -> Array:
    """(samples, size) numbers in -1..1, half of them -1 or 1."""
    inner = rng.uniform(-1.0, 1.0, (samples, size))
    return np.where(rng.uniform(size=inner.shape) < 0.5, np.sign(inner), inner)


def _broken(d: space.Design, q: Array, assembly: int, bound: irs.CertifiedBounds) -> NDArray[np.bool_]:
    with np.errstate(invalid="ignore"):
        psi1, psi2, *_ = space.posture(d, q[:, 0], q[:, 1], assembly)
    found = [np.abs(np.sin(q[:, 0] - psi1)), np.abs(np.sin(q[:, 1] - psi2)), np.abs(np.sin(psi1 - psi2))]
    kept = [value >= floor - LIMIT for value, floor in zip(found, (*bound.type1, bound.type2), strict=True)]
    if bound.constraint > 0.0:
        kept.append(space.kappa(d, psi1, psi2) >= bound.constraint - LIMIT)
    return ~np.all(kept, axis=0)


def geometry(machines: int, postures: int, seed: int, tick: Tick) -> Result:
    """Shipped robots and others of their kinds in turn; random errors, and those that lower a margin fastest."""
    result, rng, names = Result("geometry"), np.random.default_rng(seed), irs.robots()
    for number in range(machines):
        robot = irs.make_robot(names[number // 2 % len(names)])
        if number % 2:
            robot = wrong.random_machine(robot.mechanism.kind, rng)
        for _ in range(postures):
            at = wrong.some_posture(robot, rng)
            if at is None:
                continue
            slack = robot.mechanism.length_m * 10.0 ** rng.uniform(-6.0, -2.3)
            travel = rng.integers(0, 2) * wrong.random_travel(robot, at, rng)
            bound = robot.mechanism.certified_bounds(at, travel.tolist(), slack)
            if bound.type2 > 0.0:
                result.boxes += 1
                met = wrong.margins(robot, at, *wrong.attacks(robot, at, travel, slack, rng))
                kept = wrong.columns(met) >= wrong.columns(bound)[0] - LIMIT
                result.count(len(kept), np.empty(0), ~kept.all(axis=1))
        tick(1)
    return result


def sharp(machines: int, postures: int, seed: int, tick: Tick) -> Result:
    """Shipped robots and others of their kinds in turn, exact and wrong in turn. `worst` is by how much a margin is
    below its bound at most."""
    result, rng, names = Result("sharp"), np.random.default_rng(seed), irs.robots()
    for number in range(machines):
        robot = irs.make_robot(names[number // 2 % len(names)])
        if number % 2:
            robot = wrong.random_machine(robot.mechanism.kind, rng)
        lower, upper = joint_range(robot)
        for turn in range(postures):
            at = wrong.some_posture(robot, rng)
            if at is None:
                continue
            travel = (upper - lower) * 10.0 ** rng.uniform(-5.0, -1.0) * rng.uniform(0.0, 1.0, len(lower))
            travel = np.minimum(travel, np.minimum(np.array(at.joints) - lower, upper - np.array(at.joints)))
            slack = turn % 2 * robot.mechanism.length_m * 10.0 ** rng.uniform(-6.0, -2.3)
            bound = robot.mechanism.sharp_bounds(at, travel.tolist(), slack)
            if bound.type2 > LEAST_TYPE2:
                result.boxes += 1
                below = wrong.columns(bound)[0] - _searched(robot, at, travel, slack, rng)
                result.count(len(below), np.maximum(below, 0.0).max(axis=1), (below > LIMIT).any(axis=1))
        tick(1)
    return result


def _searched(robot: irs.Robot, at: irs.Posture, travel: Array, slack: float, rng: np.random.Generator) -> Array:
    """(N, margins) margins at corners, inner points, and where steps downhill from the worst points lead."""
    n, k = len(travel), wrong.number_of_errors(robot) if slack else 0
    limits = np.concatenate([travel, np.full(k, slack)])

    def met(points: Array) -> Array:
        errors = np.zeros((len(points), wrong.number_of_errors(robot)))
        errors[:, : k or None] = points[:, n:] * slack if k else 0.0
        return wrong.columns(wrong.margins(robot, at, points[:, :n] * travel, errors))

    step = 1e-4 * np.eye(n + k)[limits > 0.0]
    corners = np.array(list(product((-1.0, 1.0), repeat=n)))
    points = np.concatenate([np.zeros((1, n + k)), _corners_and_inner(rng, len(corners) + 16, n + k)])
    points[1 : 1 + len(corners), :n] = corners
    found = [met(points)]
    for _ in range(ROUNDS):
        worst = points[found[-1].argmin(axis=0)]  # one per margin
        around = worst[:, None] + np.concatenate([0.0 * step[:1], step])
        values = met(around.reshape(-1, n + k)).reshape(*around.shape[:2], -1)
        values = np.stack([values[:, :, i][i] for i in range(len(worst))])
        downhill = np.zeros_like(worst)
        downhill[:, limits > 0.0] = values[:, :1] - values[:, 1:]
        downhill /= np.maximum(np.abs(downhill).max(axis=1, keepdims=True), 1e-300)
        steps = 10.0 ** np.array([-2.0, -1.0, 0.0, 6.0])  # the last one leads to a corner
        points = np.clip(worst + steps[:, None, None] * downhill, -1.0, 1.0).reshape(-1, n + k)
        points = np.concatenate([worst, points])
        found.append(met(points))
    return np.concatenate(found)
