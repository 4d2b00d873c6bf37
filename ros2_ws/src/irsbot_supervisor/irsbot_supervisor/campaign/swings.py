"""Approaches with acceleration: drives that speed up and slow down on their way over a limit, in a closed loop.

Between two random places every joint swings smoothly, at up to all that the drives can do, whatever lies in between.
The supervisor sees each sample, its verdict is obeyed after the latency of the settings, then every joint brakes by
itself. Afterwards the margins are evaluated where the joints really were.
"""

from __future__ import annotations

import numpy as np

from irsbot_kinematics import Robot
from irsbot_msgs_py.records import JointSample
from irsbot_supervisor.campaign.rows import Job, Row, Tally
from irsbot_supervisor.campaign.truth import Array, good_postures, joint_ranges, limits, margins_along, supervised
from irsbot_supervisor.core.intake import S
from irsbot_supervisor.core.motion import JointLimits
from irsbot_supervisor.core.pipeline import Supervisor
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.settings_file import read_settings
from irsbot_supervisor.sim.joints import Drives
from irsbot_supervisor.sim.obedience import Obedience
from irsbot_supervisor.sim.trajectory import swing

NAME = "swings"
MUST = "the robot stands before its stop margin is crossed, also while it speeds up: 100 %"

BEGIN_NS = 10**15
PERIOD_S = 0.001
SILENCE_S = 0.1
SPEEDS = (0.2, 1.0)
"""1: share of the fastest swing, lowest and highest."""
REST_S = 0.5
"""s before and after a swing in which OK and a stop are still waited for."""


def run(job: Job) -> Row:
    """The row: a case is a swing that had to be stopped, the same number for every robot."""
    tally = Tally(NAME, job)
    names = job.robots or supervised()
    for k, name in enumerate(names):
        rng = np.random.default_rng([job.seed, k])
        settings, robot = read_settings(name)
        stop, done, wanted = limits(settings, "stop"), 0, -(-job.amount // len(names))
        while done < wanted:
            for start in good_postures(robot, settings, wanted - done, rng):
                way, stopped = _swing(robot, settings, start, rng)
                spare = float((margins_along(robot, settings, way) - stop).min())
                if not (stopped or spare < 0.0):
                    continue  # it met no limit
                done += 1
                tally.smallest("least margin above its stop limit", spare)
                tally.case(f"{name}: {-spare:.2e} below a stop limit" if not spare >= 0.0 else "")
    return tally.row()


def _swing(robot: Robot, settings: Settings, start: Array, rng: np.random.Generator) -> tuple[Array, bool]:
    """(N, n) where the joints were, and whether the robot was stopped."""
    low, high = joint_ranges(robot)
    drives_can = JointLimits(settings.velocity_limit, settings.deceleration_limit, settings.deceleration_limit)
    goal = np.clip(start + rng.uniform(-0.5, 0.5, len(start)) * (high - low), low, high)
    motion = swing(tuple(start.tolist()), tuple(goal.tolist()), drives_can, speed=float(rng.uniform(*SPEEDS)))
    drives, obedience = Drives(motion, drives_can, settings.latency_s), Obedience(SILENCE_S)
    supervisor = Supervisor(settings, robot)
    way, stopped = [tuple(start.tolist())], False
    for k in range(1, round((motion.duration_s + REST_S) / PERIOD_S)):
        after_ns = round(k * PERIOD_S * S)
        now = drives.step(PERIOD_S, obedience.allowed(S + after_ns))
        way.append(now.position)
        stamp_ns = BEGIN_NS + after_ns
        sample = JointSample(stamp_ns, stamp_ns, S + after_ns, settings.joint_names, now.position, now.velocity)
        verdict = supervisor.step(sample).verdict
        if verdict is not None:
            obedience.hear(verdict.level, verdict.speed_scale, S + after_ns)
            stopped = stopped or verdict.latched
        if stopped and drives.stands:
            break
    return np.array(way), stopped
