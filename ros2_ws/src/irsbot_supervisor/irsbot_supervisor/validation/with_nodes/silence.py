"""Silence of a supervisor at work: the longest time between two verdicts while it has other requests.

The supervisors of the slowest robots judge 1000 samples per second of a robot at rest. Every case causes one event and
examines the times at which verdicts were published: source time stamps of the middleware, taken in the publisher's
process. `quiet` is the control: the delays that the machine causes itself.
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
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.processes.suite import RECORDER, SUPERVISOR, Node, Suite, SuiteError, free_domain
from irsbot_supervisor.sim.scenario_file import read_scenario
from irsbot_supervisor.validation.harness.rows import Job, Row, Tally

if TYPE_CHECKING:  # needs ROS, which the list of rows does not
    from irsbot_supervisor.validation.harness.client import Tester

NAME = "silence"
MUST = "calls, settings, others' life cycles, disk stalls: verdicts go on, 99.9 % of the longest gaps <= 30 ms"

ROBOTS = ("rrr3_base", "ruu4")
"""The slowest robots: their branches have to be followed."""

LAZY = {"acceleration_limit": [10.0]}
"""rad/s2: such slow drives that late samples on a busy machine do not stop a robot at rest."""

LIMIT_S = 0.03
"""s between two verdicts, at the 99.9th percentile of the longest gaps of all cases."""

JUDGED = 300
"""Number of cases of a kind from which a 99.9th percentile is meaningful; with fewer cases times are not judged."""

LOOK_S = 0.25
"""s of observation for events without an end of their own."""

STALL_S = 0.5
"""s for which a disk stalls."""

POINTS = 200
"""Number of points of the trajectory that is checked or commanded."""

SHARES = (2.2, 10.0, 1.0, 3.0)
"""Velocity limits as multiples of the shipped ones: accepted after a search, refused after one, and accepted at
once."""

RESETS_AT_ONCE = 20

DEPTH = 10_000
"""Depth of the queue of verdicts: enough for the longest case."""

TRIES = 3
"""Number of tries of a case with an UNKNOWN verdict: on a busy machine joint states may be late."""

UNKNOWN = Level.UNKNOWN.name
DEAF = "the listener was deaf"
LOST = "verdicts that did not arrive"
"""Figure: lost verdicts. A publisher of latched verdicts keeps only the newest."""

QUIET = 20
"""Number of consecutive verdicts that allow motion before a case."""


class Heard(NamedTuple):
    """A received verdict. Times: ns, system clock."""

    sent_ns: int
    received_ns: int
    verdict: Verdict


class Cell:
    """One robot, its supervisor, a recorder and another node, and the event."""

    def __init__(self, tester: Tester, others: Suite, ear: Ear, log: Log, name: str) -> None:
        self.tester, self.others, self.ear, self.log = tester, others, ear, log
        self.settings, self.robot = read_settings(name)
        self.turn = 0
        self.pose = tuple(read_scenario("pick_and_place", self.robot).start)

    def settle(self) -> None:
        """Wait until motion has been allowed for a while: no case inherits the effect of the one before. A stop caused
        by a busy machine is reset."""
        heard: list[Heard] = []

        def allowed() -> bool:
            heard.extend(self.ear.take())
            if heard:
                self.tester.reset(heard[-1].verdict)
            return len(heard) >= QUIET and all(one.verdict.level <= Level.WARN for one in heard[-QUIET:])

        self.tester.until(allowed, "leave to move")


class Ear:
    """Receives verdicts by a subscription without executor: no callback delays a time."""

    def __init__(self, tester: Tester) -> None:
        from irsbot_msgs.msg import Verdict as Message

        self._subscription = tester.silent.create_subscription(
            Message, "supervisor/verdict", lambda data: None, DEPTH, raw=True
        )
        self.last: list[Heard] = []
        """The newest verdict; empty before the first."""

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
    """Output of a node: a pipe that is read, or not read to simulate a stalled disk."""

    def __init__(self, path: Path) -> None:
        os.mkfifo(path)
        self._path = path
        self._read = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
        self._fill = os.open(path, os.O_WRONLY | os.O_NONBLOCK)
        fcntl.fcntl(self._fill, fcntl.F_SETPIPE_SZ, 4096)
        self._flows, self._over = threading.Event(), False
        self._flows.set()
        self.stated = b""
        self._reader = threading.Thread(target=self._work, daemon=True)
        self._reader.start()

    def stall(self) -> None:
        """Stop reading: writers wait when the pipe is full."""
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
                self.stated = (self.stated + os.read(self._read, 65536))[-100_000:]
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
                        if UNKNOWN not in fault and DEAF not in fault:
                            break
                    tally.case(failed=fault)
            code = cell.tester.suite.end("supervisor")
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
    from irsbot_supervisor.validation.harness.client import Tester

    domain = free_domain()
    with (
        TemporaryDirectory(prefix="irsbot-silence-") as folder,
        Suite(Path(folder) / "logs", domain) as suite,
        Suite(Path(folder) / "others", domain, "others") as others,
        Tester(suite, domain) as tester,
    ):
        log = Log(Path(folder) / "logs" / "supervisor.log")
        ear = Ear(tester)
        cell = Cell(tester, others, ear, log, name)
        suite.start(Node("recorder", RECORDER, {"output": str(Path(folder) / "bag")}))
        suite.start(Node("supervisor", SUPERVISOR, {"robot": name, **LAZY}))
        pose = {"robot": name, "pose": list(cell.pose)}
        suite.start(Node("robot", "irsbot_supervisor.validation.harness.flood_source", pose))
        others.start(Node("supervisor", SUPERVISOR, {"robot": "irsbot2"}))
        try:
            yield cell
        finally:
            log.close()


def _case(cell: Cell, cause: str, provoke: Callable[[Cell], str], longest: list[float], tally: Tally) -> str:
    """Cause an event and observe: keeps the longest time without a verdict; returns the fault."""
    try:
        cell.settle()
        cell.ear.take()
        before, begin_ns = cell.ear.last, time.time_ns()
        fault = provoke(cell)
    except SuiteError as error:
        return f"{cause}: {error}: {cell.log.stated[-200:].decode()}"
    end_ns = time.time_ns()
    cell.tester.look(2.0 * cell.settings.heartbeat_s)
    heard = [*before, *cell.ear.take()]
    meanwhile = [one for one in heard if begin_ns < one.sent_ns < end_ns]
    gaps = [b.sent_ns - a.sent_ns for a, b in pairwise(heard) if b.sent_ns > begin_ns and a.sent_ns < end_ns]
    longest.append(max(gaps) * 1e-9 if gaps else (end_ns - begin_ns) * 1e-9)
    numbers = [one.verdict.sequence for one in heard]
    if not meanwhile and end_ns - begin_ns > 10**9 * LIMIT_S:
        longest.pop()
        missed = _missed(cell, before)
        if missed * cell.settings.heartbeat_s > LIMIT_S:
            return f"{cause}: {DEAF}, {missed} verdicts were published that it did not receive"
        return f"{cause}: no verdict in {(end_ns - begin_ns) * 1e-9:.3f} s"
    tally.add(LOST, float(sum(b - a - 1 for a, b in pairwise(numbers))))
    if any(b <= a for a, b in pairwise(numbers)):
        return f"{cause}: verdicts {numbers} are not in sequence"
    unknown = [one.verdict.text for one in meanwhile if one.verdict.level == Level.UNKNOWN]
    return fault or (f"{cause}: {UNKNOWN}, {unknown[0]}" if unknown else "")


def _missed(cell: Cell, before: list[Heard]) -> int:
    """Number of verdicts between the last one before a silence and the first one after it: 0 if the supervisor itself
    was silent."""
    later: list[Heard] = []

    def heard() -> bool:
        later.extend(one for one in cell.ear.take() if not before or one.sent_ns > before[-1].sent_ns)
        return bool(later)

    cell.tester.until(heard, "a verdict after the silence")
    return later[0].verdict.sequence - before[-1].verdict.sequence - 1 if before else 0


# --- what is provoked ----------------------------------------------------------------------------------------------


def _nothing(cell: Cell) -> str:
    cell.tester.look(LOOK_S)
    return ""


def _parameters(cell: Cell) -> str:
    """Set velocity limits that need the feasibility check."""
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
    cell.tester.until(lambda: all(answer.done() for answer in answers), "all answers")
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

    node, answers = cell.tester.node, list[Any]()
    publisher = node.create_publisher(JointTrajectory, "command_in", 10)
    subscription = node.create_subscription(JointTrajectory, "command_out", answers.append, 10)
    try:
        cell.tester.until(
            lambda: publisher.get_subscription_count() > 1 and subscription.get_publisher_count(), "the command gate"
        )
        publisher.publish(_trajectory(cell))
        cell.tester.until(lambda: answers, "an answer of the command gate")
    finally:
        node.destroy_publisher(publisher)
        node.destroy_subscription(subscription)
    return ""


def _life_cycle(cell: Cell) -> str:
    """Another supervisor is deactivated and activated, and a node comes and goes."""
    import rclpy
    from lifecycle_msgs.msg import Transition
    from lifecycle_msgs.srv import ChangeState
    from sensor_msgs.msg import JointState

    guest = rclpy.create_node(f"guest_{cell.turn}", context=cell.tester.context)
    guest.create_publisher(JointState, "others/joint_states", 10)
    for transition in (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_ACTIVATE):
        request = ChangeState.Request()
        request.transition.id = transition
        if not _ask(cell, ChangeState, "others/supervisor/change_state", request).success:
            return f"transition {transition} of another supervisor is refused"
    guest.destroy_node()
    return ""


def _disk(cell: Cell) -> str:
    """A recorder whose disk stalls."""
    process = cell.tester.suite.processes["recorder"]
    process.send_signal(signal.SIGSTOP)
    try:
        cell.tester.look(STALL_S)
    finally:
        process.send_signal(signal.SIGCONT)
    return ""


def _print(cell: Cell) -> str:
    """The output of the supervisor is not read while settings changes make it log."""
    from rcl_interfaces.srv import SetParameters
    from rclpy.parameter import Parameter

    request = SetParameters.Request(
        parameters=[Parameter("load_force_n", value=50.0 + cell.turn % 10).to_parameter_msg()]
    )
    client = _client(cell, SetParameters, "supervisor/set_parameters")
    cell.log.stall()
    try:
        answer = client.call_async(request)
        cell.tester.look(STALL_S)
    finally:
        cell.log.flow()
    cell.tester.until(answer.done, "an answer")
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
"""Events; each returns its fault, or an empty text."""


def _client(cell: Cell, kind: Any, name: str) -> Any:
    """One client per service, for the life of the cell."""
    clients = cell.__dict__.setdefault("clients", {})
    if name not in clients:
        clients[name] = cell.tester.client(kind, name)
    return clients[name]


def _ask(cell: Cell, kind: Any, name: str, request: Any) -> Any:
    return cell.tester.ask(_client(cell, kind, name), request)


def _trajectory(cell: Cell) -> Any:
    """A motion back and forth about the present posture, at a tenth of full speed."""
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
