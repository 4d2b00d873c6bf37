"""Writes bags as `ros2 bag` does: a folder with metadata.yaml, or one MCAP file. Needs message definitions, not ROS."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

import yaml

from irsbot_supervisor.bag.bag_files import CONFIGURATION, METADATA
from irsbot_supervisor.bag.entries import ENCODERS, LATCHED, Record
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.bag.mcap_writer import McapWriter
from irsbot_supervisor.bag.topics import Topic, installed_topic
from irsbot_supervisor.bag.whole_file import write_whole


def claimed(target: Path) -> Path:
    """The target, or the first of target_2, target_3 and so on that does not exist. A folder is created: of two that
    ask for the same one at the same time, each gets its own. Raises BagError."""
    path, number = target, 1
    while not _is_claimed(path):
        number += 1
        path = target.with_name(f"{target.stem}_{number}{target.suffix}")
    return path


def _is_claimed(path: Path) -> bool:
    if path.suffix == ".mcap":
        return not path.exists()
    try:
        path.mkdir(parents=True)
    except FileExistsError:
        return False
    except OSError as error:
        raise BagError(f"cannot create '{path}': {error.strerror}") from None
    return True


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
        self._channels: dict[tuple[str, ...], int] = {}  # by name, type, definition and encodings
        self._added: dict[str, int] = {}  # channels of `add`, by name
        self._topics: list[tuple[Topic, int]] = []  # with their channels
        self._schemas: dict[tuple[str, ...], int] = {("", "", ""): 0}  # 0: a channel without a schema

    def channel(self, topic: Topic) -> int:
        """The channel of a topic, for `write`. Topics of one name with other types or encodings have their own."""
        schema = (topic.type, topic.text, topic.text_encoding)
        key = (topic.name, topic.encoding, *schema)
        if key not in self._channels:
            if schema not in self._schemas:
                self._schemas[schema] = self.file.add_schema(*schema)
            channel = self.file.add_channel(topic.name, self._schemas[schema], topic.metadata, topic.encoding)
            self._channels[key] = channel
            self._topics.append((topic, channel))
        return self._channels[key]

    def add(self, topic: str, record: Record, log_ns: int) -> None:
        """Write one record that was received at log_ns (ROS clock)."""
        kind, encode = ENCODERS[type(record)]
        if topic not in self._added:
            self._added[topic] = self.channel(installed_topic(topic, kind, latched=kind in LATCHED))
        self.write(self._added[topic], log_ns, log_ns, encode(record))

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
            try:
                write_whole(self._folder / METADATA, text.encode())
            except OSError as error:
                raise BagError(f"cannot write '{self._folder / METADATA}': {error.strerror}") from None

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Finish the bag; after an error leave it without its end, so that it does not look complete."""
        if kind is None:
            self.close()
        else:
            self.file.abandon()

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
                        "serialization_format": topic.encoding,
                        "offered_qos_profiles": topic.offered,
                        "type_description_hash": topic.type_hash,
                    },
                    "message_count": self.file.counts.get(channel, 0),
                }
                for topic, channel in self._topics
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
