"""Tables and help on a terminal of 80 columns, and as JSON."""

from __future__ import annotations

import inspect
import json
from dataclasses import fields
from pathlib import Path

import pytest
from command import irsbot

from irsbot_supervisor.cli import kinematics, settings
from irsbot_supervisor.cli.app import commands_of, whole_app
from irsbot_supervisor.cli.common import _Output
from irsbot_supervisor.core.settings import Settings

COMMANDS = {command.name: command for command in commands_of(whole_app())}
WITHOUT_JSON = ("demo", "up", "urdf", "policy")
"""They run until they are ended, and tell what happens meanwhile, or print XML."""


@pytest.fixture(params=[80, 250])
def width(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> int:
    columns = int(request.param)
    for module in (kinematics, settings):
        monkeypatch.setattr(module, "out", _Output(width=columns, highlight=False, soft_wrap=True, markup=False))
    return columns


def test_no_number_of_an_assembly_mode_is_folded(width: int) -> None:
    stated = irsbot("dk", "rrr3_base", 0.3, 2.2, 4.5).out.splitlines()
    assert max(map(len, stated)) <= width
    assert sum(line.startswith("│ pressure angle") for line in stated) == (2 if width == 80 else 1)
    firsts = [line.split("│")[1].strip() for line in stated if line.startswith("│")]
    assert "" not in firsts, "a cell is folded"


def test_a_setting_takes_two_or_three_lines(width: int) -> None:
    stated = irsbot("settings", "irsbot2").out.splitlines()
    assert max(map(len, stated)) <= width
    assert len(stated) < 3 * len(fields(Settings))
    assert "0.001..1" in "".join(stated)


def test_help_cuts_no_summary_short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    for words in ([], ["design"], ["algebra"]):
        stated = irsbot(*words, "--help").out
        assert "..." not in stated.replace("[ARGS]...", "")
        assert max(map(len, stated.splitlines())) <= 80


@pytest.mark.parametrize("name", [name for name in COMMANDS if name not in WITHOUT_JSON])
def test_every_command_prints_json(name: str) -> None:
    assert "as_json" in inspect.signature(COMMANDS[name].callback).parameters


def test_the_written_files_are_listed_as_json(tmp_path: Path) -> None:
    joints = tmp_path / "j.csv"
    joints.write_text("joint_1,joint_2\n2.9,-0.17\n0,0\n")
    stated = json.loads(irsbot("evaluate", "irsbot2", "--input", joints, "--output", tmp_path / "m.csv", "--json").out)
    assert stated == {"samples": 2, "assembled": 2, "file": str(tmp_path / "m.csv")}
    target = tmp_path / "m.npz"
    stated = json.loads(irsbot("map", "irsbot2", "--joints", "--nodes", 5, "-o", target, "--json").out)
    assert stated["file"] == str(target)
