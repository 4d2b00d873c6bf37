"""The numbers of docs/limits.md are those that the command prints."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

PAGE = (Path(__file__).parents[1] / "docs" / "limits.md").read_text()
IRSBOT = [sys.executable, "-m", "irsbot_supervisor"]


def run(arguments: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*IRSBOT, *arguments], capture_output=True, text=True, timeout=120, cwd=folder)


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[str], Path, dict]:
    """The command of the page, its folder, and what it says."""
    command = re.findall(r"^    \./irsbot (limits .*?)\n\n", PAGE, re.MULTILINE | re.DOTALL)[0]
    arguments, folder = shlex.split(command.replace("\\\n", " ")), tmp_path_factory.mktemp("limits")
    done = run([*arguments, "--json"], folder)
    assert done.returncode == 0, done.stderr
    return arguments, folder, json.loads(done.stdout)


def test_the_table_of_the_example_is_what_the_command_proposes(example: tuple[list[str], Path, dict]) -> None:
    _arguments, _folder, said = example
    table = PAGE.split("## Example")[1]
    rows = dict(re.findall(r"^\| `(\w+)` \| ([0-9.]+) \|", table, re.MULTILINE))
    assert len(rows) == 11
    assert {name: float(value) for name, value in rows.items()} == {name: said["settings"][name] for name in rows}
    for name, lost in re.findall(r"^\| `(\w+_warn)` .* \| ([0-9.]+) is lost in 17 ms", table, re.MULTILINE):
        assert f"loses {lost} with all joints" in said["reasons"][name]


def test_the_distances_of_the_example_are_what_the_command_prints(example: tuple[list[str], Path, dict]) -> None:
    _arguments, _folder, said = example
    assert pytest.approx(0.296) == 8 * (0.015 + 0.002) + 8 * 8 / (2 * 200)
    assert [row["needs"] for row in said["stopping"]] == pytest.approx([0.296, 0.296])
    assert all(2.5 < row["share"] < 3.5 for row in said["stopping"])
    assert f"worst combination from {said['all_joints_together']:.1f} times" in PAGE


def test_the_file_of_the_example_is_accepted(example: tuple[list[str], Path, dict]) -> None:
    _arguments, folder, _said = example
    assert run(["settings", "irsbot2", "--file", "mine.yaml"], folder).returncode == 0


def test_the_last_two_sentences_hold(example: tuple[list[str], Path, dict]) -> None:
    arguments, folder, said = example
    tolerance = arguments.index("--geometry-tolerance") + 1
    coarse = run([*arguments[:tolerance], "0.002", *arguments[tolerance + 1 :], "--json"], folder)
    assert json.loads(coarse.stdout)["settings"]["type1_stop"] > said["settings"]["type1_stop"]
    assert run([*arguments, "--deceleration", "10"], folder).returncode == 1


def test_the_refusal_that_is_quoted_is_the_one_that_is_given(tmp_path: Path) -> None:
    quoted = " ".join(re.findall(r"joint 'joint_1' needs .*? can be stopped", PAGE, re.DOTALL)[0].split())
    done = run(["limits", "irsbot2", "--deceleration", "20"], tmp_path)
    assert done.returncode == 1
    assert quoted in done.stderr
