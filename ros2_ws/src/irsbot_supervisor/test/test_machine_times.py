"""Settings proposed from what a computer did: twice the worst, never milder than what is in force."""

from __future__ import annotations

import pytest

from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.configuration.machine_times import (
    MOST_HEARTBEAT_S,
    Proposed,
    Times,
    bounding_for,
    longest,
    proposals,
    proposed_bounding,
)
from irsbot_supervisor.core.stopping import cuts_of

SETTINGS, _ROBOT = read_settings("irsbot2")
PERIOD_S = 0.001
BOX_S = 2e-5


def proposed(met: Times, cuts: int = 0, box_s: float = BOX_S, **changed: float) -> list[Proposed]:
    settings, _robot = read_settings("irsbot2", **changed)
    longest_s = {number: (3 + 2 * number) * box_s for number in range(13)}
    return proposals(settings, met, PERIOD_S, proposed_bounding(settings, longest_s, cuts), cuts)


def test_the_longest_gap_and_delay_count() -> None:
    met = longest([0.0, 0.001, 0.031, 0.032], [0.0, 0.01, 0.025], [0.001, 0.004, 0.002], [2e-4, 9e-4])
    assert met == pytest.approx(Times(0.03, 0.015, 0.004, 9e-4))


def test_a_fast_computer_keeps_the_times_in_force() -> None:
    found = proposed(Times(0.002, 0.011, 0.002, 0.001))
    assert all(one.kept for one in found)
    assert [one.value for one in found] == [SETTINGS.stale_s, SETTINGS.heartbeat_s, SETTINGS.latency_s, 3e-5, 9e-5]


def test_for_a_slow_computer_longer_times_are_proposed() -> None:
    stale, heartbeat, latency, _bounding, judging = proposed(Times(0.0404, 0.03, 0.0301, 0.0071))
    assert (stale.kept, stale.value) == (False, 0.081)
    assert (heartbeat.kept, heartbeat.value) == (False, 0.015)
    assert (latency.kept, latency.value) == (False, 0.046)
    assert (judging.kept, judging.value) == (False, 0.011)


def test_times_of_a_computer_that_judges_longer_than_a_silence_lasts_are_settings() -> None:
    found = proposed(Times(0.002, 0.011, 0.002, 0.06))
    settings, _robot = read_settings("irsbot2", **{one.name: one.value for one in found})
    assert settings.judging_s == settings.stale_s == 0.09
    assert [one.name for one in found if not one.kept] == ["stale_s", "judging_s"]


def test_without_verdicts_no_time_is_kept() -> None:
    found = proposed(longest([], [], [], []))
    assert [one.name for one in found if one.kept] == ["bounding_s"]
    assert found[1].value == MOST_HEARTBEAT_S


def test_the_largest_heartbeat_is_not_kept_by_a_computer_that_says_nothing_for_longer() -> None:
    kept = [
        proposed(Times(0.002, gap_s, 0.004, 0.0005), heartbeat_s=MOST_HEARTBEAT_S)[1].kept
        for gap_s in (2.0 * MOST_HEARTBEAT_S, 2.1 * MOST_HEARTBEAT_S, 0.3)
    ]
    assert kept == [True, False, False]


@pytest.mark.parametrize(("cuts", "judging_s"), [(0, 0.0036), (1, 0.006), (12, 0.0324)])
def test_the_judging_time_has_the_time_for_the_cuts(cuts: int, judging_s: float) -> None:
    found = proposed(Times(0.002, 0.011, 0.002, 0.001), cuts, 0.0008)
    values = {one.name: one.value for one in found}
    settings, _robot = read_settings("irsbot2", **values)
    assert (values["bounding_s"], values["judging_s"]) == pytest.approx((0.0012, judging_s))
    assert cuts_of(settings) == cuts
    assert all(one.kept for one in found), "no time was stated that this computer does not keep"


def test_a_computer_that_bounds_a_box_too_slowly_does_not_keep_the_stated_time() -> None:
    times = Times(0.002, 0.011, 0.002, 0.001)
    kept = [
        {one.name: one.kept for one in proposed(times, 0, box_s, bounding_s=0.0012, judging_s=0.0036)}["bounding_s"]
        for box_s in (0.0008, 0.00081)
    ]
    assert kept == [True, False]
    assert proposed(times, 0, 0.0001, bounding_s=0.0012, judging_s=0.0036)[3].value == 0.0012


def test_the_time_of_a_sample_is_divided_among_its_boxes() -> None:
    """Where all else of a step takes longer than boxes, each of few boxes counts for more."""
    longest_s = {0: 0.0004, 4: 0.0011, 12: 0.002}
    assert [bounding_for(longest_s[cuts], cuts) for cuts in longest_s] == pytest.approx([0.0002, 0.00015, 0.00012])
    few = read_settings("irsbot2", bounding_s=0.0002, judging_s=0.0006)[0]
    many = read_settings("irsbot2", bounding_s=0.00011, judging_s=0.00297)[0]
    assert [proposed_bounding(one, longest_s, 4).kept for one in (few, many)] == [True, False]


def test_times_beyond_the_range_of_a_setting_are_its_end() -> None:
    found = {one.name: one for one in proposed(Times(0.002, 0.011, 0.002, 0.9), 12, 0.07, stale_s=1.0)}
    assert found["bounding_s"].value == 0.1
    assert found["judging_s"].value == 1.0
    assert not found["judging_s"].kept
