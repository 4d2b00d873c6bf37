"""A folder of results that a later run goes on with: every file appears when it is complete."""

from __future__ import annotations

import os
from pathlib import Path

from irsbot_kinematics import BadInput


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
            _write(self._mark, f"Written by irsbot: {self._text}\n".encode())
        file.parent.mkdir(parents=True, exist_ok=True)
        _write(file, data)


def _write(file: Path, data: bytes) -> None:
    part = file.with_name(f"{file.name}.part")
    part.write_bytes(data)
    os.replace(part, file)
