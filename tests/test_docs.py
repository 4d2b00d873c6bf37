"""The documentation runs: its examples, its code blocks, the commands of the README."""

from __future__ import annotations

import re
import subprocess
import sys
from abc import ABCMeta
from enum import IntEnum
from pathlib import Path

import pytest
from command import irsbot

from irsbot_kinematics import Robot, own_mechanism, robots, stiffness
from irsbot_kinematics.analysis.rectangle import Limits
from irsbot_kinematics.conformance import LAWS
from irsbot_kinematics.description.robot_file import KEYS
from irsbot_kinematics.mechanisms import TOPOLOGIES
from irsbot_msgs_py.gate_status import GateOutcome, GateReason
from irsbot_msgs_py.records import Cause
from irsbot_supervisor.configuration.loading import read_settings, read_values

ROOT = Path(__file__).parents[1]
EXAMPLES = sorted((ROOT / "docs" / "examples").glob("*.py"))


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_every_example_runs_and_its_assertions_hold(example: Path) -> None:
    assert "assert " in example.read_text()
    done = subprocess.run([sys.executable, str(example)], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stdout


@pytest.mark.parametrize("page", ["README.md", "docs/explanation/stiffness.md"])
def test_the_python_blocks_run(page: str) -> None:
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(), re.DOTALL)
    assert blocks
    for block in blocks:
        done = subprocess.run([sys.executable, "-c", block], capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stderr


def test_every_command_of_the_readme_exists_and_has_help_with_an_example() -> None:
    named = set(re.findall(r"\./irsbot ([a-z][a-z-]*)", (ROOT / "README.md").read_text())) - {
        "test",
        "python",
        "shell",
        "setup",
    }
    assert {"demo", "ik", "replay"} <= named
    for command in sorted(named):
        done = irsbot(command, "--help")
        assert done.code == 0, (command, done.err)
        if command not in ("algebra", "design"):  # groups of commands, each with its own example
            assert "Example:" in done.out, command


def test_the_causes_of_the_verdicts_page_are_those_of_the_code() -> None:
    page = (ROOT / "docs" / "explanation" / "verdicts.md").read_text()
    table = page.split("## Causes")[1].split("## Stopping in time")[0]
    stated = set(re.findall(r"\b[A-Z][A-Z0-9_]{3,}\b", table)) - {"WARN", "STOP", "UNKNOWN"}
    assert stated == {cause.name for cause in Cause if cause}


@pytest.mark.parametrize(("title", "words"), [("| outcome |", GateOutcome), ("| reason |", GateReason)])
def test_the_words_of_the_gate_on_the_verdicts_page_are_those_of_the_code(title: str, words: type[IntEnum]) -> None:
    page = (ROOT / "docs" / "how_to" / "command_gate.md").read_text()
    table = page.split(title)[1].split("\n\n")[0]
    assert re.findall(r"^\| `([A-Z0-9_]+)` \|", table, re.MULTILINE) == [word.name for word in words]


def test_the_readme_shows_robots_that_exist() -> None:
    named = set(re.findall(r"robot:?=(\w+)", (ROOT / "README.md").read_text()))
    assert named
    assert named <= set(robots())


def test_every_mechanism_has_its_drawing_and_every_drawing_is_small() -> None:
    page = (ROOT / "docs" / "reference" / "mechanisms.md").read_text()
    own = (ROOT / "docs" / "how_to" / "own_mechanism.md").read_text()
    drawn = set(re.findall(r"\]\(\.\./pictures/(\w+)\.png\)", page + own))
    assert drawn == {*TOPOLOGIES, "prr3"}
    for name in drawn:
        assert (ROOT / "docs" / "pictures" / f"{name}.png").stat().st_size < 60_000
    assert f"tries {len(LAWS) + 1} laws" in own


def test_the_page_about_own_mechanisms_names_all_that_can_be_imported_and_every_field() -> None:
    page = (ROOT / "docs" / "how_to" / "own_mechanism.md").read_text()
    imports = page.split("## What to import")[1].split("\n## ")[0]
    assert set(re.findall(r"`(\w+)`", imports)) == set(own_mechanism.__all__)
    fields = page.split("### Every field of a robot file")[1].split("\n### ")[0]
    assert set(re.findall(r"^\| `(\w+)`", fields, re.MULTILINE)) == KEYS


def test_the_page_about_own_mechanisms_names_every_method_that_a_class_has_to_write() -> None:
    page = (ROOT / "docs" / "how_to" / "own_mechanism.md").read_text()
    members = page.split("## Members of the class")[1].split("\n## ")[0]
    of_all = {name for row in re.findall(r"^\| (.*?) \|", members, re.MULTILINE) for name in re.findall(r"`(\w+)", row)}
    table = page.split("## Inherit the bounds")[1].split("\n### ")[0]
    rows = dict(re.findall(r"^\| `(\w+)` \|.*\| (.*) \|$", table, re.MULTILINE))
    written = {name: set(re.findall(r"`(\w+)", cell)) for name, cell in rows.items()}
    bases = {name for name in own_mechanism.__all__ if isinstance(getattr(own_mechanism, name), ABCMeta)} - {
        "Mechanism"
    }
    assert set(rows) == bases
    assert set(own_mechanism.Mechanism.__abstractmethods__) <= of_all
    for name, stated in written.items():
        inherited = set[str]().union(*[written[other] for other in stated & bases])
        missing = getattr(own_mechanism, name).__abstractmethods__ - stated - inherited - of_all
        assert not missing, f"{name} does not say: {missing}"


def test_the_files_of_the_stiffness_page_are_used_as_they_stand(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "explanation" / "stiffness.md").read_text()
    design, settings = re.findall(r"```yaml\n(.*?)```", page, re.DOTALL)
    path = tmp_path / "page.yaml"
    path.write_text(design)
    shipped = stiffness.load("irsbot2_table2")
    assert stiffness.mass(stiffness.load(path)) == pytest.approx(stiffness.mass(shipped))
    path.write_text(settings)
    found, _robot = read_settings("five_bar", read_values(path))
    assert f"here it is {1e3 * found.slack_m:.2f} mm" in page
    assert (ROOT / "docs" / "pictures" / "stiffness.png").stat().st_size < 60_000


def test_the_example_of_bending_on_the_stiffness_page_follows_from_the_bounds() -> None:
    """Table 2 with 1.5 kg at 60 m/s2, at (0, -0.8) and over the box that the page names."""
    page = (ROOT / "docs" / "explanation" / "stiffness.md").read_text()
    design = stiffness.load("irsbot2_table2")
    load = stiffness.Load(payload_kg=1.5, acceleration_m_s2=60.0)
    over_all = stiffness.compliance_error(design, load, Limits(0.15, 0.15, 0.04), ((-0.35, 0.35), (-0.95, -0.6)))
    assert f"margins of at least 0.15, 0.15 and 0.04: slack {1e3 * over_all.slack_m:.1f} mm" in page
    slack = float(stiffness.pose_errors(design, [(0.0, -0.8)], load).slack_m[0])
    robot = Robot(design.mechanism)
    at = robot.posture(robot.inverse((0.0, -0.8)))
    bounds = [
        bound(at, (0.0, 0.0), slack) for bound in (design.mechanism.certified_bounds, design.mechanism.sharp_bounds)
    ]
    type2, constraint = max(b.type2 for b in bounds), max(b.constraint for b in bounds)
    assert f"At (0, -0.8) alone it is {1e3 * slack:.1f} mm" in page
    assert f"Type 2 margin of {at.type2:.3f} at least {type2:.3f} is left" in page
    assert f"constraint margin of {at.constraint:.3f} at least {constraint:.3f}" in page
