"""Keeps the last seconds before every stop, so that no file grows all day. Pure: values in, values out."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from irsbot_msgs_py.cdr import decode_verdict
from irsbot_msgs_py.errors import CdrError
from irsbot_msgs_py.records import Level


class Kept(NamedTuple):
    """A message that waits to be written. log_ns: time of reception, ROS clock."""

    log_ns: int
    publish_ns: int
    channel: int
    data: bytes


RECORD_BYTES = 200
"""Memory of a `Kept` besides its data: the tuple, two times, the head of the data and the place in the queue."""


class BlackBox:
    """Keeps messages until a stop asks for them; bounded in time and in memory."""

    def __init__(self, keep_ns: int, after_ns: int, keep_bytes: int) -> None:
        """keep_ns: time to keep before a stop; after_ns: time to write after it; keep_bytes: most memory of the kept
        messages."""
        self.overflowed = 0  # messages younger than keep_ns that had to go
        self._keep_ns, self._after_ns, self._keep_bytes = keep_ns, after_ns, keep_bytes
        self._held: deque[Kept] = deque()
        self._bytes = 0
        self._open_until_ns: int | None = None

    def pass_on(self, message: Kept) -> list[Kept]:
        """Messages to write after the arrival of this message: none, or the message itself soon after a stop."""
        if self._open_until_ns is not None and message.log_ns <= self._open_until_ns:
            return [message]
        self._open_until_ns = None
        self._held.append(message)
        self._bytes += RECORD_BYTES + len(message.data)
        oldest_ns = message.log_ns - self._keep_ns
        while self._held and (self._held[0].log_ns < oldest_ns or self._bytes > self._keep_bytes):
            gone = self._held.popleft()
            self._bytes -= RECORD_BYTES + len(gone.data)
            self.overflowed += gone.log_ns >= oldest_ns
        return []

    def stop(self, log_ns: int) -> list[Kept]:
        """Messages to write because of a stop: all kept messages. For `after_ns`, later messages pass."""
        self._open_until_ns = log_ns + self._after_ns
        held = list(self._held)
        self._held.clear()
        self._bytes = 0
        return held


class StopWatch:
    """Recognises stops among serialised verdicts."""

    def __init__(self) -> None:
        self._level: Level | None = None
        self._event = 0
        self._bypassed = False

    def is_new_stop(self, verdict: bytes) -> bool:
        """True if this verdict begins a stop, or the bypass of one. An unreadable verdict counts as a stop: the
        messages before it are of interest.

        The first verdict of a supervisor is UNKNOWN; it does not count as a stop.
        """
        try:
            now = decode_verdict(verdict)
        except CdrError:
            return True
        rose = self._level is not None and self._level < Level.STOP <= now.level
        new = rose or (now.level >= Level.STOP and now.event > self._event)
        new = new or (bool(now.bypassed) and not self._bypassed)
        self._level, self._event, self._bypassed = now.level, now.event, bool(now.bypassed)
        return new
