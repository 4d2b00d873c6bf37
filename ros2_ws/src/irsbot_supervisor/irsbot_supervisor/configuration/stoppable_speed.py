"""Search for the fastest motion that can be stopped: stopping distances against margins, in the postures with the
largest margins.

The postures of a robot are computed once, spread evenly over its joint ranges; limits and speeds are evaluated anew
each time.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import isfinite, pi
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from irsbot_kinematics import Mechanism, Posture
from irsbot_kinematics.batch import Evaluations, evaluate_many
from irsbot_kinematics.mechanism import Coordinate, Floats, Signs
from irsbot_supervisor.core.assessment import SOLVED
from irsbot_supervisor.core.estimation.estimate import Speeds
from irsbot_supervisor.core.margins import margins_of
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.stopping import StoppingPredictor, limits_of

Array = NDArray[np.float64]

TRIED = 8192
"""Number of joint positions that are tried. For every shipped robot at least 1 % of them lie in the usual modes."""

CANDIDATES = 48
"""Number of postures from which stopping is tried: a sample of the best fifth. For the shipped robots the best of 150
random postures was among the best 7 %."""

ROUNDS, AROUND = 6, 64
"""Refinement of the best posture: number of rounds, and of points around it in each; each round has half the size. It
is tried last, if the known postures do not suffice."""

HALVINGS = 7
"""Bisections of the stoppable speed once it is known within a factor of 2: to a hundredth of it."""

LEAST_SHARE = 1e-9
"""1: smaller shares of the velocity limits are not distinguished: settings allow no such limits."""

WIDEST = 4.0
"""Multiple of `length_m`, on both sides of zero, over which slides without limits are searched."""


class Postures(NamedTuple):
    """Postures in one pair of modes."""

    joints: Array  # (N, n) rad or m
    margins: Array  # (N, 4) in the order of `Margins`, infinite where there is none


class StoppableSpeed(NamedTuple):
    """The fastest motion that can be stopped from a posture before a stop limit is reached."""

    at: Posture
    share: float  # of the velocity limits; 0 where the robot cannot be stopped in time even from rest
    travel: Floats  # rad or m each joint takes to stop from that motion
    kind: int  # the margin that ends it, in the order of `Margins`; -1: nothing ends it in the range looked at


class _Case(NamedTuple):
    """Data that determine the postures."""

    kind: type[Mechanism]
    geometry: Any
    working: Signs
    assembly: int


@dataclass(frozen=True)
class _Robot:
    """Robot as a cache key: robots of equal geometry are equal."""

    case: _Case
    mechanism: Mechanism = field(compare=False)


def postures(settings: Settings, mechanism: Mechanism) -> Postures:
    """Postures over the whole joint range in the configured modes, computed once per geometry and modes."""
    case = _Case(type(mechanism), mechanism.geometry, settings.working_mode, settings.assembly_mode)
    return _postures(_Robot(case, mechanism))


def candidates(settings: Settings, mechanism: Mechanism) -> Iterator[Posture]:
    """The most favourable postures, the best one first. All keep the stop limits; empty if no posture does.

    The criterion is the least margin, each measured from its stop limit as a share of its largest value.
    """
    found, stop = postures(settings, mechanism), np.array(limits_of(settings, "stop"))
    if not len(found.joints):
        return
    order = np.argsort(-_spare(found.margins, stop, found.margins.max(axis=0)), kind="stable")
    best = found.joints[order[0]]
    order = order[(found.margins[order] >= stop).all(axis=1)]
    better = order[: -(-len(order) // 5)]
    for row in found.joints[better[:: max(len(better) // CANDIDATES, 1)]]:
        yield mechanism.posture(tuple(row.tolist()), settings.assembly_mode)
    finest = mechanism.posture(tuple(_improved(settings, mechanism, found, best).tolist()), settings.assembly_mode)
    if finest.status == SOLVED and (np.array(margins_of(finest)) >= stop).all():
        yield finest


def find_stoppable_speed(
    settings: Settings,
    mechanism: Mechanism,
    places: Iterable[Posture],
    patterns: list[Floats],
    prediction_delay_s: float = 0.0,
    most: float = 1.0,
) -> StoppableSpeed:
    """The posture from which the fastest motion can be stopped, in the least favourable of the patterns.

    places: at least one. patterns: share of its velocity limit that each joint has at share 1, with its sign.
    prediction_delay_s: time that the robot moves without supervision. most: share at which the search ends.
    """
    stop, patient = limits_of(settings, "stop"), settings.bounding_s == 0.0  # else cuts of the supervisor count

    def predictor(pattern: Floats, share: float) -> tuple[StoppingPredictor, Speeds]:
        """Stopping predictor of a robot whose moving joints are as fast as possible."""
        rates = [share * p * v for p, v in zip(pattern, settings.velocity_limit, strict=True)]
        most = [abs(r) if p else v for r, p, v in zip(rates, pattern, settings.velocity_limit, strict=True)]
        speeds = Speeds(tuple([max(rate, 0.0) for rate in rates]), tuple([max(-rate, 0.0) for rate in rates]))
        return StoppingPredictor(replace(settings, velocity_limit=tuple(most)), mechanism, patient), speeds

    def ends(at: Posture, share: float) -> int:
        """Index of the margin that ends a motion of this share, -1 for none."""
        for pattern in patterns:
            seer, speeds = predictor(pattern, share)
            certified = seer.predict(at, speeds, prediction_delay_s, stop)
            spare = [have - want for have, want in zip(certified, stop, strict=True)]
            if not min(spare) >= 0.0:
                return spare.index(min(spare))
        return -1

    best, low, kind = None, 0.0, -1
    for at in places:
        if best is not None and ends(at, low) >= 0:
            continue
        best, high, kind = at, most, ends(at, most)
        if kind < 0:
            low = most
            break
        if low == 0.0 and (still := ends(at, 0.0)) >= 0:
            kind = still
            continue
        while high > 2.0 * low and high > LEAST_SHARE and (found := ends(at, 0.5 * high)) >= 0:
            high, kind = 0.5 * high, found
        if not high > LEAST_SHARE:
            continue
        low = max(low, 0.5 * high)
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            found = ends(at, middle)
            low, high, kind = (middle, high, kind) if found < 0 else (low, middle, found)
    if best is None:
        raise ValueError("no posture to start from")
    most_of_all = tuple([max(abs(p[k]) for p in patterns) for k in range(len(mechanism.joints))])
    seer, speeds = predictor(most_of_all, low)
    return StoppableSpeed(best, low, tuple(seer.travel(speeds, prediction_delay_s)[0]), kind)


def margins_of_many(found: Evaluations) -> Array:
    """(N, 4) margins of many postures in the order of `margins_of`; NaN where there is no posture."""
    none = np.full(len(found.status), np.inf)
    limb = found.limb_margin.min(axis=1) if found.limb_margin.shape[1] else none
    solved = found.status == SOLVED
    constraint = np.where(solved & np.isnan(found.constraint_margin), np.inf, found.constraint_margin)
    return np.column_stack((found.type1_margin.min(axis=1), found.type2_margin, constraint, limb))


def _spare(margins: Array, stop: Array, top: Array) -> Array:
    """(N,) least margin of each posture above its stop limit, as a share of its largest value; -inf for NaN."""
    some = np.isfinite(top)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (margins[:, some] - stop[some]) / np.abs(top[some] - stop[some])
    return np.asarray(np.where(np.isnan(share), -np.inf, share).min(axis=1, initial=np.inf))


@lru_cache(maxsize=32)
def _postures(robot: _Robot) -> Postures:
    joints = robot.mechanism.joints
    low, high = np.array([_range(joint, robot.mechanism.length_m) for joint in joints]).T
    Q = low + (high - low) * _spread(TRIED, len(joints))
    found = evaluate_many(robot.mechanism, Q, robot.case.assembly)
    belong = (found.status == SOLVED) & (found.working_mode == robot.case.working).all(axis=1)
    return Postures(Q[belong], margins_of_many(found)[belong])


def _range(joint: Coordinate, length_m: float) -> tuple[float, float]:
    far = pi if joint.is_angle else WIDEST * length_m
    low = max(joint.lower, -far) if joint.is_angle or not isfinite(joint.lower) else joint.lower
    high = min(joint.upper, far) if joint.is_angle or not isfinite(joint.upper) else joint.upper
    return low, high


def _spread(number: int, dimensions: int) -> Array:
    """(number, dimensions) points that fill the unit cube evenly: multiples of powers of 1/g, modulo 1, with g the
    root of g^(d + 1) = g + 1, the golden ratio for d = 1. The same ones every time."""
    g = 2.0
    for _ in range(64):  # converges for every d
        g = (1.0 + g) ** (1.0 / (dimensions + 1.0))
    steps = g ** -np.arange(1.0, dimensions + 1.0)
    return np.asarray((0.5 + np.arange(number)[:, None] * steps) % 1.0)


def _improved(settings: Settings, mechanism: Mechanism, found: Postures, start: Array) -> Array:
    """A posture at least as good as `start`, from searches of decreasing size around it."""
    stop, top = np.array(limits_of(settings, "stop")), found.margins.max(axis=0)
    reach = np.ptp(found.joints, axis=0) / max(len(found.joints), 1) ** (1.0 / len(start))
    cube = 2.0 * _spread(AROUND, len(start)) - 1.0
    best = start
    for turn in range(ROUNDS):
        tried = np.vstack((best, best + reach * 0.5**turn * cube))
        near = evaluate_many(mechanism, tried, settings.assembly_mode)
        belong = (near.working_mode == settings.working_mode).all(axis=1)
        spare = np.where(belong, _spare(margins_of_many(near), stop, top), -np.inf)
        best = tried[int(np.argmax(spare))]
    return np.asarray(best)
