"""Sends log lines through a pipe to another process that writes them, so that this process never waits for a disk.

rclpy writes log lines, to the terminal and to a file, while it holds the interpreter's lock. A stalled disk or a paused
terminal would stop every callback of a node. If the pipe is full, lines are lost and the node goes on. Lines that a
node printed before a crash are in the pipe and arrive. Linux.
"""

from __future__ import annotations

import fcntl
import os
import subprocess
import time
from collections.abc import Iterator, MutableMapping
from contextlib import contextmanager, suppress
from pathlib import Path

PIPE_BYTES = 1024 * 1024
"""Bytes: largest pipe that a process without privileges may request: thousands of lines."""

END_S = 1.0
"""s: longest time that the end of a node waits until its last lines have arrived."""

NO_FILE = "--disable-external-lib-logs"
"""ROS argument: rcl writes no log file."""


@contextmanager
def log_aside(folder: Path, name: str, environment: MutableMapping[str, str]) -> Iterator[None]:
    """While the context is active, log output goes to the same place, and to a file in `folder`, through a separate
    process. environment: of this process, before rcl reads it. Does nothing if there is no `tee`."""
    log = 1 if environment.get("RCUTILS_LOGGING_USE_STDOUT") == "1" else 2
    if os.isatty(log):
        environment.setdefault(
            "RCUTILS_COLORIZED_OUTPUT", "1"
        )  # rcl would see a pipe, and the pipe leads to a terminal
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{name}_{os.getpid()}_{time.time_ns() // 1_000_000}.log"
    outlet, inlet = os.pipe()
    try:
        writer = subprocess.Popen(
            ["tee", "-a", "-i", "-p", str(file)],
            stdin=outlet,
            stdout=log,
            start_new_session=True,  # Ctrl-C is for us: the last lines are still to come
        )
    except OSError:
        os.close(inlet)
        os.close(outlet)
        yield
        return
    os.close(outlet)
    with suppress(OSError):  # the machine may allow less
        fcntl.fcntl(inlet, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
    os.set_blocking(inlet, False)
    before = os.dup(log)
    os.dup2(inlet, log)
    os.close(inlet)
    try:
        yield
    finally:
        os.dup2(before, log)
        os.close(before)
        with suppress(subprocess.TimeoutExpired):
            writer.wait(END_S)
