"""Oracles are importable by their own names."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent / "oracles"))


@pytest.fixture
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Results of the algebra are kept in a folder of the test alone."""
    monkeypatch.setenv("IRSBOT_CACHE", str(tmp_path))
