"""The layouts for Foxglove, RViz and PlotJuggler name topics that a suite has, and fields that their messages have."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

PACKAGE = Path(__file__).resolve().parents[1]
LAYOUTS = PACKAGE / "layouts"
MESSAGES = PACKAGE.parent / "irsbot_msgs" / "msg"
ELSEWHERE = {"/diagnostics", "/robot_description"}
"""Of every ROS system, and of robot_state_publisher."""

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
    for splitter in root.iter("DockSplitter"):
        assert int(splitter.attrib["count"]) == len(list(splitter))
        assert sum(map(float, splitter.attrib["sizes"].split(";"))) == pytest.approx(1.0, abs=1e-5)
