"""The rows of the fault campaign that start nodes, short. How old data may get is asked only as far as
old samples in a queue would show: machines differ."""

from __future__ import annotations

import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

from irsbot_supervisor.validation.harness.rows import Job, Row
from irsbot_supervisor.validation.with_nodes import floods, operators, outages, silence, soak
from irsbot_supervisor.validation.with_nodes.silence_causes import CAUSES

pytestmark = [pytest.mark.ros, pytest.mark.slow]


def short(amount: int) -> Job:
    return Job(amount, 3, lambda number: None)


def met(row: Row) -> bool:
    assert row.ok, f"{row.note} {row.figures}"
    return True


def test_transitions_at_random_are_answered_and_leave_nothing_behind():
    assert met(operators.run_lifecycle(short(40)))


def test_parameters_at_random_are_in_force_as_a_whole_or_not_at_all():
    row = operators.run_parameters(short(60))
    assert met(row)
    assert 0 < row.figures["accepted"] < 60


def test_a_thousand_resets_at_once_end_one_stop_once_and_no_active_cause():
    assert met(operators.run_resets(short(2000)))


def test_the_newest_wins_in_a_flood_and_memory_is_bounded(monkeypatch: pytest.MonkeyPatch):
    rate_hz = 20_000.0
    monkeypatch.setattr(floods, "RATES_HZ", (rate_hz,))
    row = floods.run(short(3))
    assert row.unsafe == 0
    growth = {name: value for name, value in row.figures.items() if "memory" in name}
    assert len(growth) == 3
    assert max(growth.values()) < floods.GROWTH_MB
    backlog_ms = 1e3 * floods.SETTLE_S  # in the order of arrival, samples would be as late as the flood is old
    assert row.figures["20000 Hz: age [ms]"] < 0.5 * backlog_ms
    assert 0.0 < row.figures["20000 Hz: judged [Hz]"] <= rate_hz * 1.1  # as many as this machine can, none twice


def test_nodes_may_freeze_and_die(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(outages, "CASES", outages.CASES[:4])  # the two whose absence means stop
    row = outages.run(short(4))
    assert met(row)
    assert row.figures[outages.STAND_S] > 0.05  # the robot moved on for a while: the test bites


@pytest.mark.parametrize("cause", CAUSES)
def test_verdicts_continue_during_requests_and_while_output_stalls(monkeypatch: pytest.MonkeyPatch, cause: str):
    monkeypatch.setattr(silence, "ROBOTS", ("irsbot2",))  # the slowest robots: the long row
    monkeypatch.setattr(silence, "CAUSES", {cause: CAUSES[cause]})
    row = silence.run(short(1))
    assert met(row)
    assert row.amount == 1


def test_the_suite_at_work_holds_no_more_memory_and_descriptors_at_the_end():
    row = soak.run(short(5))
    assert met(row)
    assert row.figures["supervisor at the end [MB]"] > 10.0
