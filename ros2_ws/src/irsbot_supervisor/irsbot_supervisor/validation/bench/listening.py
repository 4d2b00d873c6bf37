"""Listens to one topic of a running suite. Needs ROS, which other parts of the benchmark do not: import it where it is
used."""

from __future__ import annotations

import os
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor

from irsbot_msgs_py.process.fastdds import choose_transport
from irsbot_supervisor.processes.suite import Suite, SuiteError
from irsbot_supervisor.validation.bench.transport import PATIENCE_S


@contextmanager
def next_message(domain: int, kind: Any, topic: str) -> Iterator[Callable[[Suite], Any]]:
    """Gives a function that waits for the next message of a topic. It raises SuiteError if none comes."""
    choose_transport(os.environ, rclpy.get_rmw_implementation_identifier())  # for all that this process starts later
    context, heard = rclpy.Context(), deque[Any]()
    rclpy.init(context=context, domain_id=domain)
    node = rclpy.create_node("bench", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    node.create_subscription(kind, topic, lambda message: heard.append(message), 10)  # rclpy wants a signature

    def following(suite: Suite) -> Any:
        heard.clear()
        end = time.monotonic() + PATIENCE_S
        while not heard:
            executor.spin_once(timeout_sec=0.1)
            suite.check()
            if time.monotonic() > end:
                raise SuiteError(f"nothing has come on {topic} within {PATIENCE_S:.0f} s")
        return heard[-1]

    try:
        yield following
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown(context=context)
