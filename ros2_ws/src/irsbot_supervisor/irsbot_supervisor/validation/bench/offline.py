"""A recorded run judged offline from its bag, compared with the supervisor that judges every sample."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from irsbot_supervisor.bag.bag_writer import BagWriter
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.replay.judgement import judge_bag
from irsbot_supervisor.validation.bench.motion import recorded
from irsbot_supervisor.validation.bench.one_sample import frozen_garbage

ROBOT = "irsbot2"
HOUR = 3_600_000
"""Samples of an hour at 1 kHz."""
REPETITIONS = 3


class Offline(NamedTuple):
    """Times of a whole run of pick and place; the fastest repetition of each counts."""

    robot: str
    samples: int
    columns_s: float
    """From the bag to the result, reading included."""
    one_by_one_s: float
    """The steps of the supervisor for the same samples, without reading."""

    @property
    def hour_s(self) -> float:
        """s for an hour at 1 kHz; the cost of a sample does not depend on the length of the run."""
        return self.columns_s / self.samples * HOUR

    @property
    def ratio(self) -> float:
        """Offline over one by one."""
        return self.columns_s / self.one_by_one_s


def measure(tell: Callable[[str], None], *, quick: bool = False) -> Offline:
    """Write a bag of joint states, judge it, and judge the same samples one by one, in turns."""
    number = 1000 if quick else 60_000
    tell(f"offline: {number} samples of {ROBOT}")
    settings, robot, samples = recorded(ROBOT, number)
    columns = one_by_one = float("inf")
    with TemporaryDirectory() as folder, frozen_garbage():
        bag = Path(folder) / "run.mcap"
        with BagWriter(bag, compression="zstd") as opened:
            for sample in samples:
                opened.add("joint_states", sample, sample.received_ns)
        for _ in range(1 if quick else REPETITIONS):
            begin = time.perf_counter()
            judge_bag(bag, ROBOT)
            columns = min(columns, time.perf_counter() - begin)
            step = Supervisor(settings, robot).step
            begin = time.perf_counter()
            for sample in samples:
                step(sample)
            one_by_one = min(one_by_one, time.perf_counter() - begin)
    return Offline(ROBOT, number, columns, one_by_one)
