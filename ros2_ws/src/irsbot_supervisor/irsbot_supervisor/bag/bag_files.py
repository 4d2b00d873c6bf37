"""Files of a bag: a folder as `ros2 bag` makes it, or one file."""

from __future__ import annotations

import re
from pathlib import Path, PurePath

import yaml

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
    BagError for a folder without files of a bag."""
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
