"""Damaged recordings: files cut anywhere, single bits flipped anywhere. All but the damaged chunk must be recovered.

The required result is known without our reader: the library `mcap` lists the chunks of the undamaged file and their
content. Every salvaged bag is opened again with `mcap` (all checksums) and with `rosbags`.
"""

from __future__ import annotations

import random
import shutil
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.reader import make_reader
from mcap.records import Chunk, DataEnd, Message
from mcap.stream_reader import StreamReader, breakup_chunk

from irsbot_msgs_py.records import Cause, JointSample, SingularityState, unknown_state
from irsbot_supervisor.bag.bag_writer import BagWriter
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.bag.loss import Loss
from irsbot_supervisor.bag.salvage import salvage
from irsbot_supervisor.validation.harness.rows import Job, Row, Tally

CUT, CUT_MUST = "bags-cut", "a bag cut at any byte gives back every chunk before the cut, and says what is lost"
FLIP, FLIP_MUST = "bit-flips", "a flipped bit costs the chunk that holds it at most, and it is counted"

BAG_MS = 1000
"""ms of the recording that is damaged."""

NS_PER_MS = 1_000_000
START_NS = 1_700_000_000 * 1000 * NS_PER_MS
TOPICS = ("/joint_states", "/supervisor/state")
FLUSH_MS = 20
"""ms: flush period, as in the recorder."""

BACK, OF = "messages back", "messages in all"

Line = tuple[str, int, bytes]
"""Topic, sequence and data of a message."""


class Piece(NamedTuple):
    """A chunk of the undamaged file, as the library `mcap` reads it."""

    start: int
    end: int
    lines: list[Line]


def run_cut(job: Job) -> Row:
    """The row: a case is an offset at which the file ends."""
    tally, rng = Tally(CUT, job), random.Random(job.seed)
    with TemporaryDirectory(prefix="irsbot-bags-") as name:
        bag = Path(name) / "whole.mcap"
        pieces = make_bag(bag, BAG_MS)
        size = bag.stat().st_size
        cut(tally, bag, pieces, [rng.randrange(size) for _ in range(job.amount)], Path(name))
    return tally.row()


def run_flip(job: Job) -> Row:
    """The row: a case is a bit. Half of the files were closed, half end with their last chunk as after SIGKILL."""
    tally, rng = Tally(FLIP, job), random.Random(job.seed)
    with TemporaryDirectory(prefix="irsbot-bags-") as name:
        bag = Path(name) / "whole.mcap"
        pieces = make_bag(bag, BAG_MS)
        size = bag.stat().st_size
        places = [(rng.randrange(size), rng.randrange(8)) for _ in range(job.amount)]
        half = job.amount // 2
        flip(tally, bag, pieces, places[:half], Path(name), closed=True)
        flip(tally, bag, pieces, places[half:], Path(name), closed=False)
    return tally.row()


def spoken(k: int, now_ns: int) -> tuple[JointSample, SingularityState]:
    """Messages of a robot and its supervisor at one moment, with `k` inside."""
    joints = (1e-3 * k, -1e-3 * k)
    sample = JointSample(now_ns, now_ns, now_ns, ("joint_1", "joint_2"), joints, joints, joints)
    return sample, unknown_state((now_ns,) * 3, "irsbot2", k, Cause.NOT_ASSEMBLED, (joints, joints), (2, 2))


def make_bag(path: Path, milliseconds: int) -> list[Piece]:
    """A bag flushed as the recorder does; returns its chunks."""
    with BagWriter(path) as opened:
        opened.add_configuration({"settings": {"robot": "irsbot2"}}, "0", START_NS)
        for k in range(milliseconds):
            now_ns = START_NS + k * NS_PER_MS
            sample, state = spoken(k, now_ns)
            opened.add(TOPICS[0], sample, now_ns)
            opened.add(TOPICS[1], state, now_ns)
            if k % FLUSH_MS == 0:
                opened.flush()
    return list(_pieces(path))


def cut(tally: Tally, bag: Path, pieces: list[Piece], offsets: list[int], scratch: Path) -> None:
    """The file ends at each of the offsets: exactly the chunks before it must be recovered. That a file was not closed
    must be said if it ends before its data does, and that a place is unreadable if it ends inside a chunk."""
    whole, data_end = bag.read_bytes(), _data_end(bag)
    total = sum(len(piece.lines) for piece in pieces)
    for offset in offsets:
        must = [line for piece in pieces if piece.end <= offset for line in piece.lines]
        inside = any(piece.start < offset < piece.end for piece in pieces)
        found, fault, loss = _come_back(whole[:offset], scratch, must, [])
        if loss is not None and not (loss.cut == (offset < data_end) and loss.places >= inside):
            fault = fault or f"what is said to be lost: {loss}"
        _count(tally, found, total, f"cut at {offset} of {len(whole)}: {fault}" if fault else "")


def flip(
    tally: Tally, bag: Path, pieces: list[Piece], places: list[tuple[int, int]], scratch: Path, closed: bool
) -> None:
    """One bit of the file is inverted: all but the chunk with this bit must be recovered unchanged.

    closed: True if the file was closed, False if it ends with its last chunk as after SIGKILL.
    """
    end = len(bag.read_bytes()) if closed else pieces[-1].end
    whole = bag.read_bytes()[:end]
    total = sum(len(piece.lines) for piece in pieces)
    for place, bit in places:
        at = place % end
        damaged = bytearray(whole)
        damaged[at] ^= 1 << bit
        hit = [line for piece in pieces if piece.start <= at < piece.end for line in piece.lines]
        must = [line for piece in pieces if not piece.start <= at < piece.end for line in piece.lines]
        found, fault, _loss = _come_back(bytes(damaged), scratch, must, hit)
        _count(tally, found, total, f"bit {bit} of byte {at} of {end}: {fault}" if fault else "")


def _count(tally: Tally, found: int, total: int, fault: str) -> None:
    tally.add(BACK, found)
    tally.add(OF, total)
    tally.case(failed=fault)


def _come_back(damaged: bytes, scratch: Path, must: list[Line], may: list[Line]) -> tuple[int, str, Loss | None]:
    """Number of recovered messages, the fault if a required message is missing or a foreign one appears, and what is
    said to be lost; None if the file is refused."""
    source, target = scratch / "damaged.mcap", scratch / "saved"
    source.write_bytes(damaged)
    shutil.rmtree(target, ignore_errors=True)
    try:
        saved = salvage(source, target)
    except BagError as error:
        return 0, f"refused: {error}" if must else "", None
    found = list(lines_of(target / "saved_0.mcap"))
    missing = len(must) + len(may) - len(found)
    if found not in (must, _merged(must, may)):
        fault = f"{len(found)} messages came back, {len(must)} must and {len(may)} may"
    elif rosbags_count(target) != len(found) or saved.messages != len(found):
        fault = "rosbags counts differently"
    elif saved.loss.exact and saved.loss.messages != missing:
        fault = f"{saved.loss.messages} counted as lost, {missing} are"
    else:
        fault = f"{missing} are lost, and nothing is said" if missing and not saved.loss else ""
    return len(found), fault, saved.loss


def _merged(must: list[Line], may: list[Line]) -> list[Line]:
    """Both in their order: sequences grow with the file, topic by topic in turn."""
    return sorted(must + may, key=lambda line: (line[1], TOPICS.index(line[0])))


def _pieces(path: Path) -> Iterator[Piece]:
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        for index in summary.chunk_indexes:
            stream.seek(index.chunk_start_offset + 9)  # behind opcode and length
            chunk = Chunk.read(ReadDataStream(stream))
            lines = [
                (summary.channels[message.channel_id].topic, message.sequence, message.data)
                for message in breakup_chunk(chunk, validate_crc=True)
                if isinstance(message, Message)
            ]
            yield Piece(index.chunk_start_offset, index.chunk_start_offset + index.chunk_length, lines)


def _data_end(path: Path) -> int:
    """Offset behind the record that closes the data; only indices follow."""
    with path.open("rb") as stream:
        for record in StreamReader(stream, emit_chunks=True).records:
            if isinstance(record, DataEnd):
                return stream.tell()
    raise AssertionError("the bag was closed")


def lines_of(path: Path) -> Iterator[Line]:
    """All messages of a file; every checksum is checked."""
    with path.open("rb") as stream:
        for _, channel, message in make_reader(stream, validate_crcs=True).iter_messages(log_time_order=False):
            yield channel.topic, message.sequence, message.data


def rosbags_count(folder: Path) -> int:
    """Messages in a bag, by the library `rosbags`."""
    from rosbags.rosbag2 import Reader  # nothing else of the suite needs it

    with Reader(folder) as reader:
        return sum(1 for _ in reader.messages())
