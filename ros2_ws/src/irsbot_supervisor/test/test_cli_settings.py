"""`settings` on a terminal: names can be copied from it however narrow it is."""

from __future__ import annotations

from dataclasses import fields

import pytest
from rich.console import Console

from irsbot_supervisor.cli import settings as module
from irsbot_supervisor.core.settings import Settings


@pytest.mark.parametrize("width", [40, 60, 80, 200])
def test_the_names_of_settings_are_whole_on_every_terminal(
    width: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setattr(module, "out", Console(width=width))
    module.settings("irsbot2", None, False)
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= width
    firsts = {line.split("│")[1].strip() for line in lines if line.startswith("│")}
    assert firsts - {""} == {entry.name for entry in fields(Settings)}
