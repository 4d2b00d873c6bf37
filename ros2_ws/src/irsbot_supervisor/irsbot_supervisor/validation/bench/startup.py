"""Time from the start of the supervisor's process to its first verdict, and its memory then."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import psutil

from irsbot_msgs_py.records import Level, Verdict
from irsbot_supervisor.processes.suite import SUPERVISOR, Node, Suite, SuiteError, free_domain
from irsbot_supervisor.validation.bench.transport import PATIENCE_S, ROBOT, SINK, SOURCE, await_file


class Start(NamedTuple):
    """One start of supervisor_node while joint states are published."""

    first_verdict_s: float
    first_judged_s: float
    """s until the first verdict that is not UNKNOWN."""
    resident_mb: float
    """Memory at that time."""


def measure(tell: Callable[[str], None], *, quick: bool = False) -> list[Start]:
    """Several starts. A first start, in which Python compiles byte code, does not count. Raises SuiteError."""
    starts = 1 if quick else 5
    found = []
    with TemporaryDirectory(prefix="irsbot-bench-") as folder, _own_byte_code(Path(folder) / "byte_code"):
        for number in range(starts + 1):
            tell(f"start-up: {number} of {starts}" if number else "start-up: byte code")
            found.append(_start(Path(folder) / f"start_{number}"))
    return found[1:]


def _start(folder: Path) -> Start:
    from irsbot_supervisor.processes.listener import Watch  # needs ROS, which other parts of the benchmark do not

    heard: list[tuple[float, Level]] = []

    def hear(verdict: Verdict) -> None:
        heard.append((time.monotonic(), verdict.level))

    domain, seen_file = free_domain(), folder / "seen"
    with Suite(folder, domain) as suite, Watch(domain, hear) as watch:
        suite.start(Node("source", SOURCE, {"robot": ROBOT, "times": str(folder / "sent")}))
        suite.start(Node("sink", SINK, {"topic": "joint_states", "times": str(seen_file)}))
        await_file(suite, seen_file)
        begin = time.monotonic()
        suite.start(Node("supervisor", SUPERVISOR, {"robot": ROBOT}))
        while not (heard and heard[-1][1] < Level.UNKNOWN):
            watch.look(0.1)
            suite.check()
            if time.monotonic() - begin > PATIENCE_S:
                raise SuiteError(f"the supervisor has judged nothing within {PATIENCE_S:.0f} s")
        resident_mb = psutil.Process(suite.processes["supervisor"].pid).memory_info().rss * 1e-6
    return Start(heard[0][0] - begin, heard[-1][0] - begin, resident_mb)


@contextmanager
def _own_byte_code(folder: Path) -> Iterator[None]:
    """Make processes keep their byte code in a temporary folder, whatever the user's environment says."""
    before = dict(os.environ)
    os.environ["PYTHONPYCACHEPREFIX"] = str(folder)
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)
