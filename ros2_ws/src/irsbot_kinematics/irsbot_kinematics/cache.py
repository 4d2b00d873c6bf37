"""Where results are kept that take long to compute."""

from __future__ import annotations

import os
from pathlib import Path


def cache_folder(kind: str) -> Path:
    """Folder of one kind of results: $IRSBOT_CACHE, else $XDG_CACHE_HOME/irsbot/<kind>, else ~/.cache/irsbot/<kind>."""
    stated = os.environ.get("IRSBOT_CACHE")
    if stated:
        return Path(stated)
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "irsbot" / kind
