"""Listens to one suite for `irsbot monitor`, in a terminal and as a page. Needs ROS."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from irsbot_msgs.msg import SingularityState as StateMessage
from irsbot_msgs.msg import Verdict as VerdictMessage
from rclpy.serialization import deserialize_message
from std_msgs.msg import String

from irsbot_msgs_py.cdr import VerdictReader
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.processes.listener import LATCHED
from irsbot_supervisor.processes.observed import Observed, Seen
from irsbot_supervisor.processes.polling import NEWEST, Polling, taken

TAKE_S = 0.05
"""s within which `NEWEST` overflows for no robot: 200 messages at 4 kHz."""


class Monitor(Polling):
    """Hears states, verdicts and the journal."""

    def __init__(self, domain: int = 0, namespace: str = "", name: str = "monitor") -> None:
        super().__init__(domain, namespace, name)
        self._seen, self._verdicts = Observed(), VerdictReader()
        self._sources: list[tuple[Any, Callable[[list[bytes], list[float]], None]]] = [
            (self.listen(kind, f"supervisor/{topic}", quality), hear)
            for kind, topic, quality, hear in (
                (String, "journal", LATCHED, self._on_journal),
                (StateMessage, "state", NEWEST, self._seen.hear_states),
                (VerdictMessage, "verdict", NEWEST, self._on_verdicts),
            )
        ]

    def look(self, seconds: float) -> Seen:
        """Wait for this time, then return the state of the suite. No message is missed meanwhile."""
        deadline = time.monotonic() + seconds
        while (left_s := deadline - time.monotonic()) > TAKE_S:
            time.sleep(TAKE_S)
            self.take()
        time.sleep(max(left_s, 0.0))
        return self.take()

    def take(self) -> Seen:
        """Take all messages that have arrived, then return the state of the suite."""
        now_s = time.monotonic()
        ahead_s = now_s - time.time_ns() / NS_PER_S  # of the system clock, once: messages are many
        for subscription, hear in self._sources:
            found = list(taken(subscription))
            times = [min(ahead_s + arrived_ns / NS_PER_S, now_s) for _data, arrived_ns in found]
            hear([data for data, _arrived_ns in found], times)
        return self._seen.look(time.monotonic())

    def _on_verdicts(self, found: list[bytes], times_s: list[float]) -> None:
        for data, now_s in zip(found, times_s, strict=True):
            self._seen.hear_verdict(self._verdicts.read(data), now_s)

    def _on_journal(self, found: list[bytes], _times_s: list[float]) -> None:
        for data in found:
            self._seen.hear_journal(deserialize_message(data, String).data)
