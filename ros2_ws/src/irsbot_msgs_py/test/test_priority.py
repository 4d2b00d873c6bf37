"""Real-time priority of a process: all of its threads, none of those that it starts later, and none by force."""

from __future__ import annotations

import ctypes
import json
import resource
import subprocess
import sys

import pytest

PROGRAM = """
import json, os, subprocess, sys
from threading import Event, Thread
from irsbot_msgs_py.process.priority import priority_now, take_priority

def told():
    found.append(priority_now())

end, found = Event(), []
before = Thread(target=end.wait)
before.start()
refused = take_priority(int(sys.argv[1]))
threads = [os.sched_getparam(int(thread)).sched_priority for thread in os.listdir("/proc/self/task")]
after = Thread(target=told)
after.start()
after.join()
command = [sys.executable, "-c", "import os; print(os.sched_getparam(0).sched_priority)"]
child = int(subprocess.run(command, capture_output=True, text=True).stdout)
end.set()
print(json.dumps([refused, threads, found[0], child]))
"""

PR_CAPBSET_DROP, CAP_SYS_NICE = 24, 23


def forbid() -> None:
    """As for a user without the right; for root the capability is gone after the next exec."""
    resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
    ctypes.CDLL(None).prctl(PR_CAPBSET_DROP, CAP_SYS_NICE, 0, 0, 0)


def stated(priority: int, permitted: bool = True) -> tuple[str, list[int], int, int]:
    """Refusal; priorities of the threads that are there, of a later one, and of a child process."""
    command = [sys.executable, "-c", PROGRAM, str(priority)]
    done = subprocess.run(
        command, capture_output=True, text=True, check=True, timeout=120, preexec_fn=None if permitted else forbid
    )
    refused, threads, later, child = json.loads(done.stdout)
    return refused, threads, later, child


def is_permitted() -> bool:
    command = [sys.executable, "-c", "import os; os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))"]
    return subprocess.run(command, stderr=subprocess.DEVNULL).returncode == 0


@pytest.mark.skipif(not is_permitted(), reason="needs the right to real-time priorities")
def test_all_threads_have_the_priority_and_what_they_start_has_none():
    assert stated(7) == ("", [7, 7], 0, 0)


def test_without_the_right_nothing_changes_and_the_remedy_is_named():
    refused, threads, later, child = stated(7, permitted=False)
    assert "Operation not permitted" in refused
    assert "docs/how_to/real_time.md" in refused
    assert (threads, later, child) == ([0, 0], 0, 0)


def test_no_priority_is_no_change():
    assert stated(0) == ("", [0, 0], 0, 0)
