"""What commands say: one line that a user understands, with the file that is meant; version; a reader who goes away."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest
from command import IRSBOT, irsbot

GEOMETRY = "geometry: {l1: 0.4, l2: 0.4, b: 0.2}"
ROBOTS = {
    "impossible.yaml": "mechanism: five_bar\ngeometry: {l1: -1.0, l2: 0.4, b: 0.2}\n",
    "settings.yaml": f"mechanism: five_bar\n{GEOMETRY}\nsupervision: {{type1_stop: 7.0}}\n",
}


@pytest.fixture(autouse=True)
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name, text in {
        **ROBOTS,
        "mine.yaml": "type1_stop: 7.0\n",
        "scenario.yaml": "robots: {irsbot2: {strat: [0.0, -0.8]}}\n",
        "semicolon.csv": "joint_1;joint_2\n1,5;2\n",
        "huge.csv": "joint_1,joint_2\n2.9,-0.17\n1e300,-0.17\n",
        "moves.csv": "time_s,joint_1,joint_2\n0,2.9,-0.17\n1,1e300,-0.17\n",
    }.items():
        Path(name).write_text(text)


@pytest.mark.parametrize(
    ("words", "stated"),
    [
        ("ik nofile.yaml 0 -0.8", "nofile.yaml: there is no such file"),
        ("ik impossible.yaml 0 -0.8", "impossible.yaml: geometry must satisfy l1 > 0, got -1"),
        ("settings settings.yaml", "settings.yaml: type1_stop is 7.0, must be in 0.001..1"),
        ("settings irsbot2 --file mine.yaml", "mine.yaml: type1_stop is 7.0, must be in 0.001..1"),
        (
            "check-trajectory irsbot2 moves.csv --settings mine.yaml",
            "mine.yaml: type1_stop is 7.0, must be in 0.001..1",
        ),
        ("demo --scenario scenario.yaml", "scenario.yaml: robots.irsbot2: unknown key 'strat'"),
        ("evaluate irsbot2 --input semicolon.csv --output x.csv", "semicolon.csv: columns are separated by ';'"),
        ("evaluate irsbot2 --input huge.csv --output x.csv", "huge.csv: row 2 below the header, column 'joint_1'"),
        ("check-trajectory irsbot2 moves.csv", "moves.csv: row 2 below the header, column 'joint_1'"),
        ("dk irsbot2 1e300 0", "joints (joint_1 [rad], joint_2 [rad]) must be 2 finite numbers of at most 1e+06"),
        ("ik irsbot2 1e300 0", "pose (x [m], z [m]) must be 2 finite numbers of at most 1e+06"),
        ("design search --size -1", "a search must satisfy size > 0, got -1"),
        ("map irsbot2 --nonsense", "No such option: --nonsense"),
        ("nonsense", "No such command 'nonsense'; see irsbot --help"),
        ("ik irsbot2 0 -0.8 --json --mode", "Option '--mode' requires an argument"),
        ("map irsbot2 --nodes many", "Invalid value for '--nodes': Input should be a valid integer"),
    ],
)
def test_a_refusal_is_one_line_with_the_file_that_is_meant(words: str, stated: str) -> None:
    done = irsbot(*words.split())
    assert done.code == 2
    assert done.refusal.startswith(f"irsbot: {stated}")


def test_the_version_is_that_of_the_package() -> None:
    done = irsbot("--version")
    setup = Path(__file__).parents[1] / "package.xml"
    number = done.out.split()[1]
    assert done.code == 0
    assert f"<version>{number}</version>" in setup.read_text()


def test_a_reader_who_goes_away_ends_a_command_without_a_traceback() -> None:
    """The reader is gone before the first line comes."""
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run([*IRSBOT, "settings", "irsbot2"], stdout=write, stderr=subprocess.PIPE, text=True, timeout=60)
    os.close(write)
    assert done.stderr == ""
    assert done.returncode == 141


def test_examples_name_the_program_as_it_was_called(monkeypatch: pytest.MonkeyPatch) -> None:
    environment = {**os.environ, "IRSBOT_COMMAND": "./irsbot"}
    done = subprocess.run([*IRSBOT, "map", "--help"], capture_output=True, text=True, timeout=60, env=environment)
    assert "Example: ./irsbot map" in done.stdout
    assert "Usage: ./irsbot map" in done.stdout
