"""Bags against two readers that are not ours: the library `mcap` and the library `rosbags`."""

from __future__ import annotations

import resource
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from math import nan
from pathlib import Path

import pytest
import yaml
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from irsbot_msgs_py.cdr import encode_string
from irsbot_msgs_py.records import Cause, Finding, JointSample, Level, Verdict, unknown_state
from irsbot_supervisor.bag.bag import Bag
from irsbot_supervisor.bag.bag_writer import BagWriter, claimed
from irsbot_supervisor.bag.entries import Entry
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.bag.mcap_writer import CHUNK_BYTES, CHUNK_NS, McapWriter
from irsbot_supervisor.bag.message_definitions import definition, type_hash
from irsbot_supervisor.bag.topics import STRING, installed_topic

START_NS = 1_700_000_000_000_000_000
MS = 1_000_000
CONFIGURATION = {"settings": {"robot": "irsbot2", "type2_stop": 0.15}, "machine": {"beta": 0.17}}


def sample(k: int) -> JointSample:
    now = START_NS + k * MS
    return JointSample(now - 200_000, now, now, ("joint_1", "joint_2"), (0.1 * k, nan), (1.0, -1.0), (0.5,))


def entries(count: int) -> list[Entry]:
    """A run as the recorder sees it: sample, state, now and then a verdict, one line of the journal."""
    finding = Finding(Cause.TYPE2, Level.STOP, 0.1, 0.15, "1", "too near: 0.1 < 0.15")
    run = [Entry("/supervisor/journal", START_NS, '{"kind": "configure"}')]
    for k in range(count):
        now = START_NS + k * MS
        times = (now - 200_000, now, now)
        state = unknown_state(times, "irsbot2", k, Cause.NOT_ASSEMBLED, ((0.1 * k, 0.2), (0.0, 0.0)), (2, 2))
        run += [Entry("/joint_states", now, sample(k)), Entry("/supervisor/state", now, state)]
        if k % 10 == 0:
            verdict = Verdict(
                now, Level.STOP, Cause.TYPE2, True, 1, (1.0, 0.0), "stop", k, "ab12", now, 0.0, (finding,) * (k % 3)
            )
            run.append(Entry("/supervisor/verdict", now, verdict))
    return run


def record(target: Path, run: list[Entry], compression: str = "") -> None:
    with BagWriter(target, compression) as opened:
        opened.add_configuration(CONFIGURATION, "ab12", START_NS)
        add_all(opened, run)


def add_all(opened: BagWriter, run: list[Entry]) -> None:
    for entry in run:
        opened.add(entry.topic, entry.record, entry.log_ns)


@pytest.fixture(scope="module")
def run() -> list[Entry]:
    return entries(400)


@pytest.fixture(scope="module")
def bag(run: list[Entry], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bags") / "run"
    record(folder, run)
    return folder


@pytest.mark.parametrize("name", ["run", "run.mcap"])
@pytest.mark.parametrize("compression", ["", "zstd"])
def test_records_come_back_in_the_order_in_which_they_were_written(
    run: list[Entry], tmp_path: Path, name: str, compression: str
):
    record(tmp_path / name, run, compression)
    with Bag(tmp_path / name) as opened:
        assert list(map(repr, opened.records())) == list(map(repr, run))  # NaN is not equal to itself
        assert opened.configuration() == CONFIGURATION
        assert not opened.loss
        samples = [entry.record for entry in run if isinstance(entry.record, JointSample)]
        for topic in ("/joint_states", "joint_states"):
            assert repr([entry.record for entry in opened.records(topic)]) == repr(samples)
        assert not list(opened.records("states"))  # the end of a name is not a name


def test_the_library_mcap_reads_the_file_and_finds_small_checked_chunks(bag: Path, run: list[Entry]):
    path = bag / "run_0.mcap"
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        messages = list(reader.iter_messages(log_time_order=False))
        assert [(channel.topic, message.log_time) for _, channel, message in messages] == [
            (entry.topic, entry.log_ns) for entry in run
        ]
        assert {(s.encoding, c.message_encoding) for s, c, _ in messages} == {("ros2msg", "cdr")}
        (attached,) = reader.iter_attachments()
        assert yaml.safe_load(attached.data) == CONFIGURATION
        (stated,) = reader.iter_metadata()
        assert stated.metadata == {"config_hash": "ab12"}
        statistics = reader.get_summary().statistics
        assert statistics.message_count == len(run)
        assert (statistics.message_start_time, statistics.message_end_time) == (run[0].log_ns, run[-1].log_ns)
    with path.open("rb") as stream:
        records = StreamReader(stream, emit_chunks=True, validate_crcs=True).records
        chunks = [record for record in records if isinstance(record, Chunk)]
    assert len(chunks) > 3
    definitions = sum(len(definition(kind)) for kind in {"std_msgs/msg/String", "sensor_msgs/msg/JointState"})
    assert all(chunk.uncompressed_crc for chunk in chunks)
    assert all(chunk.uncompressed_size <= CHUNK_BYTES for chunk in chunks)
    assert all(chunk.message_end_time - chunk.message_start_time < CHUNK_NS for chunk in chunks)
    assert chunks[0].uncompressed_size > definitions  # the types are in a chunk too, where a checksum protects them


def test_a_chunk_never_spans_half_a_second(tmp_path: Path):
    with BagWriter(tmp_path / "slow.mcap") as opened:
        for k in range(10):
            opened.add("/t", "x", START_NS + k * CHUNK_NS // 2)
        for back in (3, 2, 1):  # a clock that is set back ends the chunk too
            opened.add("/t", "x", START_NS + back)
    with (tmp_path / "slow.mcap").open("rb") as stream:
        spans = [(c.message_start_time, c.message_end_time) for c in make_reader(stream).get_summary().chunk_indexes]
    assert len(spans) == 8  # 10 messages in pairs, then each backward one alone
    assert all(0 <= end - start < CHUNK_NS for start, end in spans)


def test_the_library_rosbags_opens_the_folder_and_reads_every_field(bag: Path, run: list[Entry]):
    with Reader(bag) as reader:
        assert reader.message_count == len(run)
        assert reader.start_time == run[0].log_ns
        assert reader.ros_distro == "jazzy"
        durability = {c.topic: c.ext.offered_qos_profiles[0].durability.name for c in reader.connections}
    assert durability["/supervisor/verdict"] == "TRANSIENT_LOCAL"  # so that `ros2 bag play` offers it that way
    assert durability["/joint_states"] == "VOLATILE"

    with AnyReader([bag]) as any_reader:  # types from the bag alone
        read = [
            (connection.topic, any_reader.deserialize(raw, connection.msgtype))
            for connection, _, raw in any_reader.messages()
        ]
    by_topic = {topic: [message for name, message in read if name == topic] for topic, _ in read}
    for entry, message in zip((e for e in run if e.topic == "/joint_states"), by_topic["/joint_states"], strict=True):
        assert isinstance(entry.record, JointSample)
        stamp = message.header.stamp
        assert stamp.sec * 10**9 + stamp.nanosec == entry.record.stamp_ns
        assert tuple(message.name) == entry.record.names
        assert repr(message.position.tolist()) == repr([*entry.record.position])
        assert tuple(message.effort) == entry.record.effort
    for entry, message in zip(
        (e for e in run if e.topic == "/supervisor/verdict"), by_topic["/supervisor/verdict"], strict=True
    ):
        assert isinstance(entry.record, Verdict)
        assert (message.level, message.event, message.text) == (entry.record.level, 1, "stop")
        assert [f.text for f in message.findings] == [f.text for f in entry.record.findings]
    assert [m.sequence for m in by_topic["/supervisor/state"]] == list(range(400))


def test_the_metadata_of_the_folder_counts_the_messages_of_the_file(bag: Path, run: list[Entry]):
    stated = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert (stated["version"], stated["storage_identifier"], stated["ros_distro"]) == (9, "mcap", "jazzy")
    assert stated["relative_file_paths"] == ["run_0.mcap"]
    assert stated["message_count"] == stated["files"][0]["message_count"] == len(run)
    assert stated["duration"]["nanoseconds"] == run[-1].log_ns - run[0].log_ns
    counts = {t["topic_metadata"]["name"]: t["message_count"] for t in stated["topics_with_message_count"]}
    assert counts == {topic: sum(e.topic == topic for e in run) for topic in counts}
    assert not (bag / "metadata.yaml.part").exists()


@pytest.mark.parametrize(
    "metadata", [pytest.param("[" * 3000, id="deep"), "a: 2024-13-45", "a: [", "- 1", "rosbag2_bagfile_information: 3"]
)
def test_a_folder_with_wrong_metadata_is_read_by_its_files(bag: Path, run: list[Entry], metadata: str, tmp_path: Path):
    copy = shutil.copytree(bag, tmp_path / "bag")
    (copy / "metadata.yaml").write_text(metadata)
    with Bag(copy) as opened:
        assert len(list(opened.records())) == len(run)


@pytest.mark.parametrize("kind", ["sensor_msgs/msg/JointState", "diagnostic_msgs/msg/DiagnosticArray"])
def test_definitions_hold_all_dependencies_and_the_hash_is_that_of_the_type(kind: str):
    types = get_types_from_msg(definition(kind), kind)
    store = get_typestore(Stores.EMPTY)
    store.register(types)
    assert store.hash_rihs01(kind) == type_hash(kind)


def test_the_definition_of_our_messages_is_complete():
    types = get_types_from_msg(definition("irsbot_msgs/msg/Verdict"), "irsbot_msgs/msg/Verdict")
    assert set(types) == {
        *("irsbot_msgs/msg/Verdict", "irsbot_msgs/msg/Finding", "std_msgs/msg/Header", "builtin_interfaces/msg/Time")
    }


def test_a_type_that_is_not_installed_is_named():
    with pytest.raises(BagError, match="other_msgs/msg/Thing"):
        definition("other_msgs/msg/Thing")


@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD])
@pytest.mark.parametrize("chunked", [True, False])
def test_files_of_other_writers_are_read(tmp_path: Path, compression: CompressionType, chunked: bool):
    path = tmp_path / "foreign.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=500, compression=compression, use_chunking=chunked)
        writer.start("ros2")
        schema = writer.register_schema(STRING, "ros2msg", b"string data\n")
        channel = writer.register_channel("/text", "cdr", schema)
        for k in range(50):
            writer.add_message(channel, START_NS + k, encode_string(f"text {k}"), START_NS, k)
        writer.finish()
    with Bag(path) as opened:
        assert list(opened.records()) == [Entry("/text", START_NS + k, f"text {k}") for k in range(50)]
        assert not opened.loss


def test_a_message_larger_than_a_chunk_has_one_of_its_own(tmp_path: Path):
    texts = ["small", "x" * (3 * CHUNK_BYTES), "small again"]
    record(tmp_path / "large", [Entry("/t", START_NS + k, text) for k, text in enumerate(texts)])
    with Bag(tmp_path / "large") as opened:
        assert [entry.record for entry in opened.records()] == texts


@pytest.mark.parametrize(
    ("target", "words"),
    [("full", "exists already"), ("file", "exists already"), ("file/below", "cannot create"), ("there.mcap", "exists")],
)
def test_nothing_is_overwritten(tmp_path: Path, target: str, words: str):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "something").touch()
    (tmp_path / "file").touch()
    (tmp_path / "there.mcap").touch()
    with pytest.raises(BagError, match=words):
        BagWriter(tmp_path / target)


@pytest.mark.parametrize(("target", "names"), [("run", "run run_2 run_3"), ("a.mcap", "a.mcap a_2.mcap a_3.mcap")])
def test_bags_that_want_the_same_name_get_different_ones(tmp_path: Path, target: str, names: str):
    (tmp_path / "below").mkdir()
    claims = [claimed(tmp_path / "below" / target)]
    for _ in range(2):
        BagWriter(claims[-1]).close()
        claims.append(claimed(tmp_path / "below" / target))
    assert [claim.name for claim in claims] == names.split()


def test_a_claimed_folder_is_taken_before_anything_is_written_to_it(tmp_path: Path):
    assert claimed(tmp_path / "run") != claimed(tmp_path / "run")
    with pytest.raises(BagError, match="cannot create '/proc/bag'"):
        claimed(Path("/proc/bag"))


def test_a_place_where_nothing_can_be_created_is_refused_with_the_reason():
    with pytest.raises(BagError, match="cannot create '/proc/bag'"):
        BagWriter(Path("/proc/bag"))


@pytest.mark.parametrize("content", [b"", b"no bag at all\n", bytes(1000), b"\x89MCAP0\r\n"])
def test_a_file_that_is_not_a_bag_is_refused(tmp_path: Path, content: bytes):
    path = tmp_path / "thing.mcap"
    path.write_bytes(content)
    with pytest.raises(BagError, match=r"thing\.mcap"):
        Bag(path)


def test_a_folder_with_several_bags_is_refused_and_they_are_named(tmp_path: Path):
    for day in ("monday", "tuesday"):
        with BagWriter(tmp_path / f"{day}.mcap") as writer:
            writer.add("/text", day, START_NS)
    with pytest.raises(BagError, match=r"several bags; name one of them: monday\.mcap, tuesday\.mcap"):
        Bag(tmp_path)


def test_a_folder_without_a_bag_is_refused(tmp_path: Path):
    with pytest.raises(BagError, match=r"holds no \.mcap"):
        Bag(tmp_path)


@contextmanager
def largest_file(size: int) -> Iterator[None]:
    """No file may grow beyond `size`: the kernel refuses the rest of a write, as it does on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_full_disk_costs_the_chunk_that_did_not_fit_and_nothing_else(tmp_path: Path):
    samples = entries(1000)
    opened = BagWriter(tmp_path / "full")
    with pytest.raises(BagError, match="messages lost"), largest_file(200_000):
        add_all(opened, samples)
    written = opened.file.message_count
    opened.close()  # there is room again
    assert 0 < written < len(samples)
    with Bag(tmp_path / "full") as read:
        assert list(map(repr, read.records())) == list(map(repr, samples[:written]))
        assert not read.loss
    with Reader(tmp_path / "full") as reader:
        assert reader.message_count == written


def test_a_disk_that_stays_full_leaves_a_readable_file(tmp_path: Path):
    samples = entries(1000)
    opened = BagWriter(tmp_path / "full.mcap")
    with pytest.raises(BagError, match="messages lost"), largest_file(200_000):
        add_all(opened, samples)
    written = opened.file.message_count
    with pytest.raises(BagError, match="cannot write"), largest_file(opened.file.bytes_written + 100):
        opened.close()  # not even the summary fits
    with Bag(tmp_path / "full.mcap") as read:
        assert list(map(repr, read.records())) == list(map(repr, samples[:written]))
        assert not read.loss.messages


def test_a_message_that_is_not_of_its_type_is_named(tmp_path: Path):
    with BagWriter(tmp_path / "bad.mcap") as opened:
        opened.write(opened.channel(installed_topic("/text", STRING)), START_NS, START_NS, b"\x00\x01\x00\x00\xff")
    with Bag(tmp_path / "bad.mcap") as read, pytest.raises(BagError, match="/text at"):
        list(read.records())


def test_a_long_recording_holds_no_more_descriptors_than_a_short_one(tmp_path: Path):
    with McapWriter(tmp_path / "long.mcap") as writer:
        channel = writer.add_channel("/topic", writer.add_schema("std_msgs/msg/String", "string data"), {})
        held = []
        for number in range(5000):  # a minute of the recorder's flushes, and more
            writer.write(channel, number, number, b"message")
            writer.flush()
            if number in (0, 4999):
                held.append(len(list(Path("/proc/self/fd").iterdir())))
        assert held[1] == held[0]
