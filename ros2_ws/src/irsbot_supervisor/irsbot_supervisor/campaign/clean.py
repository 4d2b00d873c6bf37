"""Clean motion: nobody is stopped where nothing is near."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice

import numpy as np

from irsbot_kinematics import Robot
from irsbot_msgs_py.records import JointSample, Level
from irsbot_supervisor.campaign.motion import PERIOD_S, Motion, measured, swings, work, works
from irsbot_supervisor.campaign.rows import FALSE_STOPS, Job, Row, Tally
from irsbot_supervisor.campaign.truth import supervised
from irsbot_supervisor.core.intake import S
from irsbot_supervisor.core.pipeline import Supervisor
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.settings_file import read_settings

NAME = "clean"
MUST = "0 false stops in pick and place and in random motion free of singularities"

BEGIN_NS = 10**15
BATCH = 1000
"""Samples between two messages to the progress bar."""


def run(job: Job) -> Row:
    """The row: a case is a sample, the same number for every robot and both kinds of motion."""
    tally = Tally(NAME, job)
    tally.figures.update({FALSE_STOPS: 0.0, "warnings": 0.0})
    names = job.robots or supervised()
    streams = [(name, kind) for name in names for kind in ("work", "swings") if kind == "swings" or name in works()]
    for k, (name, kind) in enumerate(streams):
        settings, robot = read_settings(name)
        motion = (
            work(robot, settings) if kind == "work" else swings(robot, settings, np.random.default_rng([job.seed, k]))
        )
        _watch(tally, f"{name}, {kind}", robot, replace(settings, dwell_s=0.0), motion, -(-job.amount // len(streams)))
    tally.figures["robots"] = len(names)
    return tally.row()


def _watch(tally: Tally, where: str, robot: Robot, settings: Settings, motion: Motion, number: int) -> None:
    supervisor = Supervisor(settings, robot)
    period_ns = round(PERIOD_S * S)
    done = stops = 0
    note = ""
    for k, (position, velocity) in enumerate(islice(motion, number)):
        times = BEGIN_NS + k * period_ns, BEGIN_NS + k * period_ns, S + k * period_ns
        step = supervisor.step(JointSample(*times, settings.joint_names, measured(position, settings), velocity))
        assert step.state is not None, "every sample has a state"
        done += 1
        if step.state.level >= Level.STOP:
            stops += 1
            note = note or f"{where}: sample {k}: {step.verdict.text if step.verdict else step.state.causes}"
        elif step.state.level == Level.WARN:
            tally.add("warnings")
        if done == BATCH or k == number - 1:
            tally.add(FALSE_STOPS, stops)
            tally.many(done, stops, note)
            done = stops = 0
