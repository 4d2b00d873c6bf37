"""Reads bags of other recorders with the library `rosbags`: sqlite3, messages compressed one by one, ROS 1.

The reader has the interface of `McapReader`, but it does not repair: it refuses a damaged bag with one sentence.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from mcap.records import Attachment, Channel, Metadata, Schema

from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.bag.loss import Loss
from irsbot_supervisor.bag.message import Message

SUFFIXES = (".db3", ".bag")
"""Suffixes of files that only the library reads; it also reads folders with a metadata.yaml."""


class ForeignReader:
    """An open bag: iterate `messages()`; then look at `loss`."""

    def __init__(self, path: Path) -> None:
        """Open a folder with metadata.yaml, or one file. Raises BagError if it cannot be read, or without `rosbags`."""
        self.path = path
        self.attachments: list[Attachment] = []
        self.metadata: list[Metadata] = []
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        folder, stem = (path, "") if path.is_dir() else (path.parent, path.name)
        left = [wal for wal in folder.glob(f"{stem}*-wal") if wal.stat().st_size]  # what sqlite had not yet taken over
        self.loss = Loss(exact=not left, cut=bool(left))
        try:
            from rosbags.highlevel import AnyReader  # a machine that reads its own bags alone needs no rosbags
            from rosbags.rosbag2 import Reader
            from rosbags.typesys import Stores, get_typestore
        except ImportError:
            raise BagError(f"cannot read '{path}': it needs rosbags, 'pip install rosbags'") from None
        self._stack = ExitStack()
        self._types = get_typestore(Stores.ROS2_JAZZY) if path.suffix == ".bag" else None  # ROS 1 has another encoding
        try:
            reader: Any = AnyReader([path]) if self._types else Reader(path)
            self._reader = self._stack.enter_context(reader)
        except Exception as problem:  # of the library, of sqlite, of the decompressor: each has its own
            raise self._unreadable(problem) from None
        for connection in self._reader.connections:
            number, kind = len(self.channels) + 1, connection.msgtype
            self.schemas[number] = Schema(number, connection.msgdef.data.encode(), "ros2msg", kind)
            known = {"topic_type_hash": connection.digest or ""}
            self.channels[number] = Channel(number, connection.topic, "cdr", known, number)

    def close(self) -> None:
        """Release the files."""
        self._stack.close()

    def messages(self, wanted: Callable[[str], bool] = lambda topic: True) -> Iterator[Message]:
        """Every message of the wanted topics, as CDR. Raises BagError where the bag is damaged."""
        connections = [known for known in self._reader.connections if wanted(known.topic)]
        numbers: Counter[str] = Counter()
        try:
            for known, log_ns, data in self._reader.messages(connections) if connections else ():
                numbers[known.topic] += 1
                if self._types is not None and known.msgtype in self._types.fielddefs:
                    data = self._types.ros1_to_cdr(data, known.msgtype)
                yield Message(known.topic, known.msgtype, log_ns, log_ns, numbers[known.topic], bytes(data))
        except GeneratorExit:
            raise
        except Exception as problem:
            raise self._unreadable(problem) from None

    def _unreadable(self, problem: Exception) -> BagError:
        stated = " ".join(str(problem).split()) or type(problem).__name__
        return BagError(f"cannot read '{self.path}': {stated}")
