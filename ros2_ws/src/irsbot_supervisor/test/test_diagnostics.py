"""What the diagnostics say of joint positions that may be in another unit, of samples that are judged late, and of
rates over several activations."""

from __future__ import annotations

import math
from collections import Counter
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from supervised import feed, ready, resting

from irsbot_kinematics import make_robot
from irsbot_supervisor.nodes import diagnostics
from irsbot_supervisor.nodes.diagnostics import DiagnosticsPublisher, of_units
from irsbot_supervisor.nodes.judging_times import JudgingTimes

pytestmark = pytest.mark.ros

JOINTS = make_robot("irsbot2").mechanism.joints
SLIDES = make_robot("linear_delta").mechanism.joints
NAMES = ("joint_1", "joint_2")


def test_angles_more_than_a_turn_from_zero_are_reported_as_possible_degrees():
    found = of_units(JOINTS, NAMES, (math.degrees(2.9), math.degrees(0.05)))
    assert found.level == DiagnosticStatus.WARN
    assert found.text.startswith("'joint_1' is at 166.2 rad, 26.4 turns from zero: ")
    assert "if these are degrees" in found.text


@pytest.mark.parametrize("position", [(2.9, -6.2), (), (math.nan, 0.0)])
def test_angles_within_a_turn_and_no_angles_are_fine(position: tuple[float, ...]):
    assert of_units(JOINTS, NAMES, position).level == DiagnosticStatus.OK


def test_a_slide_has_no_turns():
    assert of_units(SLIDES, ("a", "b", "c"), (7.0, 0.0, 0.0)).level == DiagnosticStatus.OK


def test_samples_that_took_longer_to_judge_than_allowed_are_reported_once_and_counted():
    times = JudgingTimes()
    for took_s, allowed_s in ((0.004, 0.005), (0.0072, 0.005), (0.006, 0.001), (0.05, math.inf), (0.001, 0.001)):
        times.note(took_s, allowed_s)
    found = times.report()
    assert found.level == DiagnosticStatus.WARN
    assert found.text.startswith("2 samples took longer to judge than the certified box allows, up to 7.2 ms of 5.0 ms")
    assert (times.late, times.longest_s) == (2, 0.05)
    assert times.report().level == DiagnosticStatus.OK
    assert times.late == 2


class Reported:
    """Diagnostics of a supervised robot, without ROS: reports once a second, at the times of the test."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.seconds = 0
        monkeypatch.setattr(diagnostics, "time", SimpleNamespace(monotonic_ns=lambda: self.seconds * 10**9))
        monkeypatch.setattr(diagnostics, "Clock", lambda **_: None)
        self._said: list[Any] = []
        self._turns: list[Any] = []
        self.supervisor, self._joints = ready()
        self._until_ms = 0
        now = SimpleNamespace(to_msg=Time)
        node: Any = SimpleNamespace(
            create_publisher=lambda *_args, **_more: SimpleNamespace(publish=self._said.append),
            create_timer=lambda _period, turn, **_more: self._turns.append(turn),
            get_clock=lambda: SimpleNamespace(now=lambda: now),
            get_fully_qualified_name=lambda: "/supervisor",
        )
        nothing = SimpleNamespace(name="", level=b"\x00", text="")
        graph: Any = SimpleNamespace(look=lambda: [])
        callers: Any = SimpleNamespace(report=lambda: nothing, counts=Counter())
        samples: Any = SimpleNamespace(skipped=0)
        self.publisher = DiagnosticsPublisher(
            node, self.supervisor, graph, samples, JudgingTimes(), callers, self._failed
        )

    def _failed(self, error: Exception) -> None:
        raise error

    def judge(self, samples: int) -> None:
        """Samples of a robot at rest."""
        begin_ms, self._until_ms = self._until_ms, self._until_ms + samples
        for step in feed(self.supervisor, resting(begin_ms, self._until_ms, self._joints)):
            self.publisher.state = step.state
            self.publisher.verdict = step.verdict or self.publisher.verdict

    def report(self) -> float | None:
        """Samples per second in the report after another second; None without a report."""
        self.seconds += 1
        before = len(self._said)
        self._turns[0]()
        values = {pair.key: pair.value for message in self._said[before:] for s in message.status for pair in s.values}
        return float(values["samples [1/s]"]) if values else None


def test_the_rate_of_samples_is_that_of_the_time_in_which_the_supervisor_is_active(monkeypatch: pytest.MonkeyPatch):
    reported = Reported(monkeypatch)
    reported.judge(100)
    reported.report()
    reported.judge(100)
    verdict = reported.publisher.verdict
    assert reported.report() == 100.0
    reported.judge(50)
    reported.publisher.forget()
    assert [reported.report() for _ in range(4)] == [None] * 4
    reported.publisher.verdict = verdict  # active again, and no sample yet
    assert reported.report() == 0.0
    reported.judge(80)
    assert reported.report() == 80.0


def test_a_judging_time_that_is_not_a_number_is_late():
    times = JudgingTimes()
    times.note(math.nan, 0.005)
    assert times.report().level == DiagnosticStatus.WARN
