"""Binary layout of an MCAP file, as far as reader and writer pack it themselves. Format: https://mcap.dev/spec."""

from __future__ import annotations

from struct import Struct

from mcap.opcode import Opcode

MAGIC = b"\x89MCAP0\r\n"

PREFIX = Struct("<BQ")
"""Begin of every record: opcode, length of the rest."""

MESSAGE = Struct("<BQHIQQ")
"""Begin of a message: prefix, channel, sequence, log and publish time, ns. The data follow."""

CHUNK = Struct("<QQQII")
"""Begin of a chunk behind its prefix: start, end, uncompressed size, checksum, length of the compression's name."""

LENGTH = Struct("<Q")
"""Length of the records of a chunk, behind the name of its compression."""

CHUNK_OPCODE = bytes([Opcode.CHUNK])

MAX_CHUNK_BYTES = 1 << 30
"""A larger size comes from damage, not from a recorder."""


def count_messages(records: bytes, partial: bool = False) -> int | None:
    """Number of messages among the records of a chunk; None if the records do not follow one another to its end.

    partial: count the visible ones, the truncated one included.
    """
    count = place = 0
    while place < len(records):
        known = records[place] in (Opcode.MESSAGE, Opcode.CHANNEL, Opcode.SCHEMA)
        if not known or place + PREFIX.size > len(records):
            return count if partial else None
        opcode, length = PREFIX.unpack_from(records, place)
        if opcode == Opcode.MESSAGE:
            if PREFIX.size + length < MESSAGE.size:
                return count if partial else None
            count += 1
        place += PREFIX.size + length
    return count if partial or place == len(records) else None
