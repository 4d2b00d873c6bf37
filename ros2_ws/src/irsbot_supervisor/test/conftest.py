"""Helpers are importable by their own names, also where the package stands alone; commands run in this process."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

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


@pytest.fixture
def wire(tmp_path: Path) -> Iterator[Any]:
    """A domain of its own with a suite and the drives of a robot: `cell.Wire`. Needs ROS."""
    from cell import Wire

    with Wire(tmp_path / "logs") as wire:
        yield wire


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """One supervisor for all tests that leave it as it was; nothing may have failed inside when they are over."""
    from cell import Cell, Wire

    from irsbot_msgs_py.records import Cause

    with Wire(tmp_path_factory.mktemp("shared")) as wire:
        cell = Cell(wire)
        yield cell
        assert cell.suite.stop() == {"supervisor": 0}
        assert "Traceback" not in cell.printed
        assert not any(verdict.causes & Cause.INTERNAL for verdict in cell.verdicts)


@pytest.fixture
def cell(shared: Any) -> Any:
    """A robot at rest whose supervisor says OK: `cell.Cell`."""
    from cell import GOOD, resting

    from irsbot_msgs_py.records import Level

    shared.say = resting(GOOD)
    shared.heard_level(Level.OK)
    return shared
