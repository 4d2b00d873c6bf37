"""Runs rows of the campaign, each in its own process: on this machine with their progress, or on a cluster."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic
from types import FrameType
from typing import NamedTuple

from irsbot_supervisor.fleet.cluster import Cluster, JobFailed, run
from irsbot_supervisor.processes.suite import end_with_parent
from irsbot_supervisor.validation.harness.rows import Entry, Job, Row

TELL_S = 0.2
"""s between two messages about the progress of a row."""

PATIENCE_S = 60.0
"""s for which an interrupted row may end its nodes and remove its files, before it is ended by force."""

Progress = Callable[[str, int], None]
"""Called with the name of a row and the number of cases done since the last call."""


class Order(NamedTuple):
    """A row and its amount."""

    entry: Entry
    amount: int
    seed: int
    robots: tuple[str, ...] = ()


def run_rows(orders: Sequence[Order], workers: int, progress: Progress) -> Iterator[Row]:
    """Rows as they are done, at most `workers` at a time. A row whose process crashes has failed, with the reason."""
    context = multiprocessing.get_context("spawn")  # nothing of one row is left to another
    waiting, running = list(reversed(orders)), dict[Connection, tuple[SpawnProcess, Order]]()
    try:
        while waiting or running:
            while waiting and len(running) < workers:
                order = waiting.pop()
                ours, theirs = context.Pipe(duplex=False)
                process = context.Process(target=_work, args=(order, theirs), daemon=False)
                process.start()
                theirs.close()
                running[ours] = process, order
            for ready in wait(list(running)):
                assert isinstance(ready, Connection), "only connections are waited for"
                process, order = running[ready]
                stated = _hear(ready)
                if isinstance(stated, int):
                    progress(order.entry.name, stated)
                    continue
                process.join()
                ready.close()
                del running[ready]
                yield stated or _broken(order, f"the process of the row ended with exit code {process.exitcode}")
    finally:
        _end([process for process, _order in running.values()])
        for connection in running:
            connection.close()


def run_rows_on(orders: Sequence[Order], cluster: Cluster) -> Iterator[Row]:
    """Likewise, by the workers of a cluster. The row of a worker that ends is begun again by another one.

    Raises BadInput where the cluster cannot be used.
    """
    for answer in run(run_row, orders, cluster):
        result = answer.result
        yield _broken(orders[answer.place], result.text) if isinstance(result, JobFailed) else result


def run_row(order: Order) -> Row:
    """A row in a process of its own, which ends with this one. For workers: they must not use multiprocessing."""
    with TemporaryDirectory() as folder:
        stated, found = Path(folder, "order"), Path(folder, "row")
        stated.write_bytes(pickle.dumps(order))
        done = subprocess.run(
            [sys.executable, "-c", _IN_A_PROCESS, stated, found],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            preexec_fn=partial(end_with_parent, os.getpid()),
        )
        if done.returncode:
            return _broken(order, f"the process of the row ended with exit code {done.returncode}")
        row: Row = pickle.loads(found.read_bytes())
        return row


_IN_A_PROCESS = "import sys; from irsbot_supervisor.validation.runner import serve; serve(*sys.argv[1:])"


def serve(stated: str, found: str) -> None:
    """Read an order from a file, write its row to another."""
    row = _row_of(pickle.loads(Path(stated).read_bytes()), lambda _cases: None)
    Path(found).write_bytes(pickle.dumps(row))


def _end(rows: Sequence[SpawnProcess]) -> None:
    """Interrupt rows, and end by force what does not end in time.

    They are interrupted again and again: a signal that comes between Python's last look for signals and a system call
    that blocks does not wake that call.
    """
    deadline = monotonic() + PATIENCE_S
    while (left := [process for process in rows if process.is_alive()]) and monotonic() < deadline:
        for process in left:
            process.terminate()
        wait([process.sentinel for process in left], TELL_S)
    for process in rows:
        process.kill()
        process.join()


def _hear(connection: Connection) -> int | Row | None:
    """Number of cases done, or the row; None if the process has ended."""
    try:
        stated: int | Row = connection.recv()
    except EOFError:
        return None
    return stated


def _work(order: Order, connection: Connection) -> None:
    """One row, in its own process, which ends with the command. A signal interrupts it: it cleans up and says
    nothing."""
    command = multiprocessing.parent_process()
    assert command is not None, "a row has a process of its own"
    end_with_parent(command.pid or 0)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _interrupt)
    pending, told_s = 0, monotonic()

    def tell(cases: int) -> None:
        nonlocal pending, told_s
        pending += cases
        if monotonic() - told_s > TELL_S:
            connection.send(pending)
            pending, told_s = 0, monotonic()

    with suppress(KeyboardInterrupt):
        connection.send(_row_of(order, tell))
    connection.close()


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    """The first signal interrupts a row; none interrupts its cleaning up."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    raise KeyboardInterrupt


def _row_of(order: Order, tell: Callable[[int], None]) -> Row:
    """The row, also of one that breaks down."""
    try:
        return order.entry.run(Job(order.amount, order.seed, tell, order.robots))
    except Exception as error:  # a campaign that breaks must not look like one that found nothing
        return _broken(order, f"{type(error).__name__}: {error}")


def _broken(order: Order, why: str) -> Row:
    return Row(order.entry.name, 0, 0, 1, {}, why)
