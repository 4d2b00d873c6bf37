"""Files that commands write: never the input, existing ones only on request, folders are made, errors name the file."""

from __future__ import annotations

import shlex
import signal
import subprocess
from pathlib import Path
from time import monotonic, sleep

import pytest
from command import IRSBOT, PATIENCE_S, irsbot

JOINTS = "joint_1,joint_2\n2.9,-0.17\n"


@pytest.fixture
def joints(tmp_path: Path) -> Path:
    file = tmp_path / "j.csv"
    file.write_text(JOINTS)
    return file


@pytest.mark.parametrize("force", [[], ["--force"]])
def test_the_input_is_never_overwritten(joints: Path, force: list[str]) -> None:
    same = joints.parent / "." / joints.name
    stated = irsbot("evaluate", "irsbot2", "--input", joints, "--output", same, *force)
    assert stated.code == 2
    assert "it is the input" in stated.refusal
    assert joints.read_text() == JOINTS


def test_a_robot_file_is_an_input_too(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("mechanism: irsbot2\n")
    stated = irsbot("limits", file, "-o", file, "--force")
    assert (stated.code, file.read_text()) == (2, "mechanism: irsbot2\n")


WRITERS = {
    "map": ["map", "irsbot2", "--nodes", "5", "-o", "x.npz"],
    "joint map": ["map", "irsbot2", "--joints", "--nodes", "5", "-o", "x.npz"],
    "limits": ["limits", "irsbot2", "-o", "x.yaml"],
    "sweep": ["design", "sweep", "--vary", "l1=0.1:0.5:2", "-o", "x.csv"],
    "search": ["design", "search", "--generations", "1", "--population", "1", "-o", "x.yaml"],
    "evaluate": ["evaluate", "irsbot2", "--input", "j.csv", "--output", "x.csv"],
    "faults": ["faults", "--quick", "-o", "x.md"],
    "stiffness": ["stiffness", "irsbot2_table2", "--map", "--nodes", "5", "-o", "x.npz"],
    "report": ["report", "bag.mcap", "-o", "x.html"],
    "replay": ["replay", "bag.mcap", "--junit", "x.xml"],
    "algebra": ["algebra", "cells", "3rpr", "--plot", "x.png"],
}
SLOW = ("faults", "report", "replay", "algebra", "search")
"""Of these only the refusal is tested here."""


@pytest.mark.parametrize("name", WRITERS)
def test_an_existing_file_stays_without_force(
    name: str, joints: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    words = WRITERS[name]
    target = Path(words[-1])
    target.write_text("mine")
    stated = irsbot(*words)
    assert stated.code == 2
    flag = "--overwrite" if name == "stiffness" else "--force"
    assert stated.refusal == f"irsbot: '{target}' exists; {flag} replaces it"
    assert target.read_text() == "mine"
    if name not in SLOW:
        assert irsbot(*words, flag).code == 0
        assert target.read_bytes() != b"mine"


@pytest.mark.parametrize("name", [name for name in WRITERS if name not in SLOW])
def test_folders_are_made(name: str, joints: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    *words, last = WRITERS[name]
    assert irsbot(*words, f"new/folder/{last}").code == 0
    assert Path("new/folder", last).is_file()


def test_a_command_that_fails_leaves_no_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert irsbot("limits", "nobody", "-o", "new/x.yaml").code == 2
    assert list(tmp_path.iterdir()) == []


def test_stiffness_without_a_map_writes_nothing_and_asks_for_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("stiffness.png").write_text("mine")
    assert irsbot("stiffness", "irsbot2_table2", "0", "-0.8").code == 0
    assert Path("stiffness.png").read_text() == "mine"


@pytest.mark.parametrize(
    "words",
    [
        ["evaluate", "irsbot2", "--input", "j.csv", "--output", "j.csv/x.csv"],
        ["limits", "irsbot2", "-o", "j.csv/x.yaml"],
        ["map", "irsbot2", "--nodes", "5", "-o", "j.csv/x.npz"],
        ["design", "sweep", "--vary", "l1=0.1:0.5:2", "-o", "j.csv/x.csv"],
        ["map", "irsbot2", "--nodes", "5", "-o", "."],
    ],
)
def test_an_error_of_the_system_names_the_file(
    words: list[str], joints: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    stated = irsbot(*words)
    assert stated.code == 2
    assert words[-1].split("/")[0] in stated.refusal
    assert "os error" not in stated.refusal


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_sweep_that_is_ended_leaves_no_draft(number: signal.Signals, tmp_path: Path) -> None:
    """CI and `timeout` end a command by SIGTERM."""
    words = ["design", "sweep", "--vary", "l1=0.1:0.5", "--samples", "900000000", "--workers", "1", "-o", "t.csv"]
    process = subprocess.Popen([*IRSBOT, *words], cwd=tmp_path, stderr=subprocess.DEVNULL)
    try:
        begin_s, draft = monotonic(), tmp_path / "t.csv.part"
        while not (draft.exists() and draft.stat().st_size) and monotonic() - begin_s < PATIENCE_S:
            assert process.poll() is None
            sleep(0.02)
        assert draft.exists()
        process.send_signal(number)
        assert process.wait(PATIENCE_S) not in (0, None)
    finally:
        process.kill()
        process.wait()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("where", "code"), [(">&-", 0), (">/dev/full", 2)])
def test_output_that_nobody_can_take_is_no_traceback(where: str, code: int) -> None:
    command = f"{shlex.join([*IRSBOT, 'ik', 'irsbot2', '0.3', '-0.75'])} {where}"
    told = subprocess.run(["sh", "-c", command], stderr=subprocess.PIPE, text=True)
    assert told.returncode == code
    assert told.stderr == ("irsbot: No space left on device\n" if code else "")
