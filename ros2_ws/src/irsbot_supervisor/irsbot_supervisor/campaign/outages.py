"""Nodes that freeze (SIGSTOP) or die (SIGKILL) while the robot works: the robot stands in time, or is not concerned."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, NamedTuple

from irsbot_msgs_py.records import Floats, Level
from irsbot_supervisor.campaign.rows import RECOVERY_S, TO_STOP_S, Job, Row, Tally
from irsbot_supervisor.core.intake import S
from irsbot_supervisor.mcap_writer import BagError
from irsbot_supervisor.replay import Recording, read_recording
from irsbot_supervisor.settings_file import read_settings
from irsbot_supervisor.sim.simulation import Simulation
from irsbot_supervisor.suite import JOINTS, KINEMATICS, RECORDER, SUPERVISOR, Node, Suite, SuiteError, free_domain

if TYPE_CHECKING:  # needs ROS, which the list of rows does not
    from irsbot_supervisor.campaign.peer import Peer

NAME = "outages"
MUST = "nodes frozen or killed: without its supervisor the robot stands after 0.1 s and its braking, bags are readable"

WATCHED_S = 0.5
"""s that are looked at after a node is gone."""

PERIODS_S = 0.005
"""s: a sample before the signal and one after it, and their way. Simulated joints that get no processor for longer than
this neither move nor stop meanwhile: that is the machine's time, not the suite's."""

LISTENERS = 3
"""Subscriptions to the verdict: of the joints, the recorder and the campaign. A recorder finds topics one by one."""

AT_WORK = 0.3
"""1: share of its speed limit with which a joint moves in the middle of a swing."""

ARRIVAL_S = 0.02
"""s a message may be under way on a busy machine: a verdict counts when it arrives."""

NOTHING = "nothing is shown"
TRIES = 3
"""How often a case is tried that shows nothing: a busy machine may stop the robot, or find the recorder late."""

STAND_S = "standstill after the supervisor is gone [s]"

CASES = tuple(
    (name, how)
    for name in ("supervisor", "simulated_joints", "recorder", "kinematics")
    for how in (signal.SIGKILL, signal.SIGSTOP)
)


BYSTANDERS = ("recorder", "kinematics")
"""Nodes without which the robot is supervised as before."""


class Gone(NamedTuple):
    """A node that was sent a signal."""

    name: str
    how: signal.Signals
    at_ns: int  # system clock
    steady_ns: int


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
    """What was unsafe and what failed."""
    from irsbot_supervisor.campaign.peer import Peer

    fastest = read_settings("irsbot2")[0].velocity_limit
    domain = free_domain()
    with Suite(folder / "logs", domain) as suite, Peer(suite, domain) as peer:
        suite.start(Node("recorder", RECORDER, {"output": str(folder / "bag")}))
        suite.start(Node("kinematics", KINEMATICS, {}))
        suite.start(Node("supervisor", SUPERVISOR, {}))
        suite.start(Node("simulated_joints", JOINTS, {"scenario": "pick_and_place"}))
        peer.listen()
        peer.until(lambda: [v.level for v in peer.verdicts[-100:]] == [Level.OK] * 100, "a second of work")
        peer.until(lambda: peer.node.count_subscribers("supervisor/verdict") >= LISTENERS, "a recorder that listens")
        peer.until(lambda: _moves(peer, fastest), "a robot that moves")
        process = suite.processes[name]
        peer.forget()
        gone = Gone(name, how, time.time_ns(), time.monotonic_ns())
        if how == signal.SIGKILL:
            suite.end(name, how)
        else:
            process.send_signal(how)
        peer.look(WATCHED_S)
        noticed = _noticed(peer)
        failed = _come_back(tally, peer, process.pid) if how == signal.SIGSTOP else ""
    recording = read_recording(folder / "bag")
    judges: dict[str, Callable[[], tuple[str, str]]] = {
        "supervisor": lambda: _stands(tally, recording, gone),
        "simulated_joints": lambda: _told(tally, recording, gone),
    }
    unsafe, fault = judges.get(name, lambda: ("", ""))()
    if name in BYSTANDERS:
        fault = noticed
    return unsafe, failed or fault


def _moves(peer: Peer, fastest: Floats) -> bool:
    """Whether the robot is in the middle of a swing. fastest: rad/s that its joints may move at."""
    state = peer.newest_state()
    rates = state.joint_velocity if state is not None else ()
    return any(abs(rate) > AT_WORK * most for rate, most in zip(rates, fastest, strict=False))


def _noticed(peer: Peer) -> str:
    """What a consumer has noticed of it."""
    stops = [verdict.text for verdict in peer.verdicts if verdict.level >= Level.STOP]
    if stops:
        return f"the robot was stopped: {stops[0]}"
    return f"no verdict for {peer.silence_s:.3f} s" if peer.silence_s > Simulation().verdict_timeout_s else ""


def _come_back(tally: Tally, peer: Peer, pid: int) -> str:
    """The node goes on where it stood: the verdict is OK again, without a restart."""
    peer.forget()
    begin = time.monotonic()
    os.kill(pid, signal.SIGCONT)
    try:
        peer.until(lambda: peer.verdicts and peer.verdicts[-1].level == Level.OK, "OK again")
    except SuiteError as error:
        return str(error)
    tally.largest(RECOVERY_S, time.monotonic() - begin)
    return ""


def _stands(tally: Tally, recording: Recording, gone: Gone) -> tuple[str, str]:
    """Without verdicts the robot brakes after its time-out and stands."""
    settings, _robot = read_settings("irsbot2")
    braking_s = max(v / a for v, a in zip(settings.velocity_limit, settings.deceleration_limit, strict=True))
    limit_s = Simulation().verdict_timeout_s + braking_s + PERIODS_S
    after = [s for s in recording.samples if gone.at_ns < s.stamp_ns < gone.at_ns + WATCHED_S * S]
    moving = [sample.stamp_ns for sample in after if any(sample.velocity)]
    if not moving:
        return "", f"{NOTHING}, no motion was recorded after the supervisor went: {len(after)} joint states in the bag"
    stood_s = (moving[-1] - gone.at_ns) / S
    tally.largest(STAND_S, stood_s)
    stamps = [gone.at_ns, *[sample.stamp_ns for sample in after if sample.stamp_ns <= moving[-1]]]
    limit_s += sum(max((b - a) / S - PERIODS_S, 0.0) for a, b in pairwise(stamps))
    return ("" if stood_s <= limit_s else f"still moving {stood_s:.3f} s later, limit {limit_s:.3f} s"), ""


def _told(tally: Tally, recording: Recording, gone: Gone) -> tuple[str, str]:
    """Without joint states the verdict is UNKNOWN, within the stale limit and a heartbeat of the last that arrived: one
    that waited for a busy machine on its way was sent before the signal."""
    settings, _robot = read_settings("irsbot2")
    end_ns = gone.at_ns + round(WATCHED_S * S)
    heard = [(log_ns, verdict.level) for log_ns, verdict in recording.verdicts if gone.at_ns < log_ns < end_ns]
    if deaf := _unrecorded(recording, gone.at_ns, end_ns):
        return "", f"{NOTHING}, the recorder missed {deaf} verdicts that were published"
    if not any(level == Level.UNKNOWN for _log_ns, level in heard):
        return "", f"no verdict UNKNOWN among the {len(heard)} of {WATCHED_S} s after the joint states ended"
    good = [state.received_ns for state in recording.states if state.level < Level.STOP and state.received_ns < end_ns]
    arrived_ns = max(gone.at_ns, *good)
    last_s = (max((log_ns for log_ns, level in heard if level < Level.STOP), default=arrived_ns) - arrived_ns) / S
    tally.largest(TO_STOP_S, last_s)
    limit_s = settings.stale_s + settings.heartbeat_s + ARRIVAL_S
    return (f"OK still {last_s:.3f} s after the last joint state" if not last_s <= limit_s else ""), ""


def _unrecorded(recording: Recording, begin_ns: int, end_ns: int) -> int:
    """Verdicts of a time that the bag lacks, by their numbers; 0 if there is one: a supervisor that fell silent misses
    none."""
    before = [verdict.sequence for log_ns, verdict in recording.verdicts if log_ns <= begin_ns]
    after = [verdict.sequence for log_ns, verdict in recording.verdicts if log_ns > begin_ns]
    heard = [log_ns for log_ns, _verdict in recording.verdicts if begin_ns < log_ns < end_ns]
    return after[0] - before[-1] - 1 if before and after and not heard else 0
