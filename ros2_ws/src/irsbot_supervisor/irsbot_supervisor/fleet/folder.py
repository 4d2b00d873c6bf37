"""A folder of results that a later run goes on with: every file appears when it is complete.

The name of a file holds the key of what it was made from, so what is there is not made again.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from pathlib import Path

from irsbot_kinematics import BadInput
from irsbot_kinematics.description import yaml_text
from irsbot_kinematics.description.topologies import file_of
from irsbot_supervisor.bag.whole_file import write_whole
from irsbot_supervisor.fleet.version import code_version

BLOCK = 1 << 20
"""Bytes of a file that are read at once."""


def key_of(stated: str, files: Iterable[Path] = ()) -> str:
    """A hash of a text, of the names and contents of files, and of this code.

    Raises OSError if a file cannot be read.
    """
    found = hashlib.sha256(f"{stated}\0{code_version()}".encode())
    for file in files:
        found.update(f"\0{file.name}\0".encode())
        with file.open("rb") as opened:
            while block := opened.read(BLOCK):
                found.update(block)
    return found.hexdigest()[:16]


def robot_files(robot: str) -> list[Path]:
    """The files that decide what a robot is: none of a preset; else its file, the Python file of its mechanism, all
    Python files beside one of the two, and the file of its tubes."""
    file = Path(robot)
    if not file.is_file():
        return []
    try:
        stated = yaml_text.parsed(file.read_bytes())
    except BadInput:
        stated = None  # it will be refused when it is read as a robot
    stated = stated if isinstance(stated, dict) else {}
    mechanism = file_of(stated.get("mechanism"), file.parent)
    modules = python_files([place for place in (file, mechanism) if place is not None])
    return [file, *modules, *tubes_files(stated.get("supervision"))]


def python_files(beside: Iterable[Path]) -> list[Path]:
    """All Python files in the folders of some files."""
    folders = dict.fromkeys(file.parent for file in beside)
    return [module for folder in folders for module in sorted(folder.glob("*.py"))]


def tubes_files(settings: object) -> list[Path]:
    """The file of the elastic design that settings, by name, state; none of a preset."""
    stated = settings.get("tubes") if isinstance(settings, Mapping) else None
    file = Path(stated) if isinstance(stated, str) else Path()
    return [file] if file.is_file() else []


class ResultFolder:
    """A new or empty folder, or one that a run of the same kind left behind, known by its file KIND.txt."""

    def __init__(self, path: Path, kind: str, text: str) -> None:
        """kind: one word. text: what the folder holds, for people.

        Raises BadInput for a folder with other files.
        """
        self.path, self._mark, self._text = path, path / f"{kind}.txt", text
        if path.exists() and not path.is_dir():
            raise BadInput(f"cannot write '{path}': it is a file, must be a new folder, or one of a {kind}")
        if path.is_dir() and any(path.iterdir()) and not self._mark.exists():
            raise BadInput(f"'{path}' holds other files; a {kind} needs a new or empty folder, or one of a {kind}")

    def write(self, file: Path, data: bytes) -> None:
        """Write a file of the folder, with the folders above it."""
        if not self._mark.exists():
            self.path.mkdir(parents=True, exist_ok=True)
            write_whole(self._mark, f"Written by irsbot: {self._text}\n".encode())
        file.parent.mkdir(parents=True, exist_ok=True)
        write_whole(file, data)
