"""Runs rows of the campaign, each in its own process, and reports their progress."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from time import monotonic
from typing import NamedTuple

from irsbot_supervisor.validation.harness.rows import Entry, Job, Row

TELL_S = 0.2
"""s between two messages about the progress of a row."""

Progress = Callable[[str, int], None]
"""Called with the name of a row and the number of cases done since the last call."""


class Order(NamedTuple):
    """A row and its amount."""

    entry: Entry
    amount: int
    seed: int
    robots: tuple[str, ...] = ()


def run_rows(orders: Sequence[Order], jobs: int, progress: Progress) -> Iterator[Row]:
    """Rows as they are done, at most `jobs` at a time. A row whose process crashes has failed, with the reason."""
    context = multiprocessing.get_context("spawn")  # nothing of one row is left to another
    waiting, running = list(reversed(orders)), dict[Connection, tuple[SpawnProcess, Order]]()
    try:
        while waiting or running:
            while waiting and len(running) < jobs:
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
        for connection, (process, _order) in running.items():
            process.terminate()
            process.join()
            connection.close()


def _hear(connection: Connection) -> int | Row | None:
    """Number of cases done, or the row; None if the process has ended."""
    try:
        stated: int | Row = connection.recv()
    except EOFError:
        return None
    return stated


def _work(order: Order, connection: Connection) -> None:
    """One row, in its own process."""
    pending, told_s = 0, monotonic()

    def tell(cases: int) -> None:
        nonlocal pending, told_s
        pending += cases
        if monotonic() - told_s > TELL_S:
            connection.send(pending)
            pending, told_s = 0, monotonic()

    try:
        row = order.entry.run(Job(order.amount, order.seed, tell, order.robots))
    except Exception as error:  # a campaign that breaks must not look like one that found nothing
        row = _broken(order, f"{type(error).__name__}: {error}")
    connection.send(row)
    connection.close()


def _broken(order: Order, why: str) -> Row:
    return Row(order.entry.name, 0, 0, 1, {}, why)
