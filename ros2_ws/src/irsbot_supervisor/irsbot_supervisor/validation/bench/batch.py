"""Margins of many samples at once, compared with copying memory."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import fields
from functools import partial
from typing import NamedTuple

import numpy as np

from irsbot_kinematics import NotCompiled, Robot, make_robot

ROBOT = "irsbot2"
REPETITIONS = 5
COPIED_BYTES = 256 * 2**20
"""Bytes per copy: far more than any cache."""


class Batch(NamedTuple):
    """Throughput of `evaluate_many` and of a copy; the fastest repetition of each counts."""

    samples: int
    samples_per_s: float
    """With numpy."""
    compiled_samples_per_s: float | None
    """As machine code, one thread; None without a C compiler."""
    threads: int
    """Number of cores."""
    threaded_samples_per_s: float | None
    """As machine code, one thread per core."""
    anew_samples_per_s: float | None
    """The same into the arrays of an earlier call: the system need not clear new memory."""
    bytes_per_sample: float
    """Bytes read and written: joints in, all margins out."""
    copied_bytes_per_s: float
    """Read plus written."""

    @property
    def share_of_copy(self) -> float:
        """Bytes of the samples per second over those of a copy, 0..1, on one thread."""
        fastest = max(self.samples_per_s, self.compiled_samples_per_s or 0.0)
        return fastest * self.bytes_per_sample / self.copied_bytes_per_s


def measure(tell: Callable[[str], None], *, quick: bool = False) -> Batch:
    """Measure with joint positions from the whole workspace in random order."""
    number = 50_000 if quick else 1_000_000
    tell(f"batch: {number} samples against a copy of memory")
    robot = make_robot(ROBOT)
    joints = np.random.default_rng(0).uniform(-np.pi, np.pi, (number, len(robot.mechanism.joints)))
    columns = robot.evaluate_many(joints)
    arrays = [getattr(columns, field.name) for field in fields(columns)]
    moved = sum(array.nbytes for array in arrays if isinstance(array, np.ndarray))  # joint positions are among them
    source = np.ones((COPIED_BYTES // 8) // (16 if quick else 1))
    target = np.zeros_like(source)
    threads = len(os.sched_getaffinity(0))
    robots = [robot, *_compiled(tell, [1, threads])]
    calls = [partial(one.evaluate_many, joints) for one in robots]
    if len(robots) > 1:
        calls.append(partial(robots[-1].evaluate_many, joints, out=columns))
    evaluating, copying = [np.inf] * len(calls), np.inf
    for _ in range(2 if quick else REPETITIONS):  # in turns, so that all meet the same machine
        copying = min(copying, _seconds(lambda: np.copyto(target, source)))
        taken = [_seconds(call) for call in calls]
        evaluating = list(map(min, evaluating, taken))
    plain, compiled, threaded, anew, *_ = [*(number / seconds for seconds in evaluating), None, None, None]
    assert plain is not None
    return Batch(number, plain, compiled, threads, threaded, anew, moved / number, 2.0 * source.nbytes / copying)


def _compiled(tell: Callable[[str], None], threads: Sequence[int]) -> list[Robot]:
    """The robot on machine code, with these numbers of threads; none without a C compiler."""
    robots = []
    try:
        for number in threads:
            robots.append(make_robot(ROBOT))
            robots[-1].compile(number)
    except NotCompiled as error:
        tell(f"batch: no machine code: {error}")
        return []
    return robots


def _seconds(work: Callable[[], object]) -> float:
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin
