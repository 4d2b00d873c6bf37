"""`urdf` and `limits --urdf`: what is written, what is read back, and what is refused in one line."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
import yaml
from command import irsbot

import irsbot_kinematics as irs


@pytest.mark.parametrize("name", irs.robots())
def test_every_shipped_robot_is_written_and_printed_alike(name: str, tmp_path: Path):
    file = tmp_path / "robot.urdf"
    assert irsbot("urdf", name, "-o", file) == (0, f"written to {file}\n", "")
    assert irsbot("urdf", name) == (0, file.read_text(), "")
    assert ElementTree.parse(file).getroot().tag == "robot"


def test_an_output_that_cannot_be_written_is_refused_in_one_line():
    for words in (("nonsense",), ("irsbot2", "-o", "/dev/null/robot.urdf")):
        stated = irsbot("urdf", *words)
        assert stated.code == 2
        assert words[-1].split("/robot")[0] in stated.refusal


def test_ranges_of_a_urdf_become_settings(tmp_path: Path):
    described, proposed = tmp_path / "r.urdf", tmp_path / "mine.yaml"
    irsbot("urdf", "orthoglide", "-o", described)
    words = ["limits", "orthoglide", "--speed", "1", "--deceleration", "20", "--urdf", described]
    assert irsbot(*words, "-o", proposed).code == 0
    told = yaml.safe_load(proposed.read_text())["/**"]["ros__parameters"]
    assert (told["position_lower"], told["position_upper"]) == ([0.0] * 3, [4.0] * 3)
    latin = "<?xml version='1.0' encoding='ISO-8859-1'?>\n<!-- Krän -->" + described.read_text().partition("?>")[2]
    described.write_text(latin, encoding="latin-1")
    assert irsbot(*words, "-o", proposed, "--force").code == 0
    for text, why in (
        ("<robot", "not XML"),
        ("<robot name='a'/>", "has no joint 'slide_1'"),
        ("<robot><joint name='slide_1' type='prismatic'/></robot>", "no lower and upper limit"),
        ("<robot><joint name='slide_1'><limit lower='1' upper='nan'/></joint></robot>", "lower must be below upper"),
    ):
        described.write_text(text)
        stated = irsbot(*words)
        assert stated.code == 2
        assert why in stated.refusal
