"""The supervisor whose silence is measured, with its robot, recorder and another supervisor, and who listens to it."""

from __future__ import annotations

import fcntl
import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple

from irsbot_msgs_py.records import Level, Verdict
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.processes.suite import RECORDER, SUPERVISOR, Node, Suite, free_domain
from irsbot_supervisor.sim.scenario_file import read_scenario

if TYPE_CHECKING:  # needs ROS, which the list of rows does not
    from irsbot_supervisor.validation.harness.client import Tester

LAZY = {"acceleration_limit": [10.0]}
"""rad/s2: such slow drives that late samples on a busy machine do not stop a robot at rest."""

DEPTH = 10_000
"""Depth of the queues of verdicts and of joint states: enough for the longest case."""

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
        """Number of the round: causes vary with it."""
        self._clients: dict[str, Any] = {}
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

    def client(self, kind: Any, name: str) -> Any:
        """The client of a service, one for the life of the cell. kind: of the service."""
        if name not in self._clients:
            self._clients[name] = self.tester.client(kind, name)
        return self._clients[name]

    def ask(self, kind: Any, name: str, request: Any) -> Any:
        """Call a service; returns its answer. Raises SuiteError if it does not answer."""
        return self.tester.ask(self.client(kind, name), request)


class Ear:
    """Receives verdicts and joint states by subscriptions without executor: no callback delays a time."""

    def __init__(self, tester: Tester) -> None:
        from irsbot_msgs.msg import Verdict as Message
        from sensor_msgs.msg import JointState

        def subscription(kind: Any, topic: str) -> Any:
            return tester.silent.create_subscription(kind, topic, lambda data: None, DEPTH, raw=True)

        self._verdicts = subscription(Message, "supervisor/verdict")
        self._samples = subscription(JointState, "joint_states")
        self.last: list[Heard] = []
        """The newest verdict; empty before the first."""

    def take(self) -> list[Heard]:
        """The verdicts since the last call."""
        from irsbot_msgs_py.cdr import decode_verdict

        heard = [
            Heard(info["source_timestamp"], info["received_timestamp"], decode_verdict(data))
            for data, info in _waiting(self._verdicts)
        ]
        self.last = heard[-1:] or self.last
        return heard

    def samples_ns(self) -> list[int]:
        """ns, system clock: when the joint states since the last call were sent."""
        return [info["source_timestamp"] for _data, info in _waiting(self._samples)]


def _waiting(subscription: Any) -> Iterator[tuple[bytes, dict[str, int]]]:
    """The messages that wait, with the times of the middleware."""
    with subscription.handle:
        while (found := subscription.handle.take_message(subscription.msg_type, True)) is not None:
            yield found


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
        """The newest output, at most 100 kB."""
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
        """Go on reading."""
        self._flows.set()

    def close(self) -> None:
        """End reading; the pipe stays in its folder."""
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


@contextmanager
def supervised(name: str) -> Iterator[Cell]:
    """Start all nodes for a robot of this name; they end with the context."""
    from irsbot_supervisor.validation.harness.client import PATIENCE_S, Tester

    domain = free_domain()
    with (
        TemporaryDirectory(prefix="irsbot-silence-") as folder,
        Suite(Path(folder) / "logs", domain, patience_s=PATIENCE_S) as suite,
        Suite(Path(folder) / "others", domain, "others", patience_s=PATIENCE_S) as others,
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
