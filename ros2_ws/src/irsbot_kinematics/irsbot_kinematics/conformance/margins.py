"""Laws of margins and statuses: their range, unknown values, one sample and many, certified bounds over boxes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import inf, isfinite, nan, sqrt

import numpy as np

from irsbot_kinematics.batch import evaluate_many
from irsbot_kinematics.conformance.samples import Case, Machine, apart, numbers, place
from irsbot_kinematics.errors import Unreachable
from irsbot_kinematics.mechanism import CertifiedBounds, Mechanism, Posture, Status
from irsbot_kinematics.numerics.arithmetic import FLOATS, Array
from irsbot_kinematics.numerics.tolerances import COINCIDENT_TOL_M

IN_BOX = 16
"""Random joint positions in each box, half of their coordinates at its faces."""
SEARCHED, STARTS, STEPS = 12, 2, (2.0, 1.0, 0.5)
"""Postures whose bounds a local search attacks: number, number of corners, and steps as shares of the travel."""
HALVINGS = 12
"""Of the width of the boxes that are searched."""
SMALL = 1e-9
"""1: share of the joint range of a box over which a certified bound must be almost the margins."""


def in_range(machine: Machine) -> Iterator[Case]:
    """All margins lie in 0..1; the constraint margin may be larger."""
    for at in machine.postures:
        margins = (*at.type1, at.type2, *at.limb, 0.0 if at.constraint != at.constraint else min(at.constraint, 1.0))
        outside = max([max(-value, value - 1.0) if value == value else inf for value in margins])
        yield Case(outside, f"{place(at)}: margins {numbers(margins)}")


def _margins(at: Posture) -> tuple[float, ...]:
    constraint = (at.constraint,) if isfinite(at.constraint) else ()
    return (*at.type1, at.type2, *constraint, *at.limb)


def _floors(bound: CertifiedBounds) -> tuple[float, ...]:
    constraint = (bound.constraint,) if isfinite(bound.constraint) else ()
    return (*bound.type1, bound.type2, *constraint, *bound.limb)


def unit_screws(machine: Machine) -> Iterator[Case]:
    """The force part of every screw has length 1."""
    turns = machine.mechanism.task[-1].is_angle
    for at in machine.postures:
        for leg, screw in enumerate(at.screws, 1):
            size = float(np.linalg.norm(screw[:-1] if turns else screw))
            yield Case(
                abs(size - 1.0), f"leg {leg} at {place(at)}: the force of {numbers(screw)} has length {size:.6g}"
            )


def posture_is_legs(machine: Machine) -> Iterator[Case]:
    """A posture carries what `legs` says at its joints and pose, also where `posture` is written for speed."""
    for at in machine.postures:
        legs = machine.mechanism.legs(FLOATS, at.joints, at.pose)
        for name in ("screws", "levers", "normalised_levers", "reach", "limb", "attachments"):
            stated, by_legs = np.array(getattr(at, name)).ravel(), np.array(getattr(legs, name)).ravel()
            away = float(np.abs(stated - by_legs).max(initial=0.0)) if stated.shape == by_legs.shape else inf
            yield Case(away, f"{place(at)}: {name} {numbers(stated)}, by legs {numbers(by_legs)}")


def sines_are_levers(machine: Machine) -> Iterator[Case]:
    """Type 1 sine is the lever over its largest size: their ratio is one number per leg, with sign +."""
    ratios: list[list[float]] = [[] for _ in machine.mechanism.joints]
    for at in machine.regular:
        for leg, (sine, lever) in enumerate(zip(at.normalised_levers, at.levers, strict=True)):
            ratios[leg].append(lever / sine)
            usual = float(np.median(ratios[leg]))
            error = abs(ratios[leg][-1] / usual - 1.0) if usual > 0.0 else inf
            yield Case(
                error, f"leg {leg + 1} at {place(at)}: lever {lever:.6g}, sine {sine:.6g}, elsewhere over {usual:.6g}"
            )


def unknown_is_unknown(machine: Machine) -> Iterator[Case]:
    """NaN and infinite joints give INVALID and NaN; nothing is promised for a travel that is no number."""
    mechanism = machine.mechanism
    good = machine.regular[0]
    for bad in (nan, inf, -inf):
        for joint in range(len(good.joints)):
            q = tuple(bad if k == joint else value for k, value in enumerate(good.joints))
            for at in (mechanism.posture(q, good.assembly_mode), mechanism.track(q, good)):
                known = [value for value in (*at.pose, *at.type1, at.type2) if value == value]
                right = at.status == Status.INVALID and not known
                yield Case(
                    0.0 if right else 1.0, f"joints {numbers(q)} give {Status(at.status).name}, pose {numbers(at.pose)}"
                )
            if bad < 0.0:
                continue
            far = [bad if k == joint else 0.0 for k in range(len(good.joints))]
            bounds = [mechanism.certified_bounds(good, far), mechanism.sharp_bounds(good, far)]
            for floors in map(_floors, bounds):
                promised = max([value if value == value else 1.0 for value in floors])
                yield Case(promised, f"{place(good)}, travel {numbers(far)}: promises {numbers(floors)}")


def refusals(machine: Machine) -> Iterator[Case]:
    """A pose far away is Unreachable by a negative reach; joints without a pose are NotAssembled, with NaN margins."""
    robot, mechanism = machine.robot, machine.mechanism
    far = tuple(0.3 if axis.is_angle else 1e4 * mechanism.length_m for axis in mechanism.task)
    for mode in mechanism.working_modes:
        _, reach = mechanism.inverse(FLOATS, far, mode)
        try:
            robot.inverse(far, mode)
            yield Case(1.0, f"pose {numbers(far)} counts as reachable, reach {numbers(reach)} m")
        except Unreachable as error:
            yield Case(0.0 if error.reach_m < 0.0 else 1.0, str(error))
    for q, label, at in machine.asked:
        if at.status == Status.SOLVED:
            continue
        known = [value for value in (*at.pose, *at.type1, at.type2) if value == value]
        if at.status != Status.INVALID and min(at.gaps) > COINCIDENT_TOL_M:
            known.append(min(at.gaps))
        stated = f"joints {numbers(q)}, mode {label:+d}: {Status(at.status).name}, yet {numbers(tuple(known))}"
        yield Case(1.0 if known else 0.0, stated)


def many_are_single(machine: Machine) -> Iterator[Case]:
    """evaluate_many and inverse_many say what the single calls say."""
    robot, mechanism = machine.robot, machine.mechanism
    found = {label: evaluate_many(mechanism, machine.joints, label) for label in mechanism.assembly_modes}
    for k, (q, label, at) in enumerate(machine.asked):
        many, i = found[label], k // len(mechanism.assembly_modes)
        where = f"joints {numbers(q)}, mode {label:+d}"
        if many.status[i] != at.status:
            yield Case(inf, f"{where}: one says {Status(at.status).name}, many say {Status(many.status[i]).name}")
        elif at.status == Status.SOLVED:
            one, all_ = (
                (*at.type1, at.type2, *at.limb),
                (*many.type1_margin[i], many.type2_margin[i], *many.limb_margin[i]),
            )
            away = max(apart(mechanism.task, tuple(many.pose[i]), at.pose), _away(one, all_))
            yield Case(away * at.type2, f"{where}: one says {numbers(one)}, many say {numbers(all_)}")
    blank = evaluate_many(mechanism, np.full((1, len(mechanism.joints)), nan), mechanism.usual_assembly_mode)
    left = blank.status[0] == Status.INVALID and np.isnan([*blank.pose[0], blank.type2_margin[0]]).all()
    yield Case(
        0.0 if left else inf, f"NaN joints among many: {Status(blank.status[0]).name}, pose {numbers(blank.pose[0])}"
    )
    X = np.array([at.pose for at in machine.regular])
    for mode in mechanism.working_modes:
        joints, status, reach = robot.inverse_many(X, mode)
        for x, q, state, r in zip(X.tolist(), joints, status, reach, strict=True):
            one, slack = mechanism.inverse(FLOATS, x, mode)
            away = abs(min(slack) - r) if state != Status.SOLVED or r < 1e-3 else apart(mechanism.joints, one, tuple(q))
            yield Case(
                away, f"pose {numbers(tuple(x))}, mode {mode}: one says {numbers(one)}, many say {numbers(tuple(q))}"
            )


def _away(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    return float(np.abs(np.subtract(a, b)).max())


def promises_kept(machine: Machine) -> Iterator[Case]:
    """No margin met in a box of joints is below what `certified_bounds` promises, and the branch goes on in the box."""
    yield from _boxes(machine, machine.mechanism.certified_bounds)


def sharp_promises_kept(machine: Machine) -> Iterator[Case]:
    """No margin met in a box of joints is below what `sharp_bounds` promises, and the branch goes on in the box."""
    yield from _boxes(machine, machine.mechanism.sharp_bounds)


def _boxes(machine: Machine, promise: Callable[[Posture, Sequence[float]], CertifiedBounds]) -> Iterator[Case]:
    rng = machine.random()
    lower, upper = machine.ranges
    for at in machine.spread:
        for size in (10.0 ** rng.uniform(-5.0, -1.0), 10.0 ** rng.uniform(-3.0, -2.0)):
            travel = (upper - lower) * size * rng.uniform(0.0, 1.0, len(lower))
            bound = promise(at, travel.tolist())
            stated = f"{place(at)}, travel {numbers(tuple(travel))}"
            yield from _kept(machine.mechanism, at, bound, stated, _in_box(rng, np.array(at.joints), travel))
    for at in machine.spread[:: max(1, len(machine.spread) // SEARCHED)]:
        travel = _widest(machine, at, promise, rng)
        bound = promise(at, travel.tolist())
        stated = f"{place(at)}, travel {numbers(tuple(travel))}"
        yield from _kept(machine.mechanism, at, bound, stated, _worst_in_box(machine.mechanism, at, bound, travel, rng))


def _widest(
    machine: Machine,
    at: Posture,
    promise: Callable[[Posture, Sequence[float]], CertifiedBounds],
    rng: np.random.Generator,
) -> Array:
    """A box over which little of the Type 2 margin is left: there a bound depends most on the second order."""
    lower, upper = machine.ranges
    shape = (upper - lower) * rng.uniform(0.2, 1.0, len(lower))
    low, high = 1e-6, 0.3
    for _ in range(HALVINGS):
        middle = sqrt(low * high)
        low, high = (middle, high) if promise(at, (middle * shape).tolist()).type2 > 0.1 * at.type2 else (low, middle)
    return np.asarray(low * shape)


def _worst_in_box(
    mechanism: Mechanism, at: Posture, bound: CertifiedBounds, travel: Array, rng: np.random.Generator
) -> Array:
    """Joints (1, n) of a box at which a margin comes nearest to its bound, or falls below it: local search from random
    corners, one joint after the other, with steps that become smaller."""
    floors, middle = np.array(_floors(bound)), np.array(at.joints)

    def lack(share: Array) -> float:
        met = mechanism.track(tuple((middle + share * travel).tolist()), at)
        return float((floors - _margins(met)).max()) if met.status == Status.SOLVED else inf

    best: Array = np.zeros(len(travel))
    worst = -inf
    for _ in range(STARTS):
        share = np.sign(rng.uniform(-1.0, 1.0, len(travel)))
        found = lack(share)
        for step in STEPS:
            for joint in range(len(travel)):
                for way in (step, -step):
                    moved = share.copy()
                    moved[joint] = min(max(moved[joint] + way, -1.0), 1.0)
                    if moved[joint] != share[joint] and (value := lack(moved)) > found:
                        share, found = moved, value
        if found > worst:
            best, worst = share, found
    return (middle + best * travel)[np.newaxis]


def _kept(mechanism: Mechanism, at: Posture, bound: CertifiedBounds, stated: str, joints: Array) -> Iterator[Case]:
    """Compare a bound with the margins at joints (N, n)."""
    if not bound.type2 > 0.0:
        return
    floors = np.array(_floors(bound))
    stated = f"{stated}: promised {numbers(tuple(floors))}"
    for q in joints.tolist():
        met = mechanism.track(tuple(q), at)
        if met.status != Status.SOLVED:
            yield Case(inf, f"{stated}; at joints {numbers(q)} there is no posture")
            continue
        margins = _margins(met)
        yield Case(float((floors - margins).max()), f"{stated}; at joints {numbers(q)} {numbers(margins)}")


def _in_box(rng: np.random.Generator, middle: Array, travel: Array) -> Array:
    inner = rng.uniform(-1.0, 1.0, (IN_BOX, len(travel)))
    share = np.where(rng.uniform(size=inner.shape) < 0.5, np.sign(inner), inner)
    return np.asarray(middle + share * travel)


def promises_something(machine: Machine) -> Iterator[Case]:
    """Over a box that is almost a point the guarantee is almost the margins: bounds of 0 stop a robot for nothing."""
    lower, upper = machine.ranges
    for at in machine.regular:
        bound = machine.mechanism.certified_bounds(at, (SMALL * (upper - lower)).tolist())
        lost = float(np.subtract(_margins(at), _floors(bound)).max())
        yield Case(lost, f"{place(at)}: margins {numbers(_margins(at))}, promised {numbers(_floors(bound))}")


def clearance_kept(machine: Machine) -> Iterator[Case]:
    """No straight translation shorter than `clearance` meets a singularity or leaves the workspace."""
    mechanism, rng = machine.mechanism, machine.random()
    turns = mechanism.task[-1].is_angle
    for at in machine.regular:
        clearance = mechanism.clearance(at)
        if not clearance >= 0.0:
            yield Case(inf, f"{place(at)}: clearance {clearance}")
            continue
        for _ in range(6):
            way = rng.normal(size=len(at.pose) - turns)
            way *= 0.999 * clearance / np.linalg.norm(way)
            met, way = at, np.append(way, [0.0] * turns)
            for share in np.linspace(0.1, 1.0, 10):
                x = tuple((np.array(at.pose) + share * way).tolist())
                q, reach = mechanism.inverse(FLOATS, x, at.working_mode)
                met = mechanism.track(q, met)
                if not min(reach) > 0.0 or met.status != Status.SOLVED:
                    break
            stated = f"{place(at)}, clearance {clearance:.6g} m: pose {numbers(x)}"
            if not min(reach) > 0.0 or met.status != Status.SOLVED:
                yield Case(inf, f"{stated} has reach {min(reach):.6g} m, {Status(met.status).name}")
            else:
                yield Case(apart(mechanism.task, met.pose, x), f"{stated} is not on the branch any more")


def _other_label(mechanism: Mechanism, here: Posture, there: Posture, straight: float) -> str:
    """The fault of a branch that continues with another label although labels are declared to be invariant."""
    if not mechanism.label_is_invariant or apart(mechanism.task, there.pose, here.pose) <= 2.0 * straight:
        return ""
    for mode in mechanism.assembly_modes:
        other = mechanism.posture(there.joints, mode)
        if other.status == Status.SOLVED and apart(mechanism.task, other.pose, here.pose) <= 2.0 * straight:
            return f", the branch goes on in assembly mode {mode:+d}: set label_is_invariant = False and write track"
    return ""


def labels_stay(machine: Machine) -> Iterator[Case]:
    """Along a motion free of singularities the posture moves on continuously, under the same label."""
    mechanism, rng = machine.mechanism, machine.random()
    lower, upper = machine.ranges
    for at in machine.regular[: len(machine.regular) // 4 + 1]:
        way = rng.uniform(-1.0, 1.0, len(lower)) * (upper - lower) * 2e-4
        here = at
        for _ in range(40):
            there = mechanism.track(tuple(np.add(here.joints, way).tolist()), here)
            if there.status != Status.SOLVED or min(there.type2, here.type2) < 0.2:
                break
            step = apart(mechanism.task, there.pose, here.pose)
            A, B = np.array(here.screws), np.array(here.levers)
            straight = float(np.abs(np.linalg.solve(A, -B * way)).max())
            stated = f"{place(here)}, then joints {numbers(there.joints)}: the pose jumps to {numbers(there.pose)}"
            yield Case(step - 2.0 * straight, stated + (_other_label(mechanism, here, there, straight) if step else ""))
            here = there
