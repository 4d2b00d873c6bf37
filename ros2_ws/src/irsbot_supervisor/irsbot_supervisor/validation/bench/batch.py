"""Margins of many samples at once, compared with copying memory."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import fields
from typing import NamedTuple

import numpy as np

from irsbot_kinematics import make_robot

ROBOT = "irsbot2"
REPETITIONS = 5
COPIED_BYTES = 256 * 2**20
"""Bytes per copy: far more than any cache."""


class Batch(NamedTuple):
    """Throughput of `evaluate_many` and of a copy; the fastest repetition of each counts."""

    samples: int
    samples_per_s: float
    bytes_per_sample: float
    """Bytes read and written: joints in, all margins out."""
    copied_bytes_per_s: float
    """Read plus written."""

    @property
    def share_of_copy(self) -> float:
        """Bytes of the samples per second over those of a copy, 0..1."""
        return self.samples_per_s * self.bytes_per_sample / self.copied_bytes_per_s


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
    evaluating = copying = np.inf
    for _ in range(2 if quick else REPETITIONS):  # in turns, so that both meet the same machine
        copying = min(copying, _seconds(lambda: np.copyto(target, source)))
        evaluating = min(evaluating, _seconds(lambda: robot.evaluate_many(joints)))
    return Batch(number, number / evaluating, moved / number, 2.0 * source.nbytes / copying)


def _seconds(work: Callable[[], object]) -> float:
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin
