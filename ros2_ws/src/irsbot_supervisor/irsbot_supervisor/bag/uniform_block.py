"""Blocks whose messages all belong to one channel and have one size: read at once, without a step for each message."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from irsbot_supervisor.bag.message import Message

_HEAD = [
    ("opcode", "u1"),
    ("length", "<u8"),
    ("channel", "<u2"),
    ("sequence", "<u4"),
    ("log", "<u8"),
    ("publish", "<u8"),
]


class UniformBlock(NamedTuple):
    """Messages of one channel."""

    channel: int
    sequence: NDArray[Any]  # (N,)
    log_ns: NDArray[np.int64]  # (N,)
    publish_ns: NDArray[Any]  # (N,)
    data: NDArray[np.uint8]  # (N, bytes)

    def messages(self, topic: str, kind: str) -> Iterator[Message]:
        """The same one by one."""
        columns = (column.tolist() for column in (self.log_ns, self.publish_ns, self.sequence))
        for log_ns, publish_ns, sequence, data in zip(*columns, self.data, strict=True):
            yield Message(topic, kind, log_ns, publish_ns, sequence, data.tobytes())


def uniform(block: bytes, at: int) -> UniformBlock | None:
    """The messages from byte `at` to the end of a block; None if they differ in channel or size."""
    head = np.dtype(_HEAD)
    if at + head.itemsize > len(block):
        return None
    length = int(np.frombuffer(block, head, 1, at)["length"][0])
    stride = length + head["opcode"].itemsize + head["length"].itemsize
    if stride < head.itemsize or (len(block) - at) % stride:
        return None
    found = np.frombuffer(block, np.dtype([*_HEAD, ("data", "u1", (stride - head.itemsize,))]), offset=at)
    channel = found["channel"][0]
    alike = (found["opcode"] == Opcode.MESSAGE) & (found["length"] == length) & (found["channel"] == channel)
    if not alike.all():
        return None
    return UniformBlock(int(channel), found["sequence"], found["log"].astype(np.int64), found["publish"], found["data"])
