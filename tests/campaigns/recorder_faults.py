"""What is left of a recording: SIGKILL of the recorder, files cut anywhere, single bits flipped anywhere.

    ./irsbot python tests/campaigns/recorder_faults.py --kills 50 --cuts 200 --flips 500

What must come back is known without our reader: the library `mcap` says where the chunks of the undamaged file are and
what is in them. Every salvaged bag is opened again with `mcap` (all checksums) and with `rosbags`. For the kills, a
publisher of our own knows what it sent until when. Exit code 1 if anything else than the damaged chunk is missing.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.reader import make_reader
from mcap.records import Chunk, Message
from mcap.stream_reader import breakup_chunk
from rosbags.rosbag2 import Reader

from irsbot_msgs_py.cdr import encode_joint_state, encode_state
from irsbot_msgs_py.records import Cause, JointSample, SingularityState, unknown_state
from irsbot_supervisor.mcap_writer import BagError
from irsbot_supervisor.salvage import salvage
from irsbot_supervisor.tape import Tape, TapeWriter

NS_PER_MS = 1_000_000
START_NS = 1_700_000_000 * 1000 * NS_PER_MS
TOPICS = ("/joint_states", "/supervisor/state")
FLUSH_MS = 20
"""As the recorder flushes."""
PATIENCE_S = 30.0
"""Longest wait until the recorder has written something."""
ALLOWED_LOSS_S = 1.0
"""Most that may be missing before a SIGKILL; the goal is 0.05 s."""

Line = tuple[str, int, bytes]
"""Topic, sequence and data of a message."""


class Piece(NamedTuple):
    """A chunk of the undamaged file, as the library `mcap` sees it."""

    start: int
    end: int
    lines: list[Line]


class Report(NamedTuple):
    """Outcome of one kind of damage."""

    cases: int
    faults: list[str]
    messages: int  # in all cases together
    recovered: int
    longest_loss_s: float = 0.0


def spoken(k: int, now_ns: int) -> tuple[JointSample, SingularityState]:
    """What a robot and its supervisor say at one moment, with `k` inside."""
    joints = (1e-3 * k, -1e-3 * k)
    sample = JointSample(now_ns, now_ns, now_ns, ("joint_1", "joint_2"), joints, joints, joints)
    return sample, unknown_state((now_ns,) * 3, "irsbot2", k, Cause.NOT_ASSEMBLED, (joints, joints), (2, 2))


def make_bag(path: Path, milliseconds: int) -> list[Piece]:
    """A bag flushed as the recorder does; returns its chunks."""
    with TapeWriter(path) as tape:
        tape.add_configuration({"settings": {"robot": "irsbot2"}}, "0", START_NS)
        for k in range(milliseconds):
            now_ns = START_NS + k * NS_PER_MS
            for topic, record in zip(TOPICS, spoken(k, now_ns), strict=True):
                tape.add(topic, record, now_ns)
            if k % FLUSH_MS == 0:
                tape.flush()
    return list(_pieces(path))


def cut(bag: Path, pieces: list[Piece], offsets: list[int], scratch: Path) -> Report:
    """The file ends at each of the offsets: all chunks before it must come back, and nothing else."""
    whole, faults, recovered = bag.read_bytes(), [], 0
    total = sum(len(piece.lines) for piece in pieces)
    for offset in offsets:
        must = [line for piece in pieces if piece.end <= offset for line in piece.lines]
        found, fault = _come_back(whole[:offset], scratch, must, [])
        recovered += found
        if fault:
            faults.append(f"cut at {offset} of {len(whole)}: {fault}")
    return Report(len(offsets), faults, total * len(offsets), recovered)


def flip(bag: Path, pieces: list[Piece], places: list[tuple[int, int]], scratch: Path, closed: bool) -> Report:
    """One bit of the file is inverted: all but the chunk that holds it must come back, as it was.

    closed: whether the file had been closed, or ends with its last chunk as after SIGKILL.
    """
    end = len(bag.read_bytes()) if closed else pieces[-1].end
    whole, faults, recovered = bag.read_bytes()[:end], [], 0
    total = sum(len(piece.lines) for piece in pieces)
    for place, bit in places:
        at = place % end
        damaged = bytearray(whole)
        damaged[at] ^= 1 << bit
        hit = [line for piece in pieces if piece.start <= at < piece.end for line in piece.lines]
        must = [line for piece in pieces if not piece.start <= at < piece.end for line in piece.lines]
        found, fault = _come_back(bytes(damaged), scratch, must, hit)
        recovered += found
        if fault:
            faults.append(f"bit {bit} of byte {at} of {end}: {fault}")
    return Report(len(places), faults, total * len(places), recovered)


def kill(times: int, scratch: Path, rng: random.Random, domain: int) -> Report:
    """SIGKILL while two topics arrive at 1 kHz: what is missing is only the last moment, and the bag can be saved."""
    faults, sent_in_all, recovered, longest_s = [], 0, 0, 0.0
    for number in range(times):
        folder = scratch / f"kill{number}"
        sent, killed_ns = _record_and_kill(folder, rng.uniform(0.3, 1.5), domain)
        fault, last = _after_kill(folder, sent)
        loss_s = (killed_ns - sent[last]) * 1e-9
        longest_s = max(longest_s, loss_s)
        if fault or not loss_s <= ALLOWED_LOSS_S:
            faults.append(f"kill {number}: {fault or f'{loss_s:.3f} s lost'}")
        sent_in_all += len(sent)
        recovered += last + 1
        shutil.rmtree(folder)
    return Report(times, faults, sent_in_all, recovered, longest_s)


def _record_and_kill(folder: Path, seconds: float, domain: int) -> tuple[list[int], int]:
    """Record what we publish, then SIGKILL; returns when each pair was sent, and when the recorder was killed, ns."""
    import rclpy
    from irsbot_msgs.msg import SingularityState as SingularityStateMsg
    from sensor_msgs.msg import JointState

    parameters = ("--ros-args", "--log-level", "error", "-p", f"output:={folder}")
    recorder = subprocess.Popen(
        [sys.executable, "-m", "irsbot_supervisor.nodes.recorder", *parameters],
        env={**os.environ, "ROS_DOMAIN_ID": str(domain)},
    )
    context = rclpy.Context()  # a new one each time: it would take 20 s to notice that the recorder is dead
    rclpy.init(context=context, domain_id=domain)
    try:
        node = rclpy.create_node("robot", context=context)
        kinds = (JointState, SingularityStateMsg)
        publishers = [node.create_publisher(kind, topic, 1000) for kind, topic in zip(kinds, TOPICS, strict=True)]
        while not all(publisher.get_subscription_count() for publisher in publishers):
            if recorder.poll() is not None:
                raise RuntimeError(f"the recorder ended with exit code {recorder.returncode}")
            time.sleep(0.01)
        sent = _publish(publishers, folder / f"{folder.name}_0.mcap", seconds)
        killed_ns = time.time_ns()
        recorder.kill()
        node.destroy_node()
    finally:
        recorder.kill()
        recorder.wait()
        rclpy.shutdown(context=context)
    return sent, killed_ns


def _publish(publishers: list[Any], bag: Path, seconds: float) -> list[int]:
    """Publish at 1 kHz until something has reached the bag, and then for so long; returns when each pair was sent, ns.

    A reader may be known to us before we are known to it: what is sent in between is nobody's loss.
    """
    sent: list[int] = []
    begin, due = bag.stat().st_size, time.perf_counter()
    end = due + PATIENCE_S
    while due < end:
        if bag.stat().st_size > begin:
            begin, end = sys.maxsize, due + seconds
        now_ns = time.time_ns()
        sample, state = spoken(len(sent), now_ns)
        publishers[0].publish(encode_joint_state(sample))
        publishers[1].publish(encode_state(state))
        sent.append(now_ns)
        due += 1e-3
        if (rest := due - time.perf_counter()) > 0:
            time.sleep(rest)
    return sent


def _after_kill(folder: Path, sent: list[int]) -> tuple[str, int]:
    """What is wrong with the bag of a killed recorder, and the number of the last pair in it."""
    saved = folder / "saved"
    try:
        with Tape(folder) as tape:
            states = [entry.record.sequence for entry in tape.records(TOPICS[1])]  # type: ignore[union-attr]
            samples = [entry.record.stamp_ns for entry in tape.records(TOPICS[0])]  # type: ignore[union-attr]
        salvage(folder, saved)
        count = len(list(_lines(next(saved.glob("*.mcap")))))
    except BagError as error:
        return str(error), 0
    if not states or not samples:
        return "nothing was recorded", 0
    first = sent.index(samples[0])
    if states != list(range(states[0], states[-1] + 1)) or samples != sent[first : first + len(samples)]:
        return "there is a gap", 0
    if count != len(states) + len(samples) or _rosbags_count(saved) != count:
        return "the salvaged bag does not hold all that could be read", 0
    return "", min(states[-1], sent.index(samples[-1]))


def _come_back(damaged: bytes, scratch: Path, must: list[Line], may: list[Line]) -> tuple[int, str]:
    """How many messages came back, and what is wrong if not all that must and nothing but what may did."""
    source, target = scratch / "damaged.mcap", scratch / "saved"
    source.write_bytes(damaged)
    shutil.rmtree(target, ignore_errors=True)
    try:
        saved = salvage(source, target)
    except BagError as error:
        return 0, f"refused: {error}" if must else ""
    found = list(_lines(target / "saved_0.mcap"))
    missing = len(must) + len(may) - len(found)
    if found not in (must, _merged(must, may)):
        return len(found), f"{len(found)} messages came back, {len(must)} must and {len(may)} may"
    if _rosbags_count(target) != len(found) or saved.messages != len(found):
        return len(found), "rosbags counts differently"
    if saved.loss.exact and saved.loss.messages != missing:
        return len(found), f"{saved.loss.messages} counted as lost, {missing} are"
    if missing and not saved.loss:
        return len(found), f"{missing} are lost, and nothing is said"
    return len(found), ""


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


def _lines(path: Path) -> Iterator[Line]:
    with path.open("rb") as stream:
        for _, channel, message in make_reader(stream, validate_crcs=True).iter_messages(log_time_order=False):
            yield channel.topic, message.sequence, message.data


def _rosbags_count(folder: Path) -> int:
    with Reader(folder) as reader:
        return sum(1 for _ in reader.messages())


def main() -> None:
    """Run the campaign and print what came of it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--cuts", type=int, default=200)
    parser.add_argument("--flips", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--domain", type=int, default=87, help="DDS domain of the kills")
    options = parser.parse_args()
    rng = random.Random(options.seed)
    with tempfile.TemporaryDirectory() as name:
        scratch = Path(name)
        bag = scratch / "whole.mcap"
        pieces = make_bag(bag, 1000)
        size = bag.stat().st_size
        places = [(rng.randrange(size), rng.randrange(8)) for _ in range(options.flips)]
        half = options.flips // 2
        reports = {
            "cut": cut(bag, pieces, [rng.randrange(size) for _ in range(options.cuts)], scratch),
            "bit flipped, file closed": flip(bag, pieces, places[:half], scratch, closed=True),
            "bit flipped, recorder killed": flip(bag, pieces, places[half:], scratch, closed=False),
            "SIGKILL": kill(options.kills, scratch, rng, options.domain),
        }
    for title, report in reports.items():
        share = 100 * report.recovered / max(report.messages, 1)
        print(f"{title}: {report.cases} cases, {report.recovered} of {report.messages} messages back ({share:.2f} %)")
        if title == "SIGKILL":
            print(f"    longest loss {report.longest_loss_s:.3f} s")
        for fault in report.faults:
            print(f"    {fault}")
    sys.exit(1 if any(report.faults for report in reports.values()) else 0)


if __name__ == "__main__":
    main()
