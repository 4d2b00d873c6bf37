"""What consumers make of the verdicts that were published: until when they may have allowed motion."""

from __future__ import annotations

from irsbot_msgs_py.records import CONSUMER_TIMEOUT_S
from irsbot_msgs_py.stamps import NS_PER_S

TIMEOUT_NS = round(CONSUMER_TIMEOUT_S * NS_PER_S)


class Spoken:
    """Times of the last verdicts, steady clock."""

    def __init__(self) -> None:
        self._allowed_ns: int | None = None  # the last verdict that allowed motion
        self._ended_ns: int | None = None  # the first one after it that did not

    def note(self, allows: bool, now_ns: int) -> None:
        """Take in a verdict that has just been published. allows: True if a consumer may move the robot, also slowly
        through the command gate."""
        if allows:
            self._allowed_ns, self._ended_ns = now_ns, None
        elif self._ended_ns is None:
            self._ended_ns = now_ns

    def brakes_ns(self, now_ns: int) -> int:
        """Time from which on consumers have braked; now, if they have not yet; 0 if motion was never allowed."""
        if self._allowed_ns is None:
            return 0
        return min(self._allowed_ns + TIMEOUT_NS, now_ns if self._ended_ns is None else self._ended_ns)
