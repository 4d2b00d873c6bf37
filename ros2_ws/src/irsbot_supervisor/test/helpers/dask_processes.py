"""A Dask scheduler and a worker as processes, and ways to end them in the middle of the work."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from threading import Thread

import psutil

PATH = os.pathsep.join(filter(None, sys.path))


@contextmanager
def process(*words: str, until: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A process of Dask, and the line by which it says that it is ready."""
    command = [sys.executable, "-m", *words]
    with subprocess.Popen(
        command, stderr=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": PATH}
    ) as started:
        assert started.stderr is not None
        reader = Thread(target=deque, args=(started.stderr, 0), daemon=True)  # so that no full pipe stops them
        try:
            ready = next(line for line in started.stderr if until in line)
            reader.start()
            yield started, ready
        finally:
            _kill(started)
            if reader.ident is not None:
                reader.join()


@contextmanager
def dask_cluster() -> Iterator[tuple[str, subprocess.Popen[str], subprocess.Popen[str]]]:
    """Address and process of a scheduler, and the nanny of its one worker."""
    where = ("--host", "127.0.0.1", "--no-dashboard")
    with process("distributed.cli.dask_scheduler", *where, "--port", "0", until="Scheduler at") as (scheduler, line):
        stated = re.search(r"tcp://\S+", line)
        assert stated is not None, line
        address = stated[0]
        words = ("distributed.cli.dask_worker", address, *where, "--nthreads", "1", "--nworkers", "1")
        with process(*words, until="Registered to") as (nanny, _line):
            yield address, scheduler, nanny


def once(act: Callable[[], None], when: int) -> Callable[[int, int], None]:
    """A progress that acts when that many bags are done."""
    left = [act]
    return lambda done, _total: left.pop()() if done >= when and left else None


def _kill(started: subprocess.Popen[str]) -> None:
    """End a process, then its descendants: some of them end by themselves when another one does."""
    family: list[psutil.Process] = []
    with suppress(psutil.NoSuchProcess):
        family += psutil.Process(started.pid).children(recursive=True) if started.poll() is None else []
    started.kill()
    for one in family:
        with suppress(psutil.NoSuchProcess):
            one.kill()


def kill_family(nanny: subprocess.Popen[str]) -> None:
    """End a nanny and its worker, so that nobody starts another one."""
    _kill(nanny)


def kill_worker(nanny: subprocess.Popen[str]) -> None:
    """End the worker process of a nanny as a lack of memory does."""
    (worker,) = [
        one for one in psutil.Process(nanny.pid).children() if "resource_tracker" not in " ".join(one.cmdline())
    ]
    worker.send_signal(signal.SIGKILL)
