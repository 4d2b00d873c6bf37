"""The numbers of docs/how_to/limits.md are those that the command prints."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import pytest
from command import Said, irsbot

PAGE = (Path(__file__).parents[1] / "docs" / "how_to" / "limits.md").read_text()


def run(arguments: list[str], folder: Path) -> Said:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        return irsbot(*arguments)


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[str], Path, dict]:
    """The command of the page, its folder, and what it says."""
    command = re.findall(r"^    \./irsbot (limits .*?)\n\n", PAGE, re.MULTILINE | re.DOTALL)[0]
    arguments, folder = shlex.split(command.replace("\\\n", " ")), tmp_path_factory.mktemp("limits")
    done = run([*arguments, "--json"], folder)
    assert done.code == 0, done.err
    return arguments, folder, json.loads(done.out)


def test_the_table_of_the_example_is_the_proposal_of_the_command(example: tuple[list[str], Path, dict]) -> None:
    _arguments, _folder, stated = example
    table = PAGE.split("## Example")[1]
    rows = dict(re.findall(r"^\| `(\w+)` \| ([0-9.e-]+) \|", table, re.MULTILINE))
    assert len(rows) == 13
    for name, value in rows.items():
        assert stated["settings"][name] in (float(value), [float(value)] * 2), name
    lost = re.findall(r"^\| `(\w+_warn)` .* \| ([0-9.]+) is lost on ([0-9.]+) rad", table, re.MULTILINE)
    assert len(lost) == 3
    for name, margin, way in lost:
        assert f"goes on by {way} rad; the margin loses {margin} on that" in stated["reasons"][name]


def test_the_costs_of_the_example_are_those_of_the_command(example: tuple[list[str], Path, dict]) -> None:
    _arguments, _folder, stated = example
    table = PAGE.split("## Example")[1].split("| machine |")[1]
    rows = [[cell.strip() for cell in line.strip("| ").split("|")] for line in table.splitlines()[2:] if "|" in line]
    assert len(rows) == len(stated["costs"]) == 5
    for (machine, after, *ways, stopped), cost in zip(rows, stated["costs"], strict=True):
        assert machine == cost["machine"]
        assert after == f"{cost['free_s'] * 1e3:.3g} ms"
        numbers = cost["from_rest"][0], cost["platform_rest_m"], cost["from_full"][0], cost["platform_full_m"]
        assert ways == [f"{n:.3g} {unit}" for n, unit in zip(numbers, ("rad", "m", "rad", "m"), strict=True)]
        assert abs(float(stopped.strip(" %")) - 100.0 * cost["stopped"]) <= 1.0


def test_the_distances_of_the_example_are_those_of_the_command(example: tuple[list[str], Path, dict]) -> None:
    _arguments, _folder, stated = example
    assert pytest.approx(0.312) == 8 * (0.015 + 0.004) + 8 * 8 / (2 * 200)
    assert [row["needs"] for row in stated["stopping"]] == pytest.approx([0.312, 0.312])
    assert all(2.5 < row["share"] < 3.5 for row in stated["stopping"])
    assert f"worst combination from {stated['all_joints_together']:.1f} times" in PAGE


def test_the_file_of_the_example_is_accepted(example: tuple[list[str], Path, dict]) -> None:
    _arguments, folder, _stated = example
    assert run(["settings", "irsbot2", "--file", "mine.yaml"], folder).code == 0


def test_the_last_two_sentences_hold(example: tuple[list[str], Path, dict]) -> None:
    arguments, folder, stated = example
    tolerance = arguments.index("--geometry-tolerance") + 1
    coarse = run([*arguments[:tolerance], "0.002", *arguments[tolerance + 1 :], "--json", "--force"], folder)
    assert json.loads(coarse.out)["settings"]["constraint_stop"] == 0.15 > stated["settings"]["constraint_stop"]
    assert run([*arguments, "--deceleration", "10", "--force"], folder).code == 1


def test_the_quoted_refusal_is_that_of_the_command(tmp_path: Path) -> None:
    quoted = " ".join(re.findall(r"joint 'joint_1' needs .*? can be stopped", PAGE, re.DOTALL)[0].split())
    done = run(["limits", "irsbot2", "--deceleration", "20"], tmp_path)
    assert done.code == 1
    assert quoted in done.err
