"""Files are whole or absent: after an error, an interrupt, and an interrupt while the first one is being handled."""

from __future__ import annotations

from pathlib import Path

import polars as pl
import pytest

from irsbot_supervisor.bag.column_stream import table_file
from irsbot_supervisor.bag.whole_file import whole_file, write_whole


def test_a_file_appears_when_it_is_complete(tmp_path: Path) -> None:
    file = tmp_path / "a.html"
    file.write_text("earlier")
    with whole_file(file) as draft:
        draft.write_text("new")
        assert file.read_text() == "earlier"
    assert file.read_text() == "new"
    write_whole(file, b"newest")
    assert [(one.name, one.read_text()) for one in tmp_path.iterdir()] == [("a.html", "newest")]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_after_an_error_what_was_there_is_still_there(tmp_path: Path, error: type[BaseException]) -> None:
    file = tmp_path / "a.html"
    file.write_text("earlier")
    with pytest.raises(error), whole_file(file):
        raise error
    assert [(one.name, one.read_text()) for one in tmp_path.iterdir()] == [("a.html", "earlier")]


def test_a_second_interrupt_leaves_no_draft(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    unlink, interrupts = Path.unlink, [KeyboardInterrupt]

    def interrupted(path: Path, missing_ok: bool = False) -> None:
        if interrupts:
            raise interrupts.pop()
        unlink(path, missing_ok=missing_ok)

    monkeypatch.setattr(Path, "unlink", interrupted)
    with pytest.raises(KeyboardInterrupt), whole_file(tmp_path / "a.csv"):
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_written_is_told_before_the_work_begins(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), whole_file(tmp_path / "gone" / "a.csv"):
        pytest.fail("the work has begun")


@pytest.mark.parametrize("full", [pl.exceptions.ComputeError("No space left (os error 28)"), OSError("disk full")])
def test_an_error_that_polars_states_in_words_names_the_file(tmp_path: Path, full: Exception) -> None:
    file = tmp_path / "a.parquet"
    with pytest.raises(OSError, match="cannot be written") as told, table_file(file):
        raise full
    assert told.value.filename == str(file)
    assert list(tmp_path.iterdir()) == []


def test_another_error_stays_as_it_is(tmp_path: Path) -> None:
    with pytest.raises(pl.exceptions.ComputeError, match="a worker ended"), table_file(tmp_path / "a.parquet"):
        raise pl.exceptions.ComputeError("a worker ended")
    with pytest.raises(PermissionError), table_file(tmp_path / "a.csv"):
        raise PermissionError(13, "Permission denied")
