"""A law of exactly singular postures: every request there returns numbers or a refusal."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import product
from math import inf, isfinite, pi

import numpy as np

from irsbot_kinematics.batch import evaluate_many
from irsbot_kinematics.conformance.samples import JOINTS, Case, Machine, numbers, place
from irsbot_kinematics.errors import NotAssembled
from irsbot_kinematics.mechanism import CertifiedBounds, Floats, Mechanism, Posture, Signs, Status
from irsbot_kinematics.numerics.arithmetic import FLOATS, Array
from irsbot_kinematics.numerics.tolerances import REACH_TOL_M

COMBINED = 60
"""Largest number of combinations of corners and middles of the ranges."""
EQUAL = 6
"""Number of joint positions that are all equal, or equal with alternating signs."""
BOUNDARY = 3
"""Number of regular postures from which the boundary of the workspace is searched, along each leg."""
MODES = 4
"""Number of working modes and labels that are tried there."""
FARTHER = 6
"""Number of steps, each twice as long, after which the search for the other end of a reach is given up."""
STEPS = 8
"""Newton steps to the boundary: the reach of most legs is linear along its gradient, so two would suffice."""
TRIED = ((0.0, 0.0), (1e-9, 0.0), (1e-3, 0.0), (0.0, 1e-9), (1e-3, 1e-4))
"""Shares of the joint range and of the characteristic length: travels with slacks."""


def singular_answered(machine: Machine) -> Iterator[Case]:
    """Straight, folded, coincident, parallel and symmetric postures are answered: margins are numbers in 0..1, no bound
    is above them, nothing raises but NotAssembled. Who asks for fewer than JOINTS random joint positions gets as much
    fewer of these joint positions and poses, evenly chosen."""
    for at in _postures(machine):
        stated = place(at)
        for name, wrong in (("posture", _of_posture), ("bounds", _of_bounds), ("answers", _of_answers)):
            try:
                error, words = wrong(machine, at)
            except Exception as problem:  # a mechanism of the user may raise anything
                error, words = inf, f"{name}: {type(problem).__name__}: {' '.join(str(problem).split())}"
            yield Case(error, f"{stated}: {words}")


# --- what is asked -----------------------------------------------------------------------------------------------


def _of_posture(machine: Machine, at: Posture) -> tuple[float, str]:
    """Numbers of a posture that counts as solved."""
    margins = _margins(at)
    others = [*at.pose, *at.reach, at.det, *at.levers, *[value for row in at.screws for value in row]]
    known = all(map(isfinite, (*margins, *others))) and len(at.limb) == machine.mechanism.limb_count
    outside = max([max(-value, value - 1.0) for value in (*at.type1, at.type2, *at.limb)])
    return (outside if known else inf), f"margins {numbers(margins)}, pose and legs {numbers(others)}"


def _of_bounds(machine: Machine, at: Posture) -> tuple[float, str]:
    mechanism, worst, words = machine.mechanism, 0.0, "bounds"
    lower, upper = machine.ranges
    margins = _margins(at)
    clearance = mechanism.clearance(at)
    if not 0.0 <= clearance < inf:
        return inf, f"clearance {clearance}"
    for share, slack in TRIED:
        travel = (share * (upper - lower)).tolist()
        bound = mechanism.certified_bounds(at, travel, slack * mechanism.length_m)
        sharp = mechanism.sharp_bounds(at, travel, slack * mechanism.length_m)
        for floors, least in ((_margins(bound), margins), (_margins(sharp), margins)):
            right = len(floors) == len(margins) and min(floors) >= 0.0 and all(map(isfinite, floors))
            over = float(np.subtract(floors, least).max()) if right else inf
            if over > worst:
                worst, words = over, f"travel {numbers(travel)}: margins {numbers(margins)}, promised {numbers(floors)}"
    return worst, words


def _of_answers(machine: Machine, at: Posture) -> tuple[float, str]:
    """The other requests of library users and of the supervisor."""
    robot, mechanism, q, ones = machine.robot, machine.mechanism, at.joints, (1.0,) * len(at.joints)
    near = tuple(np.add(q, 1e-6).tolist())
    for joints in (q, near):
        mechanism.track(joints, at)
    many = evaluate_many(mechanism, np.array([q, near]), at.assembly_mode)
    poses = many.pose[many.status == Status.SOLVED]
    worst = [value for value in robot.reaction_max(at.pose, q, 1.0, 0.3).tolist() if not value >= 0.0]
    if worst or not np.isfinite(poses).all() or not all(map(isfinite, mechanism.bias(at, ones, ones))):
        return inf, f"reaction_max, evaluate_many or bias: not numbers, {numbers(worst)}"
    asked: tuple[Callable[[], Array], ...] = (
        lambda: np.array(robot.evaluate(q, at.assembly_mode).pressure_angle),
        lambda: robot.velocity(at.pose, q, ones),
        lambda: robot.acceleration(at.pose, q, ones, ones),
        lambda: robot.reactions(at.pose, q, ones),
        lambda: robot.efforts(at.pose, q, ones),
    )
    for question in asked:
        try:
            answer = question()
        except NotAssembled:
            continue
        if not np.isfinite(answer).all():
            return inf, f"velocity, forces or angles {numbers(answer)}"
    return 0.0, "answers"


def _margins(of: Posture | CertifiedBounds) -> Floats:
    """The margins that the posture has."""
    return (*of.type1, of.type2, *of.limb, *([of.constraint] if isfinite(of.constraint) else []))


# --- postures ------------------------------------------------------------------------------------------------------


def _postures(machine: Machine) -> Iterator[Posture]:
    mechanism, share = machine.mechanism, min(len(machine.joints) / JOINTS, 1.0)
    for q in _thinned(_special_joints(machine), share):
        for label in mechanism.assembly_modes:
            yield from _solved(mechanism.posture(q, label))
    for pose in _thinned(_special_poses(machine), share):
        for mode in _some(mechanism.working_modes, mechanism.usual_working_mode):
            q, reach = mechanism.inverse(FLOATS, pose, mode)
            if min(reach) < -REACH_TOL_M:
                continue
            for label in mechanism.assembly_modes[:MODES]:
                yield from _solved(mechanism.posture(q, label))
            _, gaps = mechanism.direct(FLOATS, q, mechanism.usual_assembly_mode)
            yield mechanism.at(q, pose, mechanism.usual_assembly_mode, gaps)


def _thinned(found: Iterable[Floats], share: float) -> Iterator[Floats]:
    """This share of them, evenly chosen."""
    return (one for number, one in enumerate(found) if int(share * number) < int(share * (number + 1)))


def _solved(at: Posture) -> Iterator[Posture]:
    if at.status == Status.SOLVED:
        yield at


def _some(modes: tuple[Signs, ...], usual: Signs) -> list[Signs]:
    return [usual, *[mode for mode in modes if mode != usual][: MODES - 1]]


def _special_joints(machine: Machine) -> Iterator[Floats]:
    """Quarters of a turn, ends and middles of slides, in every combination; equal joints."""
    mechanism, rng = machine.mechanism, machine.random()
    lower, upper = machine.ranges
    kinds = [
        (0.0, 0.5 * pi, pi, -0.5 * pi) if joint.is_angle else (first, 0.5 * (first + last), last)
        for joint, first, last in zip(mechanism.joints, lower.tolist(), upper.tolist(), strict=True)
    ]
    combined = list(product(*kinds))
    for k in rng.permutation(len(combined))[:COMBINED]:
        yield combined[k]
    for share in rng.uniform(size=EQUAL):
        same = lower + share * (upper - lower)
        yield tuple(same.tolist())
        yield tuple((0.5 * (lower + upper) + (same - 0.5 * (lower + upper)) * (-1.0) ** np.arange(len(same))).tolist())


def _special_poses(machine: Machine) -> Iterator[Floats]:
    """The platform in the middle, at turns that symmetric legs have in common; and every leg at the end of its reach,
    which is straight or folded, to nothing if its links are equal."""
    mechanism = machine.mechanism
    turns = mechanism.task[-1].is_angle
    for turn in (0.0, 0.5 * pi, pi) if turns else (0.0,):
        for height in (0.0, mechanism.length_m):
            places = [0.0] * (len(mechanism.task) - turns - 1) + [height]
            yield (*places, turn) if turns else tuple(places)
    for at in machine.regular[:BOUNDARY]:
        for leg in range(len(at.joints)):
            yield from _boundaries(mechanism, at, leg)


def _boundaries(mechanism: Mechanism, at: Posture, leg: int) -> Iterator[Floats]:
    """Poses that the platform reaches on a straight line, without a turn, at the ends of the reach of one leg."""
    size = len(at.pose)
    moves = np.eye(size)[: size - mechanism.task[-1].is_angle]
    step = 1e-6 * mechanism.length_m

    def reach(x: Array) -> float:
        reaches: Floats
        _, reaches = mechanism.inverse(FLOATS, tuple(x.tolist()), at.working_mode)
        return reaches[leg]

    def slope(x: Array) -> Array:
        ahead = np.array([reach(x + step * move) - reach(x - step * move) for move in moves])
        return np.asarray(ahead / (2.0 * step) @ moves)

    def boundary(x: Array) -> Floats:
        for _ in range(STEPS):
            way, left = slope(x), reach(x)
            steep = float(way @ way)
            if not steep > 0.0 or left == 0.0:
                break
            x = x - left / steep * way
        return tuple(x.tolist())

    start = np.array(at.pose)
    yield boundary(start)
    inwards = slope(start)
    for k in range(FARTHER):
        other = start + mechanism.length_m * 2.0 ** (k - 2) * inwards
        if slope(other) @ inwards < 0.0:  # reach falls again: another end is near
            yield boundary(other)
            break
