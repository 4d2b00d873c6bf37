"""Bounds of speeds are certain whatever a message says; how far a robot goes on, and when it stands."""

from __future__ import annotations

from dataclasses import replace
from math import inf, isnan, nan, tau

import pytest
from estimates import (
    BRAKE,
    SPEED,
    accepted,
    estimator,
    good,
    holds,
    implausible,
    moving,
    watch,
)
from supervised import settings_of

from irsbot_supervisor.core.estimation.estimator import Estimator
from irsbot_supervisor.core.settings import UNTRUSTED

# --- velocities that are reported --------------------------------------------------------------------------------


def test_reported_rates_that_the_positions_bear_out_are_reported_as_they_are():
    for answer in watch(estimator(), moving((5.0, -3.0), (5.0, -3.0))):
        assert good(answer).velocity == (5.0, -3.0)
        assert not answer.degraded
        assert holds(answer, 5.0, -3.0)


@pytest.mark.parametrize("stated", [(), (nan, nan), (inf, -inf), (nan, -3.0), (5.0, nan)])
def test_rates_that_are_missing_or_no_numbers_come_from_the_positions_and_are_called_degraded(stated):
    first, *later = watch(estimator(), moving((5.0, -3.0), stated))
    assert isnan(good(first).velocity[0]) or stated == (5.0, nan)
    assert first.degraded
    for answer in later:
        assert good(answer).velocity == pytest.approx((5.0, -3.0), abs=1e-6)
        assert answer.degraded


@pytest.mark.parametrize(
    ("rate", "stated"), [(5.0, -5.0), (-6.0, 6.0), (8.0, 1.0), (2.0, 11.0), (6.0, 0.0), (9.0, 4.5)]
)
def test_a_rate_that_contradicts_the_positions_is_replaced(rate, stated):
    for answer in watch(estimator(), moving((rate, 0.0), (stated, 0.0)))[8:]:
        assert good(answer).velocity[0] == pytest.approx(rate, abs=1e-6)
        assert "joint_1" in answer.degraded


LIES = {
    "right": lambda v: v,
    "zeros": lambda v: 0.0 * v,
    "halved": lambda v: 0.5 * v,
    "reversed": lambda v: -v,
    "no numbers": lambda v: nan + v,
    "huge": lambda v: 1e308 + v,
}


@pytest.mark.parametrize("lie", LIES.values(), ids=LIES)
@pytest.mark.parametrize("tolerance", [None, 0.3])
def test_reported_velocities_never_hide_a_start_from_rest(lie, tolerance):
    """All that the drives can do. Velocities that are trusted within 0.3 rad/s may only be wrong by that; so zeros and
    halves hide nothing that positions do not contradict, and what they contradict is not used."""
    changes = {} if tolerance is None else {"velocity_tolerance": tolerance}
    filter_, told = estimator(**changes), estimator()
    for ms in range(60):
        t = max(ms - 30, 0) * 1e-3
        v = min(BRAKE * t, SPEED)
        q = 0.5 * BRAKE * t * t if v < SPEED else 0.18 + SPEED * (t - 0.03)
        sample = accepted(ms, (q, 1.0), (float(lie(v)), 0.0))
        answer, plain = good(filter_.update(sample)), good(told.update(sample._replace(velocity=())))
        if tolerance is None:
            assert holds(answer, v, 0.0)
            assert answer.speeds.forward[0] >= plain.speeds.forward[0] - 1e-9
        elif abs(lie(v) - v) <= tolerance:
            assert holds(answer, v, 0.0)
    assert bool(answer.degraded) == (lie is not LIES["right"])


def test_a_tolerance_of_one_joint_says_nothing_about_the_others():
    apart = estimator(velocity_tolerance=[0.1, UNTRUSTED])
    lies = good(watch(apart, moving((5.0, 1.0), (5.0, SPEED / 2)))[-1])
    assert lies.degraded
    assert lies.velocity == pytest.approx((5.0, 1.0))


def test_a_tolerance_narrows_the_bounds_and_without_one_nothing_does():
    wide = good(watch(estimator(), moving((5.0, -3.0), (5.0, -3.0)))[-1]).speeds
    narrow = good(watch(estimator(velocity_tolerance=0.1), moving((5.0, -3.0), (5.0, -3.0)))[-1]).speeds
    assert wide.forward[0] > 5.5
    within = 0.1 + 400.0 * 5e-5  # a joint speeds up by 400 rad/s2 in 0.05 ms, the error of a stamp
    assert narrow.forward == pytest.approx((5.0 + within, 0.0))
    assert narrow.backward == pytest.approx((0.0, 3.0 + within))
    silent = good(watch(estimator(), moving((5.0, -3.0), ()))[-1]).speeds
    assert silent == wide


@pytest.mark.parametrize(("beyond", "right"), [(0.05, True), (0.15, False)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_rate_may_exceed_what_the_positions_allow_by_its_tolerance(beyond, right, sign):
    *before, last = moving((5.0 * sign, 0.0), (5.0 * sign, 0.0))
    speeds = good(watch(estimator(), [*before, last])[-1]).speeds
    rate = sign * (max(speeds.forward[0], speeds.backward[0]) + beyond)
    answer = good(watch(estimator(velocity_tolerance=0.1), [*before, last._replace(velocity=(rate, 0.0))])[-1])
    assert (answer.velocity[0] == rate) == right
    assert (not answer.degraded) == right


@pytest.mark.parametrize("stated", [(), (nan, -3.0), (0.0, -3.0), (5.0, 9.0)])
def test_reported_velocities_with_a_wrong_part_narrow_no_bound(stated):
    plain = good(watch(estimator(), moving((5.0, -3.0), ()))[-1]).speeds
    assert good(watch(estimator(velocity_tolerance=0.1), moving((5.0, -3.0), stated))[-1]).speeds == plain


# --- how far ahead -------------------------------------------------------------------------------------------------


def test_the_robot_goes_on_unseen_for_the_age_of_the_sample_and_until_the_next_one_has_been_judged():
    """A period of 1 ms, and as much for judging."""
    filter_ = estimator()
    ahead = [good(filter_.update(accepted(k, (0.0, 1.0), age_ms=3.0))).prediction_delay_s for k in range(5)]
    assert ahead == pytest.approx([0.003, 0.005, 0.005, 0.005, 0.005])


def test_a_sample_from_the_future_is_not_younger_than_now():
    assert good(estimator().update(accepted(0, (0.0, 1.0), age_ms=-15.0))).prediction_delay_s >= 0.0


def test_missing_velocities_make_the_robot_go_on_no_longer():
    assert good(watch(estimator(), moving((5.0, 0.0), ()))[-1]).prediction_delay_s == pytest.approx(0.002)


def test_one_gap_does_not_announce_another_but_a_slower_pace_does():
    filter_ = estimator()
    times = [0, 1, 2, 30, 31, 32, 37, 42, 47, 67, 87]
    ahead = [good(filter_.update(accepted(t, (0.0, 1.0)))).prediction_delay_s for t in times]
    assert ahead == pytest.approx([0.0, 0.002, 0.002, 0.002, 0.002, 0.002, 0.01, 0.01, 0.01, 0.025, 0.025])


def test_a_stated_gap_is_expected_before_any_came_so_late():
    filter_ = estimator(sample_gap_s=0.03)
    times = [0, 1, 2, 30, 31, 71, 111]
    ahead = [good(filter_.update(accepted(t, (0.0, 1.0)))).prediction_delay_s for t in times]
    assert ahead[1:6] == pytest.approx([0.035] * 5)  # and 5 ms for judging
    assert ahead[6] == pytest.approx(0.045)  # what came later than stated twice is learned


def test_a_stated_judging_time_is_part_of_the_delay_at_every_rate():
    """Twice: the next sample waits as long, and is then judged itself."""
    filter_ = estimator(judging_s=0.02)
    estimates = [good(filter_.update(accepted(t, (0.0, 1.0)))) for t in (0, 1, 2, 32, 62)]
    assert [e.prediction_delay_s for e in estimates[1:]] == pytest.approx([0.04, 0.04, 0.04, 0.05])
    assert [e.judging_s for e in estimates[1:]] == pytest.approx([0.02] * 4)
    shorter = estimator(judging_s=0.002)
    assert [good(shorter.update(accepted(t, (0.0, 1.0)))).judging_s for t in (0, 20, 40)][1:] == [0.005] * 2


@pytest.mark.parametrize("burst", [2, 5, 20, 40])
def test_samples_that_come_in_bursts_are_as_rare_as_their_bursts(burst):
    filter_, ahead = estimator(), []
    for k in range(6 * burst):
        seen_ms = burst * (k // burst + 1) + 1e-3 * (k % burst)
        ahead.append(good(filter_.update(accepted(k, (0.0, 1.0), seen_ms=seen_ms))).prediction_delay_s)
    assert min(ahead[3 * burst :]) >= burst * 1e-3 * (1.0 - 1e-3)


@pytest.mark.parametrize("lead_ms", [1.0, 10.0, 20.0])
def test_samples_of_a_sender_whose_clock_is_ahead_are_older_than_they_say(lead_ms):
    filter_ = estimator()
    for k in range(30):
        good(filter_.update(accepted(k, (0.0, 1.0), age_ms=-lead_ms)))
    late = [good(filter_.update(accepted(30 + k, (0.0, 1.0), age_ms=25.0 - lead_ms))) for k in range(400)]
    assert min(one.prediction_delay_s for one in late) >= 0.025 + 0.002 - 1e-9
    assert late[-1].prediction_delay_s == pytest.approx(0.027)


def test_one_stamp_from_the_future_does_not_make_all_samples_old():
    filter_ = estimator()
    ahead = [
        good(filter_.update(accepted(k, (0.0, 1.0), age_ms=-15.0 * (k == 5)))).prediction_delay_s for k in range(9)
    ]
    assert max(ahead[7:]) == pytest.approx(0.002)


# --- rest and settings -----------------------------------------------------------------------------------------------


def test_a_robot_stands_from_the_last_motion_above_the_standstill_speed_on():
    filter_ = estimator()
    watch(filter_, moving((1.0, 0.0), (1.0, 0.0), 0, 20))
    standing = [good(filter_.update(accepted(k, (0.019 + 1e-5 * (k % 2), 1.0)))).standing_s for k in range(20, 120)]
    assert standing[-1] == pytest.approx(0.1, abs=2e-3)
    assert good(filter_.update(accepted(120, (0.024, 1.0), (5.0, 0.0)))).standing_s == 0.0


def test_a_joint_that_may_be_frozen_does_not_stand():
    filter_ = estimator()
    assert good(watch(filter_, moving((0.0, 0.0), (0.0, 0.0), 0, 100))[-1]).standing_s > 0.09
    assert good(filter_.update(accepted(100, (0.0, 1.0), (0.5, 0.0)))).standing_s == 0.0


@pytest.mark.parametrize(("rate", "stands"), [(0.015, True), (0.05, False)])
def test_creeping_is_standing_only_below_the_standstill_speed(rate, stands):
    """0.02 rad/s are shipped; two steps of the encoder, 2e-5 rad, take 1 ms at 0.02 rad/s more."""
    last = good(watch(estimator(), moving((rate, 0.0), (rate, 0.0), 0, 1000))[-1])
    assert (last.standing_s > 0.5) is stands
    assert stands or last.standing_s < 2e-3


def test_new_limits_hold_from_the_next_sample_and_the_last_sample_stays_known():
    filter_ = estimator()
    watch(filter_, moving((5.0, 0.0), (5.0, 0.0), 0, 20))
    filter_.configure(settings_of(velocity_limit=2.0)[0])
    assert implausible(filter_.update(accepted(20, (0.13, 1.0), (5.0, 0.0))))
    filter_.configure(settings_of()[0])
    assert holds(good(filter_.update(accepted(21, (0.105, 1.0), ()))), 5.0, 0.0)


@pytest.mark.parametrize("before_s", [0.12, 0.2, 0.5])
def test_how_often_samples_come_is_still_known_when_silence_begins_earlier(before_s):
    """Ten samples every 45 ms."""
    filter_ = estimator(stale_s=before_s)
    times = [45 * (k // 10) + k % 10 for k in range(60)]
    for time_ms in times[:40]:
        good(filter_.update(accepted(time_ms, (0.0, 1.0))))
    filter_.configure(settings_of(stale_s=0.05)[0])
    for time_ms in times[40:]:
        assert good(filter_.update(accepted(time_ms, (0.0, 1.0)))).prediction_delay_s >= 0.036


def test_a_gap_that_has_become_a_silence_counts_for_no_more_than_that():
    filter_ = estimator(stale_s=0.5)
    for k in range(6):
        good(filter_.update(accepted(300 * k, (0.0, 1.0))))
    filter_.configure(settings_of(stale_s=0.05)[0])
    assert good(filter_.update(accepted(1501, (0.0, 1.0)))).prediction_delay_s == pytest.approx(0.055)


def test_slides_are_not_compared_modulo_anything():
    settings, machine = settings_of("orthoglide")
    # No drive stops from here; unchecked, because this fast a slide passes any length in one period.
    filter_ = Estimator(replace(settings, velocity_limit=(1e4,) * 3), machine.mechanism.joints)
    good(filter_.update(accepted(0, (0.1, 0.1, 0.1), ())))
    far = good(filter_.update(accepted(1, (0.1 + tau, 0.1, 0.1), ())))
    assert far.velocity[0] == pytest.approx(tau * 1e3)
