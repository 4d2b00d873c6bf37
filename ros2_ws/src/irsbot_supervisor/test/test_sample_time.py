"""The time of a box and of a step, and the number of cuts that pays.

The clock of these tests shows the number of boxes that were bounded.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest
from counted import Counted
from supervised import settings_of

from irsbot_kinematics import CertifiedBounds, Posture, Robot
from irsbot_supervisor.configuration import sample_time
from irsbot_supervisor.configuration.sample_time import (
    TRIED,
    cuts_that_pay,
    longest_box_s,
    longest_step_s,
    longest_times,
)
from irsbot_supervisor.configuration.stopping_cost import box_ways, free_time, places_above_stop, speeds_at_rest
from irsbot_supervisor.core.box_search import BoxBounds, spare_of
from irsbot_supervisor.core.estimation.estimate import Speeds
from irsbot_supervisor.core.settings import Settings, time_for_cuts
from irsbot_supervisor.core.stopping import cuts_of, limits_of

PERIOD_S = 0.001


def box_time_s(settings: Settings, counted: Counted) -> float:
    """As many nanoseconds as a box needs bounds."""
    return longest_box_s(settings, counted, PERIOD_S, places_above_stop(settings, counted))


@pytest.mark.parametrize("name", ["irsbot2", "rrr3"])
def test_the_time_of_one_box_is_that_of_one_box(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    settings, robot = settings_of(name)
    counted = Counted(robot.mechanism)
    monkeypatch.setattr(sample_time.time, "perf_counter_ns", lambda: counted.boxes)
    assert box_time_s(settings, counted) == pytest.approx(1e-9)


def test_a_box_is_bounded_to_second_order_as_near_a_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    settings, robot = settings_of("irsbot2")
    counted = Counted(robot.mechanism)
    counted.sharp_bounds = lambda *given: counted.certified_bounds(*given)
    monkeypatch.setattr(sample_time.time, "perf_counter_ns", lambda: counted.boxes)
    assert box_time_s(settings, counted) == pytest.approx(2e-9)


def test_boxes_of_robots_at_rest_at_half_and_at_full_speed_are_timed() -> None:
    """Bounds of large boxes may end early, so the longest is not always that of the largest."""
    settings, robot = settings_of("irsbot2")
    counted, sizes = Counted(robot.mechanism), set()

    def sharp_bounds(at: Posture, travel: Sequence[float], *others: float) -> CertifiedBounds:
        sizes.add(round(travel[0], 6))
        return robot.mechanism.sharp_bounds(at, travel, *others)

    counted.sharp_bounds = sharp_bounds
    box_time_s(settings, counted)
    free_s, fastest = free_time(settings, PERIOD_S), settings.velocity_limit
    speeds = [
        speeds_at_rest(settings, robot.mechanism.joints, PERIOD_S),
        *[Speeds(v, v) for v in ((6.0, 6.0), fastest)],
    ]
    assert fastest == (12.0, 12.0)
    assert sizes == {round(box_ways(settings, one, free_s)[0][0], 6) for one in speeds}


@pytest.mark.parametrize("name", ["irsbot2", "five_bar"])
def test_the_longest_step_is_that_of_a_robot_that_needs_its_cuts(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The report takes a box, too."""
    settings, robot = settings_of(name)
    places = places_above_stop(settings, robot.mechanism)
    robot.mechanism = counted = Counted(robot.mechanism)
    monkeypatch.setattr(sample_time.time, "perf_counter_ns", lambda: counted.boxes)
    steps = [round(1e9 * longest_step_s(settings, robot, cuts, PERIOD_S, places)) for cuts in (0, 2, 12)]
    assert 2 <= steps[0] <= 4
    assert steps[0] < steps[1] <= 8
    assert 14 <= steps[2] <= 28


def test_a_sample_takes_the_longest_step_that_was_met_and_what_its_boxes_can_take(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    settings, robot = settings_of("irsbot2")
    met = {0: 0.5, 2: 0.6, 4: 0.7, 12: 4.0}
    monkeypatch.setattr(sample_time, "longest_step_s", lambda _settings, _robot, cuts, *_: met[cuts])
    monkeypatch.setattr(sample_time, "longest_box_s", lambda *_: 0.1)
    found = longest_times(settings, robot, PERIOD_S, (2, 4, 12), ())
    assert found == pytest.approx({2: 0.5 + 4 * 0.1, 4: 0.5 + 8 * 0.1, 12: 4.0})


def shares(name: str, bounding_s: float) -> dict[int, float]:
    """Share of postures in which a resting robot is stopped, by the number of cuts, each counted here."""
    settings, robot = settings_of(name)
    found = {}
    for cuts in TRIED:
        timed = replace(settings, bounding_s=bounding_s, judging_s=time_for_cuts(bounding_s, cuts))
        speeds = speeds_at_rest(timed, robot.mechanism.joints, PERIOD_S)
        ways, _ = box_ways(timed, speeds, free_time(timed, PERIOD_S))
        places, bounds, stop = places_above_stop(timed, robot.mechanism), BoxBounds(robot.mechanism, 0.0), []
        for at in places:
            low, high = (tuple(q + side * way for q, way in zip(at.joints, ways, strict=True)) for side in (-1, 1))
            least = bounds.least(at, low, high, limits_of(timed, "stop"), cuts)
            stop.append(spare_of(least, limits_of(timed, "stop")) < 0.0)
        found[cuts] = sum(stop) / len(stop)
    return found


def best_cuts(settings: Settings, robot: Robot, bounding_s: float) -> int:
    """The number of cuts that pays where every box takes the same time."""
    places = places_above_stop(settings, robot.mechanism)
    return cuts_that_pay(settings, robot.mechanism, dict.fromkeys(TRIED, bounding_s), PERIOD_S, places)


@pytest.mark.parametrize(("name", "bounding_s"), [("irsbot2", 4e-5), ("irsbot2", 1.4e-4), ("rrr3", 2e-4)])
def test_the_number_of_cuts_is_that_with_the_fewest_stops(name: str, bounding_s: float) -> None:
    settings, robot = settings_of(name)
    found = shares(name, bounding_s)
    assert best_cuts(settings, robot, bounding_s) == min(found, key=lambda cuts: found[cuts])


def test_cuts_that_take_no_time_pay_and_slow_ones_do_not() -> None:
    settings, robot = settings_of("irsbot2")
    assert best_cuts(settings, robot, 1e-9) >= 8
    assert best_cuts(settings, robot, 5e-3) == 0


def test_a_stated_judging_time_is_kept() -> None:
    """A sample has that time anyway, and the cuts that fit in it cost nothing."""
    settings, robot = settings_of("irsbot2")
    settings = replace(settings, judging_s=0.004)
    timed = replace(settings, bounding_s=0.00014)
    assert best_cuts(settings, robot, 0.00014) <= cuts_of(timed) == 12
