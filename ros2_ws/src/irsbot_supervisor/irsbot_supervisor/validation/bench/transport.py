"""Latency, loss and CPU of the supervisor, compared with relays without computation: publisher -> node -> subscriber at
1 kHz.

The subjects run in turn, each time in new processes on their own DDS domain, so that all of them meet the same machine.
Times are of the steady clock, which all processes of a machine share.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
import psutil
from numpy.typing import NDArray

from irsbot_supervisor.processes.suite import SUPERVISOR, Node, Suite, SuiteError, free_domain

ROBOT = "irsbot2"
SOURCE = "irsbot_supervisor.validation.bench.source"
SINK = "irsbot_supervisor.validation.bench.sink"

WARM_UP_S = 5.0
"""s after the first message until counting begins: discovery may hold up messages about 3 s after nodes have joined."""

DRAIN_S = 0.5
"""s after counting in which late messages still arrive."""

PATIENCE_S = 30.0
"""s until the first message must have arrived."""


class Subject(NamedTuple):
    """A node between publisher and subscriber."""

    name: str
    node: Node
    topic: str
    type: str


RAW, TYPED, SUPERVISED = "relay, raw", "relay, typed", "supervisor"
SUBJECTS = (
    Subject(RAW, Node("subject", "irsbot_supervisor.validation.bench.relay_raw", {}), "relayed", "JointState"),
    Subject(TYPED, Node("subject", "irsbot_supervisor.validation.bench.relay_typed", {}), "relayed", "JointState"),
    Subject(SUPERVISED, Node("subject", SUPERVISOR, {"robot": ROBOT}), "supervisor/state", "SingularityState"),
)


class Run(NamedTuple):
    """One run of one subject."""

    subject: str
    seconds: float
    sent: int
    lost: int
    p50_us: float
    p99_us: float
    cpu_us: float
    """CPU time of the whole process per message."""
    resident_mb: float
    """At the end."""

    @property
    def cpu_share(self) -> float:
        """Share of one core."""
        return self.cpu_us * 1e-6 * self.sent / self.seconds


def measure(tell: Callable[[str], None], *, quick: bool = False) -> list[Run]:
    """Every subject in each of several rounds. Raises SuiteError if no message arrives."""
    rounds, warm_up_s, seconds = (1, 0.5, 1.0) if quick else (5, WARM_UP_S, 6.0)
    runs = []
    for number in range(1, rounds + 1):
        for subject in SUBJECTS:
            tell(f"transport: round {number} of {rounds}, {subject.name}")
            with TemporaryDirectory(prefix="irsbot-bench-") as folder:
                runs.append(_run(subject, Path(folder), warm_up_s, seconds))
    return runs


def _run(subject: Subject, folder: Path, warm_up_s: float, seconds: float) -> Run:
    sent_file, seen_file = folder / "sent", folder / "seen"
    with Suite(folder / "logs", free_domain()) as suite:
        sink = {"topic": subject.topic, "type": subject.type, "times": str(seen_file)}
        suite.start(Node("sink", SINK, sink))
        suite.start(subject.node)
        source = {"robot": ROBOT, "times": str(sent_file)}
        suite.start(Node("source", SOURCE, source))
        await_file(suite, seen_file)
        time.sleep(warm_up_s)
        process = psutil.Process(suite.processes[subject.node.name].pid)
        begin_ns, before_s = time.monotonic_ns(), cpu_s(process)
        time.sleep(seconds)
        end_ns, after_s = time.monotonic_ns(), cpu_s(process)
        resident_mb = process.memory_info().rss * 1e-6
        time.sleep(DRAIN_S)
        suite.check()
    sent, seen = times_of(sent_file), times_of(seen_file)
    latencies_us, lost = match(sent[(sent[:, 1] >= begin_ns) & (sent[:, 1] < end_ns)], seen)
    number = len(latencies_us) + lost
    p50, p99 = np.percentile(latencies_us, (50.0, 99.0)) if latencies_us else (np.nan, np.nan)
    return Run(
        subject.name,
        (end_ns - begin_ns) * 1e-9,
        number,
        lost,
        float(p50),
        float(p99),
        (after_s - before_s) / number * 1e6 if number else np.nan,
        resident_mb,
    )


def match(sent: NDArray[np.int64], seen: NDArray[np.int64]) -> tuple[list[float], int]:
    """Latencies, us, of the messages that arrived, and the number of those that did not.

    sent, seen: (N, 2) stamp and time, ns; a message is identified by its stamp. The first arrival counts.
    """
    arrivals: dict[int, int] = {}
    for stamp, arrived in seen.tolist():
        arrivals.setdefault(stamp, arrived)
    latencies_us = [(arrivals[stamp] - left) / 1e3 for stamp, left in sent.tolist() if stamp in arrivals]
    return latencies_us, len(sent) - len(latencies_us)


def await_file(suite: Suite, file: Path) -> None:
    """Wait until a sink has received its first message. Raises SuiteError if a node ends or no message arrives."""
    deadline = time.monotonic() + PATIENCE_S
    while not file.exists():
        suite.check()
        if time.monotonic() > deadline:
            raise SuiteError(f"no message has come through within {PATIENCE_S:.0f} s")
        time.sleep(0.05)


def cpu_s(process: psutil.Process) -> float:
    """s of processor time that a process has used, its own and the system's for it."""
    times = process.cpu_times()
    return float(times.user + times.system)


def times_of(file: Path) -> NDArray[np.int64]:
    """(N, 2) int64: stamp and time, ns, as `source` and `sink` write them."""
    return np.fromfile(file, dtype=np.int64).reshape(-1, 2)
