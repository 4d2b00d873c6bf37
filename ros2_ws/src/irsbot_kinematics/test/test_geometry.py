"""Geometries and robot files: what is refused, and that the refusal says which inequality, with both values."""

from __future__ import annotations

import re
from importlib import resources
from math import inf, nan, pi, sin

import pytest
import yaml
from postures import NAMES, ROBOTS

import irsbot_kinematics as irs
from irsbot_kinematics.description.robot_file import fingerprint, read_robot
from irsbot_kinematics.mechanisms import TOPOLOGIES

DEFAULT = {"l1": 0.375, "l2eq": 0.825, "b": 0.1375, "p": 0.05, "a1": 0.42, "a2": 0.03, "beta": 0.2, "e": 0.0}
PRESETS = resources.files("irsbot_kinematics").joinpath("presets")

BAD = [
    # robot, changed numbers, inequality, left value, right value
    ("irsbot2", {"a1": 0.03}, "a1 > a2", "0.03", "0.03"),
    ("irsbot2", {"a2": 0.5}, "a1 > a2", "0.42", "0.5"),
    ("irsbot2", {"beta": 0.0}, "beta > 0", "0", ""),
    ("irsbot2", {"beta": -0.1}, "beta > 0", "-0.1", ""),
    ("irsbot2", {"beta": pi / 2}, "beta < pi/2", "1.57079633", "1.57079633"),
    ("irsbot2", {"beta": 45.0}, "beta < pi/2", "45", "1.57079633"),
    ("irsbot2", {"b": 0.05 + 0.42 * sin(0.2)}, "|b0| > ", "0", "1e-09"),
    ("irsbot2", {"b": 2.0, "beta": 0.2}, "|b0| <= l1 + l2eq", f"{2.0 - 0.05 - 0.42 * sin(0.2):.9g}", "1.2"),
    *(("irsbot2", {name: -0.01}, f"{name} > 0", "-0.01", "") for name in ("l1", "l2eq", "b", "p", "a1", "a2")),
    *(("irsbot2", {name: 0.0}, f"{name} > 0", "0", "") for name in ("l1", "l2eq", "b", "p", "a1", "a2")),
    *(("irsbot2", {name: nan}, f"{name} must be finite", "nan", "") for name in DEFAULT),
    *(("irsbot2", {name: -inf}, f"{name} must be finite", "-inf", "") for name in DEFAULT),
    ("five_bar", {"l1": 0.0}, "l1 > 0", "0", ""),
    ("five_bar", {"l2": -1.0}, "l2 > 0", "-1", ""),
    ("five_bar", {"b": nan}, "b must be finite", "nan", ""),
    ("five_bar", {"b": 1.3}, "b <= l1 + l2", "1.3", "1.2"),
    *((name, {"limits": (-0.1, 0.9)}, "limits[0] >= 0", "-0.1", "") for name in ("rpr3", "rails2")),
    *(("rails2", {name: -0.1}, "min(L2, L3) > 0", "-0.1", "") for name in ("L2", "L3")),
    ("rails3", {"L": (0.5, -0.1, 0.5)}, "min L > 0", "-0.1", ""),
    *(("rrr3", {name: 0.0}, f"{name} > 0", "0", "") for name in ("rb", "rp", "l")),
    ("rrr3", {"rb": 1.0}, "|rb - rp| <= 2 l", "0.9", "0.8"),
    ("rrr3", {"rp": 1.25}, "|rb - rp| <= 2 l", "0.9", "0.8"),
    *((name, {"limits": (0.9, 0.9)}, "limits[0] < limits[1]", "0.9", "0.9") for name in ("rpr3", "rails2", "rails3")),
    ("rails2", {"travel": (0.3, 0.2)}, "travel[0] < travel[1]", "0.3", "0.2"),
    ("rails2", {"u3": (0.0, 0.0)}, "|u3| > 0", "0", ""),
    ("rails3", {"u1": (0.0, 0.0)}, "|u1| > 0", "0", ""),
    ("rpr3", {"b1": (0.0, 0.0), "b2": (0.0, 0.0), "b3": (0.0, 0.0)}, "max |b| > 0", "0", ""),
]


@pytest.mark.parametrize(("name", "changes", "inequality", "left", "right"), BAD)
def test_bad_lengths_are_refused_with_the_inequality_and_both_values(name, changes, inequality, left, right):
    numbers = DEFAULT | changes if name == "irsbot2" else changes
    with pytest.raises(irs.InvalidGeometry) as refused:
        irs.make_robot(name, **numbers)
    sentence = str(refused.value)
    assert inequality in sentence
    values = re.search(r"got (\S+)(?: against (\S+))?$", sentence)
    assert values
    if inequality.startswith("|b0| > "):  # b0 is 0 but for rounding
        assert abs(float(values[1])) < 1e-15
    else:
        assert values[1] == left
    assert (values[2] or "") == right


def test_lengths_at_their_bounds_are_accepted():
    """A 3-RRR with stretched legs alone, struts from length 0 on, rails to one side, a platform joint at P, a rail of
    another size: none is wrong."""
    assert irs.make_robot("rrr3", rb=0.5, rp=0.25, l=0.125).mechanism.geometry
    assert irs.make_robot("rpr3", limits=(0.0, 0.5), b1=(0.0, 0.0)).mechanism.geometry
    assert irs.make_robot("rails3", limits=(-0.9, -0.2)).mechanism.geometry
    small, large = (irs.make_robot("rails2", u2=way, u3=(0.0, 2.0)).mechanism for way in ((0.03, 0.04), (3.0, 4.0)))
    assert small.rails[1].way == pytest.approx((0.6, 0.8))
    assert large.rails[1].way == pytest.approx((0.6, 0.8))


def test_the_smallest_legal_steps_beyond_the_bounds_are_accepted():
    for changes in ({"a2": 0.4199999}, {"beta": 1e-6}, {"beta": pi / 2 - 1e-6}, {"e": -3.0}, {"b": 1.25}):
        assert irs.make_robot("irsbot2", **(DEFAULT | changes)).mechanism.geometry


@pytest.mark.parametrize("value", ["0.4", None, True, [0.4], {"value": 0.4}])
def test_a_length_that_is_not_a_number_is_refused(value):
    with pytest.raises(irs.InvalidGeometry, match="l1"):
        irs.make_robot("irsbot2", l1=value)


def test_a_length_that_the_robot_does_not_have_is_refused_with_those_it_has():
    with pytest.raises(irs.InvalidGeometry, match="no 'l3'; it has l1, l2eq, b, p, a1, a2, beta, e"):
        irs.make_robot("irsbot2", l3=1.0)


@pytest.mark.parametrize("name", ["irsbot3", "", ".."])
def test_an_unknown_robot_is_refused_with_the_known_names(name):
    with pytest.raises(irs.UnknownRobot) as refused:
        irs.make_robot(name)
    assert all(known in str(refused.value) for known in irs.robots())


@pytest.mark.parametrize("name", ["irsbot2.yml", "/nowhere/robot.yaml"])
def test_a_missing_robot_file_is_reported_as_missing(name):
    with pytest.raises(irs.BadInput, match=f"^{name}: there is no such file$"):
        irs.load_robot(name)


# --- shipped files ---


@pytest.mark.parametrize("name", NAMES)
def test_a_shipped_preset_reads_with_a_source_for_every_number(name):
    stated = yaml.safe_load(PRESETS.joinpath(f"{name}.yaml").read_text(encoding="utf-8"))
    assert stated["mechanism"] in TOPOLOGIES
    assert stated["description"]
    assert "\n" not in stated["description"].strip()
    for key, entry in stated["geometry"].items():
        assert set(entry) == {"value", "source"}, key
        values = entry["value"] if isinstance(entry["value"], list) else [entry["value"]]
        assert all(type(value) is float for value in values), f"{key}: 1 in YAML is not a double"
        assert len(entry["source"]) > 3
    assert set(stated["usual"]) == {"working_mode", "assembly_mode"}
    mechanism = ROBOTS[name].mechanism
    assert mechanism.kind == stated["mechanism"]
    for key, entry in stated["geometry"].items():
        value = getattr(mechanism.geometry, key)
        assert value == (tuple(entry["value"]) if isinstance(entry["value"], list) else entry["value"])
    assert list(mechanism.usual_working_mode) == stated["usual"]["working_mode"]
    assert mechanism.usual_assembly_mode == stated["usual"]["assembly_mode"]


@pytest.mark.parametrize("name", NAMES)
def test_a_shipped_preset_works_in_its_usual_modes(name):
    robot = ROBOTS[name]
    lower = [max(joint.lower, -pi) for joint in robot.mechanism.joints]
    assert robot.mechanism.usual_working_mode in robot.mechanism.working_modes
    assert robot.mechanism.usual_assembly_mode in robot.mechanism.assembly_modes
    assert len(lower) == len(robot.mechanism.usual_working_mode)


def test_robots_names_every_shipped_file_once_defaults_first():
    files = {entry.name.removesuffix(".yaml") for entry in PRESETS.iterdir() if entry.name.endswith(".yaml")}
    assert set(irs.robots()) == files
    assert len(irs.robots()) == len(files)
    assert irs.robots()[: len(TOPOLOGIES)] == tuple(TOPOLOGIES)


def test_a_file_of_the_user_makes_the_same_machine_as_the_preset(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text(PRESETS.joinpath("irsbot2.yaml").read_text(encoding="utf-8"), encoding="utf-8")
    mine = irs.load_robot(file)
    assert mine.name == "mine"
    assert mine.mechanism.geometry == irs.make_robot("irsbot2").mechanism.geometry
    assert fingerprint(mine.mechanism) == fingerprint(irs.make_robot("irsbot2").mechanism)
    assert fingerprint(mine.mechanism) != fingerprint(irs.load_robot(file, l1=0.376).mechanism)
    assert fingerprint(mine.mechanism) != fingerprint(irs.make_robot("five_bar").mechanism)
    assert read_robot(file).sources["l1"] == "S1, robot parameters"


LENGTHS = "{l1: 0.3, l2eq: 0.8, b: 0.2, p: 0.05, a1: 0.4, a2: 0.03, beta: 0.2}"
MALFORMED = [
    # text, word of the sentence
    ("geometry: {l1: 0.3", "not YAML"),
    ("\t- x", "not YAML"),
    ("a: &x 1\nb: *y", "not YAML"),
    ("", "expected a mapping"),
    ("- 1\n- 2", "expected a mapping"),
    ("0.4", "expected a mapping"),
    ("mechanism: irsbot2", "expected a mapping"),
    ("{mechanism: irsbot2, geometry: [0.3]}", "expected a mapping"),
    (f"{{mechanism: irsbot2, geometry: {LENGTHS}, colour: red}}", "unknown key 'colour'"),
    (f"{{mechanism: irsbot3, geometry: {LENGTHS}}}", "mechanism is 'irsbot3'"),
    (f"{{geometry: {LENGTHS}}}", "mechanism is 'None'"),
    (f"{{mechanism: [irsbot2], geometry: {LENGTHS}}}", "mechanism is"),
    (f"{{mechanism: {{a: 1}}, geometry: {LENGTHS}}}", "mechanism is"),
    ("{mechanism: irsbot2, geometry: {l1: 0.3}}", "lacks l2eq, b, p, a1, a2, beta"),
    (f"{{mechanism: irsbot2, geometry: {LENGTHS[:-1]}, l9: 1.0}}}}", "no 'l9'"),
    (f"{{mechanism: irsbot2, geometry: {LENGTHS[:-1]}, 7: 1.0}}}}", "no '7'"),
    (f"{{mechanism: irsbot2, geometry: {LENGTHS.replace('0.3', 'long')}}}", "geometry.l1 must be a number"),
    (f"{{mechanism: irsbot2, geometry: {LENGTHS.replace('0.3', 'yes')}}}", "geometry.l1 must be a number"),
    (f"{{mechanism: irsbot2, geometry: {LENGTHS.replace('0.3', '{source: me}')}}}", "geometry.l1 must be a number"),
    (f"{{mechanism: irsbot2, geometry: {LENGTHS.replace('0.3', '.nan')}}}", "l1 must be finite"),
    (f"{{mechanism: irsbot2, geometry: {LENGTHS.replace('0.3', '[0.3]')}}}", "l1 must be a number"),
    (f"{{mechanism: irsbot2, geometry: {LENGTHS.replace('0.3', '[[0.3]]')}}}", "geometry.l1 must be a number"),
    ("{mechanism: orthoglide, geometry: {L: 2.0, limits: 4.0}}", "limits must be 2 numbers"),
    ("{mechanism: orthoglide, geometry: {L: 2.0, limits: [0.0, 1.0, 4.0]}}", "limits must be 2 numbers"),
    ("{mechanism: orthoglide, geometry: {L: [2.0, 2.0], limits: [0.0, 4.0]}}", "L must be a number"),
    ("{mechanism: orthoglide, geometry: {L: 2.0, limits: [0.0, .nan]}}", "limits must be finite"),
    (f"{{mechanism: irsbot2, geometry: {LENGTHS.replace('0.3', '-0.3')}}}", "l1 > 0"),
    ("{mechanism: orthoglide, geometry: {L: 2.0, limits: [4.0, 1.0]}}", "limits"),
    (f"{{mechanism: irsbot2, geometry: {LENGTHS.replace('0.3', '1' + '0' * 400)}}}", "l1"),
    (f"{{mechanism: irsbot2, geometry: {LENGTHS}, usual: 1}}", "usual"),
    (f"{{mechanism: irsbot2, geometry: {LENGTHS}, usual: {{working_mode: 1}}}}", "usual.working_mode"),
    (f"{{mechanism: irsbot2, geometry: {LENGTHS}, usual: {{working_mode: [1, 1, 1]}}}}", "usual.working_mode"),
    (f"{{mechanism: irsbot2, geometry: {LENGTHS}, usual: {{assembly_mode: 0}}}}", "usual.assembly_mode"),
    (f"{{mechanism: irsbot2, geometry: {LENGTHS}, usual: {{assembly_mode: [1]}}}}", "usual.assembly_mode"),
    (f"{{mechanism: irsbot2, geometry: {LENGTHS}, usual: {{working_modes: [1, 1]}}}}", "usual"),
]


@pytest.mark.parametrize(("text", "word"), MALFORMED)
def test_a_malformed_file_is_refused_with_one_sentence_that_names_the_file(tmp_path, text, word):
    file = tmp_path / "robot.yaml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(irs.KinematicsError) as refused:
        irs.load_robot(file)
    sentence = str(refused.value)
    assert word in sentence
    assert "\n" not in sentence
    assert str(file) in sentence or isinstance(refused.value, irs.InvalidGeometry)  # which names the length


def test_a_file_that_is_not_text_is_refused(tmp_path):
    file = tmp_path / "robot.yaml"
    file.write_bytes(b"\xff\xfe\x00\x81" * 10)
    with pytest.raises(irs.BadInput, match="not YAML"):
        irs.load_robot(file)


def test_a_well_formed_file_of_bare_numbers_is_accepted(tmp_path):
    file = tmp_path / "robot.yaml"
    file.write_text(f"{{mechanism: irsbot2, geometry: {LENGTHS}, usual: {{working_mode: [-1, 1]}}}}", encoding="utf-8")
    robot = irs.load_robot(file)
    assert robot.mechanism.usual_working_mode == (-1, 1)
    assert robot.mechanism.geometry.e == 0.0
