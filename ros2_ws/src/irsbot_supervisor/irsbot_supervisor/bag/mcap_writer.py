"""Writes an MCAP file in small chunks and hands each chunk to the operating system as soon as it is complete.

The library `mcap` packs the rare records. Messages, chunks and their index are packed here: the library's writer takes
three times as long per message and keeps an object per chunk until the end, 60 MB per hour at 50 chunks per second.
This writer keeps no object per chunk. Format: https://mcap.dev/spec.
"""

from __future__ import annotations

import os
import tempfile
from collections import defaultdict
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from struct import Struct
from types import TracebackType
from typing import IO
from zlib import crc32

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.bag.mcap_layout import MAGIC, MESSAGE, PREFIX

CHUNK_BYTES = 64 * 1024  # a chunk stalls the writer while it is written, and is lost as a whole
CHUNK_NS = 500_000_000

_MESSAGE_FIXED = MESSAGE.size - PREFIX.size  # length of a message record without its data
_MESSAGE_INDEX = Struct("<BQHI")
_TIME_OFFSET = Struct("<QQ")
_CHUNK_HEAD = Struct("<BQQQQI")
_CHUNK_INDEX = Struct("<BQQQQQI")
_CHANNEL_OFFSET = Struct("<HQ")


class McapWriter:
    """One file of the profile "ros2". Data survives the death of the process once `flush` has returned."""

    def __init__(self, path: Path, compression: str = "") -> None:
        """Create the file, which must not exist. compression: of the chunks, "" or "zstd". Raises BagError."""
        if compression not in ("", "zstd"):
            raise BagError(f"compression is '' or 'zstd', not '{compression}'")
        self.path = path
        self.counts: dict[int, int] = defaultdict(int)  # messages by channel
        self.bytes_written = 0
        self.start_ns: int | None = None  # of the smallest and the largest log time
        self.end_ns = 0
        self._compression = compression
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._chunk = bytearray()
        self._chunk_start_ns = self._chunk_end_ns = 0
        self._chunk_count = 0
        self._message_index: dict[int, bytearray] = defaultdict(bytearray)
        self._crc = 0
        try:
            with ExitStack() as opened:
                self._file = opened.enter_context(path.open("xb", buffering=0))
                # The index of the chunks grows for as long as is written, and is needed at the end: not in memory.
                self._chunk_index = opened.enter_context(tempfile.TemporaryFile(buffering=0, dir=path.parent))
                opened.pop_all()  # `close` closes them
        except OSError as error:
            raise BagError(f"cannot write '{path}': {error.strerror}") from None
        self._put(MAGIC + _record(Header("ros2", "irsbot")))

    @property
    def message_count(self) -> int:
        """Messages written, those of the unfinished chunk included."""
        return sum(self.counts.values())

    def add_schema(self, name: str, text: str, encoding: str = "ros2msg") -> int:
        """A message type with its definition; returns its id. encoding: format of the definition."""
        data = text.encode(errors="surrogateescape")
        schema = Schema(id=len(self._schemas) + 1, name=name, encoding=encoding, data=data)
        self._define(schema)
        self._schemas.append(schema)
        return schema.id

    def add_channel(self, topic: str, schema: int, metadata: dict[str, str], encoding: str = "cdr") -> int:
        """A topic; returns the channel id that `write` takes. schema: its id; 0: none. encoding: of the messages."""
        identity = len(self._channels) + 1
        channel = Channel(id=identity, topic=topic, message_encoding=encoding, metadata=metadata, schema_id=schema)
        self._define(channel)
        self._channels.append(channel)
        return identity

    def attach(self, name: str, media_type: str, data: bytes, log_ns: int) -> None:
        """Attach a file."""
        self.flush()
        at = self.bytes_written
        self._put(_record(Attachment(log_ns, log_ns, name, media_type, data)))
        length = self.bytes_written - at
        self._attachments.append(AttachmentIndex(at, length, log_ns, log_ns, len(data), name, media_type))

    def add_metadata(self, name: str, values: dict[str, str]) -> None:
        """Write named texts."""
        self.flush()
        at = self.bytes_written
        self._put(_record(Metadata(name, values)))
        self._metadata.append(MetadataIndex(at, self.bytes_written - at, name))

    def write(self, channel: int, log_ns: int, publish_ns: int, data: bytes, sequence: int | None = None) -> None:
        """Write one message. sequence: counted per channel unless given. Raises BagError if a chunk cannot be
        written."""
        chunk = self._chunk
        if self._message_index and not (
            len(chunk) + MESSAGE.size + len(data) <= CHUNK_BYTES and 0 <= log_ns - self._chunk_start_ns < CHUNK_NS
        ):
            self.flush()
        if not self._message_index:
            self._chunk_start_ns = self._chunk_end_ns = log_ns
        elif log_ns > self._chunk_end_ns:
            self._chunk_end_ns = log_ns
        count = self.counts[channel]
        number = (count if sequence is None else sequence) & 0xFFFFFFFF
        self._message_index[channel] += _TIME_OFFSET.pack(log_ns, len(chunk))
        chunk += MESSAGE.pack(Opcode.MESSAGE, _MESSAGE_FIXED + len(data), channel, number, log_ns, publish_ns)
        chunk += data
        self.counts[channel] = count + 1

    def write_block(
        self, block: bytes, channels: Sequence[int], log_times: Sequence[int], data_starts: Sequence[int]
    ) -> None:
        """Write a chunk made elsewhere, of messages of known channels; places: begin of the data of each message."""
        self.flush()
        at = len(self._chunk)
        self._chunk += block
        for channel, log_ns, start in zip(channels, log_times, data_starts, strict=True):
            self._message_index[channel] += _TIME_OFFSET.pack(log_ns, at + start - MESSAGE.size)
            self.counts[channel] += 1
        self._chunk_start_ns, self._chunk_end_ns = min(log_times), max(log_times)
        self.flush()

    def flush(self) -> None:
        """Complete the chunk and hand it to the operating system. Raises BagError; the file stays consistent."""
        if not self._message_index:
            return
        raw = bytes(self._chunk)
        packed = zstandard.compress(raw) if self._compression else raw
        name = self._compression.encode()
        span = (self._chunk_start_ns, self._chunk_end_ns)
        head = _CHUNK_HEAD.pack(Opcode.CHUNK, 40 + len(name) + len(packed), *span, len(raw), crc32(raw))
        chunk = b"".join((head, _prefixed(name), len(packed).to_bytes(8, "little"), packed))

        offsets, index = bytearray(), bytearray()
        for channel, entries in self._message_index.items():
            offsets += _CHANNEL_OFFSET.pack(channel, self.bytes_written + len(chunk) + len(index))
            index += _MESSAGE_INDEX.pack(Opcode.MESSAGE_INDEX, 6 + len(entries), channel, len(entries)) + entries
        place = (self.bytes_written, len(chunk), len(offsets))
        tail = Struct(f"<Q{4 + len(name)}sQQ").pack(len(index), _prefixed(name), len(packed), len(raw))
        entry = _CHUNK_INDEX.pack(Opcode.CHUNK_INDEX, 36 + len(offsets) + len(tail), *span, *place) + offsets + tail

        held = {channel: len(entries) // _TIME_OFFSET.size for channel, entries in self._message_index.items()}
        self._chunk.clear()
        self._message_index.clear()
        indexed = self._chunk_index.tell()
        try:
            _write(self._chunk_index, entry)
            self._put(chunk + index)
        except (OSError, BagError) as error:
            self._chunk_index.seek(indexed)
            self._chunk_index.truncate()
            for channel, count in held.items():
                self.counts[channel] -= count
            raise BagError(f"{error}; {sum(held.values())} messages lost") from None
        self._chunk_count += 1
        self.start_ns = span[0] if self.start_ns is None else min(self.start_ns, span[0])
        self.end_ns = max(self.end_ns, span[1])

    def close(self) -> None:
        """Write the last chunk and the summary, and close. Raises BagError; the data written so far stays readable."""
        if self._file.closed:
            return
        try:
            self.flush()
            self._put(_record(DataEnd(self._crc)))
            self._summary()
        finally:
            self._chunk_index.close()
            self._file.close()

    def abandon(self) -> None:
        """Close the file without its end, as if the process had been killed: what was flushed stays readable."""
        self._chunk_index.close()
        self._file.close()

    def __enter__(self) -> McapWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        else:
            self.abandon()

    def _define(self, record: McapRecord) -> None:
        """Write a definition on its own, and again in the next chunk, whose checksum protects it; the summary repeats
        it."""
        self._put(_record(record))
        self._chunk += _record(record)

    def _summary(self) -> None:
        start = self.bytes_written
        statistics = Statistics(
            message_count=self.message_count,
            schema_count=len(self._schemas),
            channel_count=len(self._channels),
            attachment_count=len(self._attachments),
            metadata_count=len(self._metadata),
            chunk_count=self._chunk_count,
            message_start_time=self.start_ns or 0,
            message_end_time=self.end_ns,
            channel_message_counts=dict(self.counts),
        )
        self._crc = 0  # from here on that of the summary
        groups: list[SummaryOffset] = []
        self._group(groups, Opcode.SCHEMA, self._schemas)
        self._group(groups, Opcode.CHANNEL, self._channels)
        self._group(groups, Opcode.STATISTICS, [statistics])
        at = self.bytes_written
        self._chunk_index.seek(0)
        while block := self._chunk_index.read(CHUNK_BYTES):
            self._put(block)
        groups.append(SummaryOffset(Opcode.CHUNK_INDEX, at, self.bytes_written - at))
        self._group(groups, Opcode.ATTACHMENT_INDEX, self._attachments)
        self._group(groups, Opcode.METADATA_INDEX, self._metadata)
        offsets = self.bytes_written
        for group in groups:
            if group.group_length:
                self._put(_record(group))
        unchecked = _record(Footer(start, offsets, 0))[:-4]
        self._put(unchecked + crc32(unchecked, self._crc).to_bytes(4, "little") + MAGIC)

    def _group(self, groups: list[SummaryOffset], opcode: Opcode, records: Sequence[McapRecord]) -> None:
        at = self.bytes_written
        for record in records:
            self._put(_record(record))
        groups.append(SummaryOffset(opcode, at, self.bytes_written - at))

    def _put(self, data: bytes) -> None:
        """Write a whole record or nothing: a record that does not fit is removed again."""
        try:
            _write(self._file, data)
        except OSError as error:
            self._file.seek(self.bytes_written)
            os.ftruncate(self._file.fileno(), self.bytes_written)
            raise BagError(f"cannot write '{self.path}': {error.strerror}") from None
        self._crc = crc32(data, self._crc)
        self.bytes_written += len(data)


def _write(file: IO[bytes], data: bytes) -> None:
    """Write all bytes; an unbuffered file may take only a part at once."""
    rest = memoryview(data)
    while rest:
        rest = rest[file.write(rest) :]


def _record(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]


def _prefixed(text: bytes) -> bytes:
    return len(text).to_bytes(4, "little") + text
