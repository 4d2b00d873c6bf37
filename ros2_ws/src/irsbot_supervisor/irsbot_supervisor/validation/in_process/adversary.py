"""The adversary: the robot must stand before a stop limit is crossed, whatever its drives do within their limits.

Runs of every scheme with every kind of false velocities, and an optimiser that searches for the worst run of each
robot.
"""

from __future__ import annotations

import numpy as np

from irsbot_kinematics import Robot
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.validation.harness.oracle import ROUNDING, supervised
from irsbot_supervisor.validation.harness.rows import Job, Row, Tally
from irsbot_supervisor.validation.in_process.assault import CLOSE, Outcome, Run
from irsbot_supervisor.validation.in_process.deceit import ERRORS, LIES
from irsbot_supervisor.validation.in_process.edges import Edge, edges
from irsbot_supervisor.validation.in_process.hostile import Push
from irsbot_supervisor.validation.in_process.hunt import Hunt
from irsbot_supervisor.validation.in_process.schemes import HARDEST, SCHEMES, Kind

NAME = "adversary"
MUST = (
    "allowed once, the robot stands before a stop limit is crossed, whatever the drives do within their limits: 100 %"
)

RUNS_OF_EDGE = 8
"""Number of runs that begin at one place."""
GENERATIONS, POPULATION = (1, 50), (5, 10)
"""Size of the optimiser, in a short row and in a long one."""
LONG = 1000
"""Number of runs of a robot from which a row is a long one."""
TRIES, BACK_S = 16, 0.003
"""Number of places for a run, and how much farther each is from the limit: the path of full acceleration in this
time."""
BLUNT = 0.2
"""1: a robot fails if more than this share of the runs did not move it near a limit: those are not conclusive."""
FEW = 3
"""Number of such runs that a short row tolerates."""
HARDER = 5.0
"""1: hardest braking of a joint, as a multiple of the deceleration limit."""


def run(job: Job) -> Row:
    """The row: a case is a run, the same number for every robot, plus those of the optimiser."""
    tally = Tally(NAME, job)
    names = job.robots or supervised()
    tally.figures.update(dict.fromkeys(("stopped", "beyond", "let loose close to a limit"), 0.0))
    rests: list[float] = []
    for k, name in enumerate(names):
        settings, robot = read_settings(name)
        _Campaign(name, robot, settings, tally, rests).run(
            -(-job.amount // len(names)), np.random.default_rng([job.seed, k])
        )
    if rests:
        tally.figures["median rest above the limit [%]"] = 100.0 * float(np.median(rests))
    return tally.row()


class _Campaign:
    """All runs against one robot."""

    def __init__(self, name: str, robot: Robot, settings: Settings, tally: Tally, rests: list[float]) -> None:
        self._name, self._robot, self._settings, self._tally, self._rests = name, robot, settings, tally, rests
        self._blunt = 0

    def run(self, number: int, rng: np.random.Generator) -> None:
        """Run this number of runs, and an optimiser."""
        places = list(edges(self._robot, self._settings, max(number // RUNS_OF_EDGE, 2), rng))
        if not places:
            self._tally.case(failed=f"{self._name}: no place at rest is allowed")
            return
        for k in range(number):
            kind, lie = SCHEMES[k % len(SCHEMES)], LIES[k // len(SCHEMES) % len(LIES)]
            errors, place = str(rng.choice(ERRORS)), places[int(rng.integers(len(places)))]
            outcome = _one(self._robot, place, kind, lie, errors, rng)
            self._count(outcome, f"{kind.__name__}, velocities {lie}, errors {errors}")
            self._blunt += not outcome.allowed or not (outcome.stopped or outcome.close or outcome.spare <= CLOSE)
        long = number >= LONG
        Hunt(self._robot, places, self._count).run(GENERATIONS[long], POPULATION[long], rng)
        if self._blunt > max(BLUNT * number, FEW):
            why = f"{self._blunt} of {number} runs have shown nothing: not allowed, or neither stopped nor near a limit"
            self._tally.many(0, 1, f"{self._name}: {why}")

    def _count(self, outcome: Outcome, how: str) -> None:
        tally, spare = self._tally, outcome.spare
        beyond = outcome.allowed and not spare >= -ROUNDING
        tally.add("stopped", outcome.stopped)
        tally.add("beyond", beyond)
        tally.add("let loose close to a limit", outcome.close)
        if outcome.allowed:
            tally.smallest("worst spare, relative to its limit", spare)
            tally.smallest(f"worst of {self._name}", spare)
        tally.add(f"beyond with {self._name}", beyond)
        if outcome.stopped:
            self._rests.append(outcome.rest)
        tally.case(f"{self._name}: {-100.0 * spare:.1f} % below a stop limit ({how})" if beyond else "")


def _one(robot: Robot, edge: Edge, kind: Kind, lie: str, errors: str, rng: np.random.Generator) -> Outcome:
    """One run: the lead is run alone, then repeated, and the joints are let loose at its best moment.

    Errors may forbid a place that was allowed without them; then the run is tried a little farther away.
    """
    for attempt in range(TRIES):
        here = edge.back((attempt + rng.random()) * BACK_S)
        run = Run(robot, here, kind(here, rng), lie, errors, rng)
        lead = run.lead()
        if lead.allowed is not None:
            break
    last, begin_s = run.moment(lead, float(rng.choice((0.0, rng.random()))))
    signs = run.aim(last, begin_s, str(rng.choice(("slope", "worst", "any"), p=(0.5, 0.3, 0.2))), rng)
    full, n = np.array(edge.settings.velocity_limit), len(signs)
    gain = 1.0 if rng.random() < 0.8 else rng.uniform(0.1, 1.0)
    pushes = [Push(begin_s, signs * full, gain, float(rng.choice((1.0, HARDEST))))]
    if rng.random() < 0.3:  # and some joints another way before long
        then = np.where(rng.random(n) < 0.5, signs, rng.choice((-1.0, 0.0, 1.0), n))
        pushes.append(Push(begin_s + rng.uniform(0.001, 0.015), then * full, 1.0, float(rng.choice((1.0, HARDEST)))))
    harder = rng.uniform(1.0, HARDER, n) if rng.random() < 0.2 else None
    return run.attack(lead, tuple(pushes), signs, harder)
