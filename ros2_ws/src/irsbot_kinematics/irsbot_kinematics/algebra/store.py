"""Results kept on disk by the hash of what they follow from; a second call takes no time."""

from __future__ import annotations

import hashlib
import os
import pickle
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from irsbot_kinematics.algebra.system import System

Progress = Callable[[str, int, int], None]
"""Called with what is done, how much of it, and of how much."""

Result = TypeVar("Result")

VERSION = "1"
"""Of the stored form; another one is computed anew."""


def folder() -> Path:
    """Where results are kept: $IRSBOT_CACHE, else $XDG_CACHE_HOME/irsbot/algebra, else ~/.cache/irsbot/algebra."""
    said = os.environ.get("IRSBOT_CACHE")
    if said:
        return Path(said)
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "irsbot" / "algebra"


def content_hash(system: System, key: Any) -> str:
    """Of everything a result follows from: equations, inequalities, variables, values, what is asked."""
    said = (
        VERSION, system.equations, system.inequalities, system.pose, system.joints, system.passive, system.angles,
        sorted((name, str(value)) for name, value in system.values.items()), repr(system.structure), repr(key),
    )  # fmt: skip
    return hashlib.sha256(repr(said).encode()).hexdigest()


def stored_result(system: System, key: Any, kind: type[Result], work: Callable[[], Result], use: bool = True) -> Result:
    """The result of `work`, from the cache where it is there. A cache that cannot be read or written is no error."""
    if not use:
        return work()
    path = folder() / f"{content_hash(system, key)}.pickle"
    try:
        found = pickle.loads(path.read_bytes())
        if isinstance(found, kind):
            return found
    except Exception:
        pass
    result = work()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
            file.write(pickle.dumps(result))
        Path(file.name).replace(path)
    except OSError:
        pass
    return result
