"""Finds the chunks and definitions of an MCAP file, whatever state the file is in.

Where the summary at the end is intact, it says where the chunks are. A recorder that was killed never wrote one: then
the records are walked from the beginning, and where they do not follow one another the next chunk is searched.
"""

from __future__ import annotations

import re
from io import BytesIO
from mmap import mmap
from struct import Struct, error
from typing import NamedTuple
from zlib import crc32

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Metadata, Schema, Statistics

from irsbot_supervisor.bag.loss import Loss
from irsbot_supervisor.bag.mcap_layout import CHUNK, LENGTH, MAGIC, MAX_CHUNK_BYTES, MESSAGE, PREFIX

_FOOTER = Struct("<BQQQI")
_PLACE = Struct("<QQ")  # offset and size of a record, as an index says it
_FIXED_LENGTHS = {Opcode.FOOTER: 20, Opcode.DATA_END: 4, Opcode.SUMMARY_OFFSET: 17}
_FIRST_PRIVATE = 0x80
_NEXT_CHUNK = re.compile(rb"\x06.{3}[\0-\x3f]\0{4}", re.DOTALL)  # opcode, and a length below MAX_CHUNK_BYTES


class Piece(NamedTuple):
    """A chunk, a message outside a chunk, or, if not `whole`, unreadable bytes. at, size: bytes of the file."""

    at: int
    size: int
    whole: bool = True


class McapIndex:
    """Definitions and places of the messages of a file. `loss` counts the damage outside of chunks."""

    def __init__(self, data: mmap) -> None:
        """data: the whole file. Reads the summary, or the structure of all records if there is no intact one."""
        self._data = data
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.attachments: list[Attachment] = []
        self.metadata: list[Metadata] = []
        self.statistics: Statistics | None = None
        self.pieces: list[Piece] = []
        self.loss = Loss()
        try:
            self.intact = self._read_summary()
        except (error, IndexError):  # lengths and places that point anywhere
            self.intact = False
        if not self.intact:
            self.statistics, self.pieces, self.loss = None, [], Loss()
            self._walk()

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
            opcode, length = PREFIX.unpack_from(data, place)
            body = data[place + PREFIX.size : place + PREFIX.size + length]
            if opcode == Opcode.CHUNK_INDEX:
                self.pieces.append(Piece(*_PLACE.unpack_from(body, 16)))
            elif opcode in (Opcode.ATTACHMENT_INDEX, Opcode.METADATA_INDEX):
                at, size = _PLACE.unpack_from(body)
                if not self.learn(data[at], data[at + PREFIX.size : at + size]):
                    self.loss.add(size)
            else:
                self.learn(opcode, body)
            place += PREFIX.size + length
        self.pieces.sort()
        return self.statistics is not None and bool(self.statistics.message_count) == bool(self.pieces)

    def _walk(self) -> None:
        """Find the structure record by record, and after damage by searching for the next chunk."""
        data, end = self._data, len(self._data)
        at = len(MAGIC) if data[: len(MAGIC)] == MAGIC else 0
        self.loss.cut = True
        while at < end:
            size = self._record_size(at)
            opcode = data[at]
            if size and opcode in (Opcode.CHUNK, Opcode.MESSAGE):
                self.pieces.append(Piece(at, size))
            elif size and opcode in (Opcode.DATA_END, Opcode.FOOTER):
                self.loss.cut = False
                return
            elif not (size and self.learn(opcode, data[at + PREFIX.size : at + size])):
                found = _NEXT_CHUNK.search(data, at + 1)
                while found and not self.is_chunk(found.start()):
                    found = _NEXT_CHUNK.search(data, found.start() + 1)
                size = (found.start() if found else end) - at
                self.pieces.append(Piece(at, size, whole=False))
            at += size

    def _record_size(self, at: int) -> int:
        """Size of the record that begins here, 0 if there is none."""
        end = len(self._data)
        if at + PREFIX.size > end:
            return 0
        opcode, length = PREFIX.unpack_from(self._data, at)
        size: int = PREFIX.size + length
        if at + size > end:
            return 0
        if opcode == Opcode.CHUNK:
            plausible = self.is_chunk(at)
        elif opcode == Opcode.MESSAGE and size < MESSAGE.size:
            plausible = False
        elif opcode in _FIXED_LENGTHS:
            plausible = length == _FIXED_LENGTHS[opcode]
        else:
            plausible = _may_be_opcode(opcode) and (at + size == end or _may_be_opcode(self._data[at + size]))
        return size if plausible else 0

    def is_chunk(self, at: int, size: int | None = None) -> bool:
        """True if the lengths inside a chunk agree with its own length (and with the size it should have)."""
        if at + PREFIX.size + CHUNK.size > len(self._data):
            return False
        opcode, length = PREFIX.unpack_from(self._data, at)
        _, _, raw_size, _, name_size = CHUNK.unpack_from(self._data, at + PREFIX.size)
        head = CHUNK.size + name_size
        body = at + PREFIX.size + head
        return (
            opcode == Opcode.CHUNK
            and name_size <= len("zstd")
            and raw_size <= MAX_CHUNK_BYTES
            and head + LENGTH.size <= length <= len(self._data) - at - PREFIX.size
            and size in (None, PREFIX.size + length)
            and length == head + LENGTH.size + LENGTH.unpack_from(self._data, body)[0]
        )

    def learn(self, opcode: int, body: bytes) -> bool:
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
                self.statistics = Statistics.read(stream)
        except (McapError, UnicodeDecodeError, error):
            return False
        return True


def _may_be_opcode(value: int) -> bool:
    return Opcode.HEADER <= value <= Opcode.DATA_END or value >= _FIRST_PRIVATE
