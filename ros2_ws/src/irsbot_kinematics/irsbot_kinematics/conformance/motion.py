"""Laws of the kinematics: inverse, direct, Jacobians, velocities, forces."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from math import inf, remainder

import numpy as np

from irsbot_kinematics import statics
from irsbot_kinematics.batch import direct_many
from irsbot_kinematics.conformance.samples import Case, Machine, apart, numbers, place
from irsbot_kinematics.mechanism import Coordinate, Floats, Posture, Status
from irsbot_kinematics.numerics.arithmetic import FLOATS, Array

STEP = 1e-3
"""rad, or times the characteristic length: step of five-point differences, whose error is then near 1e-12."""
WEIGHTS = {-2: 1.0, -1: -8.0, 1: 8.0, 2: -1.0}
"""Weights of the five-point first difference, over 12 steps."""
BEND = {-2: -1.0, -1: 16.0, 0: -30.0, 1: 16.0, 2: -1.0}
"""Weights of the five-point second difference, over 12 squared steps."""


def inverse_closes(machine: Machine) -> Iterator[Case]:
    """Legs of every inverse solution meet their pose."""
    mechanism = machine.mechanism
    for at in machine.postures:
        for mode, q in machine.inverses(at):
            error = max(map(abs, mechanism.legs(FLOATS, q, at.pose).closure))
            yield Case(error, f"inverse of pose {numbers(at.pose)} in mode {mode} gives joints {numbers(q)}")


def inverse_keeps_mode(machine: Machine) -> Iterator[Case]:
    """Signs of the Type 1 sines of an inverse solution are its working mode."""
    mechanism = machine.mechanism
    for at in machine.regular:
        for mode, q in machine.inverses(at):
            normalised_levers = mechanism.legs(FLOATS, q, at.pose).normalised_levers
            wrong = max([-sine * sign for sine, sign in zip(normalised_levers, mode, strict=True)])
            yield Case(
                wrong, f"inverse of pose {numbers(at.pose)} in mode {mode} has the sines {numbers(normalised_levers)}"
            )


def direct_gives_back(machine: Machine) -> Iterator[Case]:
    """The pose of an inverse solution is among the direct ones of its joints."""
    mechanism = machine.mechanism
    asked = [(at, mode, q) for at in machine.regular for mode, q in machine.inverses(at)]
    Q = np.array([q for _, _, q in asked])
    found = [direct_many(mechanism, Q, label)[:2] for label in mechanism.assembly_modes]
    for i, (at, mode, q) in enumerate(asked):
        legs = mechanism.legs(FLOATS, q, at.pose)
        if min(statics.pressure_cosines(FLOATS, legs.screws, legs.attachments)[1]) < 1e-3:
            continue  # two assembly modes meet
        poses = [tuple(pose[i].tolist()) for pose, status in found if status[i] == Status.SOLVED]
        away = min([apart(mechanism.task, pose, at.pose) for pose in poses], default=inf)
        yield Case(
            away, f"pose {numbers(at.pose)}, joints {numbers(q)} of mode {mode}: no direct solution is that pose"
        )


def direct_closes(machine: Machine) -> Iterator[Case]:
    """Every direct solution meets its legs, in the assembly mode and with the residual that it claims."""
    for at in machine.postures:
        closure = machine.mechanism.legs(FLOATS, at.joints, at.pose).closure
        yield Case(max(*map(abs, closure), at.residual), f"direct solution at {place(at)}")


def jacobian_pose(machine: Machine) -> Iterator[Case]:
    """Row i of A is the gradient of the closure of leg i by the pose, or its negative."""
    for at in machine.regular:
        rows, signs = _closure_gradient(machine, at, by_pose=True), _signs(machine, at)
        for leg, (row, screw, sign) in enumerate(zip(rows, at.screws, signs, strict=True), 1):
            stated = f"leg {leg} at {place(at)}: screw {numbers(screw)}, gradient of the closure {numbers(sign * row)}"
            yield Case(float(np.abs(sign * row - screw).max()), stated)


def jacobian_joints(machine: Machine) -> Iterator[Case]:
    """B_ii is the derivative of the closure of leg i by its joint, with the sign of row i; by other joints it is 0."""
    for at in machine.regular:
        slopes, signs = _closure_gradient(machine, at, by_pose=False), _signs(machine, at)
        for leg, (slope, lever, sign) in enumerate(zip(slopes, at.levers, signs, strict=True)):
            expected = np.where(np.arange(len(slope)) == leg, lever, 0.0)
            stated = (
                f"leg {leg + 1} at {place(at)}: lever {lever:.6g}, differences of the closure {numbers(sign * slope)}"
            )
            yield Case(float(np.abs(sign * slope - expected).max()), stated)


def _signs(machine: Machine, at: Posture) -> list[float]:
    """Sign of each closure along its screw."""
    rows = _closure_gradient(machine, at, by_pose=True)
    return [1.0 if float(np.dot(row, screw)) >= 0.0 else -1.0 for row, screw in zip(rows, at.screws, strict=True)]


def _closure_gradient(machine: Machine, at: Posture, *, by_pose: bool) -> Array:
    """(legs, coordinates)"""
    legs = machine.mechanism.legs
    if by_pose:
        return _gradient(machine, at.pose, lambda x: legs(FLOATS, at.joints, x).closure, joints=False).T
    return _gradient(machine, at.joints, lambda q: legs(FLOATS, q, at.pose).closure, joints=True).T


def _gradient(machine: Machine, at: Floats, value: Callable[[Floats], Floats], *, joints: bool) -> Array:
    """(coordinates, values)"""
    axes = machine.mechanism.joints if joints else machine.mechanism.task
    rows = []
    for i, axis in enumerate(axes):
        step = STEP * (1.0 if axis.is_angle else machine.mechanism.length_m)
        moved = {k: np.array(value((*at[:i], at[i] + k * step, *at[i + 1 :]))) for k in WEIGHTS}
        rows.append(_total(moved, WEIGHTS) / (12.0 * step))
    return np.array(rows)


def inverse_rates(machine: Machine) -> Iterator[Case]:
    """A t + B qdot = 0 with qdot from differences of the inverse kinematics along t."""
    mechanism, rng = machine.mechanism, machine.random()
    for at in machine.regular:
        way = rng.normal(size=len(at.pose)) * _scales(machine.mechanism.task, machine.mechanism.length_m)
        way /= max(1.0, *np.abs(np.array(at.screws) @ way / np.array(at.levers)))
        poses = {k: tuple((np.array(at.pose) + STEP * k * way).tolist()) for k in WEIGHTS}
        found = {k: mechanism.inverse(FLOATS, x, at.working_mode) for k, x in poses.items()}
        if min(min(reach) for _, reach in found.values()) <= 0.0:
            continue
        near = {k: _unwound(mechanism.joints, q, at.joints) for k, (q, _) in found.items()}
        rates = _slope(near)
        left = np.array(at.screws) @ way + np.array(at.levers) * rates
        stated = f"{place(at)}, twist {numbers(tuple(way))}: joint rates {numbers(tuple(rates))} leave {numbers(left)}"
        yield Case(float(np.abs(left).max()) / (1.0 + float(np.abs(rates).max())), stated)


def _scales(axes: tuple[Coordinate, ...], length_m: float) -> Array:
    return np.array([1.0 if axis.is_angle else length_m for axis in axes])


def _random_rates(machine: Machine, at: Posture, rng: np.random.Generator) -> Array:
    """Joint rates at which neither joints nor platform move by more than about the length, or a radian, per second."""
    mechanism = machine.mechanism
    rates = rng.uniform(-1.0, 1.0, len(at.joints)) * _scales(mechanism.joints, mechanism.length_m)
    twist = np.linalg.solve(np.array(at.screws), -np.array(at.levers) * rates)
    return np.asarray(rates / max(1.0, *np.abs(twist / _scales(mechanism.task, mechanism.length_m))))


def _unwound(axes: tuple[Coordinate, ...], values: Floats, near: Floats) -> Array:
    """Values whose angles are counted from nearby ones, without the jump at half a turn."""
    turns = [axis.turn for axis in axes]
    return np.array([b + remainder(a - b, turn) for a, b, turn in zip(values, near, turns, strict=True)])


def direct_rates(machine: Machine) -> Iterator[Case]:
    """A a + B qddot + bias = 0 with velocities and accelerations from differences of the direct kinematics."""
    mechanism, rng = machine.mechanism, machine.random()
    for at in machine.regular:
        rates, bends = _random_rates(machine, at, rng), _random_rates(machine, at, rng)
        poses = _along(machine, at, rates, bends)
        if poses is None:
            continue
        velocity = _slope(poses)
        acceleration = _total(poses, BEND) / (12.0 * STEP**2)
        bias = mechanism.bias(at, tuple(rates.tolist()), tuple(velocity.tolist()))
        A, B = np.array(at.screws), np.array(at.levers)
        size = 1.0 + float(np.abs(acceleration).max()) + float(np.abs(velocity).max())
        left, more = A @ velocity + B * rates, A @ acceleration + B * bends + np.array(bias)
        stated = f"{place(at)}, joint rates {numbers(tuple(rates))}, accelerations {numbers(tuple(bends))}: "
        yield Case(float(np.abs(left).max()) / size, stated + f"A t + B qdot = {numbers(left)}")
        yield Case(float(np.abs(more).max()) / size, stated + f"A a + B qddot + bias = {numbers(more)}")


def _total(values: Mapping[int, Array], weights: Mapping[int, float]) -> Array:
    return np.asarray(sum([weight * values[k] for k, weight in weights.items()]))


def _slope(values: Mapping[int, Array]) -> Array:
    return np.asarray(_total(values, WEIGHTS) / (12.0 * STEP))


def _along(machine: Machine, at: Posture, rates: Array, bends: Array) -> dict[int, Array] | None:
    """Poses at -2 to 2 steps of a motion through a posture; None where the branch ends."""
    poses = {}
    for k in BEND:
        t = k * STEP
        one = machine.mechanism.track(tuple((np.array(at.joints) + rates * t + 0.5 * bends * t * t).tolist()), at)
        if one.status != Status.SOLVED:
            return None
        poses[k] = _unwound(machine.mechanism.task, one.pose, at.pose)
    return poses


def virtual_work(machine: Machine) -> Iterator[Case]:
    """Motor efforts do the work that a load takes, on velocities from differences of the direct kinematics."""
    robot, rng = machine.robot, machine.random()
    for at in machine.regular:
        rates, wrench = _random_rates(machine, at, rng), rng.normal(size=len(at.pose))
        poses = _along(machine, at, rates, 0.0 * rates)
        if poses is None:
            continue
        twist = _slope(poses)
        efforts = robot.efforts(at.pose, at.joints, wrench)
        work, size = efforts @ rates + wrench @ twist, 1.0 + np.abs(efforts) @ np.abs(rates)
        stated = (
            f"{place(at)}, load {numbers(wrench)}, rates {numbers(rates)}: efforts {numbers(efforts)} leave {work:.2g}"
        )
        yield Case(float(abs(work) / size), stated)


def load_maximum(machine: Machine) -> Iterator[Case]:
    """reaction_max is the largest leg force over 2000 directions of a load: never less, and nearly met."""
    robot, rng = machine.robot, machine.random()
    turns = machine.mechanism.task[-1].is_angle
    for at in machine.regular[: len(machine.regular) // 4 + 1]:
        ways = rng.normal(size=(2000, len(at.pose) - turns))
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        if turns:
            ways = np.concatenate([np.insert(ways, ways.shape[1], sign * 0.3, axis=1) for sign in (-1.0, 1.0)])
        met = np.abs(np.linalg.solve(np.array(at.screws).T, ways.T)).max(axis=1)
        stated = robot.reaction_max(at.pose, at.joints, 1.0, 0.3)
        over = float((met / stated - 1.0).max())
        yield Case(over, f"{place(at)}: 1 N and 0.3 N m give {numbers(met)} N, reaction_max {numbers(stated)} N")
