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
import os
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import rclpy
from irsbot_msgs.msg import GateStatus, Verdict
from irsbot_msgs.srv import ResetStop
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from irsbot_msgs_py.cdr import decode_joint_state, decode_verdict
from irsbot_msgs_py.records import JointSample, Level
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.consumer import TIMEOUT_S
from irsbot_supervisor.processes.suite import JOINTS, KINEMATICS, RECORDER, SUPERVISOR, Node, Suite, free_domain
from irsbot_supervisor.sim.simulation import STANDING, Simulation

PATIENCE_S = 60.0
FROZEN_S = 0.3
WATCHED_S = 0.3
"""s after an outage in which nothing may move by an old command, or, of a bystander, all has to go on."""

CYCLE_S = 0.005
"""s between two cycles of the controller, and between two joint states."""

SLOWEST, STEP, NUMBERS = 0.1, 0.001, 50
"""rad/s: the rate of a command is SLOWEST + STEP times its number, which counts to NUMBERS; the sign takes turns."""

MOVES = 1e-6
"""rad/s: less is standstill."""

PROCESSES = ("supervisor", "simulated_joints", "kinematics", "recorder", "controller")
BYSTANDERS = ("kinematics", "recorder")
SIGNALS = {"kill": signal.SIGKILL, "freeze": signal.SIGSTOP, "restart": signal.SIGTERM}
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Line(NamedTuple):
    """What the drives are told from a moment on, steady clock."""

    at_ns: int
    rate: float  # rad/s, first joint
    paused_ns: int  # the longest time between two cycles of the controller before
    heard_ns: int  # the last verdict


class Outage(NamedTuple):
    """What was seen of one outage."""

    took_s: float  # until the drives were told to stand, or stood; 0 for a bystander; < 0: the robot stood already
    unsafe: str
    disturbed: str  # a bystander whose loss stopped the robot


class Station:
    """The suite, the client, and an operator who resets what stops."""

    def __init__(self, folder: Path, header: bool) -> None:
        here = str(Path(__file__).resolve().parent)
        os.environ["PYTHONPATH"] = os.pathsep.join([here, *filter(None, [os.environ.get("PYTHONPATH")])])
        self.domain = free_domain()
        self.suite = Suite(folder / "logs", self.domain)
        self._log = folder / "controller.txt"
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=self.domain)
        self.node = rclpy.create_node("client", context=self.context)
        self.executor = EventsExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.verdict: Any = None
        self.stops: list[str] = []  # texts of the verdicts that brake, and of what the gate holds
        self.joints: list[JointSample] = []
        self._reset: Any = None
        self._operator = self.node.create_client(ResetStop, "supervisor/reset")
        self.node.create_subscription(Verdict, "supervisor/verdict", self._hear, LATCHED, raw=True)
        self.node.create_subscription(JointState, "joint_states", self._see, 1000, raw=True)
        self.node.create_subscription(GateStatus, "supervisor/gate", self._hold, LATCHED)
        self._velocity = self.node.create_publisher(Float64MultiArray, "velocity_in", 10)
        self.node.create_timer(0.02, self._command)
        self.number, self.commanding = 0, False
        lazy = {"acceleration_limit": [10.0]}  # so that a busy machine, which is late with samples, stops no robot
        drives = {"scenario": STANDING, "obey": False, "rate_hz": 1.0 / CYCLE_S}
        self._nodes = {
            "supervisor": Node("supervisor", SUPERVISOR, lazy),
            "simulated_joints": Node("simulated_joints", JOINTS, drives),
            "kinematics": Node("kinematics", KINEMATICS, {}),
            "recorder": Node("recorder", RECORDER, {"mode": "blackbox"}),
            "controller": Node("controller", "obedient_controller", {"log": str(self._log), "header": header}),
        }
        self._bags, self._folder = 0, folder

    @property
    def rate(self) -> float:
        """rad/s of the newest command."""
        return (SLOWEST + STEP * (self.number % NUMBERS)) * (1.0 if self.number % 2 else -1.0)

    @property
    def lines(self) -> list[Line]:
        stated = self._log.read_text().splitlines() if self._log.exists() else []
        return [Line(int(at), float(rate), int(pause), int(heard)) for at, rate, pause, heard in map(str.split, stated)]

    def start(self, name: str) -> None:
        node = self._nodes[name]
        if name == "recorder":
            self._bags += 1
            node = node._replace(parameters={**node.parameters, "output": str(self._folder / f"bag{self._bags}")})
        self.suite.start(node)

    def _hear(self, data: bytes) -> None:
        self.verdict = decode_verdict(data)
        if self.verdict.level > Level.WARN:
            self.stops.append(self.verdict.text)

    def _hold(self, status: GateStatus) -> None:
        if status.outcome == GateStatus.OUTCOME_HELD:
            self.stops.append(f"gate: {status.text}")

    def _see(self, data: bytes) -> None:
        self.joints.append(decode_joint_state(data, time.time_ns(), time.monotonic_ns()))

    def _command(self) -> None:
        if self.commanding:
            self._velocity.publish(Float64MultiArray(data=[self.rate, -self.rate]))

    def until(self, happened: Callable[[], Any], what: str) -> None:
        begin = time.monotonic()
        while not happened():
            if time.monotonic() - begin > PATIENCE_S:
                raise RuntimeError(f"in vain: {what}; {self.verdict}; {self.lines[-3:]}")
            self.executor.spin_until_future_complete(Future(), timeout_sec=0.01)

    def look(self, seconds: float) -> None:
        begin = time.monotonic()
        while time.monotonic() - begin < seconds:
            self.executor.spin_until_future_complete(Future(), timeout_sec=0.01)

    def move(self) -> None:
        """A new command, until the robot runs on it."""
        self.until(self._may_move, "leave to move")
        self.number, self.commanding = self.number + 1, True
        self.until(lambda: self._may_move() and self._moves(), "a robot that moves as commanded")

    def _moves(self) -> bool:
        told = [line.rate for line in self.lines[-1:]] == [self.rate]
        return told and abs(self.joints[-1].velocity[0] - self.rate) < MOVES

    def _may_move(self) -> bool:
        """Reset a stop, as an operator would who has looked."""
        verdict = self.verdict
        if verdict is not None and verdict.latched and (self._reset is None or self._reset.done()):
            self._reset = self._operator.call_async(ResetStop.Request(event=verdict.event, operator_text="campaign"))
        return bool(self.joints and verdict is not None and verdict.level <= Level.WARN)

    def outage(self, name: str, how: str) -> Outage:
        """One outage, from motion to a robot that may move again; another one where the motion had ended already,
        because the machine is busy."""
        while True:
            found = self._outage(name, how)
            if found.took_s >= 0.0:
                return found

    def _outage(self, name: str, how: str) -> Outage:
        self.move()
        self.joints.clear()
        self.stops.clear()
        process, told = self.suite.processes[name], len(self.lines)
        if self.lines[told - 1].rate != self.rate:
            return Outage(-1.0, "", "")
        at_ns, wall_ns = time.monotonic_ns(), time.time_ns()
        process.send_signal(SIGNALS[how])
        end_ns = wall_ns
        self.commanding = name in BYSTANDERS
        if how == "restart":  # it may command until its end
            while process.poll() is None:
                self.look(CYCLE_S)
            end_ns = time.time_ns()
        self.look(FROZEN_S)
        self.verdict = None  # of a supervisor that is gone it says nothing any more
        if how == "freeze":
            process.send_signal(signal.SIGCONT)
        else:
            self.suite.end(name, SIGNALS[how])
            self.start(name)
        if name in BYSTANDERS:
            self.look(WATCHED_S)
            ended = [line for line in self.lines[told:] if line.rate != self.rate]
            self.commanding = False
            why = self.stops[0] if self.stops else "no verdict for the consumer's time"
            return Outage(0.0, "", f"told {ended[0].rate} rad/s, {why}" if ended else "")
        if name == "controller":
            self._catch_up(wall_ns + round(FROZEN_S * NS_PER_S))
            found = self._stood(wall_ns, end_ns)
        else:
            self.until(lambda: any(line.rate == 0.0 for line in self.lines[told:]), "brakes")
            found = self._braked(next(line for line in self.lines[told:] if line.rate == 0.0), at_ns)
        self.until(self._may_move, "leave to move after it")
        self.look(WATCHED_S)
        self._catch_up(time.time_ns())
        return found._replace(unsafe=found.unsafe or self._old(told, at_ns, wall_ns + round(found.took_s * NS_PER_S)))

    def _catch_up(self, wall_ns: int) -> None:
        """A busy machine may be behind with what it hears."""
        self.until(lambda: self.joints and self.joints[-1].stamp_ns >= wall_ns, "joint states")

    def _braked(self, line: Line, at_ns: int) -> Outage:
        """The consumer's time counts from the last verdict, which may have been on its way for as long once more."""
        took_s, paused_s = (line.at_ns - at_ns) / NS_PER_S, max(line.paused_ns / NS_PER_S - CYCLE_S, 0.0)
        silent_s = (line.at_ns - line.heard_ns) / NS_PER_S
        late = took_s > 2.0 * TIMEOUT_S + CYCLE_S + paused_s or silent_s > TIMEOUT_S + 2.0 * CYCLE_S + paused_s
        return Outage(took_s, f"braked after {took_s:.3f} s, its process paused {paused_s:.3f} s" if late else "", "")

    def _stood(self, wall_ns: int, end_ns: int) -> Outage:
        """Without their controller the drives stand after their own time-out, pauses of their process not counted."""
        settings = read_settings("irsbot2")[0]
        moving = [s for s in self.joints if s.stamp_ns > wall_ns and abs(s.velocity[0]) > MOVES]
        if not moving:
            return Outage(-1.0, "", "")
        took_s = (moving[-1].stamp_ns - wall_ns) / NS_PER_S
        stamps = [wall_ns, *[s.stamp_ns for s in moving]]
        pauses_s = sum(max((b - a) / NS_PER_S - CYCLE_S, 0.0) for a, b in pairwise(stamps))
        limit_s = (
            (end_ns - wall_ns) / NS_PER_S
            + Simulation().command_timeout_s
            + abs(self.rate) / settings.deceleration_limit[0]
            + 2.0 * CYCLE_S
        )
        return Outage(took_s, f"stood after {took_s:.3f} s" if took_s > limit_s + pauses_s else "", "")

    def _old(self, told: int, at_ns: int, stood_ns: int) -> str:
        """What moved although nothing new was commanded: what the drives were told, and what they did."""
        lines = self.lines[told:]
        first = next((k for k, line in enumerate(lines) if line.rate == 0.0), len(lines))
        if again := [line for line in lines[first:] if line.rate]:
            later_s = (again[0].at_ns - at_ns) / NS_PER_S
            return f"the drives were told {again[0].rate} rad/s again after {later_s:.3f} s, gate: {self.stops[-3:]}"
        late_ns = stood_ns + round((Simulation().command_timeout_s + 0.1) * NS_PER_S)
        moved = [s for s in self.joints if s.stamp_ns > late_ns and abs(s.velocity[0]) > MOVES]
        return f"a joint moved at {moved[-1].velocity[0]} rad/s" if moved else ""

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)
        self.suite.stop()


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
                        outages.append(station.outage(name, how))
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
