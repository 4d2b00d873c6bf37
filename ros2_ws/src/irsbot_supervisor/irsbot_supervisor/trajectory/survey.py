"""Survey of a whole planned motion: every violation with its end, bounds up to the first one and over all, joint
speeds.

`certify` ends at the first violation; a survey continues after it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from irsbot_kinematics import Robot
from irsbot_msgs_py.records import Cause
from irsbot_supervisor.core.margins import MARGIN_CAUSES
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.trajectory.certificate import Minima, Violation
from irsbot_supervisor.trajectory.joint_path import peaks_of
from irsbot_supervisor.trajectory.segments import JointSegments
from irsbot_supervisor.trajectory.verification import Walk


class Run(NamedTuple):
    """A part of a motion in which a margin is below its stop limit, or cannot be proved to be above it."""

    first: Violation
    until_s: float
    """s of the motion: the end of the part."""
    worst: Violation
    """Point of the smallest value found."""


class Survey(NamedTuple):
    """Results over a whole motion."""

    runs: tuple[Run, ...]
    before: Minima
    """Smallest certified margins until the first violation, as `Certificate.minima`."""
    whole: Minima
    """Smallest certified margins of the whole motion; 0 if nothing can be proved for a part of it."""
    speeds: tuple[tuple[float, float], ...]
    """Largest speed of every joint, rad/s or m/s, and its time, s."""

    @property
    def safe(self) -> bool:
        """True if there is no violation; the speeds do not count."""
        return not self.runs

    def followed_by(self, later: Survey) -> Survey:
        """The survey of a motion in two parts."""

        def lower(first: Minima, second: Minima) -> Minima:
            return tuple(map(min, zip(first, second, strict=True)))

        return Survey(
            self.runs + later.runs,
            self.before if self.runs else lower(self.before, later.before),
            lower(self.whole, later.whole),
            tuple(map(max, zip(self.speeds, later.speeds, strict=True))),
        )


def survey(
    robot: Robot,
    settings: Settings,
    times_s: Sequence[float],
    positions: Sequence[Sequence[float]],
    velocities: Sequence[Sequence[float]] = (),
    assembly_mode: int = 0,
) -> Survey:
    """Survey a whole motion of the joints against the stop limits; arguments as those of `certify`.

    After a Type 2 singularity the margins are those of the assembly mode of the start, if labels are invariant. Raises
    BadTrajectory.
    """
    motion = JointSegments(len(robot.mechanism.joints), times_s, positions, velocities)
    walk = Walk(robot, settings, motion, assembly_mode)
    end_s, speeds = float(motion.times[-1]), fastest(motion)
    violation = walk.start()
    if violation is not None and violation.cause == Cause.BRANCH:
        return Survey(
            (Run(violation, end_s, violation),), walk.minima, ((0.0, violation.time_s),) * len(MARGIN_CAUSES), speeds
        )
    before = walk.minima if violation is not None else None
    runs = [] if violation is None else [Run(violation, violation.time_s, violation)]
    segment, inside = 0, violation is not None
    while segment < len(motion.low):
        if not inside:
            violation = walk.onwards(segment)
            if violation is None:
                break
            before = before or walk.minima
            runs.append(Run(violation, violation.time_s, violation))
            segment = int(np.searchsorted(motion.times[1:-1], violation.time_s, side="right"))
        found = walk.across(segment)
        if found is not None:
            worst = min(found[0], runs[-1].worst, key=lambda one: one.value - one.limit)
            runs[-1] = runs[-1]._replace(until_s=max(found[1], runs[-1].until_s), worst=worst)
        inside = found is not None and found[1] >= motion.times[segment + 1]
        segment += 1
    if (leaving := walk.leaving()) is not None:
        runs = sorted([*runs, Run(leaving, leaving.time_s, leaving)], key=lambda run: run.first.time_s)
    return Survey(tuple(runs), before or walk.minima, walk.minima, speeds)


def fastest(motion: JointSegments) -> tuple[tuple[float, float], ...]:
    """Largest speed of every joint, rad/s or m/s, and the time at the begin of the segment where it is reached, s."""
    if len(motion.times) < 2:
        return ((0.0, float(motion.times[0])),) * motion.q.shape[1]
    if motion.v is None:
        sizes = np.abs(np.diff(motion.q, axis=0) / np.diff(motion.times)[:, np.newaxis])
    else:
        sizes = np.array(
            [
                peaks_of(motion.times[k : k + 2], motion.q[k : k + 2], motion.v[k : k + 2])[0]
                for k in range(len(motion.times) - 1)
            ]
        )
    where = sizes.argmax(axis=0)
    return tuple((float(sizes[k, joint]), float(motion.times[k])) for joint, k in enumerate(where.tolist()))
