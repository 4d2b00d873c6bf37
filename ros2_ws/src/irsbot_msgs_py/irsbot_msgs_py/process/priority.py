"""Real-time priority of the threads of a node, as controller_manager has it: other programs of the machine do not delay
its messages."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

PRIORITY = 49
"""SCHED_FIFO, 1..99; just below the 50 that controller_manager takes, so that the control loop never waits."""

PARAMETER = "thread_priority"
MEANING = "real-time priority of all threads of the node (SCHED_FIFO, 1..99), if it is permitted; 0: none"
LIMITS = 0, 99
"""Name, meaning and range of the parameter of a node."""

NO_PRIORITY = "no real-time priority ({}): messages may be late on a busy machine, docs/how_to/real_time.md"


def take_priority(priority: int) -> str:
    """Give every thread of this process a real-time priority; 0 changes nothing. Threads and processes that these start
    later have none. Returns why it was refused, or nothing."""
    if priority == 0:
        return ""
    try:
        for thread in Path("/proc/self/task").iterdir():
            policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
            os.sched_setscheduler(int(thread.name), policy, os.sched_param(priority))
    except (OSError, AttributeError) as error:  # not permitted, or not Linux
        return NO_PRIORITY.format(getattr(error, "strerror", None) or error)
    return ""


def step_behind() -> None:
    """Lower the real-time priority of this thread to one below that of the main thread, if both have the same and it is
    above 1. A thread that computes for long calls this: at the same priority it would keep the processor from the
    others; without any, other programs would delay it while it holds the interpreter's lock, and with it the others."""
    with suppress(OSError, AttributeError):  # a lower one needs no permission
        main = os.sched_getparam(os.getpid()).sched_priority
        if priority_now() == main > 1:
            os.sched_setparam(0, os.sched_param(main - 1))


def priority_now() -> int:
    """The real-time priority of this thread; 0: none."""
    return os.sched_getparam(0).sched_priority
