"""A thread in step with the steady clock, without drift, and the conversion of that clock to ROS time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from rclpy.clock import Clock

from irsbot_msgs_py.stamps import NS_PER_S

READ_NS = 50_000
"""ns: two clocks that are read farther apart count as interrupted and are read again."""

READINGS = 10
"""How often they are read again."""

REREAD_NS = 10_000_000
"""ns between two readings of the ROS clock: a reading takes as long as a step of the robot; in 10 ms two clocks drift
apart by at most 5 us."""


class Pacer:
    """Calls `cycle(due_ns)` `rate_hz` times a second; `due_ns` is the time at which the call was due, steady clock.

    Late calls are made up for; none is left out. An error ends the thread and is passed to `failed`.
    """

    def __init__(self, rate_hz: float, cycle: Callable[[int], None], failed: Callable[[Exception], None]) -> None:
        self._rate_hz, self._cycle, self._failed = rate_hz, cycle, failed
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="pacer")
        self._thread.start()

    def close(self) -> None:
        """Returns when the last call has ended."""
        self._closing.set()
        self._thread.join()

    def _run(self) -> None:
        begin_ns, count = time.monotonic_ns(), 0
        try:
            while not self._closing.is_set():
                count += 1
                due_ns = begin_ns + round(count * NS_PER_S / self._rate_hz)
                early_ns = due_ns - time.monotonic_ns()
                if early_ns > 0:
                    time.sleep(early_ns / NS_PER_S)
                self._cycle(due_ns)
        except Exception as error:
            self._failed(error)


class RosTime:
    """Converts times of the steady clock to times of a ROS clock, within READ_NS; a step of that clock shows after
    REREAD_NS."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._difference_ns = self._read_ns = 0

    def of(self, steady_ns: int) -> int:
        """Nanoseconds of the ROS clock at a recent steady time."""
        if steady_ns - self._read_ns >= REREAD_NS:
            self._difference_ns, self._read_ns = self._compare(), steady_ns
        return steady_ns + self._difference_ns

    def _compare(self) -> int:
        for _ in range(READINGS):
            before_ns = time.monotonic_ns()
            difference_ns: int = self._clock.now().nanoseconds - before_ns
            if time.monotonic_ns() - before_ns < READ_NS:
                break
        return difference_ns
