"""The documentation runs: its examples, its code blocks, the commands of the README, the files that it names."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from irsbot_kinematics import robots, stiffness
from irsbot_kinematics.conformance import LAWS
from irsbot_kinematics.mechanisms import TOPOLOGIES
from irsbot_msgs_py.records import Cause

ROOT = Path(__file__).parents[1]
EXAMPLES = sorted((ROOT / "docs" / "examples").glob("*.py"))
PAGES = [*sorted(ROOT.glob("docs/**/*.md")), ROOT / "README.md", ROOT / "bags" / "README.md"]


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_every_example_runs_and_its_assertions_hold(example: Path) -> None:
    assert "assert " in example.read_text()
    done = subprocess.run([sys.executable, str(example)], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stdout


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_every_link_leads_to_a_file(page: Path) -> None:
    links = re.findall(r"\]\(([^)#:]+)\)", page.read_text())
    assert [link for link in links if not (page.parent / link).exists()] == []


@pytest.mark.parametrize("page", ["README.md", "docs/stiffness.md"])
def test_the_python_blocks_run(page: str) -> None:
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(), re.DOTALL)
    assert blocks
    for block in blocks:
        done = subprocess.run([sys.executable, "-c", block], capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stderr


def test_every_command_of_the_readme_exists_and_has_help_with_an_example() -> None:
    named = set(re.findall(r"\./irsbot ([a-z-]+)", (ROOT / "README.md").read_text())) - {"test", "python", "shell"}
    assert {"demo", "ik", "replay"} <= named
    for command in sorted(named):
        done = subprocess.run(
            [sys.executable, "-m", "irsbot_supervisor", command, "--help"], capture_output=True, text=True, timeout=120
        )
        assert done.returncode == 0, (command, done.stderr)
        if command not in ("algebra", "design"):  # groups of commands, each with its own example
            assert "Example:" in done.stdout, command


def test_the_causes_of_the_verdicts_page_are_those_of_the_code() -> None:
    page = (ROOT / "docs" / "verdicts.md").read_text()
    table = page.split("## Causes")[1].split("## Stopping in time")[0]
    said = set(re.findall(r"\b[A-Z][A-Z0-9_]{3,}\b", table)) - {"WARN", "STOP", "UNKNOWN"}
    assert said == {cause.name for cause in Cause if cause}


def test_the_readme_shows_robots_that_exist() -> None:
    named = set(re.findall(r"robot:?=(\w+)", (ROOT / "README.md").read_text()))
    assert named
    assert named <= set(robots())


def test_every_mechanism_has_its_drawing_and_every_drawing_is_small() -> None:
    page = (ROOT / "docs" / "mechanisms.md").read_text()
    drawn = set(re.findall(r"\]\(pictures/(\w+)\.png\)", page))
    assert drawn == {*TOPOLOGIES, "prr3"}
    for name in drawn:
        assert (ROOT / "docs" / "pictures" / f"{name}.png").stat().st_size < 60_000
    assert f"tries {len(LAWS) + 1} laws" in page


def test_the_design_file_of_the_stiffness_page_is_one(tmp_path: Path) -> None:
    (block,) = re.findall(r"```yaml\n(.*?)```", (ROOT / "docs" / "stiffness.md").read_text(), re.DOTALL)
    path = tmp_path / "page.yaml"
    said = yaml.safe_load(block)
    shipped = stiffness.load("irsbot2_table2")
    lengths = {key: f"{value} m" for key, value in vars(shipped.mechanism.geometry).items()}
    said["geometry"] = lengths | said["geometry"]
    path.write_text(yaml.safe_dump(said))
    design = stiffness.load(path)
    assert stiffness.mass(design) == pytest.approx(stiffness.mass(shipped))
    assert (ROOT / "docs" / "pictures" / "stiffness.png").stat().st_size < 60_000
