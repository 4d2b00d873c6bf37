"""The layouts for Foxglove, RViz and PlotJuggler name topics that a suite has, and fields that their messages have.
They show every margin of every robot, and their programs take them."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from math import dist, radians, tan
from pathlib import Path
from typing import Any

import pytest
import yaml

import irsbot_kinematics as irs
from irsbot_kinematics.skeleton import bars
from irsbot_msgs_py.records import Cause, Level

PACKAGE = Path(__file__).resolve().parents[1]
LAYOUTS = PACKAGE / "layouts"
MESSAGES = PACKAGE.parent / "irsbot_msgs" / "msg"
ELSEWHERE = {"/diagnostics", "/robot_description"}
"""Of every ROS system, and of robot_state_publisher."""

FOXGLOVE_PANELS = {"3D", "Plot", "StateTransitions", "RawMessages", "DiagnosticSummary"}
"""Of the types that Foxglove has, those in which our topics were seen."""

pytestmark = pytest.mark.skipif(not LAYOUTS.is_dir(), reason="installed without the source tree beside it")


def offered() -> dict[str, str]:
    """Topics of the supervisor, as its node declares them -> their messages."""
    text = "".join((PACKAGE / "irsbot_supervisor/nodes" / name).read_text() for name in ("supervisor.py", "markers.py"))
    made = re.findall(r"publisher\((?:self, |node, )?(\w+), \"~/(\w+)\"", text)
    return {f"/supervisor/{topic}": kind.replace("VerdictMsg", "Verdict") for kind, topic in made}


def fields(kind: str) -> dict[str, str]:
    """Fields of one of our messages -> their types."""
    lines = (MESSAGES / f"{kind}.msg").read_text().splitlines()
    stated = [line.split("#")[0].split() for line in lines if "=" not in line.split("#")[0]]
    return {line[1]: line[0] for line in stated if len(line) == 2}


def check(path: str, separator: str) -> None:
    """A topic with a field behind it, such as /supervisor/state.pose[0]."""
    assert path.startswith("/supervisor/")
    topic, _, rest = path[1:].replace(separator, "\0", 2 if separator == "/" else 1).rpartition("\0")
    topic = "/" + topic.replace("\0", "/")
    assert topic in offered(), path
    name, index = re.fullmatch(r"(\w+)(\[\d+\])?", rest).groups()
    known = fields(offered()[topic])
    assert name in known, path
    assert (index is not None) == known[name].endswith("[]"), path


def constants_before(kind: str, field: str) -> dict[str, int]:
    """The constants between a field of one of our messages and the field before it."""
    found: dict[str, int] = {}
    for line in (MESSAGES / f"{kind}.msg").read_text().splitlines():
        if constant := re.match(r"\w+ (\w+)=(\d+)", line):
            found[constant[1]] = int(constant[2])
        elif stated := re.match(r"[\w/\[\]]+ +(\w+)", line):
            if stated[1] == field:
                return found
            found = {}
    raise AssertionError(field)


def strings(value: Any) -> Iterator[tuple[str, str]]:
    """Every text of a tree with its key."""
    for key, one in value.items() if isinstance(value, dict) else enumerate(value):
        if isinstance(one, str):
            yield str(key), one
        elif isinstance(one, (dict, list)):
            yield from strings(one)


def test_the_supervisor_offers_what_the_test_believes() -> None:
    assert {"/supervisor/state", "/supervisor/verdict", "/supervisor/markers"} <= set(offered())
    assert fields("SingularityState")["type1_margin"] == "float64[]"
    assert "OK" not in fields("SingularityState")
    for wrong in ("/supervisor/state.type3_margin", "/supervisor/state.pose", "/supervisor/states.pose[0]"):
        with pytest.raises(AssertionError):
            check(wrong, ".")


def test_foxglove_names_what_there_is() -> None:
    layout = json.loads((LAYOUTS / "foxglove.json").read_text())
    paths = [text for key, text in strings(layout) if key == "value"]
    assert len(paths) > 10
    for path in paths:
        check(path, ".")
    panels = layout["configById"]
    topics = {text for key, text in strings(layout) if key in ("topicPath", "topicToRender")}
    topics |= {topic for panel in panels.values() for topic in panel.get("topics", {}) if isinstance(topic, str)}
    assert {"/supervisor/verdict", "/supervisor/markers"} <= topics
    assert topics <= set(offered()) | ELSEWHERE
    placed = {text for key, text in strings(layout["layout"]) if key in ("first", "second")}
    assert placed == set(panels)
    assert {panel.partition("!")[0] for panel in panels} == FOXGLOVE_PANELS


def test_foxglove_shows_names_of_levels_for_their_numbers() -> None:
    """It takes the constants that stand before a field for the names of its values."""
    layout = json.loads((LAYOUTS / "foxglove.json").read_text())
    shown = [path["value"] for path in layout["configById"]["StateTransitions!level"]["paths"]]
    assert "/supervisor/verdict.level" in shown
    levels = {level.name: level.value for level in Level}
    assert constants_before("Verdict", "level") == constants_before("SingularityState", "level") == levels
    causes = {f"CAUSE_{name}": cause.value for name, cause in Cause.__members__.items()}
    assert constants_before("SingularityState", "causes") == causes


def test_the_camera_of_foxglove_has_the_usual_robot_in_view() -> None:
    camera = json.loads((LAYOUTS / "foxglove.json").read_text())["configById"]["3D!scene"]["cameraState"]
    robot = irs.make_robot("irsbot2")
    pose = (0.0, -0.85)
    at = robot.posture_near(robot.inverse(pose), pose)
    skeleton = robot.mechanism.skeleton()
    assert skeleton is not None
    drives = dict(zip(skeleton.drives, at.joints, strict=True))
    ends = [end for bar in bars(skeleton, {**drives, **skeleton.closing(at.joints, at.pose)}) for end in bar[:2]]
    farthest = max(dist(end, camera["targetOffset"]) for end in ends)
    assert camera["target"] == [0, 0, 0]  # of the frame `base`, which nothing moves
    half_height = camera["distance"] * tan(radians(camera["fovy"] / 2.0))
    assert 0.4 * half_height < farthest < half_height
    assert camera["near"] < 0.1 * camera["distance"] < camera["far"]


@pytest.mark.parametrize("name", ["foxglove.json", "plotjuggler.xml"])
def test_every_margin_of_every_leg_limb_and_joint_of_every_robot_is_shown(name: str) -> None:
    layout = (LAYOUTS / name).read_text()
    mechanisms = [irs.make_robot(robot).mechanism for robot in irs.robots()]
    joints, limbs = (max(numbers) for numbers in zip(*((len(m.joints), m.limb_count) for m in mechanisms), strict=True))
    lengths = {"type1_margin": joints, "limb_margin": limbs, "joint_position": joints}
    wanted = [field for field in fields("SingularityState") if field.endswith("_margin")] + ["joint_position"]
    assert set(lengths) <= set(wanted)
    for field in wanted:
        for end in [f"[{number}]" for number in range(lengths[field])] if field in lengths else [""]:
            assert re.search(rf"/supervisor/state[./]{field}{re.escape(end)}\"", layout), field + end


def test_rviz_names_what_there_is() -> None:
    layout = yaml.safe_load((LAYOUTS / "irsbot.rviz").read_text())
    manager = layout["Visualization Manager"]
    topics = {text for _key, text in strings(manager["Displays"]) if text.startswith("/")}
    assert "/supervisor/markers" in topics
    assert topics <= set(offered()) | ELSEWHERE
    declared = (PACKAGE / "irsbot_supervisor/nodes/supervisor.py").read_text()
    assert f'"base_frame": ("{manager["Global Options"]["Fixed Frame"]}"' in declared


def test_plotjuggler_names_what_there_is() -> None:
    root = ElementTree.parse(LAYOUTS / "plotjuggler.xml").getroot()
    curves = [curve.attrib["name"] for curve in root.iter("curve")]
    assert len(curves) > 10
    for curve in curves:
        check(curve, "/")
    (window,) = root.iter("tabbed_widget")
    assert window.attrib == {"name": "Main Window", "parent": "main_window"}, "it crashes without a window of this name"
    assert not list(root.iter("plugin")), "a plugin without its settings reads no arrays"
    for splitter in root.iter("DockSplitter"):
        assert int(splitter.attrib["count"]) == len(list(splitter))
        assert sum(map(float, splitter.attrib["sizes"].split(";"))) == pytest.approx(1.0, abs=1e-5)
