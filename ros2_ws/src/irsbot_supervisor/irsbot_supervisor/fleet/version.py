"""Which code judges: results of other code are other results."""

from __future__ import annotations

import functools
import hashlib
from importlib.util import find_spec
from pathlib import Path

from irsbot_supervisor import __version__

PACKAGES = ("irsbot_msgs_py", "irsbot_kinematics", "irsbot_supervisor")
KINDS = (".py", ".yaml", ".j2", ".css", ".js")
"""Suffixes of files that decide what is judged and how a page shows it: code, robots, settings, templates."""


@functools.cache
def code_version() -> str:
    """The version of irsbot with a hash of its sources: the same on two machines if the code is."""
    found = hashlib.sha256()
    for package in PACKAGES:
        spec = find_spec(package)
        assert spec is not None, "we are one of them"
        for root in map(Path, spec.submodule_search_locations or ()):
            for file in sorted(file for file in root.rglob("*") if file.suffix in KINDS):
                found.update(f"{package}/{file.relative_to(root)}\0".encode())
                found.update(hashlib.sha256(file.read_bytes()).digest())
    return f"{__version__}+{found.hexdigest()[:12]}"
