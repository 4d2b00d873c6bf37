"""The campaign's own node: it calls the services of the nodes under test, receives their messages, and waits for
events.

It is not a node under test. Needs ROS.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import Any

import psutil
import rclpy
from irsbot_msgs.msg import SingularityState as StateMessage
from irsbot_msgs.msg import Verdict as VerdictMessage
from irsbot_msgs.srv import ResetStop
from rclpy.context import Context
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.task import Future

from irsbot_msgs_py.cdr import decode_state, decode_verdict
from irsbot_msgs_py.process.fastdds import choose_transport
from irsbot_msgs_py.records import Level, SingularityState, Verdict
from irsbot_supervisor.processes.asking import Asking
from irsbot_supervisor.processes.suite import Suite, SuiteError

PATIENCE_S = 60.0
"""s: longest wait for an event that must come: far more than it takes, also on a busy machine."""
LATCHED = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
ANSWERS = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
"""Depth of the queue of answers: a client receives the answers to all clients of its service, and selects its own."""

NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Quality of service of a reader that reads now and then and slows nobody down."""


class Tester:
    """A node on the domain of a suite. Close it, or use it as a context manager."""

    def __init__(self, suite: Suite, domain: int) -> None:
        choose_transport(os.environ, rclpy.get_rmw_implementation_identifier())
        self.suite = suite
        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node("campaign", context=self.context)
        self.verdicts: list[Verdict] = []
        self._reset: Any = None  # client of the service, once it is needed
        self._heard_s = self._silence_s = 0.0  # when the last verdict came, and the longest silence before one
        self._executor = EventsExecutor(context=self.context)
        self._executor.add_node(self.node)
        self.silent = rclpy.create_node("campaign_reader", context=self.context)  # served by no executor
        self._states = self.silent.create_subscription(
            StateMessage, "supervisor/state", lambda data: None, NEWEST, raw=True
        )

    def listen(self) -> None:
        """Keep every verdict from now on."""
        self.node.create_subscription(VerdictMessage, "supervisor/verdict", self._hear, LATCHED, raw=True)

    def _hear(self, data: bytes) -> None:
        self.verdicts.append(decode_verdict(data))
        self._silence_s, self._heard_s = self.silence_s, time.monotonic()

    @property
    def silence_s(self) -> float:
        """Longest time without a verdict since `forget`, s."""
        return max(self._silence_s, time.monotonic() - self._heard_s)

    def forget(self) -> None:
        """Forget the received verdicts and the silences between them."""
        self.verdicts.clear()
        self._heard_s, self._silence_s = time.monotonic(), 0.0

    def look(self, seconds: float) -> None:
        """Serve callbacks for this time."""
        self._executor.spin_until_future_complete(Future(), timeout_sec=seconds)

    def until(self, happened: Callable[[], Any], what: str, patience_s: float = PATIENCE_S) -> None:
        """Serve callbacks until a condition is true. Raises SuiteError if it does not become true, or if a node
        ends."""
        deadline = time.monotonic() + patience_s
        while not happened():
            if time.monotonic() > deadline:
                raise SuiteError(f"in {patience_s:.0f} s not seen: {what}")
            self.suite.check()
            self.look(0.01)

    def newest_state(self) -> SingularityState | None:
        """The newest state since the last look."""
        data = None
        with self._states.handle:
            while (found := self._states.handle.take_message(self._states.msg_type, True)) is not None:
                data = found[0]
        return None if data is None else decode_state(data)

    def client(self, kind: Any, name: str) -> Any:
        """A client whose service has answered it: an empty request, which changes nothing."""
        client = self.node.create_client(kind, name, qos_profile=ANSWERS)
        self.until(client.service_is_ready, f"service {name}")
        self.ask_again(client, kind.Request())
        return client

    def ask_again(self, client: Any, request: Any) -> Any:
        """The answer of a service that may be called twice: it is called until an answer comes."""
        asking = Asking(client, request)
        self.until(asking.answered, f"an answer of {client.service_name}")
        return asking.answer

    def ask(self, client: Any, request: Any) -> Any:
        """Call a service; returns its answer."""
        answer = client.call_async(request)
        self.until(answer.done, "an answer")
        return answer.result()

    def reset_stop(self) -> None:
        """Request a reset of the latched stop in the newest verdict, if there is one. It may be refused."""
        if self.verdicts:
            self.reset(self.verdicts[-1])

    def reset(self, verdict: Verdict) -> None:
        """The same for the stop of a verdict, if it is latched."""
        if verdict.latched:
            if self._reset is None:
                self._reset = self.client(ResetStop, "supervisor/reset")
            self.ask_again(self._reset, ResetStop.Request(event=verdict.event, operator_text="campaign"))

    def works(self, beats: int) -> bool:
        """True if this number of newest verdicts are all OK. A stop caused by a busy machine is reset."""
        self.reset_stop()
        return [verdict.level for verdict in self.verdicts[-beats:]] == [Level.OK] * beats

    def resident_mb(self, name: str) -> float:
        """Memory of a node, MB."""
        return float(psutil.Process(self.suite.processes[name].pid).memory_info().rss) * 1e-6

    def close(self) -> None:
        """Leave the domain."""
        self._executor.shutdown()
        self.node.destroy_node()
        self.silent.destroy_node()
        rclpy.try_shutdown(context=self.context)

    def __enter__(self) -> Tester:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()
