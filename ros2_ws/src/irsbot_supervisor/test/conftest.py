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
