"""Damaged bags: what can be trusted comes back, what cannot is counted, and nothing is made up."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from rosbags.rosbag2 import Reader

from irsbot_msgs_py.cdr import encode_string
from irsbot_supervisor.bag.bag import Bag
from irsbot_supervisor.bag.bag_writer import BagWriter
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.bag.mcap_reader import McapReader, Place
from irsbot_supervisor.bag.salvage import salvage
from irsbot_supervisor.cli import bags
from irsbot_supervisor.cli.common import Failed

START_NS = 1_700_000_000_000_000_000
PER_CHUNK, CHUNKS = 20, 30
TEXTS = [f"text {k}" for k in range(PER_CHUNK * CHUNKS)]


def record(path: Path) -> list[tuple[int, int]]:
    """A bag of TEXTS on one topic; returns where its chunks begin and end, as the library `mcap` says."""
    with BagWriter(path) as opened:
        opened.add_configuration({"settings": {"robot": "irsbot2"}}, "ab12", START_NS)
        for k, text in enumerate(TEXTS):
            opened.add("/text", text, START_NS + k)
            if k % PER_CHUNK == PER_CHUNK - 1:
                opened.flush()
    with path.open("rb") as stream:
        indexes = make_reader(stream).get_summary().chunk_indexes
    assert len(indexes) == CHUNKS
    return [(i.chunk_start_offset, i.chunk_start_offset + i.chunk_length) for i in indexes]


def texts(bag: Path) -> list[object]:
    with Bag(bag) as opened:
        return [entry.record for entry in opened.records()]


def without(*chunks: int) -> list[str]:
    return [text for k, text in enumerate(TEXTS) if k // PER_CHUNK not in chunks]


def test_a_bag_without_damage_comes_back_whole(tmp_path: Path):
    record(tmp_path / "whole.mcap")
    saved = salvage(tmp_path / "whole.mcap", tmp_path / "saved")
    assert (saved.messages, bool(saved.loss)) == (len(TEXTS), False)
    with Bag(tmp_path / "saved") as opened:
        messages = list(opened.messages())
        assert [m.sequence for m in messages] == list(range(len(TEXTS)))
        assert [m.log_ns for m in messages] == [START_NS + k for k in range(len(TEXTS))]
        assert opened.configuration() == {"settings": {"robot": "irsbot2"}}
        assert opened.topics()[0].offered[0]["durability"] == "transient_local"
    bags.salvage(tmp_path / "whole.mcap", tmp_path / "again")  # raises Failed when something is lost
    assert texts(tmp_path / "again") == TEXTS


def test_holes_in_the_file_of_a_killed_recorder_cost_the_chunks_they_touch(tmp_path: Path):
    path = tmp_path / "killed.mcap"
    chunks = record(path)
    data = bytearray(path.read_bytes()[: chunks[-1][1]])
    for start, end in ((chunks[4][0] + 60, chunks[5][0] + 60), (chunks[20][0], chunks[20][0] + 4)):
        data[start:end] = bytes(end - start)  # pages that were never written
    path.write_bytes(data)
    saved = salvage(path, tmp_path / "saved")
    assert texts(tmp_path / "saved") == without(4, 5, 20)
    assert saved.loss.messages == 3 * PER_CHUNK  # the sequence numbers tell
    assert not saved.loss.exact
    assert saved.loss.cut
    assert str(saved.loss).startswith("at least 60 message(s) lost, ")
    with Reader(tmp_path / "saved") as reader:
        assert reader.message_count == len(TEXTS) - 3 * PER_CHUNK


def test_the_last_chunk_of_a_killed_recorder_is_counted_as_far_as_it_can_be_seen(tmp_path: Path):
    path = tmp_path / "killed.mcap"
    chunks = record(path)
    path.write_bytes(path.read_bytes()[: (chunks[-1][0] + chunks[-1][1]) // 2])
    saved = salvage(path, tmp_path / "saved.mcap")
    assert texts(tmp_path / "saved.mcap") == without(CHUNKS - 1)
    assert 0 < saved.loss.messages < PER_CHUNK


def test_a_folder_without_its_metadata_is_read(tmp_path: Path):
    folder = tmp_path / "killed"
    folder.mkdir()
    chunks = record(folder / "killed_0.mcap")
    (folder / "killed_0.mcap").write_bytes((folder / "killed_0.mcap").read_bytes()[: chunks[9][1]])
    with pytest.raises(Failed, match="never closed"):
        bags.salvage(folder, tmp_path / "saved")
    assert texts(tmp_path / "saved") == TEXTS[: 10 * PER_CHUNK]


def test_a_damaged_attachment_is_left_out_and_counted(tmp_path: Path):
    path = tmp_path / "bag.mcap"
    record(path)
    data = bytearray(path.read_bytes())
    data[data.index(b"robot: irsbot2")] ^= 1
    path.write_bytes(data)
    saved = salvage(path, tmp_path / "saved")
    assert (saved.loss.messages, saved.loss.places) == (0, 1)
    with Bag(tmp_path / "saved") as opened:
        assert opened.configuration() is None
    assert texts(tmp_path / "saved") == TEXTS


def test_bytes_after_the_end_of_a_file_are_ignored(tmp_path: Path):
    path = tmp_path / "bag.mcap"
    record(path)
    path.write_bytes(path.read_bytes() + b"something else")
    saved = salvage(path, tmp_path / "saved")
    assert not saved.loss
    assert texts(tmp_path / "saved") == TEXTS


@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD])
def test_bags_of_other_recorders_keep_types_that_are_not_installed(tmp_path: Path, compression: CompressionType):
    path = tmp_path / "foreign.mcap"
    definition = "string data\n"
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=400, compression=compression)
        writer.start("ros2")
        schema = writer.register_schema("other_msgs/msg/Thing", "ros2msg", definition.encode())
        channels = [writer.register_channel(topic, "cdr", schema, {"made": "up"}) for topic in ("/never", "/thing")]
        for k in range(60):
            writer.add_message(channels[1], START_NS + k, encode_string(f"{k}"), START_NS - 1, 100 + k)
        writer.finish()
    with path.open("rb") as stream:
        indexes = make_reader(stream).get_summary().chunk_indexes
    data = bytearray(path.read_bytes()[: indexes[4].chunk_start_offset])
    data[indexes[2].chunk_start_offset + indexes[2].chunk_length - 3] ^= 0xFF
    path.write_bytes(data)

    saved = salvage(path, tmp_path / "saved")
    with Bag(tmp_path / "saved") as opened:
        messages = list(opened.messages())
        assert {t.name: (t.type, t.text) for t in opened.topics()}["/thing"] == ("other_msgs/msg/Thing", definition)
        assert {m.publish_ns for m in messages} == {START_NS - 1}
        numbers = [m.sequence for m in messages]
    assert numbers[0] == 100
    missing = sorted(set(range(100, max(numbers) + 1)) - set(numbers))
    assert missing  # the third chunk
    assert missing == list(range(missing[0], missing[-1] + 1))
    assert saved.loss.messages == len(missing)


def test_encodings_metadata_and_channels_of_one_name_are_kept(tmp_path: Path):
    path = tmp_path / "other.mcap"
    schemas = [
        ("Pose", "jsonschema", b'{"type":"object"}'),
        ("Other", "jsonschema", b"{}"),
        ("my_msgs/msg/Idl", "ros2idl", b"module my_msgs { };"),
        ("my.Message", "protobuf", bytes(range(256))),
    ]
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("other")
        pose, other, idl, message = (writer.register_schema(*schema) for schema in schemas)
        channels = [
            writer.register_channel("/pose", "json", pose, {"frame": "base"}),
            writer.register_channel("/idl", "cdr", idl, {"offered_qos_profiles": "\x0b: no [YAML"}),
            writer.register_channel("/pose", "json", other),
            writer.register_channel("/binary", "protobuf", message),
            writer.register_channel("/raw", "json", 0),
        ]
        for k in range(5):
            for channel in channels:
                writer.add_message(channel, START_NS + k, f'{{"x": {channel}}}'.encode(), START_NS + k)
        writer.finish()

    def content(file: Path) -> list[tuple[object, ...]]:
        with file.open("rb") as stream:
            return [
                (c.topic, c.message_encoding, c.metadata, s and (s.name, s.encoding, s.data), m.data)
                for s, c, m in make_reader(stream).iter_messages(log_time_order=False)
            ]

    assert not salvage(path, tmp_path / "saved.mcap").loss
    assert content(tmp_path / "saved.mcap") == content(path)


def test_an_interrupted_salvage_does_not_look_complete(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path, target = tmp_path / "killed.mcap", tmp_path / "saved"
    record(path)
    count, scan = 0, McapReader.scan

    def interrupted(self: McapReader, block: bytes) -> list[Place]:
        nonlocal count
        count += 1
        if count > 5:
            raise KeyboardInterrupt
        return scan(self, block)

    monkeypatch.setattr(McapReader, "scan", interrupted)
    with pytest.raises(KeyboardInterrupt):
        salvage(path, target)
    monkeypatch.setattr(McapReader, "scan", scan)
    assert [file.name for file in target.iterdir()] == ["saved_0.mcap"]
    with Bag(target) as opened:
        assert 0 < len(list(opened.messages())) < len(TEXTS)
        assert opened.loss.cut


@pytest.mark.parametrize("checked", [True, False], ids=["with checksums", "without"])
def test_every_damage_raises_only_a_refusal(tmp_path: Path, checked: bool):
    path, rng = tmp_path / "bag.mcap", random.Random(5)
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=300, compression=CompressionType.NONE, enable_crcs=checked)
        writer.start("ros2")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
        channel = writer.register_channel("/text", "cdr", schema)
        for k in range(40):
            writer.add_message(channel, START_NS + k, encode_string(TEXTS[k]), START_NS, k)
        writer.finish()
    whole = path.read_bytes()
    refused = 0
    for _ in range(400):
        data = bytearray(whole)
        for _ in range(rng.randrange(1, 4)):
            start = rng.randrange(len(data))
            end = min(len(data), start + rng.choice((1, 4, 8, 100)))
            data[start:end] = rng.choice(
                (b"", rng.randbytes(end - start), bytes(end - start), b"\xff" * (end - start), data[:60])
            )
        path.write_bytes(data)
        try:
            with Bag(path) as opened:
                found = list(opened.messages())
                loss = opened.loss
        except BagError:
            refused += 1
        else:
            assert loss or len(found) >= 40  # without a checksum data may be changed, never be missing silently
            if checked:
                assert {m.data for m in found} <= {encode_string(text) for text in TEXTS[:40]}
    assert refused < 20


def test_nothing_is_written_where_something_is_and_nothing_is_made_of_nothing(tmp_path: Path):
    record(tmp_path / "bag.mcap")
    (tmp_path / "noise.mcap").write_bytes(bytes(range(256)) * 50)
    with pytest.raises(BagError, match="exists already"):
        salvage(tmp_path / "bag.mcap", tmp_path)
    with pytest.raises(BagError, match="no MCAP file"):
        salvage(tmp_path / "noise.mcap", tmp_path / "saved")
    assert not (tmp_path / "saved").exists()


def test_info_prints_the_content_and_the_damage_of_a_bag(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    path = tmp_path / "bag.mcap"
    chunks = record(path)
    bags.info(path)
    assert "600 messages" in (stated := capsys.readouterr().out)
    assert "configuration ab12" in stated
    assert "damage: nothing lost" in stated
    path.write_bytes(path.read_bytes()[: chunks[9][1]])
    bags.info(path, as_json=True)
    assert '"messages": 200' in (stated := capsys.readouterr().out)
    assert '"cut": true' in stated
    assert "how many messages are lost is not known, the end is missing" in stated
    assert "at least 0" not in stated
