"""Records <-> bags: a directory as `ros2 bag` makes it, or one file. Needs message definitions, not ROS."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path, PurePath
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Any, NamedTuple

import yaml
import zstandard

from irsbot_msgs_py import cdr
from irsbot_msgs_py.records import JointSample, SingularityState, Verdict
from irsbot_supervisor.bag.column_reader import Columns, columns_in
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.bag.foreign import SUFFIXES, ForeignReader
from irsbot_supervisor.bag.loss import Loss
from irsbot_supervisor.bag.mcap_reader import McapReader
from irsbot_supervisor.bag.mcap_writer import McapWriter
from irsbot_supervisor.bag.message import Message
from irsbot_supervisor.bag.message_definitions import definition, type_hash

JOINT_STATE = "sensor_msgs/msg/JointState"
STATE = "irsbot_msgs/msg/SingularityState"
VERDICT = "irsbot_msgs/msg/Verdict"
STRING = "std_msgs/msg/String"

Record = JointSample | SingularityState | Verdict | str

METADATA = "metadata.yaml"
CONFIGURATION = "configuration.yaml"
"""Name of the attachment with the configuration of the supervisor; its hash is in the metadata record `irsbot`."""


class Entry(NamedTuple):
    """One record of a bag. log_ns: time of reception by the recorder, ROS clock."""

    topic: str
    log_ns: int
    record: Record


class Topic(NamedTuple):
    """One topic of a bag."""

    name: str
    type: str
    text: str  # definition in the format `ros2msg`
    type_hash: str
    offered: list[dict[str, Any]]  # quality of service of the publishers


def installed_topic(name: str, type_name: str, latched: bool = False) -> Topic:
    """A topic of an installed type. latched: whether it is offered transient local. Raises BagError."""
    return Topic(name, type_name, definition(type_name), type_hash(type_name), [_offered(latched)])


class BagWriter:
    """Writes a new bag. A target with the suffix .mcap becomes one file, any other a directory with metadata.yaml."""

    def __init__(self, target: Path, compression: str = "") -> None:
        """Create the bag; the target must not exist. compression: of the chunks, "" or "zstd". Raises BagError."""
        self._folder = None if target.suffix == ".mcap" else target
        if self._folder is not None:
            if target.exists() and (not target.is_dir() or any(target.iterdir())):
                raise BagError(f"'{target}' exists already: a bag needs a new or empty directory")
            try:
                target.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise BagError(f"cannot create '{target}': {error.strerror}") from None
            target = target / f"{target.name}_0.mcap"
        self.file = McapWriter(target, compression)
        self.write = self.file.write
        self.flush = self.file.flush
        self._channels: dict[str, int] = {}
        self._topics: list[Topic] = []
        self._schemas: dict[str, int] = {}

    def channel(self, topic: Topic) -> int:
        """The channel of a topic, for `write`."""
        if topic.name not in self._channels:
            if topic.type not in self._schemas:
                self._schemas[topic.type] = self.file.add_schema(topic.type, topic.text)
            offered = yaml.safe_dump(topic.offered, sort_keys=False)
            known = {"offered_qos_profiles": offered, "topic_type_hash": topic.type_hash}
            self._channels[topic.name] = self.file.add_channel(topic.name, self._schemas[topic.type], known)
            self._topics.append(topic)
        return self._channels[topic.name]

    def add(self, topic: str, record: Record, log_ns: int) -> None:
        """Write one record that was received at log_ns (ROS clock)."""
        kind, encode = _WRITTEN[type(record)]
        channel = self._channels.get(topic)
        if channel is None:
            channel = self.channel(installed_topic(topic, kind, latched=kind in _LATCHED))
        self.write(channel, log_ns, log_ns, encode(record))

    def add_configuration(self, values: Mapping[str, Any], config_hash: str, log_ns: int) -> None:
        """Store the supervisor's configuration in the file, with the hash that its verdicts carry."""
        text = yaml.safe_dump({**values}, sort_keys=False)
        self.file.attach(CONFIGURATION, "application/yaml", text.encode(), log_ns)
        self.file.add_metadata("irsbot", {"config_hash": config_hash})

    def close(self) -> None:
        """Finish the file, then write metadata.yaml beside it. Raises BagError; the data written before stays
        readable."""
        self.file.close()
        if self._folder is not None:
            text = yaml.safe_dump({"rosbag2_bagfile_information": self._information()}, sort_keys=False)
            part = self._folder / f"{METADATA}.part"
            try:
                part.write_text(text)
                os.replace(part, self._folder / METADATA)
            except OSError as error:
                raise BagError(f"cannot write '{self._folder / METADATA}': {error.strerror}") from None

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _information(self) -> dict[str, Any]:
        """The content of metadata.yaml, version 9 as ROS 2 Jazzy writes it."""
        return {
            "version": 9,
            "storage_identifier": "mcap",
            **self._extent(),
            "topics_with_message_count": [
                {
                    "topic_metadata": {
                        "name": topic.name,
                        "type": topic.type,
                        "serialization_format": "cdr",
                        "offered_qos_profiles": topic.offered,
                        "type_description_hash": topic.type_hash,
                    },
                    "message_count": self.file.counts.get(self._channels[topic.name], 0),
                }
                for topic in self._topics
            ],
            "compression_format": "",
            "compression_mode": "",
            "relative_file_paths": [self.file.path.name],
            "files": [{"path": self.file.path.name, **self._extent()}],
            "custom_data": None,
            "ros_distro": "jazzy",
        }

    def _extent(self) -> dict[str, Any]:
        start_ns = self.file.start_ns or 0
        return {
            "starting_time": {"nanoseconds_since_epoch": start_ns},
            "duration": {"nanoseconds": self.file.end_ns - start_ns},
            "message_count": self.file.message_count,
        }


Reader = McapReader | ForeignReader


class Bag:
    """An existing bag: read it, then look at `loss`. MCAP files may be damaged."""

    def __init__(self, source: Path) -> None:
        """Open a bag directory or file. Raises BagError for other paths."""
        self.readers: list[Reader] = []
        with ExitStack() as opened:
            scratch = opened.enter_context(TemporaryDirectory())
            for path in _files(source):
                self.readers.append(_reader(path, Path(scratch)))
                opened.callback(self.readers[-1].close)
            self._opened = opened.pop_all()

    def __enter__(self) -> Bag:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._opened.close()

    @property
    def loss(self) -> Loss:
        """Losses while reading, complete after iteration."""
        return sum((reader.loss for reader in self.readers), Loss(exact=True))

    def messages(self, topic: str | None = None) -> Iterator[Message]:
        """Messages in the order of recording. topic: its name with or without namespace, all topics without it."""
        for reader in self.readers:
            yield from reader.messages(lambda name: topic is None or is_named(name, topic))

    def records(self, topic: str | None = None) -> Iterator[Entry]:
        """Joint samples, states, verdicts and texts in the order of recording; other types are skipped.

        Both receive times of a sample are its recording time, by the recorder's clock. Raises BagError for a message
        that is not of its type.
        """
        for message in self.messages(topic):
            if message.type in _READ:
                yield _entry(message)

    def columns(self) -> Iterator[Entry | Columns]:
        """The same records of all topics, joint states as columns where many of one layout follow one another. Only the
        records of one topic keep their order."""
        for reader in self.readers:
            if isinstance(reader, McapReader):
                yield from columns_in(reader, _entry, _READ, JOINT_STATE)
            else:
                yield from (_entry(message) for message in reader.messages() if message.type in _READ)

    def topics(self) -> list[Topic]:
        """Topics with their definitions; for an unfinished file, the topics of the part that has been read."""
        found = [topic_of(reader, number) for reader in self.readers for number in reader.channels]
        return list({topic.name: topic for topic in found}.values())

    def configuration(self) -> dict[str, Any] | None:
        """The last configuration of the supervisor, if the bag holds one."""
        texts = [kept.data for reader in self.readers for kept in reader.attachments if kept.name == CONFIGURATION]
        return yaml.safe_load(texts[-1]) if texts else None


def _entry(message: Message) -> Entry:
    """The record of a message of a known type. Raises BagError."""
    try:
        return Entry(message.topic, message.log_ns, _READ[message.type](message))
    except cdr.CdrError as error:
        raise BagError(f"{message.topic} at {message.log_ns} ns: {error}") from None


def topic_of(reader: Reader, channel: int) -> Topic:
    """The topic of one channel of a file."""
    known = reader.channels[channel]
    schema = reader.schemas.get(known.schema_id)
    return Topic(
        known.topic,
        schema.name if schema is not None else "",
        schema.data.decode(errors="replace") if schema is not None else "",
        known.metadata.get("topic_type_hash", ""),
        yaml.safe_load(known.metadata.get("offered_qos_profiles", "")) or [],
    )


def choose_joint_topic(bag: Path, topics: Iterable[str], wanted: str | None = None) -> str:
    """Choose the topic of joint states: the only one, the only one with the usual name, or `wanted`, with or without
    its namespace. Raises BagError that lists the candidates."""
    known = sorted(set(topics))
    if not known:
        raise BagError(f"{bag}: no joint states (type {JOINT_STATE}) in it")
    wishes = known if wanted is None else [name for name in known if is_named(name, wanted)]
    found = [name for name in wishes if name == wanted] or wishes
    if wanted is None and len(found) > 1:
        found = [name for name in found if is_named(name, "joint_states")] or found
    if len(found) != 1:
        fault = f"no topic {wanted} of joint states" if not found else "several topics of joint states"
        raise BagError(f"{bag}: {fault}; choose one with --topic: {', '.join(known)}")
    return found[0]


def is_named(topic: str, wanted: str) -> bool:
    """True if this is the name of a topic, with or without its namespace."""
    return f"/{topic}".endswith(f"/{wanted.lstrip('/')}")


def is_bag(path: Path) -> bool:
    """True if a path has the name of a bag, not of a table."""
    return path.is_dir() or path.suffix in (".mcap", ".zstd", *SUFFIXES)


def _files(source: Path) -> list[Path]:
    """The files of a bag in the order of recording; the folder itself if its messages are compressed one by one."""
    if not source.is_dir():
        return [source]
    try:
        stated = yaml.safe_load((source / METADATA).read_text())["rosbag2_bagfile_information"]
        if str(stated.get("compression_mode")).lower() == "message":
            return [source]
        paths = [source / PurePath(name).name for name in stated["relative_file_paths"]]
    except (OSError, yaml.YAMLError, KeyError, TypeError, AttributeError, UnicodeDecodeError):
        paths = []  # a recorder that was killed left none
    if found := paths or sorted((file for file in source.iterdir() if _is_part(file)), key=_number):
        return found
    raise BagError(f"'{source}' is no bag: it holds no .mcap or .db3 file")


def _is_part(file: Path) -> bool:
    return file.name.removesuffix(".zstd").endswith((".mcap", *SUFFIXES))


def _number(file: Path) -> tuple[int, str]:
    """Sort key: file 10 of a split bag comes after file 9."""
    number = re.search(r"_(\d+)\.", file.name)
    return int(number[1]) if number else 0, file.name


def _reader(path: Path, scratch: Path) -> Reader:
    """Reader of one file. scratch: folder for the unpacked copy of a compressed file, up to its damage."""
    if path.suffix != ".zstd":
        return ForeignReader(path) if path.is_dir() or path.suffix in SUFFIXES else McapReader(path)
    whole = scratch / path.stem
    try:
        with path.open("rb") as packed, whole.open("wb") as unpacked:
            zstandard.ZstdDecompressor().copy_stream(packed, unpacked)
    except (OSError, zstandard.ZstdError) as error:
        raise BagError(f"cannot read '{path}': {getattr(error, 'strerror', None) or error}") from None
    found = _reader(whole, scratch)
    found.path = path
    return found


def _offered(latched: bool) -> dict[str, Any]:
    """Quality of service as rosbag2 writes it; subscribers do not know the history."""
    for_ever = {"sec": 9223372036, "nsec": 854775807}
    return {
        "history": "unknown",
        "depth": 0,
        "reliability": "reliable",
        "durability": "transient_local" if latched else "volatile",
        "deadline": dict(for_ever),
        "lifespan": dict(for_ever),
        "liveliness": "automatic",
        "liveliness_lease_duration": dict(for_ever),
        "avoid_ros_namespace_conventions": False,
    }


_LATCHED = {VERDICT, STRING}
_WRITTEN: dict[type, tuple[str, Any]] = {
    JointSample: (JOINT_STATE, cdr.encode_joint_state),
    SingularityState: (STATE, cdr.encode_state),
    Verdict: (VERDICT, cdr.encode_verdict),
    str: (STRING, cdr.encode_string),
}
_READ: dict[str, Any] = {
    JOINT_STATE: lambda message: cdr.decode_joint_state(message.data, message.log_ns, message.log_ns),
    STATE: lambda message: cdr.decode_state(message.data),
    VERDICT: lambda message: cdr.decode_verdict(message.data),
    STRING: lambda message: cdr.decode_string(message.data),
}
