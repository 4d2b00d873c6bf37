"""The bags among files and folders."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from irsbot_supervisor.bag.bag_files import METADATA, are_one_bag, is_part
from irsbot_supervisor.bag.errors import BagError


def bags_in(places: Sequence[Path]) -> list[Path]:
    """Bags in the order given, those below a folder by name; each once. A folder with the files of one bag is a bag; in
    a folder with files of several bags each file is one.

    Raises BagError for a place that is not there, and for a folder without any bag.
    """
    found: dict[Path, Path] = {}
    seen: set[Path] = set()
    for place in places:
        if not place.exists():
            raise BagError(f"the bag '{place}' does not exist")
        known = place.resolve() in seen
        here = _below(place, seen) if place.is_dir() else [place]
        if not (here or known):
            raise BagError(f"'{place}' is no bag and holds none: there is no .mcap, .db3 or .bag file in it")
        for bag in here:
            found.setdefault(bag.resolve(), bag)
    return [bag for place, bag in found.items() if bag.is_dir() or place.parent not in found]  # else a file of a bag


def _below(folder: Path, seen: set[Path]) -> list[Path]:
    """The bag that a folder is, or the bags in it, and all bags below it. seen: folders that were searched, which links
    may lead to again."""
    if (place := folder.resolve()) in seen:
        return []
    seen.add(place)
    entries = sorted(folder.iterdir())
    parts = [entry for entry in entries if entry.is_file() and is_part(entry)]
    one = folder / METADATA in entries or (parts and are_one_bag(parts))
    itself = [folder] if one else parts
    return itself + [bag for entry in entries if entry.is_dir() for bag in _below(entry, seen)]
