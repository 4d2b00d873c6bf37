"""Resets at any time, with any number, for a robot in any state.

A reset ends the stop with its number, if the robot stands, data is good, and no cause is active. The row knows the
truth: which samples were good, when the last one came, and whether the robot moved.
"""

from __future__ import annotations

from dataclasses import replace
from math import inf, isfinite, nan

import numpy as np

from irsbot_msgs_py.records import Reset
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.core.events import Configure
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.validation.harness.oracle import MARGINS, margins
from irsbot_supervisor.validation.harness.rows import Job, Row, Tally
from irsbot_supervisor.validation.harness.stream import ROBOTS, WARM_UP, InputStream

NAME = "reset-abuse"
MUST = "a reset ends the stop it names, at rest, with good data and no cause; never before there is one"

EACH = 20
"""Number of resets for one supervisor before the next one."""
SEEDS = (nan, inf, 0.0, 0.3, -0.8, 1e308)
"""m or rad: coordinates of seed poses."""
ABOVE = (0.1, 0.9)
"""1: where a stop limit lies between the margin of a posture and 1, lowest and highest."""
TYPE2 = MARGINS.index("type2")
SILENCE = 100
"""Longest silence in periods: the shipped stale limit is 50."""


class Watched:
    """A robot at work, and the truth about it."""

    def __init__(self, name: str, rng: np.random.Generator) -> None:
        self.stream = InputStream(name, rng)
        self._good_ns: int | None = None  # when the last good sample came; None after a bad one
        self._rates: tuple[float, ...] = ()
        self._active = False  # a margin is below its stop limit
        self.calm = False
        """True if nothing forbids a reset: the robot has stood for long, without a fault."""

    def happen(self, rng: np.random.Generator) -> None:
        """One random event."""
        stream = self.stream
        self.calm = False
        self._end_cause()
        match int(rng.integers(7)):
            case 0:
                stream.lose_track()
                self._well()
            case 1:
                stream.standing = not stream.standing
                stream.run(int(rng.integers(1, WARM_UP)))
                self._well()
            case 2:
                stream.standing = True
                stream.run(WARM_UP)
                self._well()
                self.calm = True
            case 3:
                for _ in range(int(rng.integers(SILENCE))):
                    stream.advance()
            case 4:
                stream.advance()
                stream.deliver([stream.sample()._replace(position=(nan,) * len(stream.position))])
                self._good_ns = None
            case 5:
                stream.standing = True
                stream.run(WARM_UP)
                self._well()
                self._begin_cause(rng)
            case _:
                pass

    def _begin_cause(self, rng: np.random.Generator) -> None:
        """From now on a stop limit is above the margin of the posture."""
        stream = self.stream
        margin = float(margins(stream.robot, stream.settings, np.array([stream.position]))[0][TYPE2])
        limit = margin + (1.0 - margin) * float(rng.uniform(*ABOVE))
        self._configure(replace(stream.settings, type2_stop=limit, type2_warn=limit))
        self._active = True

    def _end_cause(self) -> None:
        if self._active:
            self._configure(self.stream.settings)
            self._active = False

    def _configure(self, settings: Settings) -> None:
        stream = self.stream
        stream.feed(Configure(stream.received_ns, stream.now_ns, settings))
        stream.run(1)  # the limits judge samples
        self._well()

    @property
    def may_be_reset(self) -> bool:
        """True if a latched stop may be ended: no margin is below its stop limit, and the robot is known to stand."""
        stream, slow = self.stream, self.stream.settings.standstill_speed
        fresh = self._good_ns is not None and stream.now_ns - self._good_ns <= stream.settings.stale_s * NS_PER_S
        return not self._active and fresh and all(abs(rate) <= slow for rate in self._rates)

    def _well(self) -> None:
        self._good_ns, self._rates = self.stream.now_ns, self.stream.velocity


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
    """Request a reset; returns what was unsafe, and what failed."""
    stream, before = robot.stream, robot.stream.verdict
    latched, number = (before.latched, before.event) if before is not None else (False, 0)
    given = number if rng.random() < 0.5 else int(rng.choice([-1, 0, number - 1, number + 1, 2**32, 2**62]))
    count = 0 if rng.random() < 0.8 else int(rng.integers(1, 6))
    seed = tuple(float(rng.choice(SEEDS)) for _ in range(count))
    refusal = stream.feed(Reset(stream.received_ns, stream.now_ns, given, "", seed)).refusal
    tally.add("refused" if refusal else "accepted")
    may = latched and given == number and robot.may_be_reset
    if not refusal and not may:
        return f"event {given} ended stop {number} (latched: {latched}), to be reset: {robot.may_be_reset}", ""
    if not refusal and not (all(map(isfinite, seed)) and count in (0, len(stream.robot.mechanism.task))):
        return "", f"accepted with the seed pose {seed}"
    now = stream.verdict
    if refusal and latched and not (now is not None and now.latched):
        return f"refused ({refusal}), and the stop is ended", ""
    if refusal and may and not seed and robot.calm:
        return "", f"refused although nothing speaks against it: {refusal}"
    return "", ""
