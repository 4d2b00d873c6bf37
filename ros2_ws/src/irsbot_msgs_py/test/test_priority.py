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
from irsbot_msgs_py.process.priority import priority_now, step_behind, take_priority

def told():
    found.append(priority_now())

def work():
    begin.wait()
    step_behind()
    step_behind()
    told()

begin, end, found = Event(), Event(), []
before, behind = Thread(target=end.wait), Thread(target=work)
before.start()
behind.start()
refused = take_priority(int(sys.argv[1]))
threads = [os.sched_getparam(int(thread)).sched_priority for thread in os.listdir("/proc/self/task")]
after = Thread(target=told)
after.start()
after.join()
begin.set()
behind.join()
command = [sys.executable, "-c", "import os; print(os.sched_getparam(0).sched_priority)"]
child = int(subprocess.run(command, capture_output=True, text=True).stdout)
end.set()
print(json.dumps([refused, threads, *found, child]))
"""

PR_CAPBSET_DROP, CAP_SYS_NICE = 24, 23


def forbid() -> None:
    """As for a user without the right; for root the capability is gone after the next exec."""
    resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
    ctypes.CDLL(None).prctl(PR_CAPBSET_DROP, CAP_SYS_NICE, 0, 0, 0)


def stated(priority: int, permitted: bool = True) -> tuple[str, list[int], int, int, int]:
    """Refusal; priorities of the threads that are there, of a later one, of one that steps behind, and of a child
    process."""
    command = [sys.executable, "-c", PROGRAM, str(priority)]
    done = subprocess.run(
        command, capture_output=True, text=True, check=True, timeout=120, preexec_fn=None if permitted else forbid
    )
    refused, threads, later, behind, child = json.loads(done.stdout)
    return refused, threads, later, behind, child


def is_permitted() -> bool:
    command = [sys.executable, "-c", "import os; os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))"]
    return subprocess.run(command, stderr=subprocess.DEVNULL).returncode == 0


@pytest.mark.skipif(not is_permitted(), reason="needs the right to real-time priorities")
def test_all_threads_have_the_priority_and_what_they_start_has_none():
    assert stated(7) == ("", [7, 7, 7], 0, 6, 0)


@pytest.mark.skipif(not is_permitted(), reason="needs the right to real-time priorities")
def test_a_thread_at_the_lowest_priority_keeps_it():
    assert stated(1) == ("", [1, 1, 1], 0, 1, 0)


def test_without_the_right_nothing_changes_and_the_remedy_is_named():
    refused, *priorities = stated(7, permitted=False)
    assert "Operation not permitted" in refused
    assert "docs/how_to/real_time.md" in refused
    assert priorities == [[0, 0, 0], 0, 0, 0]


def test_no_priority_is_no_change():
    assert stated(0) == ("", [0, 0, 0], 0, 0, 0)
