"""Postures at which the laws are tried, and the result of a law."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import cached_property
from math import inf, isfinite, pi, remainder
from typing import Any, NamedTuple

import numpy as np

from irsbot_kinematics.mechanism import Coordinate, Floats, Mechanism, Posture, Status
from irsbot_kinematics.numerics.arithmetic import FLOATS, Array
from irsbot_kinematics.robot import Robot

JOINTS = 150
"""Number of random joint positions that are tried, each in every assembly mode, unless somebody asks for others."""
REGULAR = 0.1
"""1: laws that need differences are tried if all margins are above this: derivatives are small there."""

RANGE_LENGTHS = 10.0
"""1: a slide without limits is tried over this many characteristic lengths on both sides."""


class Check(NamedTuple):
    """Result of one law."""

    law: str
    """Short name."""
    words: str
    """The law in one sentence."""
    tried: int
    """Number of cases."""
    worst: float
    """Largest error found, in `unit`."""
    allowed: float
    unit: str
    broken: str
    """Empty, or the first case that breaks it: its place, and both numbers."""


class Case(NamedTuple):
    """One case: an error with its largest allowed value, and the message if it is larger."""

    error: float
    stated: str


Law = Callable[["Machine"], Iterator[Case]]


class Machine:
    """A robot, its random postures, and a separate generator of random numbers for every law."""

    def __init__(self, robot: Robot, number: int, seed: int) -> None:
        """number: of random joint positions; every assembly mode is tried in each."""
        self.robot, self._number, self._seed = robot, number, seed

    @property
    def mechanism(self) -> Mechanism:
        return self.robot.mechanism

    def random(self) -> np.random.Generator:
        return np.random.default_rng(self._seed)

    @cached_property
    def ranges(self) -> tuple[Array, Array]:
        """Ranges over which the joints are tried: angles over a turn, slides over their travel."""
        far = RANGE_LENGTHS * self.mechanism.length_m
        lower = [max(joint.lower, -pi if joint.is_angle else -far) for joint in self.mechanism.joints]
        upper = [min(joint.upper, pi if joint.is_angle else far) for joint in self.mechanism.joints]
        return np.array(lower), np.array(upper)

    @cached_property
    def joints(self) -> Array:
        """(N, n) random joint positions."""
        return np.asarray(self.random().uniform(*self.ranges, (self._number, len(self.mechanism.joints))))

    @cached_property
    def asked(self) -> list[tuple[Floats, int, Posture]]:
        """(joints, assembly mode, result of `posture`) in every mode at `joints`."""
        modes, posture = self.mechanism.assembly_modes, self.mechanism.posture
        return [(q, mode, posture(q, mode)) for q in map(tuple, self.joints.tolist()) for mode in modes]

    @cached_property
    def postures(self) -> list[Posture]:
        """The assembled postures."""
        return [at for _, _, at in self.asked if at.status == Status.SOLVED]

    @cached_property
    def spread(self) -> list[Posture]:
        """At most as many as joint positions, evenly from all postures."""
        return self.postures[:: max(1, -(-len(self.postures) // self._number))]

    @cached_property
    def regular(self) -> list[Posture]:
        """Postures far from every singularity, at most as many as joint positions."""
        return [at for at in self.postures if least(at) > REGULAR][: self._number]

    def inverses(self, at: Posture) -> Iterator[tuple[tuple[int, ...], Floats]]:
        """(mode, joints) of every inverse solution of the pose of a posture."""
        for mode in self.mechanism.working_modes:
            joints, reach = self.mechanism.inverse(FLOATS, at.pose, mode)
            if min(reach) > 0.0:
                yield mode, joints


def least(at: Posture) -> float:
    """The smallest margin of a posture; 0 for NaN."""
    margins = [*at.type1, at.type2, *at.limb, *([at.constraint] if at.constraint == at.constraint else [])]
    return min([margin if margin == margin else 0.0 for margin in margins])


def apart(axes: tuple[Coordinate, ...], a: Floats, b: Floats) -> float:
    """Largest |a - b|, angles modulo a turn; infinite for NaN."""
    turns = [axis.turn for axis in axes]
    away = [abs(remainder(x - y, t)) if isfinite(x - y) else inf for x, y, t in zip(a, b, turns, strict=True)]
    return max(away)


def numbers(values: Iterable[Any]) -> str:
    """A few digits of each number."""
    return "(" + ", ".join(f"{value:.6g}" for value in values) + ")"


def place(at: Posture) -> str:
    """Where a law broke, so that it can be tried again: joints, pose and assembly mode."""
    return f"joints {numbers(at.joints)}, pose {numbers(at.pose)}, assembly mode {at.assembly_mode:+d}"
