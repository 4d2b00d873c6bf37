"""The bags among files and folders."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from irsbot_supervisor.bag.bag_files import METADATA
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.bag.foreign import SUFFIXES


def bags_in(places: Sequence[Path]) -> list[Path]:
    """Bags in the order given, those below a folder by name; each once. A folder with files of a bag is one bag.

    Raises BagError for a place that is not there, and for a folder without any bag.
    """
    found: dict[Path, Path] = {}
    for place in places:
        if not place.exists():
            raise BagError(f"the bag '{place}' does not exist")
        here = _below(place) if place.is_dir() else [place]
        if not here:
            raise BagError(f"'{place}' is no bag and holds none: there is no .mcap, .db3 or .bag file in it")
        for bag in here:
            found.setdefault(bag.resolve(), bag)
    return list(found.values())


def _below(folder: Path) -> list[Path]:
    """The bag that a folder is, if it is one, and all bags below it."""
    entries = sorted(folder.iterdir())
    itself = [folder] if any(_is_part(entry) for entry in entries) else []
    return itself + [bag for entry in entries if entry.is_dir() for bag in _below(entry)]


def _is_part(file: Path) -> bool:
    return file.name == METADATA or file.name.removesuffix(".zstd").endswith((".mcap", *SUFFIXES))
