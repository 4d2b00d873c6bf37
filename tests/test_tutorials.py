"""The pages of the tutorial, followed literally: their files are accepted, their commands do what they say."""

from __future__ import annotations

import re
import runpy
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from irsbot_supervisor.cli.app import whole_app
from irsbot_supervisor.configuration.loading import read_settings

ROOT = Path(__file__).parents[1]
TUTORIAL = ROOT / "docs" / "tutorial"
PICTURES = ROOT / "docs" / "pictures"


def blocks(page: str, kind: str) -> list[str]:
    return re.findall(rf"```{kind}\n(.*?)```", (TUTORIAL / page).read_text(encoding="utf-8"), re.DOTALL)


def commands(page: str) -> list[str]:
    """Indented lines outside fences: what a reader pastes into a shell, without comments."""
    text = re.sub(r"```.*?```", "", (TUTORIAL / page).read_text(encoding="utf-8"), flags=re.DOTALL)
    lines = re.findall(r"^    (\S.*)$", text, re.MULTILINE)
    return [line.partition(" #")[0].strip() for line in lines]


def run(command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    words = shlex.split(command)
    if words[0] == "./irsbot":
        words = [sys.executable, "-m", "irsbot_supervisor", *words[1:]]
    return subprocess.run(words, capture_output=True, text=True, timeout=240, cwd=folder)


def test_a_bag_becomes_a_test_as_the_page_says(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "bags" / "type2", tmp_path / "bags" / "type2")
    *prepare, draft, replay, again = commands("bag_in_ci.md")
    for command in [*prepare, draft]:
        done = run(command, tmp_path)
        assert done.returncode == 0, done.stderr
    expected = tmp_path / "regression" / "type2" / "expected.json"
    printed, ours = blocks("bag_in_ci.md", "json")
    assert expected.read_text() == printed
    undone = run(replay, tmp_path)
    assert undone.returncode == 1
    assert "draft" in undone.stderr
    expected.write_text(ours)
    assert run(again, tmp_path).returncode == 0
    expected.write_text(ours.replace('"OK"', '"STOP"'))
    broken = run(again, tmp_path)
    assert broken.returncode == 1
    assert "expected STOP" in broken.stderr


def test_the_five_bar_of_the_page_is_a_robot_with_settings(tmp_path: Path) -> None:
    (text,) = blocks("own_five_bar.md", "yaml")
    file = tmp_path / "mine.yaml"
    file.write_text(text)
    settings, robot = read_settings(str(file))
    assert robot.mechanism.kind == "five_bar"
    assert settings.velocity_limit == (2.0, 2.0)
    ran = [
        command for command in commands("own_five_bar.md") if re.match(r"\./irsbot (ik|dk|check-m|settings)", command)
    ]
    assert len(ran) == 4
    for command in ran:
        done = run(command, tmp_path)
        assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("page", sorted(path.name for path in TUTORIAL.glob("*.md")))
def test_every_command_of_a_tutorial_exists(page: str) -> None:
    named = {shlex.split(command)[1] for command in commands(page) if command.startswith("./irsbot")}
    assert named
    assert [name for name in named if CliRunner().invoke(whole_app(), [name, "--help"]).exit_code != 0] == []


def test_the_picture_of_the_data_is_drawn_from_modules_that_exist() -> None:
    drawn = runpy.run_path(str(PICTURES / "draw_data_path.py"))
    assert (PICTURES / "data_path.svg").read_text(encoding="utf-8") == drawn["drawing"]()
    modules = [entry[2] for entry in (*drawn["STAGES"], *drawn["SIDE"]) if entry[2]]
    assert len(modules) > 10
    lost = [name for name in modules if not (ROOT / "ros2_ws" / "src" / name.split("/")[0] / name).is_file()]
    assert lost == []


def test_the_layers_of_the_architecture_page_are_those_that_are_tested() -> None:
    text = (ROOT / "docs" / "explanation" / "architecture.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| \d \| (.*?) \|", text, re.MULTILINE)
    told = tuple(tuple(re.findall(r"`(\w+)`", row)) for row in rows)
    tested = ROOT / "ros2_ws" / "src" / "irsbot_kinematics" / "test" / "test_purity.py"
    assert told == runpy.run_path(str(tested))["LAYERS"]
