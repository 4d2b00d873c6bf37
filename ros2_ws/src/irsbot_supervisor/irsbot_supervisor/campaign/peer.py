"""The campaign's own node beside the nodes under test: it asks their services, hears what they say, and waits for it.

Nothing here is a node under test. Needs ROS.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import Any

import psutil  # type: ignore[import-untyped]
import rclpy
from irsbot_msgs.msg import SingularityState as StateMessage
from irsbot_msgs.msg import Verdict as VerdictMessage
from rclpy.context import Context
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.task import Future

from irsbot_msgs_py.cdr import decode_state, decode_verdict
from irsbot_msgs_py.records import SingularityState, Verdict
from irsbot_msgs_py.transport import choose_transport
from irsbot_supervisor.suite import Suite, SuiteError

PATIENCE_S = 60.0
"""Longest wait for an event that must come: far more than it takes, on a busy machine."""

LATCHED = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
ANSWERS = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
"""A client gets the answers to all clients of its service, and picks its own."""

NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""For a reader that looks now and then and slows nobody down."""


class Peer:
    """A node on the domain of a suite. Close it, or use it as a context manager."""

    def __init__(self, suite: Suite, domain: int) -> None:
        choose_transport(os.environ, rclpy.get_rmw_implementation_identifier())
        self.suite = suite
        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node("campaign", context=self.context)
        self.verdicts: list[Verdict] = []
        self._heard_s = self._silence_s = 0.0  # when the last verdict came, and the longest silence before one
        self._executor = EventsExecutor(context=self.context)
        self._executor.add_node(self.node)
        self.silent = rclpy.create_node("campaign_reader", context=self.context)  # served by no executor
        self._states = self.silent.create_subscription(
            StateMessage, "supervisor/state", lambda data: None, NEWEST, raw=True
        )

    def listen(self) -> None:
        """From now on keep every verdict."""
        self.node.create_subscription(VerdictMessage, "supervisor/verdict", self._hear, LATCHED, raw=True)

    def _hear(self, data: bytes) -> None:
        self.verdicts.append(decode_verdict(data))
        self._silence_s, self._heard_s = self.silence_s, time.monotonic()

    @property
    def silence_s(self) -> float:
        """Longest time without a verdict since `forget`, s."""
        return max(self._silence_s, time.monotonic() - self._heard_s)

    def forget(self) -> None:
        """The verdicts that were heard until now, and the silences between them."""
        self.verdicts.clear()
        self._heard_s, self._silence_s = time.monotonic(), 0.0

    def look(self, seconds: float) -> None:
        """Serve callbacks for so long."""
        self._executor.spin_until_future_complete(Future(), timeout_sec=seconds)

    def until(self, happened: Callable[[], Any], what: str, patience_s: float = PATIENCE_S) -> None:
        """Serve callbacks until something has happened. Raises SuiteError if it does not, or if a node ends."""
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
        """A client whose service is there."""
        client = self.node.create_client(kind, name, qos_profile=ANSWERS)
        self.until(client.service_is_ready, f"service {name}")
        return client

    def ask(self, client: Any, request: Any) -> Any:
        """The answer of a service."""
        answer = client.call_async(request)
        self.until(answer.done, "an answer")
        return answer.result()

    def resident_mb(self, name: str) -> float:
        """Memory of a node, MB."""
        return float(psutil.Process(self.suite.processes[name].pid).memory_info().rss) * 1e-6

    def close(self) -> None:
        """Leave the domain."""
        self._executor.shutdown()
        self.node.destroy_node()
        self.silent.destroy_node()
        rclpy.try_shutdown(context=self.context)

    def __enter__(self) -> Peer:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()
