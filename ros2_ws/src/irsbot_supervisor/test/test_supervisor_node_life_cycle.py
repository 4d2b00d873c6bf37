"""supervisor_node through its life: transitions, restarts, signals, what is logged of them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from itertools import pairwise

import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

from cell import GOOD, HIGH, PATIENCE_S, STANDS, STRICT, Cell, Wire, check, going, resting, silent
from lifecycle_msgs.msg import Transition
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.utilities import get_rmw_implementation_identifier
from std_msgs.msg import String

from irsbot_msgs_py.records import Cause, LateBrakes, Level
from irsbot_supervisor.bag.journal import read_entry

pytestmark = pytest.mark.ros


ANEW = (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_CLEANUP, Transition.TRANSITION_CONFIGURE)
"""From active to inactive by the longer way."""


def test_only_an_active_supervisor_publishes_and_every_activation_begins_with_unknown(wire: Wire):
    cell = Cell(wire, **STANDS)
    cell.heard_level(Level.OK)

    def begins_with_unknown() -> bool:
        """As after a silence: as long as no joint states come, no verdict can be another."""
        begin = cell.heard_many(10)
        cell.say = resting(GOOD)
        cell.heard_level(Level.OK)
        return all((verdict.level, verdict.causes) == (Level.UNKNOWN, Cause.STALE) for verdict in begin)

    cell.say = lambda t: None
    cell.heard_level(Level.UNKNOWN)
    assert cell.change(Transition.TRANSITION_DEACTIVATE)
    cell.wire.until(lambda: silent(cell), "silence")
    assert not cell.change(Transition.TRANSITION_DEACTIVATE)  # it is not active
    for answer in (cell.reset(0), check(cell, GOOD)):
        assert answer.message == "the supervisor is not active"
    assert cell.set(type1_warn=0.3) == (True, "")  # for the next activation
    before = cell.verdicts[-1].config_hash
    assert cell.change(Transition.TRANSITION_ACTIVATE)
    assert begins_with_unknown()
    assert cell.verdicts[-1].config_hash != before
    cell.say = lambda t: None
    cell.heard_level(Level.UNKNOWN)
    assert all(map(cell.change, ANEW))
    cell.wire.until(lambda: silent(cell), "silence")
    assert cell.change(Transition.TRANSITION_ACTIVATE)
    assert begins_with_unknown()
    assert cell.change(Transition.TRANSITION_ACTIVE_SHUTDOWN)
    cell.wire.until(lambda: silent(cell), "silence")


def test_a_latched_stop_and_its_number_outlive_every_transition(wire: Wire):
    cell = Cell(wire, **STRICT)
    cell.say = resting(HIGH)
    assert cell.heard_level(Level.STOP).event == 1
    cell.say = going(HIGH, GOOD, time.time_ns(), 1.0)
    cell.wire.until(lambda: cell.states[-1].level == Level.OK and cell.states[-1].joint_position == GOOD)
    start, sequence = len(cell.verdicts), cell.states[-1].sequence
    for way in (ANEW[:1], ANEW):
        assert all(map(cell.change, way))
        cell.wire.until(lambda: silent(cell), "silence")
        assert cell.change(Transition.TRANSITION_ACTIVATE)
        judged = len(cell.states)
        cell.wire.until(lambda judged=judged: len(cell.states) > judged + 10)
    assert all(verdict.latched and verdict.event == 1 for verdict in cell.verdicts[start:])
    assert all(verdict.level >= Level.STOP for verdict in cell.verdicts[start:])
    assert cell.states[-1].sequence > sequence  # a bag of it all is one story
    cell.heard_level(Level.STOP)  # what was not known a moment ago is over
    right = cell.reset_at_rest(1)
    assert right.accepted, right.message
    cell.heard_level(Level.OK)
    cell.say = going(GOOD, HIGH, time.time_ns(), 1.0)
    cell.heard_level(Level.STOP)
    assert all(map(cell.change, ANEW))
    assert cell.change(Transition.TRANSITION_ACTIVATE)
    assert cell.heard_many(1)[-1].event == 2
    cell.heard_level(Level.STOP)
    assert "event 1 is not the stop in force" in cell.reset(1).message


def test_a_supervisor_that_is_started_again_waits_for_a_reset_and_does_so_once(wire: Wire):
    cell = Cell(wire, **STANDS)
    cell.heard_level(Level.OK)
    cell.suite.end("supervisor", signal.SIGKILL)
    cell.supervisor = cell.supervisor._replace(parameters=STANDS | {"start_latched": True})
    killed_ns, judged = time.monotonic_ns(), len(cell.states)
    cell.suite.start(cell.supervisor)
    latched = cell.heard(lambda verdict: verdict.latched and verdict.stamp_ns > 0, "a latched verdict")[-1]
    cell.wire.until(lambda: len(cell.states) > judged + 300, "300 states")
    heard = [one for one in cell.verdicts if one.since_ns >= killed_ns]  # the last of the old one may come late
    fresh = heard[next(k for k, one in enumerate(heard) if one.event == latched.event) :]
    assert all(one.level == Level.UNKNOWN and one.latched for one in fresh)
    assert not any(one.level < Level.STOP for one in heard)
    assert latched.event > 1
    assert not cell.reset(1).accepted
    right = cell.reset_at_rest(latched.event)
    assert right.accepted, right.message
    cell.heard_level(Level.OK)
    assert all(map(cell.change, ANEW[:1]))
    assert cell.change(Transition.TRANSITION_ACTIVATE)
    assert not cell.heard_level(Level.OK).latched


def test_a_deactivation_with_samples_in_the_queue_raises_nothing(wire: Wire):
    cell = Cell(wire, **STANDS)
    cell.clock = lambda: time.time_ns() - 10_000_000  # late: the supervisor looks into its queue for a newer sample
    for _ in range(10):
        cell.heard_level(Level.OK)
        assert cell.change(Transition.TRANSITION_DEACTIVATE)
        assert cell.change(Transition.TRANSITION_ACTIVATE)
    assert cell.suite.stop() == {"supervisor": 0}
    assert "rror" not in cell.printed
    assert "FATAL" not in cell.printed


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_process_with_exit_code_0(wire: Wire, number: signal.Signals):
    cell = Cell(wire)
    cell.heard_level(Level.OK)
    process = cell.suite.processes["supervisor"]
    process.send_signal(number)
    assert process.wait(PATIENCE_S) == 0
    assert "Traceback" not in cell.printed


def frozen(cell: Cell, silence_s: float) -> None:
    process = cell.suite.processes["supervisor"]
    process.send_signal(signal.SIGSTOP)
    end = time.monotonic() + silence_s
    cell.wire.until(lambda: time.monotonic() > end)
    process.send_signal(signal.SIGCONT)


def inactive(cell: Cell, silence_s: float) -> None:
    assert cell.change(Transition.TRANSITION_DEACTIVATE)
    end = time.monotonic() + silence_s
    cell.wire.until(lambda: time.monotonic() > end)
    assert cell.change(Transition.TRANSITION_ACTIVATE)


@pytest.mark.parametrize("silence", [frozen, inactive])
def test_a_supervisor_that_was_silent_tells_its_journal_until_when_the_drives_were_free(wire: Wire, silence):
    """Consumers brake when they have heard nothing for 0.1 s."""
    cell = Cell(wire, **STANDS)
    journal: list[str] = []
    latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    cell.node.create_subscription(String, "supervisor/journal", lambda message: journal.append(message.data), latched)
    cell.heard_level(Level.OK)

    def told() -> list[LateBrakes]:
        return [entry for entry in map(read_entry, journal) if isinstance(entry, LateBrakes)]

    def free_and_silent_s() -> tuple[float, float]:
        """From the last sample before a silence until the drives brake, and until the next sample, by the journal."""
        before = len(told())
        silence(cell, 0.4)
        cell.wire.until(lambda: len(told()) > before, "late brakes in the journal")
        entry = told()[before]
        cell.heard_level(Level.OK)
        last_ns = max(s.seen_ns for s in cell.states if s.seen_ns < entry.seen_ns)
        event_ns = entry.seen_ns + 1  # the journal has it before the event that noticed the silence
        return (entry.brakes_ns - last_ns) * 1e-9, (event_ns - last_ns) * 1e-9

    silences = [free_and_silent_s() for _ in range(3)]
    # The last verdict came within `stale_s` after the last sample. A process that is frozen between its verdict and
    # the look at the clock after it does not know when the verdict went out: it counts to the end of the silence.
    assert all(0.06 < free_s <= silent_s for free_s, silent_s in silences), silences
    assert min(free_s for free_s, _silent_s in silences) <= 0.16


LEAVING = """
import atexit, pathlib
from irsbot_supervisor.nodes.supervisor import main

def threads():
    return " ".join(comm.read_text().strip() for comm in pathlib.Path("/proc/self/task").glob("*/comm"))

atexit.register(lambda: print(threads(), flush=True))
main()
"""


@pytest.mark.skipif("fastrtps" not in get_rmw_implementation_identifier(), reason="the threads of Fast DDS have names")
@pytest.mark.parametrize(("given", "code"), [("type1_warn:=0.3", 0), ("type1_warn:=0.01", 2)])
def test_a_supervisor_that_ends_or_was_refused_has_left_the_domain(wire: Wire, given: str, code: int):
    """One that has not is seen by others for half a minute, and the next one is the second of its name."""
    command = [sys.executable, "-c", LEAVING, "--ros-args", "-p", given]
    environment = {**os.environ, "ROS_DOMAIN_ID": str(wire.domain)}
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, env=environment) as process:
        assert process.stderr is not None
        stated = next(line for line in process.stderr if "supervising" in line or "type1_warn" in line)
        assert ("supervising" in stated) == (code == 0)
        process.send_signal(signal.SIGINT)
        threads, _ = process.communicate(timeout=PATIENCE_S)
        assert process.returncode == code
        assert "python" in threads
        assert "dds." not in threads


def test_levels_and_the_life_cycle_are_logged_once(wire: Wire):
    cell = Cell(wire, **STANDS)
    cell.heard_level(Level.OK)
    cell.logged("OK: motion is allowed")
    cell.say = lambda t: None
    cell.heard_level(Level.UNKNOWN)
    # On a busy machine samples may have come late before: that is another text, or even a latched stop.
    begins = ("UNKNOWN: ", "a stop is latched")
    cell.wire.until(lambda: any(words in cell.printed.rpartition("OK: motion")[2] for words in begins), "the silence")
    for step in (*ANEW, Transition.TRANSITION_ACTIVATE, Transition.TRANSITION_ACTIVE_SHUTDOWN):
        assert cell.change(step)
    for words in ("deactivated", "cleaned up", "configured", "supervising irsbot2", "shut down in state 'active'"):
        cell.logged(words)
    assert "on /supervisor/verdict" in cell.printed
    stopped = [verdict.level >= Level.STOP for verdict in cell.verdicts]
    begun = stopped[:1].count(True) + sum(now and not before for before, now in pairwise(stopped))
    assert 1 <= cell.printed.count("UNKNOWN: ") <= begun + 1  # an activation tells its first level
