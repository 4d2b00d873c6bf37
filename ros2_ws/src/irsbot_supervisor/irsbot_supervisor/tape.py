"""Records <-> bags: a directory as `ros2 bag` makes it, or one MCAP file. Needs message definitions, not ROS."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePath
from types import TracebackType
from typing import Any, NamedTuple

import yaml

from irsbot_msgs_py import cdr
from irsbot_msgs_py.records import JointSample, SingularityState, Verdict
from irsbot_supervisor.mcap_reader import Loss, McapReader, Message
from irsbot_supervisor.mcap_writer import BagError, McapWriter
from irsbot_supervisor.message_text import definition, type_hash

JOINT_STATE = "sensor_msgs/msg/JointState"
STATE = "irsbot_msgs/msg/SingularityState"
VERDICT = "irsbot_msgs/msg/Verdict"
STRING = "std_msgs/msg/String"

Record = JointSample | SingularityState | Verdict | str

METADATA = "metadata.yaml"
CONFIGURATION = "configuration.yaml"
"""Attachment with what the supervisor was configured with; its hash is in the metadata record `irsbot`."""


class Entry(NamedTuple):
    """One record of a bag. log_ns: when the recorder received it, ROS clock."""

    topic: str
    log_ns: int
    record: Record


class Topic(NamedTuple):
    """What a bag says about one topic."""

    name: str
    type: str
    text: str  # definition in the format `ros2msg`
    type_hash: str
    offered: list[dict[str, Any]]  # quality of service of the publishers


def installed_topic(name: str, type_name: str, latched: bool = False) -> Topic:
    """A topic of an installed type. latched: whether it is offered transient local. Raises BagError."""
    return Topic(name, type_name, definition(type_name), type_hash(type_name), [_offered(latched)])


class TapeWriter:
    """A new bag. A target with the suffix .mcap becomes one file, any other a directory with metadata.yaml."""

    def __init__(self, target: Path, compression: str = "") -> None:
        """Create it; nothing may be there. compression: of the chunks, "" or "zstd". Raises BagError."""
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
        """Write one record, as received at log_ns (ROS clock)."""
        kind, encode = _WRITTEN[type(record)]
        channel = self._channels.get(topic)
        if channel is None:
            channel = self.channel(installed_topic(topic, kind, latched=kind in _LATCHED))
        self.write(channel, log_ns, log_ns, encode(record))

    def add_configuration(self, values: Mapping[str, Any], config_hash: str, log_ns: int) -> None:
        """Keep the supervisor's configuration in the file, with the hash that its verdicts carry."""
        text = yaml.safe_dump({**values}, sort_keys=False)
        self.file.attach(CONFIGURATION, "application/yaml", text.encode(), log_ns)
        self.file.add_metadata("irsbot", {"config_hash": config_hash})

    def close(self) -> None:
        """Finish the file, then metadata.yaml beside it. Raises BagError; what was written before stays readable."""
        self.file.close()
        if self._folder is not None:
            text = yaml.safe_dump({"rosbag2_bagfile_information": self._information()}, sort_keys=False)
            part = self._folder / f"{METADATA}.part"
            try:
                part.write_text(text)
                os.replace(part, self._folder / METADATA)
            except OSError as error:
                raise BagError(f"cannot write '{self._folder / METADATA}': {error.strerror}") from None

    def __enter__(self) -> TapeWriter:
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


class Tape:
    """An existing bag, damaged or not: read it, then look at `loss`."""

    def __init__(self, source: Path) -> None:
        """Open a bag directory or a file. Raises BagError for something that is neither."""
        self.readers = [McapReader(path) for path in _files(source)]

    def __enter__(self) -> Tape:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for reader in self.readers:
            reader.close()

    @property
    def loss(self) -> Loss:
        """What could not be read, complete after iteration."""
        return sum((reader.loss for reader in self.readers), Loss(exact=True))

    def messages(self, topic: str | None = None) -> Iterator[Message]:
        """Messages in the order of recording. topic: its name with or without namespace, all topics without it."""
        for reader in self.readers:
            yield from reader.messages(lambda name: topic is None or f"/{name}".endswith(f"/{topic.lstrip('/')}"))

    def records(self, topic: str | None = None) -> Iterator[Entry]:
        """Joint samples, states, verdicts and texts in the order of recording; other types are passed over.

        A sample carries the time of its recording as both of its receive times: the recorder's, not the supervisor's.
        Raises BagError for a message that is not of its type.
        """
        for message in self.messages(topic):
            decode = _READ.get(message.type)
            if decode is not None:
                try:
                    yield Entry(message.topic, message.log_ns, decode(message))
                except cdr.CdrError as error:
                    raise BagError(f"{message.topic} at {message.log_ns} ns: {error}") from None

    def topics(self) -> list[Topic]:
        """The topics with their definitions; those of an unfinished file only as far as it has been read."""
        found = [topic_of(reader, number) for reader in self.readers for number in reader.channels]
        return list({topic.name: topic for topic in found}.values())

    def configuration(self) -> dict[str, Any] | None:
        """What the supervisor was configured with at the end, if the bag holds it."""
        texts = [kept.data for reader in self.readers for kept in reader.attachments if kept.name == CONFIGURATION]
        return yaml.safe_load(texts[-1]) if texts else None


def topic_of(reader: McapReader, channel: int) -> Topic:
    """What a file says about one of its channels."""
    known = reader.channels[channel]
    schema = reader.schemas.get(known.schema_id)
    return Topic(
        known.topic,
        schema.name if schema is not None else "",
        schema.data.decode(errors="replace") if schema is not None else "",
        known.metadata.get("topic_type_hash", ""),
        yaml.safe_load(known.metadata.get("offered_qos_profiles", "")) or [],
    )


def _files(source: Path) -> list[Path]:
    if not source.is_dir():
        return [source]
    try:
        listed = yaml.safe_load((source / METADATA).read_text())["rosbag2_bagfile_information"]["relative_file_paths"]
        paths = [source / PurePath(name).name for name in listed]
    except (OSError, yaml.YAMLError, KeyError, TypeError, UnicodeDecodeError):
        paths = []  # a recorder that was killed left none
    if found := paths or sorted(source.glob("*.mcap")):
        return found
    raise BagError(f"'{source}' is no bag: it holds no .mcap file")


def _offered(latched: bool) -> dict[str, Any]:
    """Quality of service as rosbag2 writes it; history is not known to a subscriber."""
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
