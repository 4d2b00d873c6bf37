"""A damaged bag into a whole one: every message that can be trusted, and a count of the others."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from irsbot_supervisor.mcap_reader import Loss, McapReader
from irsbot_supervisor.mcap_writer import MESSAGE_HEAD
from irsbot_supervisor.tape import Tape, TapeWriter, topic_of


class Salvaged(NamedTuple):
    """What came of it."""

    messages: int
    loss: Loss


def salvage(source: Path, target: Path, compression: str = "") -> Salvaged:
    """Write all that can be read of `source` as a new bag, with the topics and sequence numbers it had.

    target: a new directory, or a file with the suffix .mcap. Raises BagError when nothing can be read or written.
    """
    with Tape(source) as damaged, TapeWriter(target, compression) as whole:
        for reader in damaged.readers:
            for kept in reader.attachments:
                whole.file.attach(kept.name, kept.media_type, kept.data, kept.log_time)
            for said in reader.metadata:
                whole.file.add_metadata(said.name, said.metadata)
        for topic in damaged.topics():
            whole.channel(topic)
        for reader in damaged.readers:
            _copy(reader, whole)
        return Salvaged(whole.file.message_count, damaged.loss)


def _copy(reader: McapReader, whole: TapeWriter) -> None:
    """Chunks as they are where they hold nothing but messages of channels with the same number, else one by one."""
    ids: dict[int, int] = {}
    for block in reader.blocks():
        messages = reader.scan(block)
        if not messages:
            continue
        channels, _, log_times, _, starts, ends = zip(*messages, strict=True)
        for channel in set(channels) - ids.keys():
            ids[channel] = whole.channel(topic_of(reader, channel))
        nothing_else = sum(ends) - sum(starts) + MESSAGE_HEAD * len(messages) == len(block)
        if nothing_else and all(ids[channel] == channel for channel in set(channels)):
            whole.file.write_block(block, channels, log_times, starts)
        else:
            for channel, sequence, log_ns, publish_ns, start, end in messages:
                whole.write(ids[channel], log_ns, publish_ns, block[start:end], sequence)
