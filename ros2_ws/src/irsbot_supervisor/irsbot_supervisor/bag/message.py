"""One message of a bag."""

from __future__ import annotations

from typing import NamedTuple


class Message(NamedTuple):
    """One message as it was recorded."""

    topic: str
    type: str
    log_ns: int
    publish_ns: int
    sequence: int
    data: bytes
