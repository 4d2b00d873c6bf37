"""Messages of an MCAP file in the order in which they were written, whatever state the file is in.

Where the summary at the end is intact, it says where the chunks are. A recorder that was killed never wrote one: then
the records are walked from the beginning, and where they do not follow one another the next chunk is searched. A chunk
is believed by its checksum. What could not be read is counted. Format: https://mcap.dev/spec
"""

from __future__ import annotations

import mmap
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from struct import Struct, error
from types import TracebackType
from typing import NamedTuple
from zlib import crc32

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Metadata, Schema, Statistics

from irsbot_supervisor.bag.mcap_writer import MAGIC, BagError
from irsbot_supervisor.bag.message import Message
from irsbot_supervisor.bag.uniform_block import UniformBlock, uniform

MAX_CHUNK_BYTES = 1 << 30  # a larger size comes from damage, not from a recorder

_PREFIX = Struct("<BQ")
_MESSAGE = Struct("<BQHIQQ")
_CHUNK = Struct("<QQQII")  # start, end, uncompressed size, checksum, length of the compression's name
_FOOTER = Struct("<BQQQI")
_LENGTH = Struct("<Q")
_PLACE = Struct("<QQ")  # offset and size of a record, as an index says it
_FIXED_LENGTHS = {Opcode.FOOTER: 20, Opcode.DATA_END: 4, Opcode.SUMMARY_OFFSET: 17}
_FIRST_PRIVATE = 0x80
_CHUNK_OPCODE = bytes([Opcode.CHUNK])
_NEXT_CHUNK = re.compile(rb"\x06.{3}[\0-\x3f]\0{4}", re.DOTALL)  # opcode, and a length below MAX_CHUNK_BYTES


class _Piece(NamedTuple):
    """A chunk, a message outside a chunk, or a stretch of unreadable bytes."""

    at: int
    size: int
    whole: bool = True


Place = tuple[int, int, int, int, int, int]
"""Place of a message in a block: channel, sequence, log and publish time, begin and end of its data."""


@dataclass
class Loss:
    """The unreadable parts of a file; complete when the messages have been iterated to the end."""

    messages: int = 0
    exact: bool = False  # the file itself says how many messages it had; else `messages` is the least
    bytes: int = 0
    places: int = 0
    cut: bool = False  # the file was never closed: data in the recorder's memory is missing

    def __bool__(self) -> bool:
        return bool(self.messages or self.places or self.cut)

    def __str__(self) -> str:
        if not self:
            return "nothing lost"
        count = f"{'' if self.exact else 'at least '}{self.messages} message(s) lost"
        if not self.exact and not self.messages:
            count = "how many messages are lost is not known"
        unread = f", {self.bytes} bytes unreadable in {self.places} place(s)" if self.places else ""
        return count + unread + (", the end is missing because the file was never closed" if self.cut else "")

    def __add__(self, other: Loss) -> Loss:
        return Loss(
            self.messages + other.messages,
            self.exact and other.exact,
            self.bytes + other.bytes,
            self.places + other.places,
            self.cut or other.cut,
        )

    def add(self, size: int) -> None:
        """Count another unreadable place of `size` bytes."""
        self.places += 1
        self.bytes += size


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
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.attachments: list[Attachment] = []
        self.metadata: list[Metadata] = []
        self.loss = Loss()
        self._stated: Statistics | None = None
        self._pieces: list[_Piece] = []
        self._tally = _Tally()
        try:
            with path.open("rb") as file:
                self._data = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        except (OSError, ValueError) as problem:  # ValueError: an empty file
            raise BagError(f"cannot read '{path}': {getattr(problem, 'strerror', None) or 'it is empty'}") from None
        try:
            intact = self._read_summary()
        except (error, IndexError):  # lengths and places that point anywhere
            intact = False
        if not intact:
            self._stated, self._pieces, self.loss = None, [], Loss()
            self._walk()
        self._structure_loss = replace(self.loss)
        if not intact:
            self._read_first_block()
        if not self.channels and not any(piece.whole for piece in self._pieces):
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

    # --- messages ----------------------------------------------------------------------------------------------

    def messages(self, wanted: Callable[[str], bool] = lambda topic: True) -> Iterator[Message]:
        """Every intact message of the wanted topics, in file order."""
        names: dict[int, tuple[str, str] | None] = {}
        for block in self.blocks():
            for channel, sequence, log_ns, publish_ns, start, end in self.scan(block):
                if channel not in names:
                    topic, kind = self.topic_and_type(channel)
                    names[channel] = (topic, kind) if wanted(topic) else None
                if (name := names[channel]) is not None:
                    yield Message(*name, log_ns, publish_ns, sequence, block[start:end])

    def topic_and_type(self, channel: int) -> tuple[str, str]:
        """The names belonging to a channel id."""
        known = self.channels[channel]
        schema = self.schemas.get(known.schema_id)
        return known.topic, schema.name if schema is not None else ""

    def blocks(self) -> Iterator[bytes]:
        """The records of each intact chunk, in file order. `loss` counts the scanned ones."""
        self.loss = replace(self._structure_loss)
        self._tally = _Tally()
        hidden = 0
        for piece in self._pieces:
            records = self._records(piece) if piece.whole else None
            if records is None:
                self.loss.add(piece.size)
                hidden += self._visible(piece)
            else:
                hidden = 0  # from here on the gap in the sequences is more accurate
                yield records
        if self._stated is not None:
            self.loss.exact = True
            self.loss.messages = self._stated.message_count - self._tally.messages
        else:
            self.loss.messages = self._tally.missed + self._tally.nameless + hidden

    def scan(self, block: bytes) -> list[Place]:
        """Places of the messages of a block. Definitions are kept; messages of channels without one are left out."""
        tally, found, latest = self._tally, [], {}
        at, end = 0, len(block)
        while at < end:
            if block[at] != Opcode.MESSAGE:
                opcode, length = _PREFIX.unpack_from(block, at)
                self._learn(opcode, block[at + _PREFIX.size : at + _PREFIX.size + length])
                at += _PREFIX.size + length
                continue
            _, length, channel, sequence, log_ns, publish_ns = _MESSAGE.unpack_from(block, at)
            start, at = at + _MESSAGE.size, at + _PREFIX.size + length
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
        """The same for a block whose messages all belong to one known channel and have one size; else None."""
        at = 0
        while at < len(block) and block[at] != Opcode.MESSAGE:
            opcode, length = _PREFIX.unpack_from(block, at)
            self._learn(opcode, block[at + _PREFIX.size : at + _PREFIX.size + length])
            at += _PREFIX.size + length
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

    def _records(self, piece: _Piece) -> bytes | None:
        """The records inside a chunk, or a message outside a chunk; None if they cannot be trusted."""
        at, end = piece.at, piece.at + piece.size
        if end > len(self._data):
            return None
        if self._data[at] == Opcode.MESSAGE:
            return self._data[at:end]
        if not self._is_chunk(at, piece.size):
            return None
        _, _, raw_size, checksum, name_size = _CHUNK.unpack_from(self._data, at + _PREFIX.size)
        body = at + _PREFIX.size + _CHUNK.size + name_size
        compression, raw = self._data[body - name_size : body], self._data[body + _LENGTH.size : end]
        try:
            if compression == b"zstd":
                raw = zstandard.decompress(raw, raw_size)
            elif compression == b"lz4":
                raw = lz4.frame.decompress(raw)
        except (zstandard.ZstdError, RuntimeError, MemoryError):  # lz4 raises RuntimeError
            return None
        if checksum:
            return raw if crc32(raw) == checksum else None
        return raw if len(raw) == raw_size and _count_messages(raw) is not None else None

    def _visible(self, piece: _Piece) -> int:
        """Messages that can still be seen in an unreadable stretch, if it is a chunk without compression."""
        if self._data[piece.at : piece.at + 1] != _CHUNK_OPCODE:
            return 0
        start = piece.at + _PREFIX.size + _CHUNK.size + _LENGTH.size
        return _count_messages(self._data[start : piece.at + piece.size], partial=True) or 0

    # --- structure ---------------------------------------------------------------------------------------------

    def _read_summary(self) -> bool:
        """Read the structure from the summary, if the file was closed and its summary is intact and complete."""
        data, footer = self._data, len(self._data) - len(MAGIC) - _FOOTER.size
        if footer < len(MAGIC) or data[footer + _FOOTER.size :] != MAGIC:
            return False
        opcode, length, start, _, checksum = _FOOTER.unpack_from(data, footer)
        if opcode != Opcode.FOOTER or length != _FIXED_LENGTHS[opcode] or not len(MAGIC) <= start < footer:
            return False
        if checksum and crc32(data[start : footer + _FOOTER.size - 4]) != checksum:
            return False
        place = start
        while place < footer:
            opcode, length = _PREFIX.unpack_from(data, place)
            body = data[place + _PREFIX.size : place + _PREFIX.size + length]
            if opcode == Opcode.CHUNK_INDEX:
                self._pieces.append(_Piece(*_PLACE.unpack_from(body, 16)))
            elif opcode in (Opcode.ATTACHMENT_INDEX, Opcode.METADATA_INDEX):
                at, size = _PLACE.unpack_from(body)
                if not self._learn(data[at], data[at + _PREFIX.size : at + size]):
                    self.loss.add(size)
            else:
                self._learn(opcode, body)
            place += _PREFIX.size + length
        self._pieces.sort()
        return self._stated is not None and bool(self._stated.message_count) == bool(self._pieces)

    def _walk(self) -> None:
        """Find the structure record by record, and after damage by searching for the next chunk."""
        data, end = self._data, len(self._data)
        at = len(MAGIC) if data[: len(MAGIC)] == MAGIC else 0
        self.loss.cut = True
        while at < end:
            size = self._record_size(at)
            opcode = data[at]
            if size and opcode in (Opcode.CHUNK, Opcode.MESSAGE):
                self._pieces.append(_Piece(at, size))
            elif size and opcode in (Opcode.DATA_END, Opcode.FOOTER):
                self.loss.cut = False
                return
            elif not (size and self._learn(opcode, data[at + _PREFIX.size : at + size])):
                found = _NEXT_CHUNK.search(data, at + 1)
                while found and not self._is_chunk(found.start()):
                    found = _NEXT_CHUNK.search(data, found.start() + 1)
                size = (found.start() if found else end) - at
                self._pieces.append(_Piece(at, size, whole=False))
            at += size

    def _read_first_block(self) -> None:
        """Read names and types from the first chunk: its checksum protects them; the copies outside chunks have
        none."""
        self.scan(next(self.blocks(), b""))

    def _record_size(self, at: int) -> int:
        """Size of the record that begins here, 0 if there is none."""
        end = len(self._data)
        if at + _PREFIX.size > end:
            return 0
        opcode, length = _PREFIX.unpack_from(self._data, at)
        size: int = _PREFIX.size + length
        if at + size > end:
            return 0
        if opcode == Opcode.CHUNK:
            plausible = self._is_chunk(at)
        elif opcode == Opcode.MESSAGE and size < _MESSAGE.size:
            plausible = False
        elif opcode in _FIXED_LENGTHS:
            plausible = length == _FIXED_LENGTHS[opcode]
        else:
            plausible = _may_be_opcode(opcode) and (at + size == end or _may_be_opcode(self._data[at + size]))
        return size if plausible else 0

    def _is_chunk(self, at: int, size: int | None = None) -> bool:
        """True if the lengths inside a chunk agree with its own length (and with the size it should have)."""
        if at + _PREFIX.size + _CHUNK.size > len(self._data):
            return False
        opcode, length = _PREFIX.unpack_from(self._data, at)
        _, _, raw_size, _, name_size = _CHUNK.unpack_from(self._data, at + _PREFIX.size)
        head = _CHUNK.size + name_size
        body = at + _PREFIX.size + head
        return (
            opcode == Opcode.CHUNK
            and name_size <= len("zstd")
            and raw_size <= MAX_CHUNK_BYTES
            and head + _LENGTH.size <= length <= len(self._data) - at - _PREFIX.size
            and size in (None, _PREFIX.size + length)
            and length == head + _LENGTH.size + _LENGTH.unpack_from(self._data, body)[0]
        )

    def _learn(self, opcode: int, body: bytes) -> bool:
        """Store the content of a record other than a chunk. False if the content is invalid."""
        stream = ReadDataStream(BytesIO(body))
        try:
            if opcode == Opcode.SCHEMA:
                schema = Schema.read(stream)
                self.schemas[schema.id] = schema
            elif opcode == Opcode.CHANNEL:
                channel = Channel.read(stream)
                self.channels[channel.id] = channel
            elif opcode == Opcode.ATTACHMENT:
                if crc32(body[:-4]) != int.from_bytes(body[-4:], "little"):
                    return False
                self.attachments.append(Attachment.read(stream))
            elif opcode == Opcode.METADATA:
                self.metadata.append(Metadata.read(stream))
            elif opcode == Opcode.STATISTICS:
                self._stated = Statistics.read(stream)
        except (McapError, UnicodeDecodeError, error):
            return False
        return True


def _may_be_opcode(value: int) -> bool:
    return Opcode.HEADER <= value <= Opcode.DATA_END or value >= _FIRST_PRIVATE


def _count_messages(records: bytes, partial: bool = False) -> int | None:
    """Number of messages among the records of a chunk; None if the records do not follow one another to its end.

    partial: count the visible ones, the truncated one included.
    """
    count = place = 0
    while place < len(records):
        known = records[place] in (Opcode.MESSAGE, Opcode.CHANNEL, Opcode.SCHEMA)
        if not known or place + _PREFIX.size > len(records):
            return count if partial else None
        opcode, length = _PREFIX.unpack_from(records, place)
        if opcode == Opcode.MESSAGE:
            if _PREFIX.size + length < _MESSAGE.size:
                return count if partial else None
            count += 1
        place += _PREFIX.size + length
    return count if partial or place == len(records) else None
