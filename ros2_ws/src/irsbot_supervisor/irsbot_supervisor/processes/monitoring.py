"""Listens to one suite for `irsbot monitor`, in a terminal and as a page. Needs ROS."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from irsbot_msgs.msg import SingularityState as StateMessage
from irsbot_msgs.msg import StateSummary as SummaryMessage
from irsbot_msgs.msg import Verdict as VerdictMessage
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription
from std_msgs.msg import String

from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.processes.listener import LATCHED
from irsbot_supervisor.processes.observed import Observed, Seen
from irsbot_supervisor.processes.polling import NEWEST, Polling, taken

TAKE_S = 0.05
"""s within which `NEWEST` overflows for no robot: 200 messages at 4 kHz."""


Hear = Callable[[Sequence[bytes], Sequence[float]], None]
"""Takes in messages, as CDR, and when each came, s."""


class StateSource:
    """Where states come from: the summaries of a supervisor. States one by one where somebody publishes these alone,
    such as a player of a bag, or a supervisor of an earlier version."""

    def __init__(self, listener: Polling, seen: Observed) -> None:
        self._listener, self._seen = listener, seen
        self._summaries = listener.listen(SummaryMessage, "supervisor/summary", NEWEST)
        self._states: Subscription | None = None
        self._topic = listener.node.resolve_topic_name("supervisor/state")

    def now(self) -> tuple[Subscription, Hear]:
        """What to listen to at present."""
        alone = not self._summaries.get_publisher_count() and self._listener.node.count_publishers(self._topic) > 0
        if alone:
            if self._states is None:
                self._states = self._listener.listen(StateMessage, self._topic, NEWEST)
            return self._states, self._seen.hear_states
        if self._states is not None:
            self._listener.node.destroy_subscription(self._states)
            self._states = None
        return self._summaries, self._seen.hear_summaries


class Monitor(Polling):
    """Hears states, verdicts and the journal."""

    def __init__(self, domain: int = 0, namespace: str = "", name: str = "monitor") -> None:
        super().__init__(domain, namespace, name)
        self._seen = Observed()
        self._states = StateSource(self, self._seen)
        self._journal: tuple[Subscription, Hear] = self.listen(String, "supervisor/journal", LATCHED), self._on_journal
        self._verdicts = self.listen(VerdictMessage, "supervisor/verdict", NEWEST), self._seen.hear_verdicts

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
        for subscription, hear in (self._journal, self._states.now(), self._verdicts):
            if found := list(taken(subscription)):
                messages, arrived_ns = zip(*found, strict=True)
                hear(messages, [min(ahead_s + ns / NS_PER_S, now_s) for ns in arrived_ns])
        return self._seen.look(time.monotonic())

    def _on_journal(self, found: Sequence[bytes], _times_s: Sequence[float]) -> None:
        for data in found:
            self._seen.hear_journal(deserialize_message(data, String).data)
