"""The mechanism of the documentation, from the shell: checked, and caught where it is wrong."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from irsbot_kinematics.conformance import LAWS

EXAMPLE = Path(__file__).parents[1] / "docs" / "examples" / "prr3"
CHECK = [sys.executable, "-m", "irsbot_supervisor", "check-mechanism"]


def check(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*CHECK, *arguments], capture_output=True, text=True, timeout=120)


def test_the_mechanism_of_the_documentation_keeps_every_law() -> None:
    done = check(str(EXAMPLE / "prr3.yaml"))
    assert done.returncode == 0, done.stderr
    assert f"prr3 keeps all {len(LAWS) + 1} laws" in done.stdout
    said = json.loads(check(str(EXAMPLE / "prr3.yaml"), "--json", "--joints", "60").stdout)
    assert said["holds"]
    assert {law["law"] for law in said["laws"]} == {"postures", *[entry.name for entry in LAWS]}
    assert all(law["tried"] > 0 and law["worst"] <= law["allowed"] for law in said["laws"])


WRONG = {
    "sign of a screw": ("screws.append((rx, ry, ax * ry - ay * rx))", "screws.append((rx, -ry, ax * ry - ay * rx))"),
    "sign of a lever": ("sines.append(-(rx * ux + ry * uy))", "sines.append(rx * ux + ry * uy)"),
    "small radius": ("self.radius = self.span", "self.radius = 0.3 * g.b\n        self.span"),
    "small span": ("self.radius = self.span =", "self.span = 0.1 * g.b\n        self.radius ="),
    "slow rods": ("max([1.0 / (l", "max([0.1 / (l"),
    "optimistic bound": ("drives = [abs(lever) * t + ends", "drives = [0.1 * abs(lever) * t + ends"),
}
LAW = {
    "sign of a screw": "Jacobian by pose",
    "sign of a lever": "Jacobian by joints",
    "small radius": "sizes are as declared",
    "small span": "sizes are as declared",
    "slow rods": "turn rate is as declared",
    "optimistic bound": "guarantee is kept",
}


@pytest.mark.parametrize("what", WRONG)
def test_a_mechanism_that_is_wrong_is_caught_with_law_posture_and_numbers(what: str, tmp_path: Path) -> None:
    right, wrong = WRONG[what]
    source = (EXAMPLE / "prr3.py").read_text()
    assert source.count(right) == 1
    (tmp_path / "prr3.py").write_text(source.replace(right, wrong))
    (tmp_path / "prr3.yaml").write_text((EXAMPLE / "prr3.yaml").read_text())
    done = check(str(tmp_path / "prr3.yaml"))
    assert done.returncode == 1, done.stdout
    (line,) = [line for line in done.stderr.splitlines() if line.startswith(LAW[what] + " (")]
    assert "joints (" in line
    assert "error" in line
    assert "allowed" in line
    assert f"laws: {LAW[what]}" in done.stderr or f", {LAW[what]}" in done.stderr
    assert "Traceback" not in done.stderr


def test_an_error_of_the_mechanism_is_told_with_its_line(tmp_path: Path) -> None:
    lines = (EXAMPLE / "prr3.py").read_text().splitlines()
    number = next(k for k, line in enumerate(lines, 1) if "screws.append(" in line)
    lines[number - 1] = lines[number - 1].replace("screws.append(", "screw.append(")
    (tmp_path / "prr3.py").write_text("\n".join(lines))
    (tmp_path / "prr3.yaml").write_text((EXAMPLE / "prr3.yaml").read_text())
    done = check(str(tmp_path / "prr3.yaml"))
    assert done.returncode == 1
    assert f"NameError: name 'screw' is not defined (prr3.py, line {number})" in " ".join(done.stderr.split())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nothing"], "no robot 'nothing'"),
        ([str(EXAMPLE / "prr3.py")], "give the YAML file of a robot"),
        ([str(EXAMPLE / "prr3.yaml"), "--joints", "0"], "--joints is 0, must be in 1..100000"),
    ],
)
def test_bad_use_is_refused_in_one_line(arguments: list[str], words: str) -> None:
    done = check(*arguments)
    assert done.returncode == 2, done
    assert words in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
