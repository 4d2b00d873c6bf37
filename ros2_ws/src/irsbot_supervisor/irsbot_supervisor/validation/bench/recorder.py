"""What the recorder costs, what it loses when it is killed, and how fast a damaged bag is salvaged."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import psutil

from irsbot_supervisor.bag.bag import Bag
from irsbot_supervisor.bag.bag_writer import BagWriter
from irsbot_supervisor.bag.salvage import salvage
from irsbot_supervisor.processes.suite import RECORDER, SUPERVISOR, Node, Suite, free_domain
from irsbot_supervisor.validation.bench.motion import recorded
from irsbot_supervisor.validation.bench.transport import ROBOT, SOURCE, cpu_s

LEAST_MESSAGES = 500
"""Messages in the bag before anything is measured."""
CUT_BYTES = 1000
"""Bytes that are missing at the end of the damaged bag."""


class Recorder(NamedTuple):
    """One recorder beside a supervisor at 1 kHz, then killed; and the salvage of a long bag."""

    messages_per_s: float
    cpu_us: float
    """CPU time of the recorder per message."""
    stall_s: float
    """Longest turn of taking and writing, as the recorder itself reports it."""
    lost_s: float
    """From the newest message in the bag to the SIGKILL."""
    salvaged_per_s: float
    """Messages of a damaged bag that are read and written again per second."""

    @property
    def share(self) -> float:
        """Share of one core at 3000 messages per second."""
        return self.cpu_us * 1e-6 * 3000.0


def measure(tell: Callable[[str], None], *, quick: bool = False) -> Recorder:
    """Record, kill, salvage. Raises SuiteError."""
    beats, kills, number = (1, 1, 5000) if quick else (6, 5, 200_000)
    runs = []
    for kill in range(1, kills + 1):
        tell(f"recorder: {kill} of {kills}")
        with TemporaryDirectory(prefix="irsbot-bench-") as folder:
            runs.append(_run(Path(folder), beats))
    tell(f"salvage: {number} messages")
    rates, cpus, stalls, losses = zip(*runs, strict=True)
    return Recorder(sum(rates) / kills, sum(cpus) / kills, max(stalls), max(losses), _salvage(number))


def _run(folder: Path, beats: int) -> tuple[float, float, float, float]:
    """Messages per second, us per message, longest turn and loss, s, of one recorder over some of its health messages,
    of which one comes each second."""
    from irsbot_msgs.msg import RecorderHealth  # need ROS, which other parts of the benchmark do not

    from irsbot_supervisor.validation.bench.listening import next_message

    domain, bag = free_domain(), folder / "bag"
    with (
        Suite(folder / "logs", domain) as suite,
        next_message(domain, RecorderHealth, "recorder/health") as next_health,
    ):
        suite.start(Node("recorder", RECORDER, {"output": str(bag), "reserve_mib": 0}))
        suite.start(Node("supervisor", SUPERVISOR, {"robot": ROBOT}))
        suite.start(Node("source", SOURCE, {"robot": ROBOT, "times": str(folder / "sent")}))
        while next_health(suite).messages_written < LEAST_MESSAGES:
            pass
        process = psutil.Process(suite.processes["recorder"].pid)
        first, before_s, begin = next_health(suite), cpu_s(process), time.monotonic()
        heard = [next_health(suite) for _ in range(beats)]
        end, after_s = time.monotonic(), cpu_s(process)
        suite.end("recorder", signal.SIGKILL)
        killed_ns = time.time_ns()
    with Bag(bag) as opened:
        newest_ns = max(entry.log_ns for entry in opened.records("supervisor/state"))
    count = heard[-1].messages_written - first.messages_written
    stall_s = max(health.write_time_max for health in heard)
    return count / (end - begin), (after_s - before_s) / count * 1e6, stall_s, (killed_ns - newest_ns) * 1e-9


def _salvage(number: int) -> float:
    """Messages per second."""
    _, _, samples = recorded(ROBOT, min(number, 5000))
    with TemporaryDirectory(prefix="irsbot-bench-") as name:
        damaged = Path(name) / "damaged.mcap"
        with BagWriter(damaged) as opened:
            for k in range(number):
                opened.add("joint_states", samples[k % len(samples)], samples[0].received_ns + k)
        data = damaged.read_bytes()
        damaged.write_bytes(data[:-CUT_BYTES])
        begin = time.perf_counter()
        found = salvage(damaged, Path(name) / "saved.mcap")
        return found.messages / (time.perf_counter() - begin)
