"""Compiled forms of modules of the suite, if the set-up has made them: the same sources, the same results, faster.

They are in a folder of the search path, with `irsbot_compiled`, which lists their sources. The compiled form of a
module is used only while all of these sources are unchanged; otherwise plain Python runs. The environment variable
IRSBOT_PLAIN also selects plain Python.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Mapping, Sequence
from importlib import import_module
from importlib.machinery import EXTENSION_SUFFIXES, ExtensionFileLoader, ModuleSpec
from importlib.util import find_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

INDEX = "irsbot_compiled"
"""Module that the set-up writes: SOURCES, the names of the modules, and FOLDER, the folder of their compiled forms. Its
name begins with the digest of the sources."""

SWITCH = "IRSBOT_PLAIN"
"""Any text selects plain Python."""


class Finder:
    """Finds the compiled form of modules before Python finds their sources."""

    def __init__(self, folder: Path) -> None:
        files = folder.rglob(f"*{EXTENSION_SUFFIXES[0]}")
        self._files = {".".join(_stem(file.relative_to(folder)).parts): str(file) for file in files}

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Called by importlib."""
        file = self._files.get(name)
        if file is None:
            return None
        return spec_from_file_location(name, file, loader=ExtensionFileLoader(name, file))


def prefer() -> None:
    """Import compiled forms from now on. Does nothing if there are none, or only older ones."""
    if os.environ.get(SWITCH) or any(isinstance(finder, Finder) for finder in sys.meta_path):
        return
    try:
        index = import_module(INDEX)
    except ImportError:
        return
    if digest(index.SOURCES) == index.FOLDER.name.partition("-")[0]:
        sys.meta_path.insert(0, Finder(index.FOLDER))


def digest(sources: Sequence[str]) -> str:
    """Digest of the present sources of modules. Empty if some are missing."""
    roots: dict[str, Path | None] = {}
    for name in sources:
        package = name.partition(".")[0]
        if package not in roots:
            spec = find_spec(package)
            roots[package] = Path(spec.origin).parent.parent if spec is not None and spec.origin else None
    return digest_of({name: root.joinpath(*name.split(".")) for name in sources if (root := roots[name.split(".")[0]])})


def digest_of(files: Mapping[str, Path]) -> str:
    """Digest of the interpreter, of modules' names, and of the content of their files, given without suffix."""
    found = hashlib.sha256(EXTENSION_SUFFIXES[0].encode())
    try:
        for name, file in files.items():
            data = file.with_suffix(".py").read_bytes()
            found.update(f"{name} {len(data)} ".encode() + data)
    except OSError:
        return ""
    return found.hexdigest()[:16]


def are_used() -> bool:
    """True if this process uses compiled forms."""
    return any(isinstance(finder, Finder) for finder in sys.meta_path)


def _stem(file: Path) -> Path:
    return file.with_name(file.name.partition(".")[0])
