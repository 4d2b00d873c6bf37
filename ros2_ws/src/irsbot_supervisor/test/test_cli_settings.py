"""`settings` on a terminal: names can be copied from it however narrow it is."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path

import pytest
from command import irsbot
from rich.console import Console

from irsbot_kinematics import Robot, load_robot
from irsbot_supervisor.cli import settings as module
from irsbot_supervisor.configuration.loading import _is_of
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.replay.judgement import assumption_from


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


def test_a_settings_file_is_checked_for_its_own_robot(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("/**: {ros__parameters: {robot: linear_delta, velocity_limit: [1.0, 1.0, 1.0]}}", encoding="utf-8")
    stated = json.loads(irsbot("settings", "--file", file, "--json").out)
    assert next(row["value"] for row in stated["settings"] if row["name"] == "robot") == "linear_delta"
    assert irsbot("settings", "linear_delta", "--file", file).code == 0
    for words in (("settings", "irsbot2", "--file", file), ("check-trajectory", "irsbot2", file, "--settings", file)):
        refused = irsbot(*words)
        assert refused.code == 2
        assert f"{file}: these are settings of robot 'linear_delta', not of 'irsbot2'" in refused.err


@pytest.mark.parametrize(
    ("stated", "robot", "same"),
    [
        ("five_bar", "five_bar", True),
        ("five_bar", load_robot("five_bar"), True),
        ("mine.yaml", "/else/mine.yaml", True),
        ("mine.yaml", "five_bar", False),
        ("five_bar", "five_bar.yaml", False),
        ("irsbot2", load_robot("five_bar"), False),
    ],
)
def test_a_robot_file_is_the_same_from_every_folder(stated: str, robot: str | Robot, same: bool) -> None:
    assert _is_of(stated, robot) is same


def test_a_bag_without_a_journal_is_of_the_robot_that_its_settings_name() -> None:
    assumed = assumption_from(None, {"robot": "five_bar"}, None)
    assert assumed is not None
    assert assumed.robot == "five_bar"
