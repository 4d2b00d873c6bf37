"""Bags in every format that the library `rosbags` writes are judged as their MCAP twins are."""

from __future__ import annotations

import json
import shutil
import tempfile
from errno import ENOSPC
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import polars as pl
import pytest
import zstandard
from command import irsbot
from rosbags.interfaces import ConnectionExtRosbag2
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from irsbot_msgs_py.cdr import encode_joint_state
from irsbot_msgs_py.records import JointSample
from irsbot_supervisor.bag.bag import Bag
from irsbot_supervisor.bag.bag_writer import BagWriter
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.bag.salvage import salvage
from irsbot_supervisor.bag.topics import JOINT_STATE
from irsbot_supervisor.configuration.loading import read_settings, shipped_values
from irsbot_supervisor.replay.judged import Judged
from irsbot_supervisor.replay.recording import read_recording
from irsbot_supervisor.replay.rejudge import Assumption, judge_again
from irsbot_supervisor.sim.closed_loop import cycles, record
from irsbot_supervisor.sim.simulation import simulation_from

FORMATS = {
    "sqlite3": (StoragePlugin.SQLITE3, CompressionMode.NONE),
    "sqlite3 file": (StoragePlugin.SQLITE3, CompressionMode.FILE),
    "sqlite3 message": (StoragePlugin.SQLITE3, CompressionMode.MESSAGE),
    "mcap": (StoragePlugin.MCAP, CompressionMode.NONE),
    "mcap chunks": (StoragePlugin.MCAP, CompressionMode.STORAGE),
    "mcap file": (StoragePlugin.MCAP, CompressionMode.FILE),
    "mcap message": (StoragePlugin.MCAP, CompressionMode.MESSAGE),
}
TOLD = Assumption("irsbot2")


@pytest.fixture(scope="module")
def ours(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A supervised run with a silence, as we record it."""
    settings, robot = read_settings("irsbot2")
    shipped = {key: shipped_values(robot)[key] for key in ("velocity_limit", "deceleration_limit")}
    simulation = simulation_from({**shipped, "rate_hz": 500.0}, robot)
    target = tmp_path_factory.mktemp("ours") / "run.mcap"
    record(cycles(simulation, robot, settings, "drop:at=0.5,lasting=0.1"), 0.8, robot, settings, target)
    return target


@pytest.fixture(scope="module")
def samples(ours: Path) -> list[JointSample]:
    return read_recording(ours).samples


@pytest.fixture(scope="module")
def judged(samples: list[JointSample], tmp_path_factory: pytest.TempPathFactory) -> Judged:
    """The joint states alone, in our MCAP."""
    target = tmp_path_factory.mktemp("alone") / "run.mcap"
    written(target, samples)
    found = judge_again(read_recording(target), TOLD)
    assert len({interval.level for interval in found.intervals}) >= 2  # there is something to compare
    return found


def written(target: Path, samples: list[JointSample], topic: str = "/joint_states") -> Path:
    with BagWriter(target) as bag:
        for number, sample in enumerate(samples):
            bag.add(topic, sample, sample.seen_ns)
            if number % 100 == 99:
                bag.flush()
    return target


def foreign(target: Path, samples: list[JointSample], form: str, topics: tuple[str, ...] = ("/joint_states",)) -> Path:
    storage, compression = FORMATS[form]
    with_compression = Writer(target, version=9, storage_plugin=storage)
    if compression != CompressionMode.NONE:
        with_compression.set_compression(compression, CompressionFormat.ZSTD)
    with with_compression as bag:
        store = get_typestore(Stores.ROS2_JAZZY)
        for topic in topics:
            connection = bag.add_connection(topic, JOINT_STATE, typestore=store)
            assert isinstance(connection.ext, ConnectionExtRosbag2)
            for sample in samples:
                bag.write(connection, sample.seen_ns, encode_joint_state(sample))
    return target


@pytest.mark.parametrize("form", FORMATS)
def test_joint_states_alone_get_the_verdicts_of_their_mcap_twin(
    form: str, samples: list[JointSample], judged: Judged, tmp_path: Path
) -> None:
    bag = foreign(tmp_path / "bag", samples, form)
    assert judge_again(read_recording(bag), TOLD) == judged


@pytest.mark.parametrize("form", ["sqlite3", "sqlite3 file", "mcap file"])
def test_one_file_is_enough_where_the_metadata_is_missing(
    form: str, samples: list[JointSample], judged: Judged, tmp_path: Path
) -> None:
    bag = foreign(tmp_path / "bag", samples, form)
    (bag / "metadata.yaml").unlink()
    (file,) = bag.iterdir()
    assert judge_again(read_recording(file), TOLD) == judge_again(read_recording(bag), TOLD) == judged


def test_messages_that_were_compressed_one_by_one_are_read_without_the_metadata(
    samples: list[JointSample], judged: Judged, tmp_path: Path
) -> None:
    bag = foreign(tmp_path / "bag", samples, "mcap message")
    (bag / "metadata.yaml").unlink()
    (file,) = bag.iterdir()
    assert judge_again(read_recording(file), TOLD) == judge_again(read_recording(bag), TOLD) == judged


def test_a_whole_run_of_ours_is_judged_from_sqlite_as_recorded(ours: Path, tmp_path: Path) -> None:
    with Bag(ours) as opened, Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.SQLITE3) as bag:
        connections = {
            topic.name: bag.add_connection(topic.name, topic.type, msgdef=topic.text, rihs01=topic.type_hash or "none")
            for topic in opened.topics()
        }
        for message in opened.messages():
            bag.write(connections[message.topic], message.log_ns, message.data)
    assert judge_again(read_recording(tmp_path / "bag")) == judge_again(read_recording(ours))


def test_a_bag_of_ros_1_is_judged(samples: list[JointSample], judged: Judged, tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS1_NOETIC)
    stamp, header, state = (
        store.types[name] for name in ("builtin_interfaces/msg/Time", "std_msgs/msg/Header", JOINT_STATE)
    )
    with Ros1Writer(tmp_path / "run.bag") as bag:
        connection = bag.add_connection("/joint_states", JOINT_STATE, typestore=store)
        for number, one in enumerate(samples):
            head = header(seq=number, stamp=stamp(*divmod(one.stamp_ns, 10**9)), frame_id="")
            arrays = [np.array(values, dtype=np.float64) for values in (one.position, one.velocity, one.effort)]
            message = state(head, list(one.names), *arrays)
            bag.write(connection, one.seen_ns, store.serialize_ros1(message, JOINT_STATE))
    assert judge_again(read_recording(tmp_path / "run.bag"), TOLD) == judged


def test_the_parts_of_a_split_bag_are_read_in_the_order_of_their_numbers(
    samples: list[JointSample], judged: Judged, tmp_path: Path
) -> None:
    size = len(samples) // 11
    folder = tmp_path / "split"
    folder.mkdir()
    for part in range(11):
        end = (part + 1) * size if part < 10 else None
        written(folder / f"split_{part}.mcap", samples[part * size : end])
    recording = read_recording(folder)
    assert [one.stamp_ns for one in recording.samples] == [one.stamp_ns for one in samples]
    assert judge_again(recording, TOLD) == judged


def test_another_name_of_the_topic_is_found_by_its_type(
    samples: list[JointSample], judged: Judged, tmp_path: Path
) -> None:
    bag = foreign(tmp_path / "bag", samples, "sqlite3", ("/cell/left/measured",))
    assert judge_again(read_recording(bag), TOLD) == judged


def test_of_several_topics_one_is_chosen_by_name(samples: list[JointSample], judged: Judged, tmp_path: Path) -> None:
    bag = foreign(tmp_path / "bag", samples, "sqlite3", ("/measured", "/wanted"))
    for wrong in (None, "/none"):
        with pytest.raises(BagError, match=r": /measured, /wanted"):
            read_recording(bag, topic=wrong)
    assert judge_again(read_recording(bag, topic="measured"), TOLD) == judged
    apart = foreign(tmp_path / "apart", samples, "sqlite3", ("/a/measured", "/b/wanted"))
    with pytest.raises(BagError, match=r"--topic: /a/measured, /b/wanted"):
        read_recording(apart)
    assert judge_again(read_recording(apart, topic="/b/wanted"), TOLD) == judged


def test_the_commands_take_a_sqlite_bag(samples: list[JointSample], judged: Judged, tmp_path: Path) -> None:
    bag = foreign(tmp_path / "bag", samples, "sqlite3", ("/measured", "/wanted"))
    replayed = irsbot("replay", bag, "--robot", "irsbot2", "--topic", "/wanted", "--json")
    assert replayed.code == 0
    levels = [interval["level"] for interval in json.loads(replayed.out)["chapters"]]
    assert levels == [interval.level.name for interval in judged.intervals]
    drafted = irsbot("replay", bag, "--robot", "irsbot2", "--topic", "/wanted", "--write-expect", bag / "expected.json")
    assert drafted.code == 0
    stated = json.loads((bag / "expected.json").read_text())
    assert stated.pop("draft")
    assert stated["topic"] == "/wanted"
    (bag / "expected.json").write_text(json.dumps(stated))
    assert irsbot("replay", bag).code == 0, "later replays need no option"
    (bag / "expected.json").unlink()
    table = tmp_path / "margins.csv"
    evaluated = irsbot("evaluate", "irsbot2", "--input", bag, "--topic", "/wanted", "--output", table)
    assert evaluated.code == 0
    assert len(pl.read_csv(table)) == len(samples)
    shown = irsbot("info", bag, "--json")
    assert json.loads(shown.out)["messages"] == 2 * len(samples)


def test_a_bag_without_its_robot_is_refused_in_one_line(samples: list[JointSample], tmp_path: Path) -> None:
    bag = foreign(tmp_path / "bag", samples, "sqlite3")
    refused = irsbot("replay", bag)
    assert refused.code == 2
    assert "--robot" in refused.refusal
    assert "--params" in refused.refusal


def test_partial_joint_sets_are_unknown_and_a_bag_of_nothing_else_is_refused(
    samples: list[JointSample], tmp_path: Path
) -> None:
    half = [one._replace(names=one.names[:1], position=one.position[:1], velocity=(), effort=()) for one in samples]
    mixed = foreign(tmp_path / "mixed", [*samples[:100], *half[100:]], "sqlite3")
    found = judge_again(read_recording(mixed), TOLD)
    assert found.intervals[-1].level.name == "UNKNOWN"
    never = foreign(tmp_path / "never", half, "sqlite3")
    with pytest.raises(BagError, match="joint_names"):
        judge_again(read_recording(never), TOLD)


def test_further_joints_in_a_message_do_no_harm(samples: list[JointSample], judged: Judged, tmp_path: Path) -> None:
    more = [
        one._replace(
            names=("gripper", *one.names),
            position=(0.0, *one.position),
            velocity=one.velocity and (0.0, *one.velocity),
            effort=one.effort and (0.0, *one.effort),
        )
        for one in samples
    ]
    assert judge_again(read_recording(foreign(tmp_path / "more", more, "sqlite3")), TOLD) == judged


# --- what is broken ---------------------------------------------------------------------------------------------


def test_a_damaged_database_is_refused(samples: list[JointSample], tmp_path: Path) -> None:
    bag = foreign(tmp_path / "bag", samples, "sqlite3")
    (file,) = bag.glob("*.db3")
    whole = file.read_bytes()
    for end in (0, 50, 5000, len(whole) // 2):
        file.write_bytes(whole[:end])
        with pytest.raises(BagError, match="cannot read"):
            judge_again(read_recording(bag), TOLD)


def test_messages_in_the_write_ahead_log_of_a_database_are_reported_as_missing(
    samples: list[JointSample], tmp_path: Path
) -> None:
    bag = foreign(tmp_path / "bag", samples, "sqlite3")
    (file,) = bag.glob("*.db3")
    assert read_recording(bag).loss == ""
    file.with_name(f"{file.name}-wal").write_bytes(b"pages")
    assert "never closed" in read_recording(bag).loss


def test_a_truncated_compressed_file_gives_its_intact_part_and_reports_the_loss(
    samples: list[JointSample], tmp_path: Path
) -> None:
    whole = written(tmp_path / "run.mcap", samples).read_bytes()
    packed = zstandard.compress(whole)
    cut = tmp_path / "run.mcap.zstd"
    cut.write_bytes(packed)
    assert len(read_recording(cut).samples) == len(samples)
    cut.write_bytes(zstandard.compress(whole[: len(whole) // 2]))
    assert "never closed" in read_recording(cut).loss
    long = written(tmp_path / "long.mcap", [*samples] * 12)  # of several blocks
    packed = zstandard.compress(long.read_bytes())
    begin = len(packed) * 3 // 4
    cut.write_bytes(packed[:begin] + b"\xff" * (len(packed) - begin))
    found = read_recording(cut)
    assert "never closed" in found.loss
    assert found.samples
    assert list(found.samples) == list(read_recording(long).samples)[: len(found.samples)]
    for content in (b"nonsense", b""):
        cut.write_bytes(content)
        with pytest.raises(BagError, match=rf"'{cut}'"):
            read_recording(cut)


def test_unpacked_copies_do_not_outlive_a_killed_process(
    samples: list[JointSample], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    packed, scratch = tmp_path / "run.mcap.zstd", tmp_path / "scratch"
    packed.write_bytes(zstandard.compress(written(tmp_path / "run.mcap", samples).read_bytes()))
    scratch.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(scratch))
    with Bag(packed) as opened:
        assert not [file for file in scratch.rglob("*") if file.is_file()]
        assert len(list(opened.messages())) == len(samples)


def test_a_full_temporary_folder_is_named(
    samples: list[JointSample], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    packed = tmp_path / "run.mcap.zstd"
    packed.write_bytes(zstandard.compress(written(tmp_path / "run.mcap", samples).read_bytes()))

    def full(*_: object) -> None:
        raise OSError(ENOSPC, "No space left on device")

    monkeypatch.setattr(zstandard, "ZstdDecompressor", lambda: SimpleNamespace(copy_stream=full))
    with pytest.raises(BagError, match=f"into '{tempfile.gettempdir()}': No space left on device; TMPDIR"):
        Bag(packed)


def test_a_foreign_bag_cannot_be_salvaged(samples: list[JointSample], tmp_path: Path) -> None:
    bag = foreign(tmp_path / "bag", samples, "sqlite3")
    with pytest.raises(BagError, match="no MCAP"):
        salvage(bag, tmp_path / "saved")
    assert not (tmp_path / "saved").exists()


def test_a_machine_without_rosbags_gets_one_sentence(
    samples: list[JointSample], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bag = foreign(tmp_path / "bag", samples, "sqlite3")
    ours = written(tmp_path / "run.mcap", samples)
    for name in ("rosbags.highlevel", "rosbags.rosbag2"):
        monkeypatch.setitem(__import__("sys").modules, name, None)
    with pytest.raises(BagError, match="pip install rosbags"):
        read_recording(bag)
    assert len(read_recording(ours).samples) == len(samples)
    shutil.rmtree(bag)
