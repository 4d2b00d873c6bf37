"""The process beside ours: results, errors, its death, and its end."""

from __future__ import annotations

import math
import os
import signal
import time
from collections.abc import Iterator
from queue import SimpleQueue
from typing import Any

import psutil
import pytest

from irsbot_supervisor.processes.worker import Task, Worker, WorkerError

PATIENCE_S = 60.0


class Desk:
    """Asks a worker, one thing after another."""

    def __init__(self) -> None:
        self.worker = Worker()
        self.heard: SimpleQueue[tuple[Any, WorkerError | None]] = SimpleQueue()

    def submit(self, function: Any, *arguments: Any) -> None:
        self.worker.submit(Task(function, arguments), lambda result, error: self.heard.put((result, error)))

    def ask(self, function: Any, *arguments: Any) -> tuple[Any, WorkerError | None]:
        self.submit(function, *arguments)
        return self.heard.get(timeout=PATIENCE_S)


@pytest.fixture
def desk() -> Iterator[Desk]:
    desk = Desk()
    yield desk
    desk.worker.close()


def test_it_computes_in_another_process_at_a_lower_priority(desk: Desk):
    pid, error = desk.ask(os.getpid)
    assert error is None
    assert pid != os.getpid()
    assert psutil.Process(pid).nice() > psutil.Process().nice() or psutil.Process().nice() == 19
    assert desk.ask(math.gcd, 12, 18) == (6, None)
    assert desk.ask(os.getpid) == (pid, None)  # one process for all tasks


def test_waiting_tasks_run_in_order(desk: Desk):
    for number in range(20):
        desk.submit(math.factorial, number)
    assert [desk.heard.get(timeout=PATIENCE_S)[0] for _ in range(20)] == [math.factorial(k) for k in range(20)]


def test_printed_text_of_a_task_is_not_its_answer(desk: Desk):
    assert desk.ask(print, "a word") == (None, None)
    assert desk.ask(math.gcd, 4, 6) == (2, None)


def test_an_error_of_a_task_is_reported_and_the_next_one_runs(desk: Desk):
    result, error = desk.ask(math.sqrt, -1.0)
    assert result is None
    assert "ValueError" in str(error)
    assert "ValueError" in str(desk.ask(int, "one")[1])
    assert desk.ask(math.gcd, 4, 6) == (2, None)


def test_a_dead_process_is_reported_and_replaced(desk: Desk):
    pid, _ = desk.ask(os.getpid)
    result, error = desk.ask(os.kill, pid, signal.SIGKILL)
    assert result is None
    assert "the worker process ended" in str(error)
    after, error = desk.ask(os.getpid)
    assert error is None
    assert after != pid


def test_it_ends_with_its_owner_in_the_middle_of_a_task_without_notice(desk: Desk):
    process = psutil.Process(desk.ask(os.getpid)[0])
    desk.submit(time.sleep, 10 * PATIENCE_S)
    desk.submit(math.gcd, 4, 6)
    desk.worker.close()
    process.wait(PATIENCE_S)
    assert desk.heard.empty()
