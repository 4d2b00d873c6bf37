"""Every process of a running suite is killed, frozen and started again while a consumer obeys the supervisor.

    nice ./irsbot python tests/campaigns/consumer_outages.py --times 50
    nice ./irsbot python tests/campaigns/consumer_outages.py --times 50 --process recorder --how freeze --header

A client commands joint velocities through the command gate, a controller with the consumer's half passes them on, and
simulated drives move that obey the controller alone. With every signal the client falls silent, so whatever moves once
the motion has ended is an old command. The rate of a command is its number: the controller's log tells which one it
runs. Unsafe is a consumer that brakes later than its time, which is counted without the pauses of its own process, and
any motion by an old command. Without recorder or kinematics nothing may happen: there the client goes on.
"""

from __future__ import annotations

import argparse
import signal
import sys
import tempfile
import time
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parent))

from consumer_station import CYCLE_S, MOVES, Line, Station  # type: ignore[import-not-found]

from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.consumer import TIMEOUT_S
from irsbot_supervisor.sim.simulation import Simulation

FROZEN_S = 0.3
WATCHED_S = 0.3
"""s after an outage in which nothing may move by an old command, or, of a bystander, all has to go on."""


PROCESSES = ("supervisor", "simulated_joints", "kinematics", "recorder", "controller")
BYSTANDERS = ("kinematics", "recorder")
SIGNALS = {"kill": signal.SIGKILL, "freeze": signal.SIGSTOP, "restart": signal.SIGTERM}


class Outage(NamedTuple):
    """What was seen of one outage."""

    took_s: float  # until the drives were told to stand, or stood; 0 for a bystander; < 0: the robot stood already
    unsafe: str
    disturbed: str  # a bystander whose loss stopped the robot


def outage_of(station: Station, name: str, how: str) -> Outage:
    """One outage, from motion to a robot that may move again; another one where the motion had ended already,
    because the machine is busy."""
    while True:
        found = _outage(station, name, how)
        if found.took_s >= 0.0:
            return found


def _outage(station: Station, name: str, how: str) -> Outage:
    station.move()
    station.joints.clear()
    station.stops.clear()
    process, told = station.suite.processes[name], len(station.lines)
    if station.lines[told - 1].rate != station.rate:
        return Outage(-1.0, "", "")
    process.send_signal(SIGNALS[how])
    at_ns, wall_ns = time.monotonic_ns(), time.time_ns()  # a pause before them makes what follows seem sooner
    end_ns = wall_ns
    station.commanding = name in BYSTANDERS
    if how == "restart":  # it may command until its end
        while process.poll() is None:
            station.look(CYCLE_S)
        end_ns = time.time_ns()
    station.look(FROZEN_S)
    station.verdict = None  # of a supervisor that is gone it says nothing any more
    if how == "freeze":
        process.send_signal(signal.SIGCONT)
    else:
        station.suite.end(name, SIGNALS[how])
        station.start(name)
    if name in BYSTANDERS:
        station.look(WATCHED_S)
        ended = [line for line in station.lines[told:] if line.rate != station.rate]
        station.commanding = False
        why = station.stops[0] if station.stops else "no verdict for the consumer's time"
        return Outage(0.0, "", f"told {ended[0].rate} rad/s, {why}" if ended else "")
    if name == "controller":
        _catch_up(station, wall_ns + round(FROZEN_S * NS_PER_S))
        found = _stood(station, wall_ns, end_ns)
    else:
        station.until(lambda: any(line.rate == 0.0 for line in station.lines[told:]), "brakes")
        found = _braked(next(line for line in station.lines[told:] if line.rate == 0.0), at_ns)
    station.until(station.may_move, "leave to move after it")
    station.look(WATCHED_S)
    _catch_up(station, time.time_ns())
    return found._replace(unsafe=found.unsafe or _old(station, told, at_ns, wall_ns + round(found.took_s * NS_PER_S)))


def _catch_up(station: Station, wall_ns: int) -> None:
    """A busy machine may be behind with what it hears."""
    station.until(lambda: station.joints and station.joints[-1].stamp_ns >= wall_ns, "joint states")


def _braked(line: Line, at_ns: int) -> Outage:
    """The consumer's time counts from the last verdict, which may have been on its way for as long once more."""
    took_s, paused_s = (line.at_ns - at_ns) / NS_PER_S, max(line.paused_ns / NS_PER_S - CYCLE_S, 0.0)
    silent_s = (line.at_ns - line.heard_ns) / NS_PER_S
    late = took_s > 2.0 * TIMEOUT_S + CYCLE_S + paused_s or silent_s > TIMEOUT_S + 2.0 * CYCLE_S + paused_s
    return Outage(took_s, f"braked after {took_s:.3f} s, its process paused {paused_s:.3f} s" if late else "", "")


def _stood(station: Station, wall_ns: int, end_ns: int) -> Outage:
    """Without their controller the drives stand after their own time-out, pauses of their process not counted."""
    settings = read_settings("irsbot2")[0]
    moving = [s for s in station.joints if s.stamp_ns > wall_ns and abs(s.velocity[0]) > MOVES]
    if not moving:
        return Outage(-1.0, "", "")
    took_s = (moving[-1].stamp_ns - wall_ns) / NS_PER_S
    stamps = [wall_ns, *[s.stamp_ns for s in moving]]
    pauses_s = sum(max((b - a) / NS_PER_S - CYCLE_S, 0.0) for a, b in pairwise(stamps))
    limit_s = (
        (end_ns - wall_ns) / NS_PER_S
        + Simulation().command_timeout_s
        + abs(station.rate) / settings.deceleration_limit[0]
        + 2.0 * CYCLE_S
    )
    return Outage(took_s, f"stood after {took_s:.3f} s" if took_s > limit_s + pauses_s else "", "")


def _old(station: Station, told: int, at_ns: int, stood_ns: int) -> str:
    """What moved although nothing new was commanded: what the drives were told, and what they did."""
    lines = station.lines[told:]
    first = next((k for k, line in enumerate(lines) if line.rate == 0.0), len(lines))
    if again := [line for line in lines[first:] if line.rate]:
        later_s = (again[0].at_ns - at_ns) / NS_PER_S
        return f"the drives were told {again[0].rate} rad/s again after {later_s:.3f} s, gate: {station.stops[-3:]}"
    late_ns = stood_ns + round((Simulation().command_timeout_s + 0.1) * NS_PER_S)
    moved = [s for s in station.joints if s.stamp_ns > late_ns and abs(s.velocity[0]) > MOVES]
    return f"a joint moved at {moved[-1].velocity[0]} rad/s" if moved else ""


def run(times: int, cases: Sequence[tuple[str, str]], header: bool = False) -> dict[tuple[str, str], list[Outage]]:
    """Outages by process and kind, `times` each. header: the consumer's half in C++."""
    found: dict[tuple[str, str], list[Outage]] = {case: [] for case in cases}
    with tempfile.TemporaryDirectory() as folder:
        station = Station(Path(folder), header)
        try:
            for name in PROCESSES:
                station.start(name)
            for (name, how), outages in found.items():
                try:
                    for _ in range(times):
                        outages.append(outage_of(station, name, how))
                finally:  # whoever interrupts it is told what there is
                    if outages:
                        print(told(name, how, outages), flush=True)
        finally:
            station.close()
    return found


def told(name: str, how: str, outages: list[Outage]) -> str:
    """One line of the report."""
    unsafe, disturbed = ([text for text in texts if text] for texts in zip(*[o[1:] for o in outages], strict=True))
    head = f"{how:8s} {name:17s} {len(outages):3d} times, unsafe {len(unsafe)}"
    if name in BYSTANDERS:
        return f"{head}, motion ended {len(disturbed)} times" + "".join(f"\n    {text}" for text in disturbed)
    times_ms = [1e3 * outage.took_s for outage in outages]
    figures = f"{min(times_ms):.0f} / {median(times_ms):.0f} / {max(times_ms):.0f} ms"
    return f"{head}, braked after {figures} (least / median / most)" + "".join(f"\n    {text}" for text in unsafe)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--times", type=int, default=50, help="outages of every process and kind")
    parser.add_argument("--process", choices=PROCESSES, action="append", help="default: all")
    parser.add_argument("--how", choices=SIGNALS, action="append", help="default: all")
    parser.add_argument("--header", action="store_true", help="the consumer's half in C++")
    given = parser.parse_args()
    cases = [(name, how) for name in given.process or PROCESSES for how in given.how or SIGNALS]
    results = run(given.times, cases, given.header)
    sys.exit(any(outage.unsafe for outages in results.values() for outage in outages))
