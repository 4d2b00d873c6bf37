"""Supervisor and simulated joints at work have a real-time priority in every thread, their helpers have none."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

from irsbot_msgs_py.process.priority import PARAMETER, PRIORITY
from irsbot_supervisor.processes.suite import JOINTS, SUPERVISOR, Node, Suite, free_domain
from irsbot_supervisor.validation.harness import client

pytestmark = pytest.mark.ros


def priorities(process: int) -> set[int]:
    """Of all threads; one that has just ended has none."""
    found = set()
    for thread in Path(f"/proc/{process}/task").iterdir():
        with suppress(ProcessLookupError):
            found.add(os.sched_getparam(int(thread.name)).sched_priority)
    return found


@pytest.mark.parametrize("given", [None, 0, 7])
def test_threads_have_the_priority_of_the_parameter_where_it_is_permitted(tmp_path: Path, given: int | None) -> None:
    domain = free_domain()
    chosen = {} if given is None else {PARAMETER: given}
    with Suite(tmp_path, domain) as suite, client.Tester(suite, domain) as tester:
        suite.start(Node("supervisor", SUPERVISOR, chosen))
        suite.start(Node("simulated_joints", JOINTS, chosen))
        tester.listen()
        tester.until(lambda: tester.works(1), "the robot at work")
        found = {name: priorities(process.pid) for name, process in suite.processes.items()}
        helpers = psutil.Process(suite.processes["supervisor"].pid).children(recursive=True)
        assert all(priorities(helper.pid) == {0} for helper in helpers)
    said = (tmp_path / "supervisor.log").read_text()
    refused = "no real-time priority" in said
    wanted = 0 if refused else PRIORITY if given is None else given
    assert found["supervisor"] == {wanted}
    assert max(found["simulated_joints"]) == wanted
    assert not (refused and given == 0)


@pytest.mark.parametrize("priority", [-1, 100])
def test_a_priority_that_does_not_exist_is_refused(tmp_path: Path, priority: int) -> None:
    with Suite(tmp_path, free_domain()) as suite:
        suite.start(Node("supervisor", SUPERVISOR, {PARAMETER: priority}))
        assert suite.processes["supervisor"].wait(120) == 2
    assert f"{PARAMETER} is {priority}, must be in 0..99" in (tmp_path / "supervisor.log").read_text()
