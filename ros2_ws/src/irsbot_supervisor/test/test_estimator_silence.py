"""Where joints may have been while no sample came, and how often samples are expected after it."""

from __future__ import annotations

from dataclasses import replace
from math import tau

import numpy as np
import pytest
from estimates import (
    BRAKE,
    HEARTBEAT_MS,
    LATENCY_MS,
    SPEED,
    STALE_MS,
    accepted,
    estimator,
    good,
    implausible,
    moving,
    watch,
)
from supervised import settings_of

from irsbot_supervisor.core.estimation.estimate import Estimate
from irsbot_supervisor.core.estimation.estimator import Estimator
from irsbot_supervisor.core.validation import Rejected

# --- silence ---------------------------------------------------------------------------------------------------------


def test_the_region_of_a_gap_matters_as_soon_as_the_box_before_it_does_not_cover_it():
    """The box covers the next sample, 1 ms later, its judging, 1 ms, and the latency, 10 ms."""
    for gap_ms, silent in ((11.9, False), (12.1, True), (STALE_MS - 1, True), (STALE_MS + 1, True), (400, True)):
        filter_ = estimator()
        watch(filter_, moving((0.0, 0.0), (0.0, 0.0), 0, 200))
        assert (good(filter_.update(accepted(199 + gap_ms, (0.0, 1.0)))).silence is not None) is silent, gap_ms


@pytest.mark.parametrize("fastest", [12.0, 60.0])
@pytest.mark.parametrize("clock_ms", [0.0, -5000.0], ids=["same clock", "clock set back"])
@pytest.mark.parametrize("seed", range(3))
def test_a_silence_holds_every_position_that_admissible_motion_can_have_met(seed, fastest, clock_ms):
    """Joints do what they like until the silence is known and the latency is over, then brake as hard as they like, but
    no less than configured. 20 runs each, of 0.06 to 0.5 s; angles modulo a turn."""
    rng = np.random.default_rng(seed)
    settings, machine = settings_of()
    settings = replace(settings, velocity_limit=(fastest,) * 2)  # unchecked: irsbot2 could not be stopped from there
    for _ in range(20):
        filter_ = Estimator(settings, machine.mechanism.joints)
        v0 = rng.uniform(-1.0, 1.0, 2) * min(fastest, 12.0)
        watch(filter_, moving(v0, v0, 0, 60))
        begin = np.array([0.0, 1.0]) + 0.059 * v0
        end_s = rng.uniform(0.06, 0.5)
        track = begin + silent_motion(rng, v0, fastest, end_s)
        now = np.remainder(track[-1] + np.pi, tau) - np.pi
        answer = filter_.update(accepted(59 + 1e3 * end_s + clock_ms, now, (), seen_ms=59 + 1e3 * end_s))
        if isinstance(answer, Rejected) or answer.branch_lost:
            continue  # nobody relies on it
        assert answer.silence is not None
        for j in range(2):
            low, high = answer.silence.low[j], answer.silence.high[j]
            inside = np.remainder(track[:, j] - low, tau) <= high - low + 1e-9
            assert inside.all() or high - low >= tau, f"{track[~inside, j]} outside {low}..{high}"


def silent_motion(rng: np.random.Generator, v: np.ndarray, fastest: float, end_s: float) -> np.ndarray:
    """(K, 2) ways from the last sample on: pieces of full acceleration, coasting and any braking, then brakes."""
    free_s, h = 1e-3 * (STALE_MS + HEARTBEAT_MS + LATENCY_MS), 2.5e-4
    speed, q, track, wish = v.astype(float), np.zeros(2), [np.zeros(2)], np.ones(2)
    for k in range(int(end_s / h)):
        if k % 40 == 0:
            wish = rng.choice([-1.0, 0.0, 1.0, 1.0], 2) * np.where(speed == 0.0, 1.0, np.sign(speed))
        if (k + 1) * h > free_s:
            end = np.sign(speed) * np.maximum(np.abs(speed) - BRAKE * rng.choice([1.0, 1.0, 5.0]) * h, 0.0)
        else:
            end = np.clip(speed + wish * BRAKE * h, -fastest, fastest)
        q = q + 0.5 * (speed + end) * h
        speed = end
        track.append(q)
    return np.array(track)


def contains(estimate: Estimate, joint: int, positions: np.ndarray) -> bool:
    """Whether the silence holds positions of a joint, modulo a turn."""
    low, high = estimate.silence.low[joint], estimate.silence.high[joint]
    return high - low >= tau or bool((np.remainder(positions - low, tau) <= high - low).all())


def test_a_joint_that_went_out_and_back_was_farther_than_where_it_is():
    """At 12 rad/s for 35 ms, stopped at once, and back with 400 rad/s2 for 25 ms."""
    filter_ = estimator()
    watch(filter_, moving((SPEED, 0.0), (), 0, 60))
    begin = 0.059 * SPEED
    answer = good(filter_.update(accepted(119, (begin + 0.42 - 0.125, 1.0), ())))
    assert contains(answer, 0, begin + np.linspace(0.0, 0.42, 50))


def test_a_joint_that_came_nearly_as_far_as_it_can_was_hardly_farther():
    """12 rad/s, its limit, for 60 ms."""
    filter_ = estimator()
    watch(filter_, moving((SPEED, 0.0), (), 0, 60))
    begin = 0.059 * SPEED
    answer = good(filter_.update(accepted(119, (begin + 0.06 * SPEED, 1.0), ())))
    assert answer.silence is not None
    assert begin - 0.02 < answer.silence.low[0] < begin
    assert 0.0 < answer.silence.high[0] - (begin + 0.06 * SPEED) < 0.35


def test_an_angle_may_have_gone_the_other_way_round():
    """4.2 rad back at 60 rad/s look like 2.1 rad forward."""
    settings, machine = settings_of()
    settings = replace(settings, velocity_limit=(60.0,) * 2)  # unchecked: irsbot2 could not be stopped from there
    filter_ = Estimator(settings, machine.mechanism.joints)
    watch(filter_, moving((-60.0, 0.0), (), 0, 60))
    begin = -60.0 * 0.059
    answer = good(filter_.update(accepted(129, (begin - 4.2, 1.0), ())))
    assert contains(answer, 0, begin - np.linspace(0.0, 4.2, 50))


def test_rejected_positions_do_not_shorten_a_silence():
    filter_ = estimator()
    watch(filter_, moving((0.0, 0.0), (0.0, 0.0), 0, 200))
    for k in range(200, 250):
        assert implausible(filter_.update(accepted(k, (2.0, 1.0))))
    back = good(filter_.update(accepted(251, (0.0, 1.0))))
    assert back.silence is not None
    assert back.speeds == ((SPEED,) * 2, (SPEED,) * 2)
