"""Resets that come at any time, with any number, to a robot in any state.

A reset ends the stop that it names, of a robot that stands, with good data, and without a cause. What is true of that
is known here: which samples were good, when the last one came, and whether the robot moved.
"""

from __future__ import annotations

from math import inf, isfinite, nan

import numpy as np

from irsbot_msgs_py.records import Reset
from irsbot_supervisor.campaign.line import ROBOTS, WARM_UP, Line
from irsbot_supervisor.campaign.rows import Job, Row, Tally
from irsbot_supervisor.core.intake import S

NAME = "reset-abuse"
MUST = "a reset ends the stop it names, at rest, with good data and no cause; never before there is one"

EACH = 20
"""Resets given to one supervisor before the next one takes over."""
SEEDS = (nan, inf, 0.0, 0.3, -0.8, 1e308)
"""m or rad: what a seed pose is made of."""
SILENCE = 100
"""Periods without a sample, at most: the shipped stale limit is 50."""


class Watched:
    """A robot at work, and what is true of it."""

    def __init__(self, name: str, rng: np.random.Generator) -> None:
        self.line = Line(name, rng)
        self._good_ns: int | None = None  # when the last good sample came; None after a bad one
        self._rates: tuple[float, ...] = ()
        self.calm = False
        """Nothing speaks against a reset: the robot has stood for long, and all was well."""

    def happen(self, rng: np.random.Generator) -> None:
        """Something happens."""
        line = self.line
        self.calm = False
        match int(rng.integers(6)):
            case 0:
                line.lose_track()
                self._well()
            case 1:
                line.standing = not line.standing
                line.run(int(rng.integers(1, WARM_UP)))
                self._well()
            case 2:
                line.standing = True
                line.run(WARM_UP)
                self._well()
                self.calm = True
            case 3:
                for _ in range(int(rng.integers(SILENCE))):
                    line.advance()
            case 4:
                line.advance()
                line.deliver([line.sample()._replace(position=(nan,) * len(line.position))])
                self._good_ns = None
            case _:
                pass

    @property
    def may_be_reset(self) -> bool:
        """Whether a latched stop may be ended: the robot is known to stand."""
        line, slow = self.line, self.line.settings.standstill_speed
        fresh = self._good_ns is not None and line.now_ns - self._good_ns <= line.settings.stale_s * S
        return fresh and all(abs(rate) <= slow for rate in self._rates)

    def _well(self) -> None:
        self._good_ns, self._rates = self.line.now_ns, self.line.velocity


def run(job: Job) -> Row:
    """The row: a case is a reset."""
    tally = Tally(NAME, job)
    tally.figures.update({"accepted": 0.0, "refused": 0.0})
    rng = np.random.default_rng(job.seed)
    robot = Watched(ROBOTS[0], rng)
    for k in range(job.amount):
        if k % EACH == 0:
            robot = Watched(ROBOTS[k // EACH % len(ROBOTS)], rng)
        robot.happen(rng)
        tally.case(*_reset(robot, rng, tally))
    return tally.row()


def _reset(robot: Watched, rng: np.random.Generator, tally: Tally) -> tuple[str, str]:
    """Give a reset; what was unsafe, and what failed."""
    line, before = robot.line, robot.line.verdict
    latched, number = (before.latched, before.event) if before is not None else (False, 0)
    given = number if rng.random() < 0.5 else int(rng.choice([-1, 0, number - 1, number + 1, 2**32, 2**62]))
    count = 0 if rng.random() < 0.8 else int(rng.integers(1, 6))
    seed = tuple(float(rng.choice(SEEDS)) for _ in range(count))
    refusal = line.feed(Reset(line.received_ns, line.now_ns, given, "", seed)).refusal
    tally.add("refused" if refusal else "accepted")
    may = latched and given == number and robot.may_be_reset
    if not refusal and not may:
        return f"event {given} ended stop {number} (latched: {latched}), to be reset: {robot.may_be_reset}", ""
    if not refusal and not (all(map(isfinite, seed)) and count in (0, len(line.robot.mechanism.task))):
        return "", f"accepted with the seed pose {seed}"
    now = line.verdict
    if refusal and latched and not (now is not None and now.latched):
        return f"refused ({refusal}), and the stop is ended", ""
    if refusal and may and not seed and robot.calm:
        return "", f"refused although nothing speaks against it: {refusal}"
    return "", ""
