"""Reads bags: a folder as `ros2 bag` makes it, or one file; also bags of other recorders and damaged ones."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Any

import zstandard

from irsbot_kinematics.description import yaml_text
from irsbot_supervisor.bag.bag_files import CONFIGURATION, files_of
from irsbot_supervisor.bag.column_reader import Columns, columns_in
from irsbot_supervisor.bag.entries import DECODERS, Entry, entry_of
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.bag.foreign import SUFFIXES, ForeignReader
from irsbot_supervisor.bag.loss import Loss
from irsbot_supervisor.bag.mcap_reader import McapReader
from irsbot_supervisor.bag.message import Message
from irsbot_supervisor.bag.topics import JOINT_STATE, Topic, is_named

Reader = McapReader | ForeignReader


class Bag:
    """An existing bag: read it, then look at `loss`. MCAP files may be damaged.

    Compressed files are unpacked into the temporary folder, all of them when the bag is opened.
    """

    def __init__(self, source: Path) -> None:
        """Open a bag directory or file. Raises BagError for other paths."""
        self.readers: list[Reader] = []
        with ExitStack() as opened:
            scratch = opened.enter_context(TemporaryDirectory())
            for path in files_of(source):
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
        for reader in self.readers:
            decoded = _decoder_of(reader)
            for message in reader.messages(lambda name: topic is None or is_named(name, topic)):
                if message.type in DECODERS:
                    yield decoded(message)

    def columns(self) -> Iterator[Entry | Columns]:
        """The same records of all topics, joint states as columns where many of one layout follow one another. Only the
        records of one topic keep their order."""
        for reader in self.readers:
            if isinstance(reader, McapReader):
                yield from columns_in(reader, _decoder_of(reader), DECODERS, JOINT_STATE)
            else:
                yield from map(_decoder_of(reader), (one for one in reader.messages() if one.type in DECODERS))

    def topics(self) -> list[Topic]:
        """Topics with their definitions, one of each name; for an unfinished file, those of the part that has been
        read."""
        found = [topic_of(reader, number) for reader in self.readers for number in reader.channels]
        return list({topic.name: topic for topic in found}.values())

    def configuration(self) -> dict[str, Any] | None:
        """The last configuration of the supervisor, if the bag holds one. Raises BadInput if that is no YAML."""
        texts = [kept.data for reader in self.readers for kept in reader.attachments if kept.name == CONFIGURATION]
        return yaml_text.parsed(texts[-1], CONFIGURATION) if texts else None


def topic_of(reader: Reader, channel: int) -> Topic:
    """The topic of one channel of a file."""
    known = reader.channels[channel]
    schema = reader.schemas.get(known.schema_id)
    return Topic(
        known.topic,
        schema.name if schema is not None else "",
        schema.data.decode(errors="surrogateescape") if schema is not None else "",
        known.metadata,
        schema.encoding if schema is not None else "",
        known.message_encoding,
    )


def _decoder_of(reader: Reader) -> Callable[[Message], Entry]:
    """`entry_of` whose errors name the file."""

    def decoded(message: Message) -> Entry:
        try:
            return entry_of(message)
        except BagError as error:
            raise BagError(f"{reader.path}: {error}") from None

    return decoded


def _reader(path: Path, scratch: Path) -> Reader:
    """Reader of one file. scratch: folder for the unpacked copy of a compressed file, up to its damage."""
    if path.suffix != ".zstd":
        return ForeignReader(path) if path.is_dir() or path.suffix in SUFFIXES else McapReader(path)
    whole = scratch / path.stem
    damage = ""
    try:
        packed = path.open("rb")
    except OSError as error:
        raise BagError(f"cannot read '{path}': {error.strerror}") from None
    try:
        with packed, whole.open("wb") as unpacked:
            zstandard.ZstdDecompressor().copy_stream(packed, unpacked)
    except zstandard.ZstdError as error:  # what is before it is read
        damage = f" ({error})"
    except OSError as error:
        place = f"cannot unpack '{path}' into '{scratch.parent}'"
        raise BagError(f"{place}: {error.strerror}; TMPDIR names another folder") from None
    try:
        found = _reader(whole, scratch)
    except BagError as error:
        raise BagError(f"{str(error).replace(str(whole), str(path))}{damage}") from None
    found.path = path
    if isinstance(found, McapReader):
        whole.unlink()  # it is mapped: so nothing of it stays if the process is killed
    return found
