"""Samples that are judged at 5 kHz, while somebody subscribes to the states."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
import psutil

from irsbot_msgs_py.stamps import nanoseconds
from irsbot_supervisor.processes.suite import SUPERVISOR, Node, Suite, free_domain
from irsbot_supervisor.validation.bench.transport import ROBOT, SINK, SOURCE, WARM_UP_S, cpu_s, times_of

RATE_HZ = 5000.0
"""Faster than the usual cycles of drives: 1 to 4 kHz."""


class HighRate(NamedTuple):
    """One run of the supervisor."""

    rate_hz: float
    seconds: float
    sent: int
    judged: int
    states: int
    """That were published: fewer than samples that are judged, by intention."""
    cpu_us: float
    """CPU time of the supervisor's whole process per sample."""

    @property
    def lost(self) -> int:
        """Samples that were not judged."""
        return self.sent - self.judged


def measure(tell: Callable[[str], None], *, quick: bool = False) -> HighRate:
    """One run. Raises SuiteError if nothing is judged."""
    warm_up_s, seconds = (0.5, 1.0) if quick else (WARM_UP_S, 20.0)
    tell(f"high rate: {RATE_HZ:.0f} Hz for {seconds:.0f} s")
    with TemporaryDirectory(prefix="irsbot-bench-") as folder:
        return _run(Path(folder), warm_up_s, seconds)


def _run(folder: Path, warm_up_s: float, seconds: float) -> HighRate:
    """Samples are counted by their numbers in two states, so that those without a state count too."""
    from irsbot_msgs.msg import StateSummary  # need ROS, which other parts of the benchmark do not

    from irsbot_supervisor.validation.bench.listening import next_message

    domain, sent_file, seen_file = free_domain(), folder / "sent", folder / "seen"
    with Suite(folder / "logs", domain) as suite, next_message(domain, StateSummary, "supervisor/summary") as following:
        suite.start(
            Node("sink", SINK, {"topic": "supervisor/state", "type": "SingularityState", "times": str(seen_file)})
        )
        suite.start(Node("supervisor", SUPERVISOR, {"robot": ROBOT}))
        suite.start(Node("source", SOURCE, {"robot": ROBOT, "times": str(sent_file), "rate_hz": RATE_HZ}))
        following(suite)
        time.sleep(warm_up_s)
        process = psutil.Process(suite.processes["supervisor"].pid)
        first, before_s, begin = following(suite).state, cpu_s(process), time.monotonic()
        time.sleep(seconds)
        last, after_s, end = following(suite).state, cpu_s(process), time.monotonic()
        suite.check()
    sent, states = (_between(times_of(file)[:, 0], first, last) for file in (sent_file, seen_file))
    return HighRate(
        RATE_HZ, end - begin, sent, last.sequence - first.sequence, states, (after_s - before_s) / sent * 1e6
    )


def _between(stamps: Any, first: Any, last: Any) -> int:
    """Number of stamps, ns, after that of the first state, up to that of the last."""
    begin, end = (nanoseconds(state.header.stamp.sec, state.header.stamp.nanosec) for state in (first, last))
    return int(np.count_nonzero((stamps > begin) & (stamps <= end)))
