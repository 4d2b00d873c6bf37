"""Robots, postures and results of kinematics.py."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import irsbot2_3d as space
import numpy as np
from numpy.typing import NDArray

import irsbot_kinematics as irs
from irsbot_kinematics.mechanisms.irsbot2 import Irsbot2
from irsbot_kinematics.mechanisms.irsbot2_space.geometry import Irsbot2Geometry

Array = NDArray[np.float64]
Tick = Callable[[int], None]
"""Called with the number of cases done since the last call."""

LIMIT = 1e-9
"""m, or 1 for margins: the largest error that passes."""

BOUNDARY_M = 1e-6
"""m: poses nearer than this to a singularity are classified, but their error does not count."""

PRESETS = ("irsbot2", "irsbot2_beta45", "irsbot2_csc", "irsbot2_strict")
"""Predefined designs of the IRSBot-2."""


@dataclass
class Result:
    """What one part found."""

    name: str
    cases: int = 0
    worst: float = 0.0
    """Largest error, m or 1."""
    wrong: int = 0
    """Cases classified differently, or promises broken."""
    boxes: int = 0
    """Boxes in which something was promised, and attacked."""

    @property
    def passed(self) -> bool:
        return self.cases > 0 and self.wrong == 0 and self.worst < LIMIT

    def count(self, cases: int, errors: Array, wrong: Array) -> None:
        self.cases += cases
        self.worst = max(self.worst, float(np.max(errors, initial=0.0)))
        self.wrong += int(np.sum(wrong)) + int(np.sum(np.isnan(errors)))


def design_of(robot: irs.Robot) -> space.Design:
    g = robot.mechanism.geometry
    return space.Design(g.l1, g.l2eq, g.b, g.p, g.a1, g.a2, g.beta, g.e)


def random_design(rng: np.random.Generator) -> tuple[irs.Robot, space.Design]:
    """Any proportions that can be assembled; l2eq on both sides of D, b0 of both signs."""
    while True:
        a1, p, l1, l2eq, b = np.exp(rng.uniform(np.log(0.03), np.log(1.0), 5)).tolist()
        a2, beta, e = a1 * rng.uniform(0.05, 0.95), rng.uniform(0.05, 1.5), rng.uniform(-0.3, 0.3)
        d = space.Design(l1, l2eq, b, p, a1, a2, beta, e)
        if 1e-3 < abs(d.b0) < 0.95 * (l1 + l2eq):
            return irs.Robot(Irsbot2(Irsbot2Geometry(*d))), d


def assembled(d: space.Design, number: int, rng: np.random.Generator) -> Iterator[tuple[int, Array]]:
    """Joints of `number` postures that exist and are a micrometre away from Type 2, by assembly mode."""
    found: list[Array] = []
    while sum(map(len, found)) < number:
        q = rng.uniform(-np.pi, np.pi, (4 * number, 2))
        with np.errstate(invalid="ignore"):
            *_, apart = space.posture(d, q[:, 0], q[:, 1], 1)
        found.append(q[(apart > BOUNDARY_M) & (2.0 * d.l2eq - apart > BOUNDARY_M)])
    q = np.concatenate(found)[:number]
    yield -1, q[: number // 2]
    yield 1, q[number // 2 :]
