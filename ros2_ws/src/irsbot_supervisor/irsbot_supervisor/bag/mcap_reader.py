"""Messages of an MCAP file in the order in which they were written, whatever state the file is in.

`mcap_index` finds the chunks. A chunk is trusted if its checksum is right. What could not be read is counted.
"""

from __future__ import annotations

import mmap
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from zlib import crc32

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.opcode import Opcode

from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.bag.mcap_index import McapIndex, Piece
from irsbot_supervisor.bag.mcap_layout import CHUNK, CHUNK_OPCODE, LENGTH, MESSAGE, PREFIX, count_messages
from irsbot_supervisor.bag.message import Message
from irsbot_supervisor.bag.uniform_block import UniformBlock, uniform

Place = tuple[int, int, int, int, int, int]
"""Place of a message in a block: channel, sequence, log and publish time, begin and end of its data."""


class _Tally:
    """Counts of the scan, from which the number of missing messages follows."""

    def __init__(self) -> None:
        self.messages = 0
        self.missed = 0  # by a gap in the sequence of a channel that has damage inside
        self.nameless = 0  # of a channel whose record is lost
        self.last: dict[int, tuple[int, int]] = {}  # by channel: sequence, and how many damaged places were before it


class McapReader:
    """An open file: iterate `messages()`, or `blocks()` and `scan()`; then look at `loss`."""

    def __init__(self, path: Path) -> None:
        """Open the file and find its chunks. Raises BagError for a file that is not MCAP."""
        self.path = path
        self._tally = _Tally()
        try:
            with path.open("rb") as file:
                self._data = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        except (OSError, ValueError) as problem:  # ValueError: an empty file
            raise BagError(f"cannot read '{path}': {getattr(problem, 'strerror', None) or 'it is empty'}") from None
        self._index = index = McapIndex(self._data)
        self.schemas, self.channels = index.schemas, index.channels
        self.attachments, self.metadata = index.attachments, index.metadata
        self.loss = replace(index.loss)
        if not index.intact:  # take names and types from the first chunk: a checksum protects them there
            self.scan(next(self.blocks(), b""))
        if not self.channels and not any(piece.whole for piece in index.pieces):
            self.close()
            raise BagError(f"'{path}' is no MCAP file, or nothing in it can be read")

    def __enter__(self) -> McapReader:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Release the file."""
        self._data.close()

    def messages(self, wanted: Callable[[str], bool] = lambda topic: True) -> Iterator[Message]:
        """Every intact message in file order. wanted: says of a topic's full name whether its messages are returned."""
        names: dict[int, tuple[str, str] | None] = {}
        for block in self.blocks():
            for channel, sequence, log_ns, publish_ns, start, end in self.scan(block):
                if channel not in names:
                    topic, kind = self.topic_and_type(channel)
                    names[channel] = (topic, kind) if wanted(topic) else None
                if (name := names[channel]) is not None:
                    yield Message(*name, log_ns, publish_ns, sequence, block[start:end])

    def topic_and_type(self, channel: int) -> tuple[str, str]:
        """Topic and type of a channel id; the type is empty if its schema is lost. Raises KeyError."""
        known = self.channels[channel]
        schema = self.schemas.get(known.schema_id)
        return known.topic, schema.name if schema is not None else ""

    def blocks(self) -> Iterator[bytes]:
        """The records of each intact chunk, in file order. `loss` is complete when all blocks have been scanned."""
        self.loss = replace(self._index.loss)
        self._tally = _Tally()
        hidden = 0
        for piece in self._index.pieces:
            records = self._records(piece) if piece.whole else None
            if records is None:
                self.loss.add(piece.size)
                hidden += self._visible(piece)
            else:
                hidden = 0  # from here on the gap in the sequences is more accurate
                yield records
        if self._index.statistics is not None:
            self.loss.exact = True
            self.loss.messages = self._index.statistics.message_count - self._tally.messages
        else:
            self.loss.messages = self._tally.missed + self._tally.nameless + hidden

    def scan(self, block: bytes) -> list[Place]:
        """Places of the messages of a block of `blocks`. Definitions in it are kept; messages of channels without a
        definition are left out and counted as lost."""
        tally, found, latest = self._tally, [], {}
        at, end = 0, len(block)
        while at < end:
            if block[at] != Opcode.MESSAGE:
                opcode, length = PREFIX.unpack_from(block, at)
                self._index.learn(opcode, block[at + PREFIX.size : at + PREFIX.size + length])
                at += PREFIX.size + length
                continue
            _, length, channel, sequence, log_ns, publish_ns = MESSAGE.unpack_from(block, at)
            start, at = at + MESSAGE.size, at + PREFIX.size + length
            if channel not in latest:
                if channel not in self.channels:
                    tally.nameless += 1
                    continue
                tally.missed += self._gap(channel, sequence)
            latest[channel] = sequence
            found.append((channel, sequence, log_ns, publish_ns, start, at))
        tally.messages += len(found)
        tally.last.update((channel, (sequence, self.loss.places)) for channel, sequence in latest.items())
        return found

    def scan_uniform(self, block: bytes) -> UniformBlock | None:
        """The messages of a block as arrays, if all belong to one known channel and have one size. Otherwise None: then
        the block is to be scanned."""
        at = 0
        while at < len(block) and block[at] != Opcode.MESSAGE:
            opcode, length = PREFIX.unpack_from(block, at)
            self._index.learn(opcode, block[at + PREFIX.size : at + PREFIX.size + length])
            at += PREFIX.size + length
        found = uniform(block, at)
        if found is None or found.channel not in self.channels:
            return None
        tally, sequence = self._tally, found.sequence
        tally.missed += self._gap(found.channel, int(sequence[0]))
        tally.messages += len(sequence)
        tally.last[found.channel] = int(sequence[-1]), self.loss.places
        return found

    def _gap(self, channel: int, sequence: int) -> int:
        """Number of messages missing between the last block and this one, if the part between them is damaged."""
        before, damage = self._tally.last.get(channel, (-1, 0))
        return max(sequence - before - 1, 0) if damage < self.loss.places else 0

    def _records(self, piece: Piece) -> bytes | None:
        """The records inside a chunk, or a message outside a chunk; None if they cannot be trusted."""
        at, end = piece.at, piece.at + piece.size
        if end > len(self._data):
            return None
        if self._data[at] == Opcode.MESSAGE:
            return self._data[at:end]
        if not self._index.is_chunk(at, piece.size):
            return None
        _, _, raw_size, checksum, name_size = CHUNK.unpack_from(self._data, at + PREFIX.size)
        body = at + PREFIX.size + CHUNK.size + name_size
        compression, raw = self._data[body - name_size : body], self._data[body + LENGTH.size : end]
        try:
            if compression == b"zstd":
                raw = zstandard.decompress(raw, raw_size)
            elif compression == b"lz4":
                raw = lz4.frame.decompress(raw)
        except (zstandard.ZstdError, RuntimeError, MemoryError):  # lz4 raises RuntimeError
            return None
        if checksum:
            return raw if crc32(raw) == checksum else None
        return raw if len(raw) == raw_size and count_messages(raw) is not None else None

    def _visible(self, piece: Piece) -> int:
        """Messages that can still be seen in an unreadable stretch, if it is a chunk without compression."""
        if self._data[piece.at : piece.at + 1] != CHUNK_OPCODE:
            return 0
        start = piece.at + PREFIX.size + CHUNK.size + LENGTH.size
        return count_messages(self._data[start : piece.at + piece.size], partial=True) or 0
