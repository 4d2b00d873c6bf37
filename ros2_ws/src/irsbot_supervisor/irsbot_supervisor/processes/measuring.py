"""Runs the suite for a while to measure the times that this computer keeps. Needs ROS."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from irsbot_msgs.msg import SingularityState as StateMessage

from irsbot_msgs_py.cdr import decode_state
from irsbot_msgs_py.records import Verdict
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.configuration.machine_times import Times, longest
from irsbot_supervisor.processes.listener import Watch
from irsbot_supervisor.processes.suite import (
    JOINTS,
    KINEMATICS,
    RECORDER,
    SUPERVISOR,
    Node,
    Suite,
    SuiteError,
    free_domain,
)

STARTING_S = 60.0
"""s until the first samples must have been judged."""

SETTLING_S = 2.0
"""s after them that are not measured: nodes still load and discover each other."""

DEPTH = 2000
"""States that the middleware holds for the listener."""


def measure(robot: str, seconds: float, rate_hz: float) -> Times:
    """Run recorder, kinematics, supervisor and a standing simulated robot, and measure times of samples and verdicts.

    Raises SuiteError if the suite does not run.
    """
    seen: list[float] = []
    heard: list[float] = []
    delays: list[float] = []
    judged: list[float] = []
    domain = free_domain()

    def on_verdict(verdict: Verdict) -> None:
        heard.append(time.monotonic())
        if verdict.stamp_ns:
            delays.append(time.time() - verdict.stamp_ns / NS_PER_S)

    def on_state(data: bytes) -> None:
        state = decode_state(data)
        seen.append(state.seen_ns / NS_PER_S)
        judged.append(state.compute_time)

    with tempfile.TemporaryDirectory() as folder, Suite(Path(folder) / "logs", domain) as suite:
        suite.start(Node("recorder", RECORDER, {"output": str(Path(folder) / "bag")}))
        suite.start(Node("kinematics", KINEMATICS, {"robot": robot}))
        suite.start(Node("supervisor", SUPERVISOR, {"robot": robot}))
        standing = {"robot": robot, "scenario": "stand", "listeners": 2, "rate_hz": rate_hz}
        suite.start(Node("simulated_joints", JOINTS, standing))
        with Watch(domain, on_verdict) as watch:
            watch.node.create_subscription(StateMessage, "supervisor/state", on_state, DEPTH, raw=True)
            _look(suite, watch, STARTING_S, lambda: bool(seen))
            if not seen:
                raise SuiteError(f"no sample was judged in the first {STARTING_S:g} s")
            _look(suite, watch, SETTLING_S, lambda: False)
            for times in (seen, heard, delays, judged):
                times.clear()
            _look(suite, watch, seconds, lambda: False)
    return longest(sorted(seen), heard, delays, judged)


def _look(suite: Suite, watch: Watch, seconds: float, done: Callable[[], bool]) -> None:
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline and not done():
        watch.look(0.05)
        suite.check()
