"""Clean motion: no stop and no warning if no limit is within reach.

An independent oracle, `reachable`, computes the positions within reach of the drives until they stand. A sample is
clear if no limit is near there. Other samples are also fed to the supervisor, but its verdicts on them do not count.
A motion may come so fast to a limit that a stop is due. It does not obey, so it ends at its first stop, and another one
begins: what is said of a robot that goes on after a stop is no figure of this row.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import chain, islice, repeat
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from irsbot_kinematics import Robot
from irsbot_msgs_py.records import JointSample, Level
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.core.estimation.sample_interval import SETTLING
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.validation.harness.motion import PERIOD_S, Motion, measured, swings, work, works
from irsbot_supervisor.validation.harness.oracle import Array, followed, limits, supervised
from irsbot_supervisor.validation.harness.rows import FALSE_STOPS, Job, Row, Tally
from irsbot_supervisor.validation.in_process.reachable import CLEAR_OF_STOP, boxes, least_margins, until_judged_s

NAME = "clean"
MUST = "0 stops where all within reach keeps 1.2 times the stop limits; 0 warnings above 1.5 times theirs, and at work"

CLEAR_OF_WARNING = 1.5
"""1: multiple of the warning limits that all margins within reach keep where no warning is due."""
BEGIN_NS = 10**15
BATCH = 500
"""Samples between two messages to the progress bar."""
PAST = 128
"""Number of samples before a batch that the oracle uses."""
MOST_FED = 20
"""1: largest number of samples for each clear one."""
FALSE_WARNINGS, WORK_WARNINGS = "false warnings", "warnings at work"
CALM, FED = "samples clear of warnings", "samples fed"
"""Figures."""


Which = NDArray[np.bool_]


class _Batch(NamedTuple):
    """Samples, and their verdicts."""

    stamps: Array  # (N,) s
    positions: Array  # (N, n) as measured
    levels: list[Level]
    texts: list[str]

    def part(self, rows: slice) -> _Batch:
        """Some of the samples."""
        return _Batch(self.stamps[rows], self.positions[rows], self.levels[rows], self.texts[rows])


def run(job: Job) -> Row:
    """The row: a case is a clear sample, the same number for every robot and both kinds of motion."""
    tally = Tally(NAME, job)
    tally.figures.update(dict.fromkeys((FALSE_STOPS, FALSE_WARNINGS, WORK_WARNINGS, CALM, FED), 0.0))
    names = job.robots or supervised()
    streams = [(name, kind) for name in names for kind in ("work", "swings") if kind == "swings" or name in works()]
    for k, (name, kind) in enumerate(streams):
        settings, robot = read_settings(name)
        at_work = kind == "work"
        rng = np.random.default_rng([job.seed, k])
        begin = partial(work, robot, settings) if at_work else partial(swings, robot, settings, rng)
        stream = _Stream(f"{name}, {kind}", robot, replace(settings, dwell_s=0.0), begin, at_work)
        stream.watch(tally, -(-job.amount // len(streams)))
    tally.figures["robots"] = len(names)
    return tally.row()


class _Supervised:
    """A motion and its supervisor: the robot stands until the sample interval is known, then it moves."""

    def __init__(self, robot: Robot, settings: Settings, motion: Motion, rest: int) -> None:
        """rest: number of samples until the robot moves."""
        position, velocity = next(motion)
        self._motion = chain(repeat((position, velocity), rest), motion)
        self._settings, self._supervisor = settings, Supervisor(settings, robot)
        self.at = robot.mechanism.posture(position, settings.assembly_mode)
        self.fed = 0

    def feed(self, number: int) -> _Batch:
        """Feed the next samples."""
        settings, stamps, positions, levels, texts = self._settings, [], [], [], []
        for position, velocity in islice(self._motion, number):
            now_ns = round(self.fed * PERIOD_S * NS_PER_S)
            seen = measured(position, settings)
            sample = JointSample(
                BEGIN_NS + now_ns, BEGIN_NS + now_ns, NS_PER_S + now_ns, settings.joint_names, seen, velocity
            )
            step = self._supervisor.step(sample)
            assert step.state is not None, "every sample has a state"
            stamps.append(self.fed * PERIOD_S)
            positions.append(seen)
            levels.append(step.state.level)
            texts.append(step.verdict.text if step.verdict else f"causes {step.state.causes}")
            self.fed += 1
        return _Batch(np.array(stamps), np.array(positions), levels, texts)


class _Stream:
    """Motions under supervision, one after the other."""

    def __init__(
        self, where: str, robot: Robot, settings: Settings, motion: Callable[[], Motion], at_work: bool
    ) -> None:
        self._where, self._robot, self._settings, self._at_work = where, robot, settings, at_work
        self._rest = round(SETTLING * settings.stale_s / PERIOD_S) + 2
        self._motion = motion

    def watch(self, tally: Tally, number: int) -> None:
        """Run until this number of samples were clear."""
        done, fed, moving = 0, 0, self._begin()
        before = self._no_positions()
        while done < number and fed < MOST_FED * number + self._rest:
            batch = moving.feed(min(BATCH, max(number - done, 1) + max(self._rest - moving.fed, 0)))
            fed += len(batch.levels)
            clear, calm = self._clear(batch, before, moving)
            before = np.concatenate((before, batch.positions))[-PAST:]
            stops = (np.array(batch.levels) >= Level.STOP) & (batch.stamps >= self._rest * PERIOD_S)
            stopped = bool(stops.any()) and not self._at_work  # at work every stop is a false one
            counted = slice(int(stops.argmax()) + 1 if stopped else None)
            done += int(clear[counted].sum())
            self._judge(tally, batch.part(counted), clear[counted], calm[counted])
            if stopped:
                moving, before = self._begin(), self._no_positions()
        tally.add(FED, fed)
        if done < number:
            tally.many(0, 1, f"{self._where}: only {done} of {fed} samples are clear")

    def _begin(self) -> _Supervised:
        """Begin a motion, under a new supervisor."""
        return _Supervised(self._robot, self._settings, self._motion(), self._rest)

    def _no_positions(self) -> Array:
        return np.empty((0, len(self._settings.joint_names)))

    def _clear(self, batch: _Batch, before: Array, moving: _Supervised) -> tuple[Which, Which]:
        """Mark the samples that are clear of stops, and those that are clear of warnings."""
        settings = self._settings
        positions = np.concatenate((before, batch.positions))
        stamps = batch.stamps[0] + PERIOD_S * np.arange(-len(before), len(batch.positions))
        unseen_s = until_judged_s(PERIOD_S)  # every sample arrives in the moment of its stamp
        low, high = (bound[len(before) :] for bound in boxes(stamps, positions, settings, unseen_s))
        ats = list(followed(self._robot, batch.positions, moving.at))
        moving.at = ats[-1]
        rows = np.flatnonzero(batch.stamps >= self._rest * PERIOD_S)  # no other sample counts
        least = np.full((len(ats), 4), -np.inf)
        if len(rows):
            least[rows] = least_margins(self._robot, settings, low[rows], high[rows], [ats[row] for row in rows])
        clear: Which = np.all(least >= CLEAR_OF_STOP * limits(settings, "stop"), axis=1)
        calm: Which = np.all(least >= CLEAR_OF_WARNING * limits(settings, "warn"), axis=1)
        return clear, clear & calm

    def _judge(self, tally: Tally, batch: _Batch, clear: Which, calm: Which) -> None:
        levels = np.array(batch.levels)
        stopped, warned = clear & (levels >= Level.STOP), calm & (levels == Level.WARN)
        at_work = (batch.stamps >= self._rest * PERIOD_S) & (levels >= Level.WARN) & self._at_work
        wrong = stopped | warned | at_work
        tally.add(FALSE_STOPS, float(stopped.sum()))
        tally.add(FALSE_WARNINGS, float(warned.sum()))
        tally.add(WORK_WARNINGS, float(at_work.sum()))
        tally.add(CALM, float(calm.sum()))
        note = ""
        if wrong.any():
            first = int(wrong.argmax())
            note = f"{self._where}: at {batch.stamps[first]:.3f} s: {batch.texts[first]}"
        tally.many(int(clear.sum()), int(wrong.sum()), note)
