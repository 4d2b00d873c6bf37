"""What else the machine does during a measurement: cores that other processes take."""

from __future__ import annotations

import os
import time
from types import TracebackType

import psutil

QUIET_CORES = 0.2
"""Cores that other processes may take before times are no longer those of a quiet machine."""


class Others:
    """Measures as a context manager. Our own processes must have ended by then: only then their time is known."""

    def __init__(self) -> None:
        self.cores = float("nan")
        """Cores taken by other processes, on average; NaN before the end."""

    def __enter__(self) -> Others:
        self._begin_s, self._busy_s, self._own_s = time.monotonic(), _busy_s(), _own_s()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        seconds = max(time.monotonic() - self._begin_s, 1e-3)
        self.cores = max((_busy_s() - self._busy_s) - (_own_s() - self._own_s), 0.0) / seconds

    @property
    def quiet(self) -> bool:
        """True if no other process can have disturbed a measurement much."""
        return self.cores <= QUIET_CORES


def _busy_s() -> float:
    """Processor time of the machine that was not idle, all cores."""
    times = psutil.cpu_times()
    return float(sum(times[:]) - times.idle - getattr(times, "iowait", 0.0) - getattr(times, "guest", 0.0))


def _own_s() -> float:
    """Processor time of this process and of its children that have ended."""
    return sum(os.times()[:4])
