"""Nodes that freeze (SIGSTOP) or die (SIGKILL) while the robot works: the robot stands in time, or is not affected."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from irsbot_msgs_py.cdr import decode_verdict
from irsbot_msgs_py.records import Floats, Level
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.bag.bag import Bag
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.configuration.loading import read_settings
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
from irsbot_supervisor.replay.recording import Recording, read_recording
from irsbot_supervisor.sim.simulation import Simulation
from irsbot_supervisor.validation.harness.rows import RECOVERY_S, TO_STOP_S, Job, Row, Tally

if TYPE_CHECKING:  # needs ROS, which the list of rows does not
    from irsbot_supervisor.validation.harness.client import Tester

NAME = "outages"
MUST = "nodes frozen or killed: without its supervisor the robot stands after 0.1 s and its braking, bags are readable"

WATCHED_S = 0.5
"""s of observation after a node is gone."""

PERIODS_S = 0.005
"""s: a sample before the signal and one after it, and their transport. Simulated joints without processor time for
longer neither move nor stop: the machine causes that, not the suite."""

LISTENERS = 3
"""Subscriptions to the verdict: of the joints, the recorder and the campaign. A recorder discovers topics one by
one."""

AT_WORK = 0.3
"""1: share of its speed limit with which a joint moves in the middle of a swing."""

NOTHING = "nothing is shown"
TRIES = 3
"""Number of tries of a case that shows nothing: a busy machine may stop the robot, or delay the recorder."""

STAND_S = "standstill after the supervisor is gone [s]"

CASES = tuple(
    (name, how)
    for name in ("supervisor", "simulated_joints", "recorder", "kinematics")
    for how in (signal.SIGKILL, signal.SIGSTOP)
)


BYSTANDERS = ("recorder", "kinematics")
"""Nodes that supervision does not need."""


def run(job: Job) -> Row:
    """The row: a case is a node and a signal, in turn."""
    tally = Tally(NAME, job)
    for number in range(job.amount):
        name, how = CASES[number % len(CASES)]
        for _ in range(TRIES):
            with TemporaryDirectory(prefix="irsbot-outage-") as folder:
                try:
                    unsafe, failed = _case(tally, Path(folder), name, how)
                except (SuiteError, BagError) as error:
                    unsafe, failed = "", str(error)
            if not failed.startswith(NOTHING):
                break
        where = f"{how.name} of {name}: "
        tally.case(unsafe and where + unsafe, failed and where + failed)
    return tally.row()


def _case(tally: Tally, folder: Path, name: str, how: signal.Signals) -> tuple[str, str]:
    """Unsafe and failed events of a case."""
    from irsbot_supervisor.validation.harness.client import Tester

    fastest = read_settings("irsbot2")[0].velocity_limit
    domain = free_domain()
    with Suite(folder / "logs", domain) as suite, Tester(suite, domain) as tester:
        suite.start(Node("recorder", RECORDER, {"output": str(folder / "bag")}))
        suite.start(Node("kinematics", KINEMATICS, {}))
        suite.start(Node("supervisor", SUPERVISOR, {}))
        suite.start(Node("simulated_joints", JOINTS, {"scenario": "pick_and_place"}))
        tester.listen()
        tester.until(lambda: tester.works(100), "a second of work")
        tester.until(
            lambda: tester.node.count_subscribers("supervisor/verdict") >= LISTENERS, "a recorder that listens"
        )
        tester.until(lambda: _moves(tester, fastest), "a robot that moves")
        process = suite.processes[name]
        tester.forget()
        gone_ns = _struck(process, how)
        if how == signal.SIGKILL:
            suite.end(name, how)
        tester.look(WATCHED_S)
        noticed, live = _noticed(tester), len(tester.verdicts)
        failed = _come_back(tally, tester, process.pid) if how == signal.SIGSTOP else ""
    recording = read_recording(folder / "bag")
    judges: dict[str, Callable[[], tuple[str, str]]] = {
        "supervisor": lambda: _stands(tally, recording, gone_ns),
        "simulated_joints": lambda: _told(tally, recording, gone_ns, live),
    }
    unsafe, fault = judges.get(name, lambda: ("", ""))()
    if name in BYSTANDERS:
        fault = noticed
    return unsafe, failed or fault


def _struck(process: subprocess.Popen[bytes], how: signal.Signals) -> int:
    """Send a signal; returns a time, ns of the system clock, after which the node does nothing more. If this process
    pauses in between, the time is late: the robot then seems to stand sooner, never later."""
    process.send_signal(how)
    return time.time_ns()


def _moves(tester: Tester, fastest: Floats) -> bool:
    """True if the robot is in the middle of a motion. fastest: rad/s, velocity limit of its joints."""
    state = tester.newest_state()
    rates = state.joint_velocity if state is not None else ()
    return any(abs(rate) > AT_WORK * most for rate, most in zip(rates, fastest, strict=False))


def _noticed(tester: Tester) -> str:
    """Observations of a consumer."""
    stops = [verdict.text for verdict in tester.verdicts if verdict.level >= Level.STOP]
    if stops:
        return f"the robot was stopped: {stops[0]}"
    return f"no verdict for {tester.silence_s:.3f} s" if tester.silence_s > Simulation().verdict_timeout_s else ""


def _come_back(tally: Tally, tester: Tester, pid: int) -> str:
    """Continue the node: the verdict is OK again, without a restart."""
    tester.forget()
    begin = time.monotonic()
    os.kill(pid, signal.SIGCONT)
    try:
        tester.until(lambda: tester.works(1), "OK again")
    except SuiteError as error:
        return str(error)
    tally.largest(RECOVERY_S, time.monotonic() - begin)
    return ""


def _stands(tally: Tally, recording: Recording, gone_ns: int) -> tuple[str, str]:
    """Without verdicts the robot brakes after its time-out and stands."""
    settings, _robot = read_settings("irsbot2")
    braking_s = max(v / a for v, a in zip(settings.velocity_limit, settings.deceleration_limit, strict=True))
    limit_s = Simulation().verdict_timeout_s + braking_s + PERIODS_S
    after = [s for s in recording.samples if gone_ns < s.stamp_ns < gone_ns + WATCHED_S * NS_PER_S]
    moving = [sample.stamp_ns for sample in after if any(sample.velocity)]
    if not moving:
        return "", f"{NOTHING}, no motion was recorded after the supervisor went: {len(after)} joint states in the bag"
    stood_s = (moving[-1] - gone_ns) / NS_PER_S
    tally.largest(STAND_S, stood_s)
    stamps = [gone_ns, *[sample.stamp_ns for sample in after if sample.stamp_ns <= moving[-1]]]
    limit_s += sum(max((b - a) / NS_PER_S - PERIODS_S, 0.0) for a, b in pairwise(stamps))
    return ("" if stood_s <= limit_s else f"still moving {stood_s:.3f} s later, limit {limit_s:.3f} s"), ""


def _told(tally: Tally, recording: Recording, gone_ns: int, live: int) -> tuple[str, str]:
    """Without joint states the verdict is UNKNOWN, within the stale limit and a heartbeat of the last one that arrived:
    a sample that waited on a busy machine was sent before the signal. Times are those of the publisher. A supervisor
    that is silent before it has to say UNKNOWN, and stays so, has no processor time; its silence also stops the robot.
    live: verdicts that another listener received."""
    settings, _robot = read_settings("irsbot2")
    end_ns = gone_ns + round(WATCHED_S * NS_PER_S)
    said = [one for one in _published(recording.path) if gone_ns < one[0] < end_ns]
    if live and not said:
        return "", f"{NOTHING}, the recorder missed the {live} verdicts that another listener heard"
    if not any(level == Level.UNKNOWN for _sent_ns, level in said):
        if deaf := _unrecorded(recording, gone_ns, end_ns):
            return "", f"{NOTHING}, the recorder missed {deaf} verdicts that were published"
        last_s = (max((sent_ns for sent_ns, _level in said), default=gone_ns) - gone_ns) / NS_PER_S
        if last_s < settings.stale_s:
            return "", f"{NOTHING}, the supervisor was silent from {last_s:.3f} s after the signal on"
        return "", f"no verdict UNKNOWN among the {len(said)} of {WATCHED_S} s after the joint states ended"
    good = [state.received_ns for state in recording.states if state.level < Level.STOP and state.received_ns < end_ns]
    arrived_ns = max(gone_ns, *good)
    last_ns = max((sent_ns for sent_ns, level in said if level < Level.STOP), default=arrived_ns)
    last_s = (last_ns - arrived_ns) / NS_PER_S
    tally.largest(TO_STOP_S, last_s)
    times = [arrived_ns, *[sent_ns for sent_ns, _level in said if arrived_ns < sent_ns <= last_ns]]
    silent_s = sum(max((b - a) / NS_PER_S - settings.heartbeat_s, 0.0) for a, b in pairwise(times))
    limit_s = settings.stale_s + settings.heartbeat_s + silent_s
    return (f"OK still {last_s:.3f} s after the last joint state" if not last_s <= limit_s else ""), ""


def _published(bag: Path) -> list[tuple[int, Level]]:
    """The verdicts of a bag with the times at which they were published, ns; delays of the recorder do not count."""
    with Bag(bag) as opened:
        messages = opened.messages("supervisor/verdict")
        return sorted((message.publish_ns, decode_verdict(message.data).level) for message in messages)


def _unrecorded(recording: Recording, begin_ns: int, end_ns: int) -> int:
    """Number of verdicts that a bag lacks from the last one before a time to the first one after it, by their sequence
    numbers: a silent supervisor skips none."""
    verdicts = recording.verdicts
    first = max((k for k, (log_ns, _verdict) in enumerate(verdicts) if log_ns <= begin_ns), default=0)
    last = min((k for k, (log_ns, _verdict) in enumerate(verdicts) if log_ns >= end_ns), default=len(verdicts) - 1)
    return verdicts[last][1].sequence - verdicts[first][1].sequence - (last - first) if verdicts else 0
