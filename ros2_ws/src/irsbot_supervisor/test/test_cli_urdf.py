"""`urdf` and `limits --urdf`: what is written, what is read back, and what is refused in one line."""

from __future__ import annotations

import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
import yaml

import irsbot_kinematics as irs
from irsbot_supervisor.cli.app import main


def ran(monkeypatch: pytest.MonkeyPatch, *words: str) -> int:
    monkeypatch.setattr(sys, "argv", ["irsbot", *words])
    with pytest.raises(SystemExit) as ended:
        main()
    return int(ended.value.code or 0)


@pytest.mark.parametrize("name", irs.robots())
def test_every_shipped_robot_is_written_and_printed_alike(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    file = tmp_path / "robot.urdf"
    assert ran(monkeypatch, "urdf", name, "-o", str(file)) == 0
    assert capsys.readouterr().out == f"written to {file}\n"
    assert ran(monkeypatch, "urdf", name) == 0
    assert capsys.readouterr().out == file.read_text()
    assert ElementTree.parse(file).getroot().tag == "robot"


def test_what_cannot_be_written_is_said_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    assert ran(monkeypatch, "urdf", "nonsense") == 2
    assert ran(monkeypatch, "urdf", "irsbot2", "-o", str(tmp_path / "no" / "robot.urdf")) == 2
    assert capsys.readouterr().err.count("\n") == 2


def test_ranges_of_a_urdf_become_settings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    described, proposed = tmp_path / "r.urdf", tmp_path / "mine.yaml"
    ran(monkeypatch, "urdf", "orthoglide", "-o", str(described))
    words = ["limits", "orthoglide", "--speed", "1", "--deceleration", "20", "--urdf", str(described)]
    assert ran(monkeypatch, *words, "-o", str(proposed)) == 0
    told = yaml.safe_load(proposed.read_text())["/**"]["ros__parameters"]
    assert (told["position_lower"], told["position_upper"]) == ([0.0] * 3, [4.0] * 3)
    capsys.readouterr()
    for text, said in (
        ("<robot", "not XML"),
        ("<robot name='a'/>", "has no joint 'slide_1'"),
        ("<robot><joint name='slide_1' type='prismatic'/></robot>", "no lower and upper limit"),
        ("<robot><joint name='slide_1'><limit lower='1' upper='nan'/></joint></robot>", "lower must be below upper"),
    ):
        described.write_text(text)
        assert ran(monkeypatch, *words) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert said in line
