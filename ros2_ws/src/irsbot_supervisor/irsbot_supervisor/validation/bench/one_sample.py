"""The cost of one whole step of the supervisor in this process: from a joint sample to the verdict.

The state is made in the same step where someone listens to it; steps with it are measured in turn. Few steps of
pick and place cut the reachable box. The hardest prediction shows what a step can take near a limit.
"""

from __future__ import annotations

import gc
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np

from irsbot_kinematics import Robot
from irsbot_kinematics.compiled import are_used
from irsbot_supervisor.core.estimation.estimate import Speeds
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.stopping import StoppingPredictor
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.sim.scenario_file import scenario_robots
from irsbot_supervisor.validation.bench.motion import RATE_HZ, SCENARIO, recorded
from irsbot_supervisor.validation.harness.oracle import good_postures

HARD = 5
"""Number of the slowest predictions that are repeated."""


class OneSample(NamedTuple):
    """Microseconds of one step, to the verdict, over a run of pick and place. The fastest repetition of each sample
    counts, which excludes other work of the machine."""

    robot: str
    samples: int
    median_us: float
    p99_us: float
    worst_us: float
    with_state_us: float
    """Median of steps that also make the state."""
    hardest_us: float
    """Longest stopping prediction from random postures within the warning limits, at random speeds."""
    compiled: bool = False
    """Whether the core ran compiled."""


def measure(tell: Callable[[str], None], *, quick: bool = False) -> list[OneSample]:
    """Every robot that can do pick and place, the default robot first."""
    results = []
    for name in scenario_robots(SCENARIO):
        tell(f"one sample: {name}")
        results.append(measure_robot(name, *((100, 2, 2) if quick else (3000, 200, 7))))
    return results


def measure_robot(name: str, number: int, postures: int, repetitions: int) -> OneSample:
    """One robot, `number` samples, judged anew in each repetition, and the hardest prediction of `postures`."""
    settings, robot, samples = recorded(name, number)
    fastest_ns = {report: [sys.maxsize] * number for report in (False, True)}
    clock = time.perf_counter_ns
    with frozen_garbage():
        for _ in range(repetitions):
            for report, fastest in fastest_ns.items():
                step = Supervisor(settings, robot).step
                for k, sample in enumerate(samples):
                    begin = clock()
                    step(sample, report)
                    taken = clock() - begin
                    if taken < fastest[k]:
                        fastest[k] = taken
        hardest_ns = hardest_prediction(settings, robot, postures, repetitions)
    median, p99, worst = (float(ns) * 1e-3 for ns in np.percentile(fastest_ns[False], (50.0, 99.0, 100.0)))
    with_state = 1e-3 * float(np.median(fastest_ns[True]))
    return OneSample(name, number, median, p99, worst, with_state, 1e-3 * hardest_ns, are_used())


def hardest_prediction(settings: Settings, robot: Robot, number: int, repetitions: int) -> int:
    """ns of the longest of `number` stopping predictions from random postures within the warning limits, at random
    speeds. Of the slowest ones, the fastest repetition counts."""
    mechanism, rng, clock = robot.mechanism, np.random.default_rng(1), time.perf_counter_ns
    delay_s = 2.0 / RATE_HZ

    def taken(joints: list[float], velocity: list[float]) -> int:
        speeds = Speeds(tuple([max(v, 0.0) for v in velocity]), tuple([max(-v, 0.0) for v in velocity]))
        at = mechanism.posture(tuple(joints), settings.assembly_mode)
        predict = StoppingPredictor(settings, mechanism).predict
        begin = clock()
        predict(at, speeds, delay_s)
        return clock() - begin

    starts = good_postures(robot, settings, number, rng)
    velocities = np.array(settings.velocity_limit) * rng.uniform(-1.0, 1.0, starts.shape)
    cases = list(zip(starts.tolist(), velocities.tolist(), strict=True))
    slowest = sorted(cases, key=lambda case: taken(*case))[-HARD:]
    return max(min(taken(*case) for _ in range(repetitions)) for case in slowest)


@contextmanager
def frozen_garbage() -> Iterator[None]:
    """Freezes the objects that exist for the garbage collector, as the nodes do."""
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
