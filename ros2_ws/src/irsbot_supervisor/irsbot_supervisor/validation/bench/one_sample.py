"""The cost of one whole step of the supervisor in this process: from a joint sample to the verdict.

The state is made in the same step where someone listens to it; steps with it are measured in turn.
"""

from __future__ import annotations

import gc
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np

from irsbot_kinematics.compiled import are_used
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.sim.scenario_file import scenario_robots
from irsbot_supervisor.validation.bench.motion import SCENARIO, recorded


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
    compiled: bool = False
    """Whether the core ran compiled."""


def measure(tell: Callable[[str], None], *, quick: bool = False) -> list[OneSample]:
    """Every robot that can do pick and place, the default robot first."""
    results = []
    for name in scenario_robots(SCENARIO):
        tell(f"one sample: {name}")
        results.append(measure_robot(name, 300 if quick else 3000, 2 if quick else 7))
    return results


def measure_robot(name: str, number: int, repetitions: int) -> OneSample:
    """One robot, `number` samples, judged anew in each repetition."""
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
    median, p99, worst = (float(ns) * 1e-3 for ns in np.percentile(fastest_ns[False], (50.0, 99.0, 100.0)))
    return OneSample(name, number, median, p99, worst, 1e-3 * float(np.median(fastest_ns[True])), are_used())


@contextmanager
def frozen_garbage() -> Iterator[None]:
    """Freezes the objects that exist for the garbage collector, as the nodes do."""
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
