"""One number for everything on which a build of the workspace depends."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Iterator
from pathlib import Path

READ = ("package.xml", "setup.py", "setup.cfg", "CMakeLists.txt")
READ_SUFFIXES = (".msg", ".srv", ".action", ".cmake", ".in", ".c", ".h", ".cpp", ".hpp")
PASSED_OVER = ("test", "__pycache__")


def fingerprint(parts: Iterable[str | bytes]) -> str:
    """A digest that changes when any part changes."""
    digest = hashlib.sha256()
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        digest.update(len(data).to_bytes(8, "big") + data)
    return digest.hexdigest()


def packages(source: Path) -> list[str]:
    """Names of the ROS packages of the workspace."""
    return sorted(path.parent.name for path in source.glob("*/package.xml"))


def workspace_parts(source: Path) -> Iterator[str | bytes]:
    """Everything that a build with symbolic links has to see again: declarations by content, other files by name.

    Python modules are linked as whole directories, so neither their content nor their names matter.
    """
    for package in packages(source):
        for directory, subdirectories, files in os.walk(source / package):
            subdirectories[:] = sorted(d for d in subdirectories if _is_ours(d))
            inner = Path(directory).relative_to(source)
            for name in sorted(files):
                if not _is_ours(name) or (name.endswith(".py") and inner.parts[1:2] == (package,)):
                    continue
                yield str(inner / name)
                if name in READ or name.endswith(READ_SUFFIXES):
                    yield Path(directory, name).read_bytes()


def _is_ours(name: str) -> bool:
    return name not in PASSED_OVER and not name.startswith(".") and not name.endswith((".egg-info", ".pyc"))
