"""Cache of results on disk, by the hash of their input."""

from __future__ import annotations

import hashlib
import pickle
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from irsbot_kinematics.algebra.model.system import System
from irsbot_kinematics.cache import cache_folder

Progress = Callable[[str, int, int], None]
"""Progress callback: task, done, total."""

Result = TypeVar("Result")

VERSION = "1"
"""Version of the stored form; results of other versions are computed anew."""


def content_hash(system: System, key: Any) -> str:
    """Hash of the input of a result: equations, inequalities, variables, values, request."""
    stated = (
        VERSION, system.equations, system.inequalities, system.pose, system.joints, system.passive, system.angles,
        sorted((name, str(value)) for name, value in system.values.items()), repr(system.structure), repr(key),
    )  # fmt: skip
    return hashlib.sha256(repr(stated).encode()).hexdigest()


def stored_result(system: System, key: Any, kind: type[Result], work: Callable[[], Result], use: bool = True) -> Result:
    """The result of `work`, from the cache if it is there. A cache that cannot be read or written is not an error."""
    if not use:
        return work()
    path = cache_folder("algebra") / f"{content_hash(system, key)}.pickle"
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
