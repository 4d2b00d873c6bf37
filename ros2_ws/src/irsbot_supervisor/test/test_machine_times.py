"""Settings proposed from what a computer did: twice the worst, never milder than what is in force."""

from __future__ import annotations

import pytest

from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.configuration.machine_times import MOST_HEARTBEAT_S, Times, longest, proposals

SETTINGS, _ROBOT = read_settings("irsbot2")
PERIOD_S = 0.001


def test_the_longest_gap_and_delay_count() -> None:
    met = longest([0.0, 0.001, 0.031, 0.032], [0.0, 0.01, 0.025], [0.001, 0.004, 0.002], [2e-4, 9e-4])
    assert met == pytest.approx(Times(0.03, 0.015, 0.004, 9e-4))


def test_a_fast_computer_keeps_the_times_in_force() -> None:
    found = proposals(SETTINGS, Times(0.002, 0.011, 0.002, 0.001), PERIOD_S)
    assert all(one.kept for one in found)
    assert [one.value for one in found] == [SETTINGS.stale_s, SETTINGS.heartbeat_s, SETTINGS.latency_s, 0.0]


def test_for_a_slow_computer_longer_times_are_proposed() -> None:
    stale, heartbeat, latency, judging = proposals(SETTINGS, Times(0.0404, 0.03, 0.0301, 0.0071), PERIOD_S)
    assert (stale.kept, stale.value) == (False, 0.081)
    assert (heartbeat.kept, heartbeat.value) == (False, 0.015)
    assert (latency.kept, latency.value) == (False, 0.046)
    assert (judging.kept, judging.value) == (False, 0.011)


def test_times_of_a_computer_that_judges_longer_than_a_silence_lasts_are_settings() -> None:
    found = proposals(SETTINGS, Times(0.002, 0.011, 0.002, 0.06), PERIOD_S)
    settings, _robot = read_settings("irsbot2", **{one.name: one.value for one in found})
    assert settings.judging_s == settings.stale_s == 0.09
    assert [one.name for one in found if not one.kept] == ["stale_s", "judging_s"]


def test_without_verdicts_no_time_is_kept() -> None:
    found = proposals(SETTINGS, longest([], [], [], []), PERIOD_S)
    assert not any(one.kept for one in found)
    assert found[1].value == MOST_HEARTBEAT_S


def test_the_largest_heartbeat_is_not_kept_by_a_computer_that_says_nothing_for_longer() -> None:
    settings, _robot = read_settings("irsbot2", heartbeat_s=MOST_HEARTBEAT_S)
    kept = [
        proposals(settings, Times(0.002, gap_s, 0.004, 0.0005), PERIOD_S)[1].kept
        for gap_s in (2.0 * MOST_HEARTBEAT_S, 2.1 * MOST_HEARTBEAT_S, 0.3)
    ]
    assert kept == [True, False, False]
