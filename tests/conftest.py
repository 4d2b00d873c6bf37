"""A copy of the set-up, and its modules."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A copy of the entry and the set-up, with one toy package of each kind of file."""
    shutil.copytree(ROOT / "setup", tmp_path / "copy" / "setup", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "irsbot", tmp_path / "copy")
    toy = tmp_path / "copy" / "ros2_ws" / "src" / "toy"
    for file in ("package.xml", "msg/Toy.msg", "toy/__init__.py", "config/toy.yaml"):
        (toy / file).parent.mkdir(parents=True, exist_ok=True)
        (toy / file).write_text("one")
    return tmp_path / "copy"


@pytest.fixture
def modules(monkeypatch: pytest.MonkeyPatch) -> Iterator[SimpleNamespace]:
    """The modules of the set-up, imported as ./irsbot does."""
    monkeypatch.syspath_prepend(str(ROOT / "setup"))
    import checks
    import environment
    import place
    import problems
    import progress
    import steps

    names = ("checks", "environment", "place", "problems", "progress", "steps", "work", "fingerprint")
    yield SimpleNamespace(
        checks=checks, environment=environment, place=place, problems=problems, progress=progress, steps=steps
    )
    for name in names:
        del sys.modules[name]
