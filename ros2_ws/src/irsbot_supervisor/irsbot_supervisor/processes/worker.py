"""A separate process for long computations. It blocks neither this thread nor the lock of this interpreter.

It starts with the first task and ends with this process: it reads tasks from a pipe, which closes at the end of this
process. Tasks are functions of a module with values, pickled; they run one after another, at a lower priority.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Callable
from queue import SimpleQueue
from threading import Thread
from typing import Any, BinaryIO, NamedTuple

NICENESS = 10
"""Added to our nice value: an answer may wait a little longer, a heartbeat may not."""

END_S = 1.0
"""s: longest time that the end of a worker waits for a running task."""


class WorkerError(Exception):
    """A task or its process ended with an error."""


class Task(NamedTuple):
    """A function that the other process can import, and its arguments."""

    function: Callable[..., Any]
    arguments: tuple[Any, ...]


Done = Callable[[Any, WorkerError | None], None]
"""Called with the result, or with the reason why there is none."""


class Worker:
    """Runs tasks in a separate process. Thread-safe; `Done` is called in a thread of the worker."""

    def __init__(self) -> None:
        self._waiting: SimpleQueue[tuple[Task, Done] | None] = SimpleQueue()
        self._process: subprocess.Popen[bytes] | None = None
        self._closed = False
        self._thread = Thread(target=self._work, name="worker", daemon=True)
        self._thread.start()

    def submit(self, task: Task, done: Done) -> None:
        """Run a task after those before it."""
        self._waiting.put((task, done))

    def close(self) -> None:
        """End. Waiting tasks are dropped without notice."""
        self._closed = True
        self._waiting.put(None)
        if self._process is not None:
            self._process.kill()  # it may be in the middle of something
        self._thread.join(END_S)

    def _work(self) -> None:
        while (waiting := self._waiting.get()) is not None and not self._closed:
            task, done = waiting
            try:
                result, text = self._ask(task)
            except Exception as error:  # a broken pipe, an end of the file, an answer that cannot be read
                self._end()
                result, text = None, f"the worker process ended: {type(error).__name__} {error}"
            if not self._closed:
                done(result, WorkerError(text) if text else None)
        self._end()

    def _ask(self, task: Task) -> tuple[Any, str]:
        if self._process is None:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "irsbot_supervisor.processes.worker"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
            )
        inlet, outlet = self._process.stdin, self._process.stdout
        assert inlet is not None, "it was asked for"
        assert outlet is not None, "it was asked for"
        pickle.dump(task, inlet)
        inlet.flush()
        answer: tuple[Any, str] = pickle.load(outlet)  # from a process that we have started
        return answer

    def _end(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
        self._process = None


def serve(tasks: BinaryIO, answers: BinaryIO) -> None:
    """Run tasks until there are no more: send the result and an empty text, or nothing and the error."""
    while True:
        try:
            task = pickle.load(tasks)
        except EOFError:
            return
        try:
            answer = pickle.dumps((task.function(*task.arguments), ""))
        except Exception as error:
            answer = pickle.dumps((None, f"{type(error).__name__}: {error}"))
        answers.write(answer)
        answers.flush()


def main() -> None:
    """The process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for those who started us
    os.nice(NICENESS)
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # printed text is not an answer
    serve(sys.stdin.buffer, answers)


if __name__ == "__main__":
    main()
