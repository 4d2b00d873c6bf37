"""Long computations, of services too: a worker process runs them, and the executor goes on.

rclpy sends the return value of a callback at once, and its EventsExecutor does not await coroutines. So the callback is
a generator: it yields tasks, receives their results, and returns the response, which is then sent.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from functools import partial
from typing import Any

from rclpy.node import Node
from rclpy.service import Service

from irsbot_supervisor.nodes.guard import Fail
from irsbot_supervisor.processes.worker import Task, Worker, WorkerError

Steps = Generator[Task, Any, Any]
"""Yields tasks, receives their results (a WorkerError is raised in it), returns the response."""


class Later:
    """Runs generators on the executor's thread, from one result of the worker to the next."""

    def __init__(self, node: Node, fail: Fail) -> None:
        """fail: called with errors in generators; the client then gets an empty response."""
        self._node, self._fail, self._worker = node, fail, Worker()

    def serve(self, service: Service, callback: Callable[[Any, Any], Steps]) -> None:
        """Serve a service with generators of request and response."""
        send = service.send_response

        def answer(steps: Any, header: Any) -> None:
            self._go_on(steps, partial(self._reply, service, send, header), partial(next, steps))

        service.callback, service.send_response = callback, answer

    def run(self, steps: Steps) -> None:
        """Run a generator that nobody waits for."""
        self._go_on(steps, _unheard, partial(next, steps))

    def close(self) -> None:
        """End; waiting clients get no answer."""
        self._worker.close()

    def _go_on(self, steps: Steps, reply: Callable[[Any], None], advance: Callable[[], Task]) -> None:
        """Run a generator to its next task, or to its end."""
        try:
            task = advance()
        except StopIteration as end:
            reply(end.value)
            return
        except Exception as error:
            self._fail(error)
            reply(None)
            return

        def done(result: Any, error: WorkerError | None) -> None:
            """Called in the worker's thread: the rest runs in the executor's thread."""
            again = partial(steps.throw, error) if error is not None else partial(steps.send, result)
            if (executor := self._node.executor) is not None:
                executor.create_task(self._go_on, steps, reply, again)

        self._worker.submit(task, done)

    def _reply(self, service: Service, send: Callable[[Any, Any], None], header: Any, response: Any) -> None:
        try:
            send(response if response is not None else service.srv_type.Response(), header)
        except Exception as error:  # a client that is gone, or a service that is
            self._node.get_logger().warning(f"{service.srv_name}: no answer sent: {error}", throttle_duration_sec=1.0)


def _unheard(_result: Any) -> None:
    """Takes what a generator without client returns."""
