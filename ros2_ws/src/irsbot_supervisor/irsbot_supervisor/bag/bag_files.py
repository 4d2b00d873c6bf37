"""Files of a bag: a folder as `ros2 bag` makes it, or one file."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path, PurePath

from irsbot_kinematics import BadInput
from irsbot_kinematics.description import yaml_text
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.bag.foreign import SUFFIXES

METADATA = "metadata.yaml"
"""Name of the file that lists the others of a bag folder."""

CONFIGURATION = "configuration.yaml"
"""Name of the attachment with the configuration of the supervisor; its hash is in the metadata record `irsbot`."""


def is_bag(path: Path) -> bool:
    """True if a path is a folder or has the suffix of a bag file; tables of samples have other suffixes."""
    return path.is_dir() or path.suffix in (".mcap", ".zstd", *SUFFIXES)


def files_of(source: Path) -> list[Path]:
    """The files of a bag in the order of recording; the folder itself if its messages are compressed one by one. Raises
    BagError for a folder without files of a bag, and for one with those of several bags."""
    if not source.is_dir():
        return [source]
    try:
        stated = yaml_text.parsed((source / METADATA).read_text(encoding="utf-8"))["rosbag2_bagfile_information"]
        if str(stated.get("compression_mode")).lower() == "message":
            return [source]
        paths = [source / PurePath(name).name for name in stated["relative_file_paths"]]
    except (OSError, BadInput, KeyError, TypeError, AttributeError, UnicodeDecodeError):
        paths = []  # a recorder that was killed left none
    if paths:
        return paths
    found = sorted(filter(is_part, source.iterdir()), key=lambda file: (_numbered(file)[1], file.name))
    if not found:
        raise BagError(f"'{source}' is no bag: it holds no .mcap or .db3 file")
    if not are_one_bag(found):
        raise BagError(f"'{source}' holds several bags; name one of them: {', '.join(file.name for file in found)}")
    return found


def is_part(file: Path) -> bool:
    """True if a file has the suffix of a bag's."""
    return file.name.removesuffix(".zstd").endswith((".mcap", *SUFFIXES))


def are_one_bag(files: Sequence[Path]) -> bool:
    """True if the names of files, at least one, differ only in numbers that follow each other, as those of a split bag
    do. A date and a time are no such numbers."""
    names, numbers = zip(*map(_numbered, files), strict=True)
    return len(set(names)) == 1 and sorted(numbers) == list(range(min(numbers), min(numbers) + len(files)))


def _numbered(file: Path) -> tuple[str, int]:
    """Name of the bag that a file belongs to, and the number of the file: 0 if it has none."""
    stem = Path(file.name.removesuffix(".zstd")).stem
    found = re.fullmatch(r"(.*)_(\d+)", stem)
    return (found[1], int(found[2])) if found else (stem, 0)
