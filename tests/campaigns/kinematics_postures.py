"""Parts of kinematics.py: poses, margins, loci and clearances of the IRSBot-2 against the robot in space."""

from __future__ import annotations

import irsbot2_3d as space
import numpy as np
import singular_points as loci
from kinematics_cases import (  # type: ignore[import-not-found]
    BOUNDARY_M,
    PRESETS,
    Array,
    Result,
    Tick,
    assembled,
    design_of,
    random_design,
)

import irsbot_kinematics as irs
from irsbot_kinematics.numerics.arithmetic import ARRAYS


def round_trip(poses: int, seed: int, tick: Tick) -> Result:
    """At least `poses` reachable poses, and unreachable ones among them, in every working mode."""
    result, rng = Result("round trip"), np.random.default_rng(seed)
    for preset in PRESETS:
        robot = irs.make_robot(preset)
        d, left = design_of(robot), poses // len(PRESETS)
        farthest = abs(d.b0) + d.l1 + d.l2eq
        while left > 0:
            x, z = rng.uniform(-farthest, farthest, (2, min(2 * left + 100, 200_000))) - [[0.0], [d.e]]
            reached = _round_trip(robot, x, z, result)
            left -= reached
            tick(reached)
    return result


def _round_trip(robot: irs.Robot, x: Array, z: Array, result: Result) -> int:
    d = design_of(robot)
    far = [np.hypot(x + sign * d.b0, z + d.e) for sign in space.SIGMA]
    reach = np.min([np.minimum(d.l1 + d.l2eq - r, r - abs(d.l1 - d.l2eq)) for r in far], axis=0)
    for mode in robot.mechanism.working_modes:
        q, status, stated = robot.inverse_many(np.stack([x, z], axis=1), mode)
        expected = np.where(reach >= 0.0, irs.Status.SOLVED, irs.Status.UNREACHABLE)
        clear = np.abs(reach) > 1e-8  # the library accepts a nanometre outside
        on = status == irs.Status.SOLVED
        result.count(int(on.sum()), np.abs(stated - reach), clear & (status != expected))
        _there_and_back(robot, d, q[on], np.stack([x, z], axis=1)[on], reach[on], mode, result)
    return int(np.sum(reach > 0.0))


def _there_and_back(
    robot: irs.Robot, d: space.Design, q: Array, P: Array, reach: Array, mode: tuple[int, ...], result: Result
) -> None:
    """Elbows from the joints alone; their distance and the side of P say which gap is near and which assembly it is."""
    C = [
        -sign * d.b0 + d.l1 * np.cos(q[:, k]) + 1j * (-d.e - d.l1 * np.sin(q[:, k]))
        for k, sign in enumerate(space.SIGMA)
    ]
    point = P[:, 0] + 1j * P[:, 1]
    rods = [point - elbow for elbow in C]
    closure = np.max([np.abs(np.abs(rod) - d.l2eq) for rod in rods], axis=0)
    apart = np.abs(C[1] - C[0])
    inside = (reach > BOUNDARY_M) & (apart > BOUNDARY_M) & (2.0 * d.l2eq - apart > BOUNDARY_M)
    side = np.imag(rods[1] * np.conj(rods[0]))  # l2eq^2 sin(psi_I - psi_II), with z up
    for assembly in robot.mechanism.assembly_modes:
        mine = inside & (np.sign(side) == assembly)
        evs = robot.evaluate_many(q[mine], assembly)
        error = np.hypot(*(evs.pose - P[mine]).T)
        wrong = (evs.status != irs.Status.SOLVED) | (evs.working_mode != mode).any(axis=1)
        result.count(0, np.maximum(error, closure[mine]), wrong)


def margins(designs: int, postures: int, seed: int, tick: Tick) -> Result:
    result, rng = Result("margins"), np.random.default_rng(seed)
    for _ in range(designs):
        robot, d = random_design(rng)
        for assembly, q in assembled(d, postures, rng):
            evs = robot.evaluate_many(q, assembly)
            psi1, psi2, *_ = space.posture(d, q[:, 0], q[:, 1], assembly)
            type1 = np.abs(np.sin(q - np.stack([psi1, psi2], axis=1))).T
            type2 = np.abs(np.sin(psi1 - psi2))
            errors = [*(evs.type1_margin.T - type1), evs.type2_margin - type2]
            errors.append(evs.constraint_margin - space.kappa(d, psi1, psi2))
            result.count(len(q), np.abs(errors).max(axis=0), evs.status != irs.Status.SOLVED)
        tick(1)
    return result


def singular_loci(designs: int, points: int, seed: int, tick: Tick) -> Result:
    result, rng = Result("loci"), np.random.default_rng(seed)
    robots = [irs.make_robot(preset) for preset in PRESETS]
    pairs = [(robot, design_of(robot)) for robot in robots] + [random_design(rng) for _ in range(designs)]
    for robot, d in pairs:
        for curve in (loci.parallel_rods(d, points), loci.rods_in_line(d, points)):
            legs = robot.mechanism.legs(ARRAYS, tuple(curve.q.T), (curve.x, curve.z))
            (ax, az), (bx, bz) = legs.screws
            errors = np.abs([ax * bz - az * bx, *legs.closure]).max(axis=0) if len(curve.x) else np.empty(0)
            result.count(len(curve.x), errors, np.empty(0))
        for point in loci.constraint_points(d):
            at = robot.mechanism.at(point.q, (point.x, point.z), 1, (0.0, 0.0))
            result.count(1, np.array([at.constraint, at.residual]), np.empty(0))
        tick(1)
    return result


def clearances(designs: int, postures: int, points: int, seed: int, tick: Tick) -> Result:
    """`worst` is by how much a clearance exceeds the distance to a sampled point, at least that to the locus."""
    result, rng = Result("clearances"), np.random.default_rng(seed)
    for _ in range(designs):
        robot, d = random_design(rng)
        curves = loci.parallel_rods(d, points), loci.rods_in_line(d, points)
        places = {mode: [np.empty((0, 2))] for mode in robot.mechanism.working_modes}
        for curve in curves:
            legs = robot.mechanism.legs(ARRAYS, tuple(curve.q.T), (curve.x, curve.z))
            signs = np.sign(np.array(legs.normalised_levers)).T.astype(int)
            for mode, found in places.items():
                found.append(np.stack([curve.x, curve.z], axis=1)[(signs == mode).all(axis=1)])
        for point in loci.constraint_points(d):
            places.get(point.working_mode, []).append(np.array([[point.x, point.z]]))
        near = {mode: np.concatenate(found) for mode, found in places.items()}
        for assembly, q in assembled(d, postures, rng):
            for joints in q:
                at = robot.mechanism.posture(tuple(joints.tolist()), assembly)
                others = near.get(at.working_mode, np.empty((0, 2)))
                distance = np.min(np.hypot(*(others - at.pose).T), initial=min(at.reach))
                result.count(1, np.array([max(robot.mechanism.clearance(at) - distance, 0.0)]), np.empty(0))
        tick(1)
    return result
