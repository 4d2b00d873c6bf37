"""A live look at a running suite: its first state and its verdicts, for the timeline of the demo, and resets. Needs
ROS."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

import rclpy
from irsbot_msgs.msg import SingularityState as StateMessage
from irsbot_msgs.msg import Verdict as VerdictMessage
from irsbot_msgs.srv import ResetStop
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from irsbot_msgs_py.cdr import decode_state, decode_verdict
from irsbot_msgs_py.process.fastdds import choose_transport
from irsbot_msgs_py.records import SingularityState, Verdict
from irsbot_supervisor.processes.asking import Asking

STATES_DEPTH = 1000
"""A second of states at 1 kHz: the first one must not be lost while this process waits for a processor."""

LATCHED = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Watch:
    """Listens to one supervisor. Close it, or use it as a context manager."""

    def __init__(
        self,
        domain: int,
        on_verdict: Callable[[Verdict], None],
        on_first_state: Callable[[SingularityState], None] = lambda state: None,
    ) -> None:
        """on_first_state: called once, with the first state."""
        choose_transport(os.environ, rclpy.get_rmw_implementation_identifier())
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain)
        self.node = rclpy.create_node("demo_watch", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self.node.create_subscription(
            VerdictMessage, "supervisor/verdict", lambda data: on_verdict(decode_verdict(data)), LATCHED, raw=True
        )
        self._resets = self.node.create_client(ResetStop, "supervisor/reset")
        self._asking: Asking | None = None  # for the last reset
        self._on_first_state = on_first_state
        self._states: Any = self.node.create_subscription(
            StateMessage, "supervisor/state", self._on_state, STATES_DEPTH, raw=True
        )

    def look(self, seconds: float) -> None:
        """Wait for the next verdict, at most for this time."""
        self._executor.spin_once(timeout_sec=seconds)

    def reset(self, event: int, operator_text: str) -> bool:
        """Request a reset of a stop; True if that was possible: the service is there, and no answer is due."""
        if not self._resets.service_is_ready() or not (self._asking is None or self._asking.answered()):
            return False
        self._asking = Asking(self._resets, ResetStop.Request(event=event, operator_text=operator_text))
        self._asking.answered()
        return True

    def _on_state(self, data: bytes) -> None:
        if self._states is not None:
            self.node.destroy_subscription(self._states)
            self._states = None
            self._on_first_state(decode_state(data))

    def close(self) -> None:
        """Leave the domain."""
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def __enter__(self) -> Watch:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()
