"""The diagnostics of supervisor_node: its checks, their figures, and partners that do not fit."""

from __future__ import annotations

import math
import re
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

from cell import HIGH, PERIOD_S, STRICT, Cell, Statuses, Wire, bad, resting, statuses_of
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from irsbot_msgs.msg import SingularityState as StateMessage
from irsbot_msgs.msg import Verdict as VerdictMessage
from rclpy.duration import Duration
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from irsbot_supervisor.core.stop_monitor import MeasuredStop
from irsbot_supervisor.nodes.diagnostics import DiagnosticsPublisher

pytestmark = pytest.mark.ros


@pytest.fixture(scope="module")
def diagnostics(shared: Cell) -> Statuses:
    return statuses_of(shared)


def test_diagnostics_have_one_status_per_check(cell: Cell, diagnostics: Statuses):
    checks = ("margins", "motion", "branch", "joint states", "velocities", "supervisor")
    cell.wire.until(lambda: diagnostics)
    others = {
        "joint states rate",
        "joint states units",
        "joint states publishers",
        "verdict subscribers",
        "other topics",
        "judging",
        "stops",
        "calls",
    }
    assert set(diagnostics[-1]) == {*checks, *others}
    cell.wire.until(lambda: all(diagnostics[-1][check] == (b"\x00", "OK") for check in checks))
    cell.say = lambda t: bad(t, position=(math.nan, 0.0))
    cell.wire.until(lambda: "nan" in diagnostics[-1]["joint states"][1])
    assert diagnostics[-1]["joint states"][0] == DiagnosticStatus.ERROR
    assert diagnostics[-1]["margins"] == (b"\x00", "OK")


def test_diagnostics_have_the_figures_as_values(cell: Cell):
    heard: list[DiagnosticArray] = []
    cell.node.create_subscription(DiagnosticArray, "/diagnostics", heard.append, 10)

    def values(check: str) -> dict[str, str]:
        statuses = heard[-1].status if heard else ()
        return {v.key: v.value for status in statuses if status.name.endswith(f": {check}") for v in status.values}

    cell.wire.until(lambda: values("supervisor").get("level") == "OK" and "samples [1/s]" in values("joint states"))
    cell.wire.until(lambda: 0.0 < float(values("joint states")["samples [1/s]"]) < 2.0 / PERIOD_S, "a rate of samples")
    state = [state for state in cell.states if state.type1_margin and math.isfinite(state.type2_margin)][-1]
    margins, supervisor = values("margins"), values("supervisor")
    assert float(margins["Type 1"]) == pytest.approx(min(state.type1_margin), abs=1e-5)
    least = float(margins["while stopping"])  # of some sample: how late the next may come changes from one to the next
    assert any(least == pytest.approx(state.stop_margin, abs=1e-5) for state in cell.states)
    assert float(margins["stop limit"]) == state.stop_limit
    assert "constraint" in margins
    assert "limb" not in margins  # this robot has none
    assert supervisor["settings"] == cell.verdicts[-1].config_hash
    assert supervisor["event"] == str(cell.verdicts[-1].event)
    assert float(values("joint states")["since arrival [s]"]) >= 0.0
    assert 0.0 < float(supervisor["time to judge [s]"]) < 1.0


def test_diagnostics_of_a_latched_stop_say_so(wire: Wire):
    cell = Cell(wire, **STRICT)
    heard = statuses_of(cell)
    cell.say = resting(HIGH)
    cell.wire.until(lambda: heard and heard[-1]["supervisor"][0] == b"\x02")
    assert heard[-1]["supervisor"][1].startswith("a stop is latched, event 1: ")
    assert "Type 1 margin 0.6669, limit 0.7000" in heard[-1]["supervisor"][1]
    assert heard[-1]["margins"][0] == b"\x02"


@pytest.mark.parametrize(("way", "level"), [(0.29, b"\x00"), (0.31, b"\x01")])
def test_a_stop_that_went_farther_than_allowed_is_reported(way: float, level: bytes):
    stop = MeasuredStop("joint_1", "rad", way, 0.3, 0.05, 0.04)
    publisher = DiagnosticsPublisher.__new__(DiagnosticsPublisher)
    publisher._supervisor = SimpleNamespace(measured_stop=stop)
    name, stated, text = publisher._stop()
    assert (name, stated) == ("stops", level)
    assert text == f"joint 'joint_1' went {way} rad of 0.3 allowed in the last stop, 0.05 s of 0.04"


def test_a_second_publisher_of_joint_states_is_reported_with_its_name(cell: Cell, diagnostics: Statuses):
    cell.wire.until(lambda: diagnostics and diagnostics[-1]["joint states publishers"] == (b"\x00", "/robot"))
    with cell.company("intruder") as intruder:
        intruder.create_publisher(JointState, "joint_states", 10)
        both = r"2 publishers, one is expected: /intruder \([0-9a-f]+\), /robot \([0-9a-f]+\)"
        cell.wire.until(lambda: re.fullmatch(both, diagnostics[-1]["joint states publishers"][1]), both)
        level, stated = diagnostics[-1]["joint states publishers"]
        assert level == b"\x01"
        cell.logged(stated)  # with the number by which the middleware knows the writer
    cell.wire.until(lambda: diagnostics[-1]["joint states publishers"] == (b"\x00", "/robot"))


def test_partners_that_ask_for_or_offer_another_quality_of_service_are_reported(cell: Cell, diagnostics: Statuses):
    """A partner is known before its name is."""
    best_effort = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    with cell.company("fieldbus") as fieldbus:
        fieldbus.create_publisher(JointState, "joint_states", best_effort)
        cell.wire.until(lambda: diagnostics and "/fieldbus" in diagnostics[-1]["joint states publishers"][1])
        level, stated = diagnostics[-1]["joint states publishers"]
        assert level == b"\x02"
        assert "reliable" in stated
    with cell.company("drive") as drive:
        deadline = QoSProfile(depth=1, deadline=Duration(seconds=0.01))  # sooner than is promised
        drive.create_subscription(VerdictMessage, "supervisor/verdict", lambda message: None, deadline)
        cell.wire.until(lambda: "/drive" in diagnostics[-1]["verdict subscribers"][1])
        assert diagnostics[-1]["verdict subscribers"][0] == b"\x02"
    cell.wire.until(lambda: diagnostics[-1]["verdict subscribers"][0] == b"\x00")
    cell.logged("/fieldbus")
    cell.logged("/drive")


@pytest.mark.parametrize(
    ("topic", "kind", "publishes"),
    [
        ("supervisor/safe", Bool, False),
        ("supervisor/state", StateMessage, False),
        ("command_out", JointTrajectory, False),
        ("velocity_out", Float64MultiArray, False),
        ("command_in", JointTrajectory, True),
        ("velocity_in", Float64MultiArray, True),
    ],
)
def test_partners_on_every_other_topic_too(cell: Cell, diagnostics: Statuses, topic: str, kind: Any, publishes: bool):
    best_effort = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    sooner = QoSProfile(depth=1, deadline=Duration(seconds=0.01))  # than is promised, if anything is
    with cell.company("partner") as partner:
        if publishes:
            partner.create_publisher(kind, topic, best_effort)
        else:
            partner.create_subscription(kind, topic, lambda message: None, sooner)
        cell.wire.until(lambda: diagnostics and diagnostics[-1]["other topics"][0] == DiagnosticStatus.ERROR)
        assert diagnostics[-1]["other topics"][1].startswith(f"do not fit: /{topic}: /partner (")
    cell.wire.until(lambda: diagnostics[-1]["other topics"][0] == DiagnosticStatus.OK)
    cell.logged(f"/{topic}: /partner (")
