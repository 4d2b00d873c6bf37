"""Helpers are importable by their own names, also where the package stands alone; commands run in this process."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent / "helpers"))


@pytest.fixture
def irsbot():
    """Runs `irsbot ...` and gives exit code, standard output and standard error."""
    from command import irsbot  # takes a second to load, and few files need it

    return irsbot


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Work with a NaN, silence, a jump that is latched, and a reset that is refused."""
    from replayed import record_work

    return record_work(tmp_path_factory.mktemp("bag") / "run.mcap")
