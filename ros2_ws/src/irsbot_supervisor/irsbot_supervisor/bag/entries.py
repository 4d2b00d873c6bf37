"""Records of a bag: joint samples, states, verdicts and texts, and their messages."""

from __future__ import annotations

from typing import Any, NamedTuple

import zstandard

from irsbot_msgs_py import cdr
from irsbot_msgs_py.errors import CdrError
from irsbot_msgs_py.records import JointSample, SingularityState, Verdict
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.bag.message import Message
from irsbot_supervisor.bag.topics import JOINT_STATE, STATE, STRING, VERDICT

Record = JointSample | SingularityState | Verdict | str
"""What the supervisor reads from a bag, and writes. A text is an entry of the journal."""

LATCHED = {VERDICT, STRING}
"""Types of the topics that are offered transient local."""

ENCODERS: dict[type, tuple[str, Any]] = {
    JointSample: (JOINT_STATE, cdr.encode_joint_state),
    SingularityState: (STATE, cdr.encode_state),
    Verdict: (VERDICT, cdr.encode_verdict),
    str: (STRING, cdr.encode_string),
}
"""Message type and encoder of each kind of record."""

DECODERS: dict[str, Any] = {
    JOINT_STATE: lambda message: cdr.decode_joint_state(message.data, message.log_ns, message.log_ns),
    STATE: lambda message: cdr.decode_state(message.data),
    VERDICT: lambda message: cdr.decode_verdict(message.data),
    STRING: lambda message: cdr.decode_string(message.data),
}
"""Decoder of a `Message` by its type; types that are not here are skipped."""


_ZSTD = bytes.fromhex("28b52ffd")
"""Begin of compressed data."""


class Entry(NamedTuple):
    """One record of a bag. log_ns: time of reception by the recorder, ROS clock."""

    topic: str
    log_ns: int
    record: Record


def entry_of(message: Message) -> Entry:
    """The record of a message whose type is in `DECODERS`. Both receive times of a joint sample are its log time. Data
    that were compressed one by one are unpacked: without metadata.yaml the bag does not say it.
    Raises BagError if the bytes are not of that type, and for a log time that has no sign to spare."""
    if not 0 <= message.log_ns < 2**63:
        raise BagError(f"{message.topic}: a log time is {message.log_ns % 2**64} ns, must be below 2**63 ns")
    try:
        if message.data.startswith(_ZSTD):  # CDR begins with another number
            message = message._replace(data=zstandard.decompress(message.data))
        return Entry(message.topic, message.log_ns, DECODERS[message.type](message))
    except (CdrError, zstandard.ZstdError) as error:
        raise BagError(f"{message.topic} at {message.log_ns} ns: {error}") from None
