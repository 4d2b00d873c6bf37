"""What every node's process has in common: start, spin, stop cleanly, exit code. Imports rclpy only when run.

A node may have `exit_code` (None while it wants to run on) and `close()` (called once before it is destroyed).
"""

from __future__ import annotations

import gc
import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from irsbot_msgs_py.transport import choose_transport

DONE, FAILED, USAGE = 0, 1, 2

WAKE_S = 0.1
"""Longest wait before a signal or an exit code is noticed: neither interrupts the wait for messages."""


class UsageError(Exception):
    """The node cannot start as it was asked to: exit code 2 and this sentence."""


def run(
    make_node: Callable[[], Any],
    argv: Sequence[str] | None = None,
    usage_errors: tuple[type[Exception], ...] = (),
) -> int:
    """Run one node until SIGINT, SIGTERM or its own wish; returns the exit code of the process.

    make_node: creates the node, after rclpy is up. argv: the process's own by default.
    usage_errors: what make_node raises for mistakes of the caller; like UsageError they become one sentence.
    """
    import rclpy
    from rclpy.exceptions import NameValidationException, ParameterException
    from rclpy.signals import SignalHandlerOptions

    stop: list[int] = []
    handlers = {
        number: signal.signal(number, lambda n, _: stop.append(n)) for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        try:
            choose_transport(os.environ, rclpy.get_rmw_implementation_identifier())
            rclpy.init(args=argv, signal_handler_options=SignalHandlerOptions.NO)
        except Exception as error:  # rclpy gives its argument errors no public name
            return _refuse(error)
        try:
            node = make_node()
        except (UsageError, ParameterException, NameValidationException, *usage_errors) as error:
            return _refuse(error)
        return _spin(node, stop)
    finally:
        rclpy.try_shutdown()
        for number, handler in handlers.items():
            signal.signal(number, handler)


def _spin(node: Any, stop: list[int]) -> int:
    """Serve callbacks; the executor's own `spin()` neither delivers nor ends in the wheels, hence the loop."""
    import rclpy
    from rclpy.experimental.events_executor import EventsExecutor
    from rclpy.task import Future

    executor = EventsExecutor()
    executor.add_node(node)
    gc.collect()
    gc.freeze()  # a full collection would stall the node for 10-22 ms
    exit_code: int | None = None
    while not stop and exit_code is None and rclpy.ok():
        with _reported(node):
            executor.spin_until_future_complete(Future(), timeout_sec=WAKE_S)
        exit_code = getattr(node, "exit_code", None)
    if hasattr(node, "close"):
        exit_code = exit_code or FAILED
        with _reported(node):
            node.close()
            exit_code = getattr(node, "exit_code", None)
    executor.shutdown()
    node.destroy_node()
    return exit_code or DONE


@contextmanager
def _reported(node: Any) -> Iterator[None]:
    """An error in a callback is a line in the log and not the end of the node."""
    try:
        yield
    except Exception as error:
        node.get_logger().error(f"{type(error).__name__}: {error}", throttle_duration_sec=1.0)


def _refuse(error: Exception) -> int:
    print(" ".join(str(error).split()) or type(error).__name__, file=sys.stderr)
    return USAGE
