"""Files that appear when they are complete, or not at all."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yields the path of a draft beside the file. At the end it becomes the file; after an error it is removed.

    Raises OSError, before the work begins if the folder cannot be written.
    """
    draft = path.with_name(f"{path.name}.part")
    with draft.open("wb"):
        pass
    try:
        yield draft
        draft.replace(path)
    finally:
        try:
            draft.unlink(missing_ok=True)
        except KeyboardInterrupt:  # a library may have raised the first one before Python saw the signal
            draft.unlink(missing_ok=True)
            raise


def write_whole(path: Path, data: bytes) -> None:
    """Write a file. Raises OSError."""
    with whole_file(path) as draft:
        draft.write_bytes(data)
