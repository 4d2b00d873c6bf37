"""What the layouts of RViz, PlotJuggler and Foxglove name is there beside a run of the robot with the most joints."""

from __future__ import annotations

import json
import signal
import subprocess
import time
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

from command import IRSBOT, PATIENCE_S
from irsbot_msgs.msg import SingularityState, Verdict
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from visualization_msgs.msg import Marker, MarkerArray

from irsbot_supervisor.processes.polling import Polling, taken
from irsbot_supervisor.processes.suite import free_domain

pytestmark = [pytest.mark.ros, pytest.mark.slow]

LAYOUTS = Path(__file__).parents[1] / "ros2_ws/src/irsbot_supervisor/layouts"
MOST_JOINTS = "ruu4"
SHOWN_BY = {"rviz_default_plugins/MarkerArray": MarkerArray}
"""Displays of topics of the suite -> the messages that they take."""

PLOTTED = {"/supervisor/state": SingularityState, "/supervisor/verdict": Verdict}


@pytest.fixture(scope="module")
def listener(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Polling]:
    """In the domain of a running suite."""
    domain = free_domain()
    out = tmp_path_factory.mktemp("up") / "run"
    command = [*IRSBOT, "up", "--robot", MOST_JOINTS, "--domain", str(domain), "--out", str(out)]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as process, Polling(domain, "", "viewer") as node:
        try:
            yield node
        finally:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(PATIENCE_S)
            finally:
                process.kill()


def newest(listener: Polling, kind: type, topic: str, quality: QoSProfile) -> Any:
    """The first message that comes, if what the topic offers and what is asked for fit together."""
    subscription = listener.listen(kind, topic, quality)
    deadline = time.monotonic() + PATIENCE_S
    while not (found := [data for data, _arrived in taken(subscription)]):
        assert time.monotonic() < deadline, f"nothing on {topic}"
        time.sleep(0.02)  # a node without an executor is not told
    return deserialize_message(found[-1], kind)


def leaves(message: Any, path: str) -> Iterator[str]:
    """Names of all numbers in a message, as PlotJuggler makes them."""
    if hasattr(message, "get_fields_and_field_types"):
        for field in message.get_fields_and_field_types():
            yield from leaves(getattr(message, field), f"{path}/{field}")
    elif isinstance(message, (int, float)):
        yield path
    elif not isinstance(message, str):
        for number, one in enumerate(message):
            yield from leaves(one, f"{path}[{number}]")


def quality(stated: dict[str, Any]) -> QoSProfile:
    """The quality of service of one topic in a file of RViz."""
    assert stated["History Policy"] == "Keep Last"
    return QoSProfile(
        depth=stated["Depth"],
        durability=DurabilityPolicy[stated["Durability Policy"].upper().replace(" ", "_")],
        reliability=ReliabilityPolicy[stated["Reliability Policy"].upper().replace(" ", "_")],
    )


def test_displays_of_rviz_get_the_messages_of_the_suite_in_their_frame(listener: Polling) -> None:
    manager = yaml.safe_load((LAYOUTS / "irsbot.rviz").read_text())["Visualization Manager"]
    shown = [display for display in manager["Displays"] if display["Class"] in SHOWN_BY]
    assert [display["Topic"]["Value"] for display in shown] == ["/supervisor/markers"]
    for display in shown:
        topic = display["Topic"]
        message = newest(listener, SHOWN_BY[display["Class"]], topic["Value"], quality(topic))
        lasting = [marker for marker in message.markers if marker.action == Marker.ADD]
        assert {marker.header.frame_id for marker in lasting} == {manager["Global Options"]["Fixed Frame"]}


def test_every_field_that_plotjuggler_and_foxglove_plot_is_in_a_message(listener: Polling) -> None:
    there = set()
    for topic, kind in PLOTTED.items():
        there |= set(leaves(newest(listener, kind, topic, QoSProfile(depth=1)), topic))
    assert "/supervisor/state/type1_margin[3]" in there
    curves = {curve.attrib["name"] for curve in ElementTree.parse(LAYOUTS / "plotjuggler.xml").iter("curve")}
    assert curves <= there
    panels = json.loads((LAYOUTS / "foxglove.json").read_text())["configById"].values()
    paths = {path["value"].replace(".", "/") for panel in panels for path in panel.get("paths", ())}
    assert len(paths) > 10
    assert paths <= there
