"""The script of the gallery draws, in every format, and its page names the sheets that are there."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[1]
GALLERY = ROOT / "docs" / "pictures" / "gallery"
BEGINNINGS = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}


@pytest.fixture(scope="module")
def script() -> Iterator[ModuleType]:
    monkeypatch = pytest.MonkeyPatch()
    monkeypatch.syspath_prepend(GALLERY.parent)
    yield import_module("draw_gallery")
    monkeypatch.undo()


def test_a_sheet_is_drawn_in_every_format(script: ModuleType, tmp_path: Path) -> None:
    sheet = script.Sheet("five_bar", 9)
    for suffix, beginning in BEGINNINGS.items():
        sheet.draw(tmp_path / f"five_bar{suffix}")
        assert (tmp_path / f"five_bar{suffix}").read_bytes().startswith(beginning)
    text = (tmp_path / "five_bar.svg").read_text()
    for label in ("x [m]", "z [m]", "joint_1 [rad]", "smallest margin [1]", "Zones at rest", "Force workspace"):
        assert f"<!-- {label}" in text


def test_the_bars_of_a_drawing_have_the_lengths_of_the_robot(script: ModuleType) -> None:
    """The rods of a five-bar end in its platform point."""
    sheet = script.Sheet("five_bar", 2)
    ends = [end for start, end, _link in sheet.bars()]
    x, z = sheet.at.pose
    assert sum(abs(end[0] - x) < 1e-6 and abs(end[2] - z) < 1e-6 for end in ends) >= 1


def test_the_page_shows_the_sheets_that_are_there(script: ModuleType) -> None:
    assert (ROOT / "docs" / "reference" / "gallery.md").read_text() == script.page(GALLERY)
