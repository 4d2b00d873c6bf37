"""Approaches with acceleration: drives accelerate and brake on their way across a limit, in a closed loop.

Between two random places every joint swings smoothly, at up to the limits of the drives, through any posture in
between. The supervisor receives each sample; its verdict is obeyed after the latency of the settings, then every joint
brakes by itself. Then the margins are evaluated at the true positions. Every swing counts that meets a limit or is
stopped: all of them begin where motion is allowed, and the supervisor must stop every motion within the limits of the
drives.
"""

from __future__ import annotations

import numpy as np

from irsbot_kinematics import Robot
from irsbot_msgs_py.records import CONSUMER_TIMEOUT_S, JointSample, Level
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.sim.joints import Drives
from irsbot_supervisor.sim.stop_response import StopResponse
from irsbot_supervisor.sim.trajectory import joint_move
from irsbot_supervisor.trajectory.joint_path import JointPath, JointPoint, joint_limits_of
from irsbot_supervisor.validation.harness.oracle import (
    Array,
    good_postures,
    joint_ranges,
    limits,
    margins_along,
    supervised,
)
from irsbot_supervisor.validation.harness.rows import Job, Row, Tally

NAME = "swings"
MUST = "the robot stands before its stop margin is crossed, also while it speeds up: 100 %"

BEGIN_NS = 10**15
PERIOD_S = 0.001
MOST_TRIED = 200
"""1: largest number of swings for each one that meets a limit."""
SPEEDS = (0.2, 1.0)
"""1: share of the fastest swing, lowest and highest."""
REST_S = 0.5
"""s before and after a swing in which OK and a stop are waited for."""


def run(job: Job) -> Row:
    """The row: a case is a swing that had to be stopped, the same number for every robot."""
    tally = Tally(NAME, job)
    names = job.robots or supervised()
    for k, name in enumerate(names):
        rng = np.random.default_rng([job.seed, k])
        settings, robot = read_settings(name)
        stop, done, wanted = limits(settings, "stop"), 0, -(-job.amount // len(names))
        tried, most = 0, MOST_TRIED * wanted
        while done < wanted and tried < most:
            for start in good_postures(robot, settings, wanted - done, rng):
                tried += 1
                motion = _random_swing(robot, settings, start, rng)
                watched = _Supervised(robot, settings)
                spare = float((margins_along(robot, settings, _way(motion, settings, watched)) - stop).min())
                if not (watched.began and (watched.stopped or spare < 0.0)):
                    continue  # it met no limit, or was never allowed to begin
                done += 1
                tally.smallest("least margin above its stop limit", spare)
                tally.case(f"{name}: {-spare:.2e} below a stop limit" if not spare >= 0.0 else "")
        if done < wanted:
            tally.many(0, 1, f"{name}: only {done} of {tried} swings began and met a limit")
    return tally.row()


class _Supervised:
    """The supervisor, and a consumer that obeys it while verdicts are fresh."""

    def __init__(self, robot: Robot, settings: Settings) -> None:
        self._supervisor, self._stop_response = Supervisor(settings, robot), StopResponse(CONSUMER_TIMEOUT_S)
        self._names = settings.joint_names
        self.began = self.stopped = False

    def allowed(self, after_ns: int, now: JointPoint) -> float:
        """Share of full speed that is allowed for the next period, after a sample of the joints."""
        stamp_ns, seen_ns = BEGIN_NS + after_ns, NS_PER_S + after_ns
        sample = JointSample(stamp_ns, stamp_ns, seen_ns, self._names, now.position, now.velocity)
        verdict = self._supervisor.step(sample).verdict
        if verdict is not None:
            self._stop_response.hear(verdict.level, verdict.speed_scale, seen_ns)
            self.began = self.began or verdict.level < Level.STOP
            self.stopped = self.stopped or verdict.latched
        return self._stop_response.allowed(seen_ns + round(PERIOD_S * NS_PER_S))


def _random_swing(robot: Robot, settings: Settings, start: Array, rng: np.random.Generator) -> JointPath:
    low, high = joint_ranges(robot)
    goal = np.clip(start + rng.uniform(-0.5, 0.5, len(start)) * (high - low), low, high)
    return joint_move(
        tuple(start.tolist()), tuple(goal.tolist()), joint_limits_of(settings), speed=float(rng.uniform(*SPEEDS))
    )


def _way(motion: JointPath, settings: Settings, lookout: _Supervised) -> Array:
    """(N, n) joint positions, period by period, until they stand after the motion or because they were stopped."""
    drives, allowed = Drives(motion, joint_limits_of(settings), settings.latency_s), 0.0
    way = [drives.now.position]
    for k in range(1, round((motion.duration_s + REST_S) / PERIOD_S)):
        way.append(drives.step(PERIOD_S, allowed).position)
        allowed = lookout.allowed(round(k * PERIOD_S * NS_PER_S), drives.now)
        if lookout.stopped and drives.stands:
            break
    return np.array(way)
