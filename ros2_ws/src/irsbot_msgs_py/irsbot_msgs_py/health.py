"""Plain twin of RecorderHealth.msg."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple


class RecorderState(IntEnum):
    """What the recorder is doing; RecorderHealth.msg explains each."""

    RECORDING = 0
    DISK_FULL = 1
    WRITE_ERROR = 2
    STOPPED = 3


class RecorderHealth(NamedTuple):
    """How the recorder is doing; the fields are those of RecorderHealth.msg, where their units stand."""

    stamp_ns: int
    state: RecorderState
    file: str
    messages_written: int
    messages_dropped: int
    bytes_written: int
    bytes_free: int
    write_time_max: float
    text: str
