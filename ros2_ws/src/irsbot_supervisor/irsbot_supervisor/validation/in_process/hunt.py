"""Searches for the worst run of a robot by differential evolution: place, lead, moment, signs, switching times, false
velocities."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np
from scipy.optimize import differential_evolution

from irsbot_kinematics import Robot
from irsbot_supervisor.validation.harness.oracle import Array
from irsbot_supervisor.validation.in_process.assault import Outcome, Run
from irsbot_supervisor.validation.in_process.deceit import ERRORS, LIES
from irsbot_supervisor.validation.in_process.edges import Edge
from irsbot_supervisor.validation.in_process.hostile import DrivenMotion, Push
from irsbot_supervisor.validation.in_process.schemes import HARDEST, LEAD_S, Scheme

WORTHLESS = 10.0
"""1: value of a run in which motion was never allowed, for the optimiser."""
FASTEST_LEAD = 0.3
"""1: share of full speed of the fastest lead that is tried."""
LONGEST_S = 0.015
"""s: longest time until a joint that was let loose changes direction."""
EARLIEST_S = 0.005
"""s: earliest time before the moment of the stop in the lead."""

T = TypeVar("T")


class Hunt:
    """An optimiser against one robot. A trial is a vector in 0..1; equal vectors are equal runs."""

    def __init__(self, robot: Robot, places: Sequence[Edge], tell: Callable[[Outcome, str], None]) -> None:
        """tell: called with every outcome and its parameters."""
        self._robot, self._places, self._tell = robot, places, tell

    def run(self, generations: int, population: int, rng: np.random.Generator) -> None:
        """Run this number of generations of this number of trials, at least 5."""
        size = 7 + 4 * len(self._places[0].place)
        differential_evolution(
            self._trial,
            [(0.0, 1.0)] * size,
            init=rng.random((population, size)),
            maxiter=generations,
            tol=0.0,
            polish=False,
            seed=rng,
        )

    def _trial(self, x: Array) -> float:
        """The least relative distance of a run to its limit."""
        (place, speed, arrival, moment, lie, errors, hard), each = x[:7], x[7:].reshape(4, -1)
        edge = _pick(self._places, place)
        slant, first, second, turns = each
        full = np.array(edge.settings.velocity_limit)
        way = edge.down + 2.0 * slant - 1.0  # roughly down
        lead = (Push(0.0, FASTEST_LEAD * speed * way / max(np.abs(way).max(), 1e-9) * full),)
        ahead = (
            DrivenMotion(edge.place, lead, edge.settings).at(np.array([(0.1 + 0.9 * arrival) * LEAD_S]))[0][0]
            - edge.place
        )
        scheme = Scheme(edge.place - ahead, lead, LEAD_S)
        told, wrong = _pick(LIES, lie), _pick(ERRORS, errors)
        run = Run(self._robot, edge, scheme, told, wrong, np.random.default_rng(0))
        seen = run.lead()
        _, begin_s = run.moment(seen, 0.0)
        begin_s -= max(EARLIEST_S * (moment - 0.3), 0.0)
        signs = np.sign(np.round(3.0 * first - 1.5))
        pushes = [Push(begin_s, signs * full, hardness=1.0 + hard * (HARDEST - 1.0))]
        now = signs.copy()
        for joint in np.argsort(turns):
            now[joint] = np.sign(np.round(3.0 * second[joint] - 1.5))
            pushes.append(Push(begin_s + LONGEST_S * float(turns[joint]), now * full, hardness=pushes[0].hardness))
        outcome = run.attack(seen, tuple(pushes), signs, None)
        self._tell(outcome, f"found by the optimiser, velocities {told}, errors {wrong}")
        return outcome.spare if outcome.allowed else WORTHLESS


def _pick(items: Sequence[T], share: float) -> T:
    return items[min(int(share * len(items)), len(items) - 1)]
