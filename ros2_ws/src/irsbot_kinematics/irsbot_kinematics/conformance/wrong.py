"""A law of machines with geometry errors: no margin is below the certified bound with a slack.

Every error of `Mechanism.certified_bounds` is tried, independently for each leg: places on the base, ends of rails,
places on a platform that turns, cranks, rods. Newton's method closes the machines as rods (`rods`), without the
mechanism.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from irsbot_kinematics import statics
from irsbot_kinematics.conformance.declared import NOTHING
from irsbot_kinematics.conformance.rods import ALIKE, Rods, moved, rods_at, units
from irsbot_kinematics.conformance.samples import Case, Machine, numbers, place
from irsbot_kinematics.mechanism import Mechanism, Posture
from irsbot_kinematics.numerics.arithmetic import ARRAYS, Array

ATTACKED = 40
"""Largest number of postures."""
RANDOM = 16
"""Number of machines with random errors, each at its limit."""
ROUNDS = 2
"""How often the gradient of the errors that lower a margin fastest is computed again."""
DIFFERENCE = 1e-4
"""1: step of the differences, over the limits of the errors."""
KEPT = 0.3
"""1: least bound of a box that is attacked, as a share of the Type 2 margin: such a machine stays on its branch."""
NEWTON = 8
"""Number of Newton steps; each doubles the number of digits."""


def wrong_machines_kept(machine: Machine) -> Iterator[Case]:
    """No Type 1 or Type 2 margin of a machine whose geometry is off by a slack is below what is promised for it."""
    mechanism, rng = machine.mechanism, machine.random()
    lower, upper = machine.ranges
    found = False
    for at in machine.regular[:: max(1, len(machine.regular) // ATTACKED)]:
        rods = rods_at(mechanism, at)
        if rods is None:
            continue
        found = True
        slack = mechanism.length_m * 10.0 ** rng.uniform(-5.0, -2.3)
        travel = rng.integers(0, 2) * (upper - lower) * 10.0 ** rng.uniform(-5.0, -2.0) * rng.uniform(size=len(lower))
        promises = [
            promise(at, travel.tolist(), slack) for promise in (mechanism.certified_bounds, mechanism.sharp_bounds)
        ]
        floors = np.array([(*bound.type1, bound.type2) for bound in promises])
        floors = np.where(floors[:, -1:] > KEPT * at.type2, floors, 0.0).max(axis=0)
        if not floors[-1] > 0.0:
            continue
        wrong = _Wrong(mechanism, at, rods, travel, slack)
        met = wrong.worst(rng)
        stated = f"{place(at)}, travel {numbers(travel)}, slack {slack:.6g} m: promised {numbers(floors)}"
        yield Case(float((floors - met).max()), f"{stated}; a machine that is off has {numbers(met)}")
    if not found:
        yield NOTHING


class _Wrong:
    """Machines near that of a posture. Their errors are numbers in -1..1: per leg the travel, the near end or the first
    end of its rail, the last end of it, the place on the platform, crank and rod."""

    def __init__(self, mechanism: Mechanism, at: Posture, rods: Rods, travel: Array, slack: float) -> None:
        self.mechanism, self.at, self.rods, self.travel, self.slack = mechanism, at, rods, travel, slack
        self.n, self.d = rods.near.shape
        own = np.abs((rods.directions * rods.tangents).sum(axis=1))
        self.counted = np.abs(own - at.type1) < ALIKE  # the Type 1 sines that are angles of rods

    def worst(self, rng: np.random.Generator) -> Array:
        """(n + 1,) least Type 1 and Type 2 margins found."""
        size = self.n * (3 * self.d + 3)
        met = self.margins(np.sign(rng.uniform(-1.0, 1.0, (RANDOM, size)))).min(axis=0)
        start = np.zeros(size)
        for _ in range(ROUNDS):
            slopes = self.margins(start + DIFFERENCE * np.concatenate([np.zeros((1, size)), np.eye(size)]))
            fastest = -np.sign(slopes[1:] - slopes[0]).T
            there = self.margins(fastest)
            met = np.minimum(met, there.min(axis=0))
            start = (1.0 - DIFFERENCE) * fastest[there[:, -1].argmin()]
        return np.asarray(met)

    def margins(self, errors: Array) -> Array:
        """(N, n + 1) Type 1 and Type 2 margins of machines with errors (N, size); 2 for sines that belong to no
        angle."""
        table, d = errors.reshape(len(errors), self.n, -1), self.d
        ahead, wrong = table[..., 0] * self.travel, table[..., 1:] * self.slack
        first, last, held = wrong[..., :d], wrong[..., d : 2 * d], wrong[..., 2 * d : 3 * d]
        crank, rod = wrong[..., -2], wrong[..., -1] * self.rods.measured
        near, tangents, grown = self._driven(ahead, first, last, crank)
        r, attachments = self._closed(near, self.rods.length + grown + rod, held * float(self.rods.turning))
        normalised_levers = np.where(self.counted, np.abs((r * tangents).sum(axis=2)), 2.0)
        rows = [tuple(leg.T) for leg in np.moveaxis(_rows(r, attachments, self.rods.turning), 1, 0)]
        places = [(leg[:, 0], leg[:, 1]) for leg in np.moveaxis(attachments, 1, 0)] if self.rods.turning else []
        _, cosines = statics.pressure_cosines(ARRAYS, rows, places)
        return np.concatenate([normalised_levers, np.min(cosines, axis=0)[:, None]], axis=1)

    def _driven(self, ahead: Array, first: Array, last: Array, crank: Array) -> tuple[Array, Array, Array]:
        """Near ends and their tangents (N, n, d), and the growth of the rods (N, n)."""
        rods, joints = self.rods, np.array(self.at.joints)
        found = moved(self.mechanism, self.at, joints + ahead)
        assert found is not None
        near, length = found
        tangents = np.broadcast_to(rods.tangents, near.shape).copy()
        rails, cranks = rods.rails > 0.0, np.asarray(rods.cranks.any(axis=1))
        if rails.any():  # carriages count from the middle of a rail
            lower, upper = (np.where(rails, end, 0.0)[:, None] for end in self._ranges)
            begin = rods.near + (lower - joints[:, None]) * rods.tangents + first
            end = rods.near + (upper - joints[:, None]) * rods.tangents + last
            along = units(np.where(rails[:, None], end - begin, 1.0))
            slid = 0.5 * (begin + end) + ((joints + ahead)[..., None] - 0.5 * (lower + upper)) * along
            near[:, rails], tangents[:, rails] = slid[:, rails], along[:, rails]
        if cranks.any():
            way = units(np.where(cranks[:, None], near - rods.near + rods.cranks, 1.0))
            near[:, cranks] += (crank[..., None] * way)[:, cranks]
            across = np.stack([-way[..., 1], way[..., 0], *[0.0 * way[..., 0]] * (self.d - 2)], axis=-1)
            tangents[:, cranks] = across[:, cranks]
        near[:, ~rails] += first[:, ~rails]
        return near, tangents, length - rods.length

    @property
    def _ranges(self) -> tuple[Array, Array]:
        """Ends of the ranges of the joints."""
        joints = self.mechanism.joints
        return np.array([axis.lower for axis in joints]), np.array([axis.upper for axis in joints])

    def _closed(self, near: Array, length: Array, held: Array) -> tuple[Array, Array]:
        """Directions of the rods and attachment vectors (N, n, d) of the posture that closes, on the branch of the
        exact one."""
        turning, d = self.rods.turning, self.d
        pose = np.tile(np.array(self.at.pose), (len(near), 1))
        start = self.at.pose[-1] if turning else 0.0
        own = _turned(self.rods.attachments[None], np.array([-start])) + held
        for _ in range(NEWTON):
            attachments = _turned(own, pose[:, -1] if turning else np.zeros(len(pose)))
            rods = pose[:, None, :d] + attachments - near
            size = np.linalg.norm(rods, axis=2)
            r = rods / size[..., None]
            pose = pose - np.linalg.solve(_rows(r, attachments, turning), (size - length)[..., None])[..., 0]
        if not np.abs(size - length).max() < ALIKE * self.mechanism.length_m:
            raise ArithmeticError("a machine with errors within the slack does not close")
        return r, attachments


def _rows(r: Array, attachments: Array, turning: bool) -> Array:
    if not turning:
        return r
    moment = attachments[..., 0] * r[..., 1] - attachments[..., 1] * r[..., 0]
    return np.concatenate([r, moment[..., None]], axis=-1)


def _turned(vectors: Array, turn: Array) -> Array:
    """Vectors (N, n, d) turned about z by angles (N,)."""
    c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
    found = np.broadcast_to(vectors, (len(turn), *vectors.shape[1:])).copy()
    found[..., 0], found[..., 1] = c * vectors[..., 0] - s * vectors[..., 1], s * vectors[..., 0] + c * vectors[..., 1]
    return found
