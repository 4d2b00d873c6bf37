"""Status of the command gate for a command: the record of GateStatus.msg."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

from irsbot_msgs_py.records import Cause


class GateCommand(IntEnum):
    """Kind of the command."""

    NONE = 0
    VELOCITY = 1
    TRAJECTORY = 2


class GateOutcome(IntEnum):
    """Result of the command; GateStatus.msg explains each value."""

    PASSED = 0
    SLOWED = 1
    LIMITED = 2
    SHORTENED = 3
    HELD = 4


class GateReason(IntEnum):
    """Reason of the result; GateStatus.msg explains each value."""

    NONE = 0
    INACTIVE = 1
    NO_COMMAND = 2
    CANCELLED = 3
    INVALID = 4
    UNKNOWN = 5
    STOP = 6
    SPEED = 7
    LIMIT = 8
    STOPPING = 9
    JOINING = 10
    INTERNAL = 11


class GateStatus(NamedTuple):
    """The fields are those of GateStatus.msg."""

    stamp_ns: int
    command: GateCommand
    outcome: GateOutcome
    reason: GateReason
    cause: Cause
    share: float
    text: str
