"""Plain twin of RecorderHealth.msg."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple


class RecorderState(IntEnum):
    """State of the recorder; RecorderHealth.msg explains each value."""

    RECORDING = 0
    DISK_FULL = 1
    WRITE_ERROR = 2
    STOPPED = 3


class RecorderHealth(NamedTuple):
    """Health of the recorder, with the fields of RecorderHealth.msg, which states their units."""

    stamp_ns: int
    state: RecorderState
    file: str
    messages_written: int
    messages_dropped: int
    bytes_written: int
    bytes_free: int
    write_time_max: float
    text: str
