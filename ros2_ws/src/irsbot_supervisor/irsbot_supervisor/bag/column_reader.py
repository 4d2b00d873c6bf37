"""Reads the joint states of an MCAP file as columns."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Container, Iterator
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from irsbot_msgs_py.errors import CdrError
from irsbot_supervisor.bag.joint_columns import SHORTEST, ColumnDecoder, JointColumns, Times
from irsbot_supervisor.bag.mcap_reader import McapReader, Place
from irsbot_supervisor.bag.message import Message

Decoded = TypeVar("Decoded")


class Columns(NamedTuple):
    """Joint states of one topic, in the order of recording."""

    topic: str
    joints: JointColumns


def columns_in(
    reader: McapReader, decoded: Callable[[Message], Decoded], known: Container[str], joint_type: str
) -> Iterator[Decoded | Columns]:
    """Columns of the messages of `joint_type`; all others of a known type, and joint states that do not fit, one by
    one."""
    decoders: dict[int, ColumnDecoder] = defaultdict(ColumnDecoder)
    for block in reader.blocks():
        whole = reader.scan_uniform(block)
        if whole is not None:
            topic, kind = reader.topic_and_type(whole.channel)
            found = _decoded(decoders[whole.channel], whole.data, whole.log_ns) if kind == joint_type else None
            if found is not None:
                yield Columns(topic, found)
            elif kind in known:
                for message in whole.messages(topic, kind):
                    yield decoded(message)
            continue
        places = reader.scan(block)
        numbers = {place[0] for place in places}
        names = {channel: reader.topic_and_type(channel) for channel in numbers}
        taken = set()
        for channel in numbers:
            if names[channel][1] == joint_type:
                found = _gathered(decoders[channel], block, [place for place in places if place[0] == channel])
                if found is not None:
                    taken.add(channel)
                    yield Columns(names[channel][0], found)
        for channel, sequence, log_ns, publish_ns, start, end in places:
            if channel not in taken and names[channel][1] in known:
                yield decoded(Message(*names[channel], log_ns, publish_ns, sequence, block[start:end]))


def _gathered(decoder: ColumnDecoder, block: bytes, places: list[Place]) -> JointColumns | None:
    """Messages of one channel among others; None if they are few or differ in size."""
    sizes = {end - start for *_, start, end in places}
    if len(places) < SHORTEST or len(sizes) > 1:
        return None
    raw = np.frombuffer(b"".join([block[start:end] for *_, start, end in places]), np.uint8)
    return _decoded(
        decoder, raw.reshape(len(places), -1), np.array([place[2] for place in places], np.uint64).astype(np.int64)
    )


def _decoded(decoder: ColumnDecoder, raw: NDArray[np.uint8], log_ns: Times) -> JointColumns | None:
    """None if the messages have to be read one by one, which also says what is wrong with them."""
    if log_ns.min(initial=0) < 0:
        return None
    try:
        return decoder.decode(raw, log_ns)
    except CdrError:
        return None
