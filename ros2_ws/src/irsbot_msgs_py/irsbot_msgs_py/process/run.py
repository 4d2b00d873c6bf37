"""Runs the process of a node: start, spin, clean stop, exit code. rclpy is imported only when a node runs.

A node may have `exit_code` (None while it wants to run on), `close()` (called once before it is destroyed; the tasks
that it creates then are still served), `thread_priority` (for all threads of the process), and, if several nodes share
a process, `bystander` (True if the others go on without it).
"""

from __future__ import annotations

import gc
import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path
from threading import Thread
from typing import Any

from irsbot_msgs_py.process.aside import NO_FILE, log_aside
from irsbot_msgs_py.process.exit_deadline import exit_within
from irsbot_msgs_py.process.fastdds import choose_transport
from irsbot_msgs_py.process.priority import take_priority
from irsbot_msgs_py.process.usage import USAGE, UsageError

DONE, FAILED = 0, 1

WAKE_S = 0.1
"""s: longest time until a signal or an exit code is noticed: neither interrupts the wait for messages."""

GOODBYE_S = 2
"""s: longest time that the middleware may take to announce the end of a node."""

SWITCH_S = 0.0005
"""s after which a computing thread lets another one run, instead of 5 ms: half the time between samples at 1 kHz."""

ARGUMENTS = """\
Arguments: --ros-args [-p PARAMETER:=VALUE]... [-r TOPIC:=OTHER]... [--params-file FILE]
Example: --ros-args -p robot:=five_bar -r __ns:=/left"""
"""What every node takes, for its help text."""

ENDS = signal.SIGINT, signal.SIGTERM
"""Exceptions that end a node."""


def run(
    make_node: Callable[[], Any],
    argv: Sequence[str] | None = None,
    usage_errors: tuple[type[Exception], ...] = (),
    log: str = "",
) -> int:
    """Run one node until SIGINT, SIGTERM or its own end; returns the exit code of the process, which has to end then:
    it ends after at most GOODBYE_S.

    make_node: creates the node, after rclpy is initialised. argv: default: those of the process. usage_errors:
    exceptions of make_node for mistakes of the caller; like UsageError they become one sentence. log: name of a log
    file that another process writes (`log_aside`), for a node that no disk and no terminal may delay.

    Arguments that are not for ROS are refused: `--robot five_bar` sets no parameter, and must not look as if it did.
    """
    from rclpy.utilities import remove_ros_args

    try:
        words = remove_ros_args(sys.argv if argv is None else list(argv))[1:]
    except Exception as error:  # rclpy gives its argument errors no public name
        return _refuse(error)
    if {"-h", "--help"} & set(words):
        about = sys.modules[make_node.__module__].__doc__ or ""
        print(about.strip(), ARGUMENTS, sep="\n\n")
        return DONE
    if words:
        return _refuse(UsageError(f"unknown argument '{words[0]}': a parameter is set by --ros-args -p NAME:=VALUE"))
    return run_together((make_node,), argv, usage_errors, log)


def run_together(
    makers: Sequence[Callable[[], Any]],
    argv: Sequence[str] | None = None,
    usage_errors: tuple[type[Exception], ...] = (),
    log: str = "",
) -> int:
    """The same for several nodes in one process, each in its own thread, so that none waits for another's callback.
    They end together, unless a bystander ends; the exit code is that of the first that failed."""
    with ExitStack() as stack:
        if log:
            from rclpy.logging import get_logging_directory

            stack.enter_context(log_aside(Path(get_logging_directory()), log, os.environ))
            argv = [*(sys.argv if argv is None else argv), "--ros-args", NO_FILE]
        return _run(makers, argv, usage_errors)


def _run(
    makers: Sequence[Callable[[], Any]], argv: Sequence[str] | None, usage_errors: tuple[type[Exception], ...]
) -> int:
    import rclpy
    from rclpy.exceptions import NameValidationException, ParameterException
    from rclpy.signals import SignalHandlerOptions

    if not _has_events_executor():
        return _refuse(UsageError(f"rclpy 7.1.4 or newer is needed, this is {_version()}: update ros-jazzy-rclpy"))
    stop: list[int] = []
    for number in ENDS:
        signal.signal(number, lambda n, _: stop.append(n))
    try:
        choose_transport(os.environ, rclpy.get_rmw_implementation_identifier())
        rclpy.init(args=argv, signal_handler_options=SignalHandlerOptions.NO)
    except Exception as error:  # rclpy gives its argument errors no public name
        return _refuse(error)
    nodes: list[Any] = []
    try:
        nodes.extend(make() for make in makers)  # those made before a refusal are in it
    except (UsageError, ParameterException, NameValidationException, *usage_errors) as error:
        exit_code = _refuse(error)
        stop.append(exit_code)
    if nodes:
        exit_code = _spin_all(nodes, stop) or (USAGE if len(nodes) < len(makers) else DONE)
        exit_within(GOODBYE_S, exit_code)
        for node in reversed(nodes):
            node.destroy_node()
    gc.collect()  # also ends the remaining parts of a refused node
    rclpy.try_shutdown()
    for number in ENDS:
        signal.signal(number, signal.SIG_IGN)  # a second signal gives the same exit code
    return exit_code


def _has_events_executor() -> bool:
    try:
        return find_spec("rclpy.experimental.events_executor") is not None
    except ModuleNotFoundError:  # not even its package
        return False


def _version() -> str:
    try:
        return metadata.version("rclpy")
    except metadata.PackageNotFoundError:
        return "an older one"


def _spin_all(nodes: list[Any], stop: list[int]) -> int:
    """Serve every node until all have ended; signals come to this thread, which serves the first."""
    gc.collect()
    gc.freeze()  # a full collection would stall a node for 10-22 ms
    sys.setswitchinterval(SWITCH_S)
    codes: list[int] = []

    def serve(node: Any) -> None:
        codes.append(_spin(node, stop))
        if not getattr(node, "bystander", False):
            stop.append(codes[-1])

    threads = [Thread(target=serve, args=(node,), name=node.get_name()) for node in nodes[1:]]
    for thread in threads:
        thread.start()
    serve(nodes[0])
    for thread in threads:
        while thread.is_alive():  # a join without an end would keep signals out
            thread.join(WAKE_S)
    return next(filter(None, codes), DONE)


def _spin(node: Any, stop: list[int]) -> int:
    """Serve callbacks; the executor's own `spin()` neither delivers nor ends in the wheels, hence the loop."""
    import rclpy
    from rclpy.experimental.events_executor import EventsExecutor
    from rclpy.task import Future

    executor = EventsExecutor()
    executor.add_node(node)
    exit_code: int | None = None
    priority = getattr(node, "thread_priority", 0)
    while not stop and exit_code is None and rclpy.ok():
        with _reported(node):
            executor.spin_until_future_complete(Future(), timeout_sec=WAKE_S)
        exit_code = getattr(node, "exit_code", None)
        if refused := take_priority(priority):  # now that the executor, too, has its threads
            node.get_logger().warning(refused)
        priority = 0
    if hasattr(node, "close"):
        exit_code = exit_code or FAILED
        with _reported(node):
            node.close()
            exit_code = getattr(node, "exit_code", None)
        with _reported(node):  # tasks that it has created, such as results of an action, run in their order
            last = Future()
            executor.create_task(last.set_result, None)
            executor.spin_until_future_complete(last, timeout_sec=WAKE_S)
    executor.shutdown()
    return exit_code or DONE


@contextmanager
def _reported(node: Any) -> Iterator[None]:
    """Log an error in a callback; it does not end the node."""
    try:
        yield
    except Exception as error:
        node.get_logger().error(f"{type(error).__name__}: {error}", throttle_duration_sec=1.0)


def _refuse(error: Exception) -> int:
    """Print the error; called while the exception is alive, because it keeps the parts of the node alive."""
    print(" ".join(str(error).split()) or type(error).__name__, file=sys.stderr)
    exit_within(GOODBYE_S, USAGE)
    return USAGE
