"""Progress of long commands where there is no terminal, as under nohup."""

from __future__ import annotations

from io import StringIO

import pytest
from rich.console import Console

from irsbot_supervisor.cli import progress


def advance_at(monkeypatch: pytest.MonkeyPatch, *times_s: float) -> None:
    """One of eight bags is done at each of these times."""
    clock_s = [0.0]
    monkeypatch.setattr(progress, "monotonic", lambda: clock_s[0])
    with progress.progress_bar() as bar:
        task = bar.add_task("bags [4]", total=8)
        for done, time_s in enumerate(times_s, 1):
            clock_s[0] = time_s
            if done % 2:
                bar.advance(task)
            else:
                bar.update(task, completed=done)


def test_in_a_file_a_line_now_and_then_says_how_far_a_long_work_is(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    advance_at(monkeypatch, 10.0, 29.0, 31.0, 60.0, 61.0, 62.0)
    lines = [line.split("  ")[:2] for line in capsys.readouterr().err.splitlines()]
    assert lines == [["bags [4]", "3 of 8"], ["bags [4]", "5 of 8"]]


def test_a_short_work_says_nothing_in_a_file(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    advance_at(monkeypatch, 1.0, 2.0, 29.0)
    assert not capsys.readouterr().err


def test_a_terminal_has_the_bar_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = StringIO()
    monkeypatch.setattr(progress, "err", Console(file=terminal, force_terminal=True, color_system=None))
    advance_at(monkeypatch, 31.0, 62.0)
    assert "2/8" in terminal.getvalue()
    assert "of 8" not in terminal.getvalue()
