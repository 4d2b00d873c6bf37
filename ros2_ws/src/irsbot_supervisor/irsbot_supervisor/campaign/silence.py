"""How long a supervisor at work is silent: the longest time between two verdicts while something else is asked of it.

The supervisors of the slowest robots judge 1000 samples per second of a robot at rest. Every case provokes one thing
and looks at the times at which verdicts were published: source time stamps of the middleware, taken in the publisher's
process. `quiet` is the control: what the machine itself does to the times.
"""

from __future__ import annotations

import fcntl
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from math import pi, sin
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from irsbot_kinematics import Robot
from irsbot_msgs_py.records import Level, Verdict
from irsbot_supervisor.campaign.rows import Job, Row, Tally
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.settings_file import read_settings
from irsbot_supervisor.sim.scenario_file import read_scenario
from irsbot_supervisor.suite import RECORDER, SUPERVISOR, Node, Suite, SuiteError, free_domain

if TYPE_CHECKING:  # needs ROS, which the list of rows does not
    from irsbot_supervisor.campaign.peer import Peer

NAME = "silence"
MUST = "calls, settings, others' life cycles, disk stalls: verdicts go on, 99.9 % of the longest gaps <= 30 ms"

ROBOTS = ("rrr3_base", "ruu4")
"""The slowest: their branches have to be followed."""

LAZY = {"acceleration_limit": [10.0]}
"""rad/s2: drives so slow that samples which are late on a busy machine are no reason to stop a robot at rest."""

LIMIT_S = 0.03
"""s between two verdicts, at the 99.9th percentile of the longest gaps of all cases."""

JUDGED = 300
"""Cases of a kind from which a 99.9th percentile means anything; with fewer only what is meant is judged, not time."""

LOOK_S = 0.25
"""s that are looked at where nothing has an end of its own."""

STALL_S = 0.5
"""s for which a disk stands."""

POINTS = 200
"""Points of the trajectory that is checked, or commanded."""

SHARES = (2.2, 10.0, 1.0, 3.0)
"""Velocity limits, times the shipped ones: accepted after a search, refused after one, and accepted at once."""

RESETS_AT_ONCE = 20

DEPTH = 10_000
"""Verdicts that the middleware holds for us: of the longest case."""

TRIES = 3
"""How often a case is tried in which a verdict was UNKNOWN: on a busy machine joint states may be late."""

UNKNOWN = Level.UNKNOWN.name
LOST = "verdicts that did not arrive"
"""Figure. A publisher of latched verdicts keeps one: the newest wins."""

QUIET = 20
"""Verdicts in a row that allow motion before a case."""


class Heard(NamedTuple):
    """A verdict. Times: ns, system clock."""

    sent_ns: int
    received_ns: int
    verdict: Verdict


class Cell:
    """One robot, its supervisor, a recorder and a bystander, and what is provoked."""

    def __init__(self, peer: Peer, others: Suite, ear: Ear, log: Log, name: str) -> None:
        self.peer, self.others, self.ear, self.log = peer, others, ear, log
        self.settings, self.robot = read_settings(name)
        self.turn = 0
        self.pose = tuple(read_scenario("pick_and_place", self.robot).start)

    def settle(self) -> None:
        """Wait until motion has been allowed for a while: no case inherits what the one before it did."""
        heard: list[Heard] = []

        def allowed() -> bool:
            heard.extend(self.ear.take())
            return len(heard) >= QUIET and all(one.verdict.level <= Level.WARN for one in heard[-QUIET:])

        self.peer.until(allowed, "leave to move")


class Ear:
    """Hears verdicts by a subscription that no executor serves: no callback of ours delays a time."""

    def __init__(self, peer: Peer) -> None:
        from irsbot_msgs.msg import Verdict as Message

        self._subscription = peer.silent.create_subscription(
            Message, "supervisor/verdict", lambda data: None, DEPTH, raw=True
        )
        self.last: list[Heard] = []
        """The newest verdict that was taken; empty before the first."""

    def take(self) -> list[Heard]:
        """The verdicts since the last call."""
        from irsbot_msgs_py.cdr import decode_verdict

        heard, subscription = [], self._subscription
        with subscription.handle:
            while (found := subscription.handle.take_message(subscription.msg_type, True)) is not None:
                data, info = found
                heard.append(Heard(info["source_timestamp"], info["received_timestamp"], decode_verdict(data)))
        self.last = heard[-1:] or self.last
        return heard


class Log:
    """Where a node prints: a pipe that we read, or let stand like a disk that stalls."""

    def __init__(self, path: Path) -> None:
        os.mkfifo(path)
        self._path = path
        self._read = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
        self._fill = os.open(path, os.O_WRONLY | os.O_NONBLOCK)
        fcntl.fcntl(self._fill, fcntl.F_SETPIPE_SZ, 4096)
        self._flows, self._over = threading.Event(), False
        self._flows.set()
        self.said = b""
        self._reader = threading.Thread(target=self._work, daemon=True)
        self._reader.start()

    def stall(self) -> None:
        """Full from now on: whoever writes waits."""
        self._flows.clear()
        time.sleep(0.02)  # the reader has gone to rest
        try:
            while os.write(self._fill, b"\n" * 512):
                pass
        except BlockingIOError:
            pass

    def flow(self) -> None:
        self._flows.set()

    def close(self) -> None:
        self._over = True
        self._flows.set()
        self._reader.join()
        os.close(self._read)
        os.close(self._fill)

    def _work(self) -> None:
        while not self._over:
            self._flows.wait()
            try:
                self.said = (self.said + os.read(self._read, 65536))[-100_000:]
            except BlockingIOError:
                time.sleep(0.005)


def run(job: Job) -> Row:
    """The row: a case is one cause of silence on one robot, in turn."""
    tally, longest = Tally(NAME, job), dict[str, list[float]]()
    rounds = max(job.amount // (len(ROBOTS) * len(CAUSES)), 1)
    for name in ROBOTS:
        with _supervised(name) as cell:
            for number in range(rounds):
                for cause, provoke in CAUSES.items():
                    cell.turn = number
                    gaps = longest.setdefault(f"{name} {cause}", [])
                    for _ in range(TRIES):
                        fault = _case(cell, cause, provoke, gaps, tally)
                        if UNKNOWN not in fault:
                            break
                    tally.case(failed=fault)
            code = cell.peer.suite.end("supervisor")
            tally.many(0, failed=code != 0, note="" if code == 0 else f"{name}: exit code {code}")
    measured = {kind: gaps for kind, gaps in longest.items() if gaps}
    for kind, gaps in measured.items():
        for share in (50.0, 99.0, 99.9):
            tally.largest(f"{kind}: longest silence, {share:g} % [ms]", float(np.percentile(gaps, share)) * 1e3)
        tally.largest(f"{kind}: longest silence of all [ms]", max(gaps) * 1e3)
    for cause in CAUSES:
        gaps = [gap for name in ROBOTS for gap in measured.get(f"{name} {cause}", ())]
        if not gaps:  # every try failed, and said why
            continue
        most = float(np.percentile(gaps, 99.9))
        late = len(gaps) >= JUDGED and not most <= LIMIT_S
        tally.many(0, failed=late, note=f"{cause}: {most * 1e3:.0f} ms without a verdict" if late else "")
    return tally.row()


@contextmanager
def _supervised(name: str) -> Iterator[Cell]:
    from irsbot_supervisor.campaign.peer import Peer

    domain = free_domain()
    with (
        TemporaryDirectory(prefix="irsbot-silence-") as folder,
        Suite(Path(folder) / "logs", domain) as suite,
        Suite(Path(folder) / "others", domain, "others") as others,
        Peer(suite, domain) as peer,
    ):
        log = Log(Path(folder) / "logs" / "supervisor.log")
        ear = Ear(peer)
        cell = Cell(peer, others, ear, log, name)
        suite.start(Node("recorder", RECORDER, {"output": str(Path(folder) / "bag")}))
        suite.start(Node("supervisor", SUPERVISOR, {"robot": name, **LAZY}))
        pose = {"robot": name, "pose": list(cell.pose)}
        suite.start(Node("robot", "irsbot_supervisor.campaign.flood_source", pose))
        others.start(Node("supervisor", SUPERVISOR, {"robot": "irsbot2"}))
        try:
            yield cell
        finally:
            log.close()


def _case(cell: Cell, cause: str, provoke: Callable[[Cell], str], longest: list[float], tally: Tally) -> str:
    """Provoke, and look: the longest time without a verdict is kept; what was wrong."""
    try:
        cell.settle()
        cell.ear.take()
        before, begin_ns = cell.ear.last, time.time_ns()
        fault = provoke(cell)
    except SuiteError as error:
        return f"{cause}: {error}: {cell.log.said[-200:].decode()}"
    end_ns = time.time_ns()
    cell.peer.look(2.0 * cell.settings.heartbeat_s)
    heard = [*before, *cell.ear.take()]
    meanwhile = [one for one in heard if begin_ns < one.sent_ns < end_ns]
    gaps = [b.sent_ns - a.sent_ns for a, b in pairwise(heard) if b.sent_ns > begin_ns and a.sent_ns < end_ns]
    longest.append(max(gaps) * 1e-9 if gaps else (end_ns - begin_ns) * 1e-9)
    numbers = [one.verdict.sequence for one in heard]
    if not meanwhile and end_ns - begin_ns > 10**9 * LIMIT_S:
        return f"{cause}: no verdict in {(end_ns - begin_ns) * 1e-9:.3f} s"
    tally.add(LOST, float(sum(b - a - 1 for a, b in pairwise(numbers))))
    if any(b <= a for a, b in pairwise(numbers)):
        return f"{cause}: verdicts {numbers} are not in sequence"
    unknown = [one.verdict.text for one in meanwhile if one.verdict.level == Level.UNKNOWN]
    return fault or (f"{cause}: {UNKNOWN}, {unknown[0]}" if unknown else "")


# --- what is provoked ----------------------------------------------------------------------------------------------


def _nothing(cell: Cell) -> str:
    cell.peer.look(LOOK_S)
    return ""


def _parameters(cell: Cell) -> str:
    """Velocity limits that have to be looked into."""
    from rcl_interfaces.srv import SetParameters
    from rclpy.parameter import Parameter

    share = SHARES[cell.turn % len(SHARES)] * (1.0 + 1e-3 * (cell.turn % 100))  # new ones every time
    values = [share * limit for limit in cell.settings.velocity_limit]
    request = SetParameters.Request(parameters=[Parameter("velocity_limit", value=values).to_parameter_msg()])
    (result,) = _ask(cell, SetParameters, "supervisor/set_parameters", request).results
    due = share < max(SHARES)
    return "" if result.successful == due else f"velocity_limit {values}: {result.successful}, {result.reason}"


def _resets(cell: Cell) -> str:
    from irsbot_msgs.srv import ResetStop

    client = _client(cell, ResetStop, "supervisor/reset")
    answers = [client.call_async(ResetStop.Request(event=1)) for _ in range(RESETS_AT_ONCE)]
    cell.peer.until(lambda: all(answer.done() for answer in answers), "all answers")
    accepted = sum(answer.result().accepted for answer in answers)
    return f"{accepted} resets without a stop" if accepted else ""


def _check(cell: Cell) -> str:
    from irsbot_msgs.srv import CheckTrajectory

    answer = _ask(
        cell, CheckTrajectory, "supervisor/check_trajectory", CheckTrajectory.Request(trajectory=_trajectory(cell))
    )
    return "" if answer.safe else f"not safe: {answer.message}"


def _command(cell: Cell) -> str:
    """A trajectory through the command gate, until the answer."""
    from trajectory_msgs.msg import JointTrajectory

    node, answers = cell.peer.node, list[Any]()
    publisher = node.create_publisher(JointTrajectory, "command_in", 10)
    subscription = node.create_subscription(JointTrajectory, "command_out", answers.append, 10)
    try:
        cell.peer.until(
            lambda: publisher.get_subscription_count() > 1 and subscription.get_publisher_count(), "the command gate"
        )
        publisher.publish(_trajectory(cell))
        cell.peer.until(lambda: answers, "an answer of the command gate")
    finally:
        node.destroy_publisher(publisher)
        node.destroy_subscription(subscription)
    return ""


def _life_cycle(cell: Cell) -> str:
    """Another supervisor falls silent and begins again, and a node comes and goes."""
    import rclpy
    from lifecycle_msgs.msg import Transition
    from lifecycle_msgs.srv import ChangeState
    from sensor_msgs.msg import JointState

    guest = rclpy.create_node(f"guest_{cell.turn}", context=cell.peer.context)
    guest.create_publisher(JointState, "others/joint_states", 10)
    for transition in (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_ACTIVATE):
        request = ChangeState.Request()
        request.transition.id = transition
        if not _ask(cell, ChangeState, "others/supervisor/change_state", request).success:
            return f"transition {transition} of another supervisor is refused"
    guest.destroy_node()
    return ""


def _disk(cell: Cell) -> str:
    """A recorder that does not come back from its disk."""
    process = cell.peer.suite.processes["recorder"]
    process.send_signal(signal.SIGSTOP)
    try:
        cell.peer.look(STALL_S)
    finally:
        process.send_signal(signal.SIGCONT)
    return ""


def _print(cell: Cell) -> str:
    """Nobody takes what the supervisor prints, and it has something to say: other settings."""
    from rcl_interfaces.srv import SetParameters
    from rclpy.parameter import Parameter

    request = SetParameters.Request(
        parameters=[Parameter("load_force_n", value=50.0 + cell.turn % 10).to_parameter_msg()]
    )
    client = _client(cell, SetParameters, "supervisor/set_parameters")
    cell.log.stall()
    try:
        answer = client.call_async(request)
        cell.peer.look(STALL_S)
    finally:
        cell.log.flow()
    cell.peer.until(answer.done, "an answer")
    (result,) = answer.result().results
    return "" if result.successful else result.reason


CAUSES: dict[str, Callable[[Cell], str]] = {
    "quiet": _nothing,
    "parameters": _parameters,
    "resets": _resets,
    "check_trajectory": _check,
    "command": _command,
    "life cycle of others": _life_cycle,
    "recorder's disk stalls": _disk,
    "log stalls": _print,
}
"""What is provoked; each returns what was wrong, or nothing."""


def _client(cell: Cell, kind: Any, name: str) -> Any:
    """One client per service, for as long as the cell."""
    clients = cell.__dict__.setdefault("clients", {})
    if name not in clients:
        clients[name] = cell.peer.client(kind, name)
    return clients[name]


def _ask(cell: Cell, kind: Any, name: str, request: Any) -> Any:
    return cell.peer.ask(_client(cell, kind, name), request)


def _trajectory(cell: Cell) -> Any:
    """To and fro about where the robot stands, at a tenth of its speed."""
    from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

    settings: Settings = cell.settings
    robot: Robot = cell.robot
    start = robot.inverse(cell.pose).tolist()
    size, period_s = 0.02, 0.02
    message = JointTrajectory(joint_names=list(settings.joint_names))
    for k in range(POINTS):
        way = size * sin(2.0 * pi * k / POINTS)
        point = JointTrajectoryPoint(positions=[q + way for q in start])
        point.time_from_start.sec, point.time_from_start.nanosec = divmod(round(k * period_s * 1e9), 10**9)
        message.points.append(point)
    return message
