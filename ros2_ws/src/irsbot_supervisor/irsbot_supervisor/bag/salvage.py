"""Copies a damaged bag into an intact one: every message that can be trusted, and the number of lost ones."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from irsbot_supervisor.bag.bag import Bag, topic_of
from irsbot_supervisor.bag.bag_writer import BagWriter
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.bag.loss import Loss
from irsbot_supervisor.bag.mcap_layout import MESSAGE
from irsbot_supervisor.bag.mcap_reader import McapReader


class Salvaged(NamedTuple):
    """Result of a salvage."""

    messages: int
    loss: Loss


def salvage(source: Path, target: Path, compression: str = "") -> Salvaged:
    """Write all readable messages of `source` to a new bag, with their topics, encodings and sequence numbers.

    target: a new directory, or a file with the suffix .mcap; after an error or an interruption its end is missing, as
    if its recorder had been killed. Raises BagError if nothing can be read or written.
    """
    with Bag(source) as damaged:
        readers = [reader for reader in damaged.readers if isinstance(reader, McapReader)]
        if len(readers) < len(damaged.readers):
            raise BagError(
                f"'{source}' holds no MCAP files: others cannot be salvaged, only read as far as they are whole"
            )
        return _salvage(damaged, readers, target, compression)


def _salvage(damaged: Bag, readers: list[McapReader], target: Path, compression: str) -> Salvaged:
    with BagWriter(target, compression) as whole:
        for reader in readers:
            for kept in reader.attachments:
                whole.file.attach(kept.name, kept.media_type, kept.data, kept.log_time)
            for stated in reader.metadata:
                whole.file.add_metadata(stated.name, stated.metadata)
            for channel in reader.channels:
                whole.channel(topic_of(reader, channel))
        for reader in readers:
            _copy(reader, whole)
        return Salvaged(whole.file.message_count, damaged.loss)


def _copy(reader: McapReader, whole: BagWriter) -> None:
    """Copy chunks unchanged if all their messages are of channels with the same number, else message by message."""
    ids: dict[int, int] = {}
    for block in reader.blocks():
        messages = reader.scan(block)
        if not messages:
            continue
        channels, _, log_times, _, starts, ends = zip(*messages, strict=True)
        for channel in set(channels) - ids.keys():
            ids[channel] = whole.channel(topic_of(reader, channel))
        nothing_else = sum(ends) - sum(starts) + MESSAGE.size * len(messages) == len(block)
        if nothing_else and all(ids[channel] == channel for channel in set(channels)):
            whole.file.write_block(block, channels, log_times, starts)
        else:
            for channel, sequence, log_ns, publish_ns, start, end in messages:
                whole.write(ids[channel], log_ns, publish_ns, block[start:end], sequence)
