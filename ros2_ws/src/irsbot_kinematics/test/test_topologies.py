"""Mechanisms of the user's own: by file, module or entry point; whatever is wrong is said in one line."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

import irsbot_kinematics as irs
from irsbot_kinematics.description.robot_file import fingerprint, read_robot
from irsbot_kinematics.description.robot_record import robot_from_record, robot_record

EXAMPLE = Path(__file__).parents[4] / "docs" / "examples" / "prr3"
SOURCE, ROBOT = (EXAMPLE / "prr3.py").read_text(), (EXAMPLE / "prr3.yaml").read_text()


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "prr3.py").write_text(SOURCE)
    (tmp_path / "prr3.yaml").write_text(ROBOT)
    return tmp_path


def robot_with(folder, mechanism):
    file = folder / "robot.yaml"
    file.write_text(ROBOT.replace("mechanism: prr3.py:Prr3", f"mechanism: {mechanism}"))
    return file


def test_a_file_beside_the_robot_file_is_a_mechanism_wherever_one_stands(folder, monkeypatch):
    monkeypatch.chdir(folder.parent)
    robot = irs.load_robot(folder / "prr3.yaml")
    assert (robot.name, robot.mechanism.kind) == ("prr3", "prr3")
    assert robot.supervision["velocity_limit"] == [1.0]
    q = robot.inverse((0.0, 0.28, 2.0))
    assert robot.direct(q) == pytest.approx((0.0, 0.28, 2.0))
    assert irs.load_robot(folder / "prr3.yaml", b=0.25).mechanism.geometry.b == 0.25
    assert read_robot(folder / "prr3.yaml").sources["b"] == "an example"
    assert fingerprint(robot.mechanism) != fingerprint(irs.load_robot(folder / "prr3.yaml", b=0.25).mechanism)


def test_the_same_text_is_loaded_once_and_a_changed_text_anew(folder):
    first, second = (irs.load_robot(folder / "prr3.yaml").mechanism for _ in range(2))
    assert type(first) is type(second)
    (folder / "prr3.py").write_text(SOURCE.replace('kind: ClassVar[str] = "prr3"', 'kind: ClassVar[str] = "prr3b"'))
    assert irs.load_robot(folder / "prr3.yaml").mechanism.kind == "prr3b"


def test_a_class_of_an_importable_module_is_a_mechanism(folder, monkeypatch):
    (folder / "our_robots").mkdir()
    (folder / "our_robots" / "planar.py").write_text(SOURCE)
    monkeypatch.syspath_prepend(folder)
    robot = irs.load_robot(robot_with(folder, "our_robots.planar:Prr3"))
    assert robot.mechanism.kind == "prr3"
    assert robot_record(robot)["mechanism"] == "our_robots.planar:Prr3"
    assert robot_from_record(robot_record(robot)).mechanism.geometry == robot.mechanism.geometry
    monkeypatch.delitem(sys.modules, "our_robots.planar")


def test_an_installed_package_offers_a_mechanism_by_its_entry_point(folder, monkeypatch):
    (folder / "prr3_robots.py").write_text(SOURCE)
    info = folder / "prr3_robots-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: prr3-robots\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[irsbot.mechanisms]\nprr3 = prr3_robots:Prr3\nlost = prr3_robots:Lost\n")
    monkeypatch.syspath_prepend(folder)
    assert irs.load_robot(robot_with(folder, "prr3")).mechanism.kind == "prr3"
    with pytest.raises(irs.BadInput, match="entry point prr3_robots:Lost cannot be used"):
        irs.load_robot(robot_with(folder, "lost"))
    with pytest.raises(irs.BadInput, match="rails2, lost, prr3; or name a class of yours"):
        irs.load_robot(robot_with(folder, "nothing"))
    monkeypatch.delitem(sys.modules, "prr3_robots")


def test_a_record_brings_back_the_robot_and_refuses_a_file_that_is_not_the_same(folder):
    robot = irs.load_robot(folder / "prr3.yaml")
    record = robot_record(robot)
    again = robot_from_record(record)
    assert again.mechanism.geometry == robot.mechanism.geometry
    assert type(again.mechanism) is type(robot.mechanism)
    (folder / "prr3.py").write_text(SOURCE + "# changed\n")
    with pytest.raises(irs.BadInput, match=r"prr3\.py, which has changed since"):
        robot_from_record(record)
    (folder / "prr3.py").unlink()
    with pytest.raises(irs.BadInput, match=r"prr3\.py, which is not there any more"):
        robot_from_record(record)


@pytest.mark.parametrize(
    "changed",
    [
        {"assembly_mode": 7},
        {"assembly_mode": "abc"},
        {"assembly_mode": "1"},
        {"assembly_mode": None},
        {"working_mode": [5]},
        {"working_mode": [1, 2]},
        {"working_mode": 1},
        {"working_mode": None},
        {"geometry": [1.0]},
        {"geometry": {"l1": "abc"}},
        {"mechanism": "a" * 300 + ".py:Prr3"},
        {"mechanism": None},
        {"name": ...},
    ],
    ids=lambda changed: f"{next(iter(changed))}",
)
def test_a_record_that_describes_no_robot_is_refused(changed):
    record = {**robot_record(irs.make_robot("five_bar")), **changed}
    with pytest.raises(irs.KinematicsError):
        robot_from_record({key: value for key, value in record.items() if value is not ...})


HEAD = "from dataclasses import dataclass\nimport irsbot_kinematics as irs\n"
COMPLETE = SOURCE + "\n\nclass Mine(Prr3):\n    def __init__(self, geometry):\n        super().__init__(geometry)\n"
REFUSED = [
    ("none.py:Prr3", "", "No such file"),
    ("prr3.py:Prr4", SOURCE, "there is no class 'Prr4' in it; it has Prr3Geometry, Prr3"),
    ("prr3.py:Prr3", "def broken(:\n", "SyntaxError: invalid syntax, line 1"),
    ("prr3.py:Prr3", "import nowhere_to_be_found\n", "ModuleNotFoundError: No module named 'nowhere_to_be_found'"),
    ("prr3.py:Prr3", "class Prr3:\n    pass\n", "Prr3 is no class derived from irsbot_kinematics.Mechanism"),
    ("prr3.py:TINY", SOURCE, "is no class derived from irsbot_kinematics.Mechanism"),
    (
        "prr3.py:Prr3",
        HEAD + "class Prr3(irs.Mechanism):\n    kind = 'prr3'\n",
        "lacks the methods bias, certified_bounds",
    ),
    ("prr3.py:Prr3", SOURCE.replace('= "prr3"', '= "rrr3"'), "Prr3.kind is 'rrr3'; it must be a name of its own"),
    ("prr3.py:Prr3", SOURCE.replace("geometry: Prr3Geometry\n", "geometry: float\n"), "'geometry: Prr3Geometry'"),
    ("prr3.py:Prr3", SOURCE.replace("geometry: Prr3Geometry\n", "geometry: Lost\n"), "name 'Lost' is not defined"),
    ("prr3.py:Mine", COMPLETE + "        self.length_m = 0.0\n", "length_m is 0.0, it must be positive"),
    ("prr3.py:Mine", COMPLETE + "        del self.task\n", "__init__ must set task"),
    ("prr3.py:Mine", COMPLETE + "        self.task = self.task[:2]\n", "3 joints and 2 task coordinates"),
    ("prr3.py:Mine", COMPLETE + "        1 / 0\n", "ZeroDivisionError: division by zero"),
    (
        "prr3.py:Mine",
        COMPLETE + "        self.usual_assembly_mode = 7\n",
        "usual_assembly_mode is 7, not one of (1, -1",
    ),
    ("no_such_module:Prr3", "", "No module named 'no_such_module'"),
    ("json:dumps", "", "dumps is no class derived"),
    ("[1, 2]", "", "known are irsbot2, five_bar"),
]


@pytest.mark.parametrize(("mechanism", "source", "words"), REFUSED, ids=[words[:40] for _, _, words in REFUSED])
def test_a_class_that_is_not_a_mechanism_is_refused_in_one_line(tmp_path, mechanism, source, words):
    if source:
        (tmp_path / "prr3.py").write_text(source)
    file = robot_with(tmp_path, mechanism)
    with pytest.raises(irs.BadInput) as refused:
        irs.load_robot(file)
    stated = str(refused.value)
    assert words in stated
    assert "\n" not in stated


@pytest.mark.parametrize("text", ["description: 2024-13-45\n", f"description: {'1' * 5000}\n", "description: [\n"])
def test_a_file_that_is_no_yaml_is_refused(folder, text):
    file = folder / "prr3.yaml"
    file.write_text(text + ROBOT)
    with pytest.raises(irs.BadInput, match="not YAML"):
        irs.load_robot(file)


def test_a_path_that_no_system_can_open_is_refused():
    with pytest.raises(irs.BadInput):
        irs.load_robot("a" * 300 + ".yaml")


def test_supervision_that_is_no_mapping_is_refused(folder):
    file = folder / "prr3.yaml"
    file.write_text(ROBOT.split("supervision:")[0] + "supervision: fast\n")
    with pytest.raises(irs.BadInput, match="supervision is 'fast'; it must be a mapping of settings"):
        irs.load_robot(file)


def test_lengths_that_no_machine_can_have_are_refused_by_the_class_itself(folder):
    with pytest.raises(irs.InvalidGeometry, match="l1 > 0 is broken"):
        irs.load_robot(folder / "prr3.yaml", l1=-0.1)
