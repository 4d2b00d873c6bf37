"""Rates are believed as far as the positions bear them out; what no motion explains is rejected."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import exp, inf, isnan, nan, pi, tau

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from supervised import settings_of

from irsbot_msgs_py.records import Cause
from irsbot_supervisor.core.estimator import Estimate, Estimator
from irsbot_supervisor.core.intake import Accepted, Rejected

BEGIN_NS = 10**15
PERIOD_MS = 1.0
BRAKE = 400.0  # rad/s2, shipped
SPEED = 12.0  # rad/s, shipped


def estimator(robot: str = "irsbot2", **changes) -> Estimator:
    settings, machine = settings_of(robot, **changes)
    return Estimator(settings, machine.mechanism.joints)


def accepted(ms: float, position, velocity=(), *, age_ms: float = 0.0, seen_ms: float | None = None) -> Accepted:
    """A sample stamped at `ms`; it arrives age_ms later, on the steady clock at `seen_ms` if that is given."""
    stamp_ns = BEGIN_NS + round(ms * 1e6)
    seen_ns = round(((ms + age_ms) if seen_ms is None else seen_ms) * 1e6) + 10**9
    return Accepted(stamp_ns, stamp_ns + round(age_ms * 1e6), seen_ns, tuple(position), tuple(velocity), ())


def watch(filter_: Estimator, samples) -> list[Estimate | Rejected]:
    return [filter_.update(one) for one in samples]


def good(answer: Estimate | Rejected) -> Estimate:
    assert isinstance(answer, Estimate), f"rejected: {answer}"
    return answer


def implausible(answer: Estimate | Rejected) -> bool:
    return isinstance(answer, Rejected) and answer.cause == Cause.IMPLAUSIBLE and not answer.harmless


def moving(rates, said, begin_ms=0, end_ms=50, start=(0.0, 1.0), period_ms=PERIOD_MS):
    """Samples of joints at constant rates, rad/s, that report other ones."""
    times = np.arange(begin_ms, end_ms, period_ms)
    return [accepted(t, [q + r * (t - begin_ms) / 1e3 for q, r in zip(start, rates, strict=True)], said) for t in times]


# --- rates ------------------------------------------------------------------------------------------------------


def test_reported_rates_that_the_positions_bear_out_are_used_as_they_are():
    for answer in watch(estimator(), moving((5.0, -3.0), (5.0, -3.0))):
        assert good(answer).velocity == (5.0, -3.0)
        assert not good(answer).degraded


@pytest.mark.parametrize("said", [(), (nan, nan), (inf, -inf), (nan, -3.0), (5.0, nan)])
def test_rates_that_are_missing_or_no_numbers_come_from_the_positions_and_are_called_degraded(said):
    first, *later = watch(estimator(), moving((5.0, -3.0), said))
    assert all(map(isnan, good(first).velocity))
    assert good(first).degraded
    for answer in later:
        assert good(answer).velocity == pytest.approx((5.0, -3.0), abs=1e-6)
        assert good(answer).degraded


def test_only_the_joint_without_a_usable_rate_is_derived():
    later = watch(estimator(), moving((5.0, -3.0), (nan, -3.1)))[1:]
    assert good(later[0]).velocity == (pytest.approx(5.0, abs=1e-6), -3.1)


@pytest.mark.parametrize(("rate", "said"), [(5.0, -5.0), (-6.0, 6.0), (8.0, 1.0), (2.0, 11.0)])
def test_a_rate_that_contradicts_the_positions_is_replaced(rate, said):
    for answer in watch(estimator(), moving((rate, 0.0), (said, 0.0)))[1:]:
        assert good(answer).velocity[0] == pytest.approx(rate, abs=1e-6)
        assert "joint_1" in good(answer).degraded


@given(
    rate=st.floats(-SPEED, SPEED),
    said=st.floats(-SPEED, SPEED),
    period_ms=st.sampled_from([0.25, 1.0, 2.0, 5.0, 20.0]),
)
def test_joints_are_never_taken_to_be_slower_than_their_positions_prove(rate, said, period_ms):
    """Over one period the joint moved at `rate` on the average; braking all the time, it is still faster than that
    less half of what braking takes off in a period, and less what the encoder steps blur, and a stamp that is half a
    millisecond off, as far as the message says that the joint moves."""
    assume(abs(rate) * period_ms * 1e-3 > 2e-5)  # what stands may be frozen
    answers = watch(estimator(), moving((rate, 0.0), (said, 0.0), end_ms=4 * period_ms, period_ms=period_ms))
    blurred = 2e-5 / (period_ms * 1e-3) + abs(said) * 0.5 / period_ms
    proven = abs(rate) - 0.5 * BRAKE * period_ms * 1e-3 - blurred
    for answer in answers[1:]:
        if isinstance(answer, Estimate):
            velocity = answer.velocity[0] if rate >= 0.0 else -answer.velocity[0]
            assert velocity >= proven - 1e-9


def test_a_joint_that_brakes_as_hard_as_it_can_is_not_taken_to_be_faster_than_it_says():
    """Backward differences of a joint that slows down lag behind: they are the rate of half a period ago."""
    filter_, v = estimator(), np.maximum(SPEED - BRAKE * np.arange(30) * 1e-3, 0.0)
    q = np.cumsum(np.concatenate(([0.0], 0.5 * (v[1:] + v[:-1]) * 1e-3)))
    for k in range(30):
        assert good(filter_.update(accepted(k, (q[k], 0.0), (v[k], 0.0)))).velocity[0] == v[k]


def test_angles_are_compared_modulo_a_turn():
    filter_ = estimator()
    good(filter_.update(accepted(0, (pi - 0.003, 1.0), ())))
    across = good(filter_.update(accepted(1, (-pi + 0.003, 1.0), ())))
    assert across.velocity == pytest.approx((6.0, 0.0))
    around = good(filter_.update(accepted(2, (-pi + 0.009 + tau, 1.0 - tau), ())))
    assert around.velocity == pytest.approx((6.0, 0.0), abs=1e-9)


def test_slides_are_not_compared_modulo_anything():
    settings, machine = settings_of("orthoglide")
    # No drive stops from here; unchecked, because this fast a slide passes any length in one period.
    filter_ = Estimator(replace(settings, velocity_limit=(1e4,) * 3), machine.mechanism.joints)
    good(filter_.update(accepted(0, (0.1, 0.1, 0.1), ())))
    far = good(filter_.update(accepted(1, (0.1 + tau, 0.1, 0.1), ())))
    assert far.velocity[0] == pytest.approx(tau * 1e3)


# --- what the outlook has to add --------------------------------------------------------------------------------


def test_the_robot_goes_on_unseen_for_the_age_of_the_sample_and_until_the_next_one_has_been_judged():
    filter_ = estimator()
    ahead = [good(filter_.update(accepted(k, (0.0, 1.0), (0.0, 0.0), age_ms=3.0))).ahead_s for k in range(5)]
    assert ahead == pytest.approx([0.003, 0.005, 0.005, 0.005, 0.005])


def test_a_sample_from_the_future_is_not_younger_than_now():
    assert good(estimator().update(accepted(0, (0.0, 1.0), (0.0, 0.0), age_ms=-15.0))).ahead_s == 0.0


def test_one_gap_does_not_announce_another_but_a_slower_pace_does():
    filter_ = estimator()
    times = [0, 1, 2, 30, 31, 32, 37, 42, 47, 67, 87]
    ahead = [good(filter_.update(accepted(t, (0.0, 1.0), (0.0, 0.0)))).ahead_s for t in times]
    assert ahead == pytest.approx([0.0, 0.002, 0.002, 0.002, 0.002, 0.002, 0.01, 0.01, 0.01, 0.025, 0.025])


@pytest.mark.parametrize("burst", [2, 5, 20, 40])
def test_samples_that_come_in_bursts_are_as_rare_as_their_bursts(burst):
    """Stamped every millisecond, delivered together: after the last of a burst nothing comes for that many."""
    filter_, ahead = estimator(), []
    for k in range(6 * burst):
        seen_ms = burst * (k // burst + 1) + 1e-3 * (k % burst)
        arrived = accepted(k, (0.0, 1.0), (0.0, 0.0), seen_ms=seen_ms)
        ahead.append(good(filter_.update(arrived)).ahead_s)
    assert min(ahead[3 * burst :]) >= burst * 1e-3 * (1.0 - 1e-3)


@pytest.mark.parametrize("lead_ms", [1.0, 10.0, 20.0])
def test_samples_of_a_sender_whose_clock_is_ahead_are_older_than_they_say(lead_ms):
    filter_ = estimator()
    for k in range(30):
        good(filter_.update(accepted(k, (0.0, 1.0), (0.0, 0.0), age_ms=-lead_ms)))
    late = [good(filter_.update(accepted(30 + k, (0.0, 1.0), (0.0, 0.0), age_ms=25.0 - lead_ms))) for k in range(400)]
    assert [one.ahead_s >= 0.025 + 0.002 - 1e-9 for one in late] == [True] * 400
    assert late[-1].ahead_s == pytest.approx(0.027)


def test_one_stamp_from_the_future_does_not_make_all_samples_old():
    filter_ = estimator()
    ahead = [
        good(filter_.update(accepted(k, (0.0, 1.0), (0.0, 0.0), age_ms=-15.0 * (k == 5)))).ahead_s for k in range(9)
    ]
    assert max(ahead[7:]) == pytest.approx(0.002)


@pytest.mark.parametrize("before_s", [0.12, 0.2, 0.5])
def test_how_often_samples_come_is_still_known_when_silence_begins_earlier(before_s):
    """Ten samples every 45 ms."""
    filter_ = estimator(stale_s=before_s)
    times = [45 * (k // 10) + k % 10 for k in range(60)]
    for time_ms in times[:40]:
        good(filter_.update(accepted(time_ms, (0.0, 1.0), (0.0, 0.0))))
    filter_.configure(settings_of(stale_s=0.05)[0])
    for time_ms in times[40:]:
        assert good(filter_.update(accepted(time_ms, (0.0, 1.0), (0.0, 0.0)))).ahead_s >= 0.036


def test_a_gap_that_has_become_a_silence_counts_for_no_more_than_that():
    filter_ = estimator(stale_s=0.5)
    for k in range(6):
        good(filter_.update(accepted(300 * k, (0.0, 1.0), (0.0, 0.0))))
    filter_.configure(settings_of(stale_s=0.05)[0])
    assert good(filter_.update(accepted(1501, (0.0, 1.0), (0.0, 0.0)))).ahead_s == pytest.approx(0.055)


# --- clocks -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("late_ms", [0.1, 0.3, 0.5, 0.9])
@pytest.mark.parametrize("rate", [1.0, 4.0, 11.0])
def test_a_stamp_that_is_a_little_late_is_no_acceleration(rate, late_ms):
    filter_ = estimator()
    for k in range(60):
        stamp_ms = k + late_ms * (k == 30)
        one = accepted(stamp_ms, (1e-3 * rate * k, 1.0), (rate, 0.0), seen_ms=k)
        answer = filter_.update(one)
        if isinstance(answer, Estimate):
            assert answer.acceleration == (0.0, 0.0)
            assert answer.velocity[0] >= 0.5 * rate
    assert good(answer).velocity == (rate, 0.0)


@pytest.mark.parametrize("late_ms", [1.2, 3.2, 10.2, 19.2])
@pytest.mark.parametrize("rate", [2.0, 4.0, 8.0, 11.0])
@pytest.mark.parametrize("tells", [True, False])
def test_one_sample_that_was_stamped_late_makes_no_jump_of_those_that_follow(rate, late_ms, tells):
    """The sender was interrupted between reading and stamping; what follows is on time."""
    filter_, newest_ms = estimator(), -1.0
    for k in range(80):
        stamp_ms = k + late_ms * (k == 30)
        if stamp_ms > newest_ms:  # others are out of order, which the intake tells
            newest_ms = stamp_ms
            said = (rate, 0.0) if tells else ()
            answer = good(filter_.update(accepted(stamp_ms, (1e-3 * rate * k, 1.0), said, seen_ms=max(k, newest_ms))))
    assert answer.velocity == pytest.approx((rate, 0.0))
    assert not filter_.lost_track


@pytest.mark.parametrize("back_ms", [5, 19, 30, 45])
@pytest.mark.parametrize("rate", [0.5, 1.0, 2.0, 4.0, 8.0])
@pytest.mark.parametrize("tells", [True, False])
def test_a_sender_whose_clock_was_set_back_does_not_run_when_it_has_caught_up(rate, back_ms, tells):
    filter_, said = estimator(), (rate, 0.0) if tells else ()
    watch(filter_, moving((rate, 0.0), said, 0, 30))
    for k in range(30 + back_ms, 140):  # stamps before are out of order
        answer = filter_.update(accepted(k - back_ms, (1e-3 * rate * k, 1.0), said, seen_ms=k))
        if isinstance(answer, Estimate):
            assert not abs(answer.velocity[0] - rate) > 3.0 + 0.2  # what may be doubted of a rate; NaN: it begins anew
            assert answer.acceleration == (0.0, 0.0) or not tells
    assert good(answer).velocity == pytest.approx((rate, 0.0))
    assert not filter_.lost_track


@pytest.mark.parametrize("ahead_ms", [100.0, 1e4, 3.6e6])
@pytest.mark.parametrize("rate", [0.1, 2.0, 10.0])
def test_a_clock_that_was_set_forward_is_no_time_that_passed(rate, ahead_ms):
    """Both clocks of one machine; the message has no velocities."""
    filter_ = estimator()
    watch(filter_, moving((rate, 0.0), (), 0, 30))
    for k in range(30, 60):
        answer = good(filter_.update(accepted(k + ahead_ms, (1e-3 * rate * k, 1.0), (), seen_ms=k)))
        assert answer.velocity == pytest.approx((rate, 0.0), abs=1e-6)
        assert answer.ahead_s <= 0.0026


def test_differences_lag_behind_by_half_a_period_which_the_outlook_makes_up_for():
    answers = watch(estimator(), moving((5.0, 0.0), ()))
    assert good(answers[-1]).ahead_s == pytest.approx(0.0025)


# --- jumps ------------------------------------------------------------------------------------------------------


@given(st.floats(0.0155, 3.1), st.sampled_from([-1.0, 1.0]), st.integers(0, 1), st.integers(1, 20))
def test_a_glitch_is_rejected_and_leaves_no_trace(size, sign, joint, length):
    """The fastest that 1.25 times the limit allows in a period is 15 mrad."""
    filter_ = estimator()
    watch(filter_, moving((1.0, 1.0), (1.0, 1.0), 0, 20))
    for k in range(20, 20 + length):
        q = [0.001 * k, 1.0 + 0.001 * k]
        q[joint] += sign * (size + 0.02 * length)  # beyond all that can be gone in the time of the glitch
        assert implausible(filter_.update(accepted(k, q, (1.0, 1.0))))
    for k in range(20 + length, 40 + length):
        back = good(filter_.update(accepted(k, (0.001 * k, 1.0 + 0.001 * k), (1.0, 1.0))))
        assert back.velocity == (1.0, 1.0)
    assert not filter_.lost_track


@pytest.mark.parametrize("size", [0.035, 0.1, 0.3, 0.7, 2.0])
def test_a_jump_that_stays_is_a_loss_of_track_however_much_time_passes(size):
    """0.3 rad could be gone in 20 ms; but nobody has seen the joint go, it was there at once."""
    filter_ = estimator(stale_s=0.05)
    watch(filter_, moving((0.0, 0.0), (0.0, 0.0), 0, 20))
    for k in range(20, 70):
        assert implausible(filter_.update(accepted(k, (size, 1.0), (0.0, 0.0)))), f"{k} ms"
        assert not filter_.lost_track
    good(filter_.update(accepted(70, (size, 1.0), (0.0, 0.0))))
    assert filter_.lost_track


def test_noise_at_full_speed_that_is_once_too_large_does_no_lasting_harm():
    filter_ = estimator()
    watch(filter_, moving((SPEED, 0.0), (SPEED, 0.0), 0, 20))
    answer = filter_.update(accepted(20, (0.24 + 0.011, 1.0), (SPEED, 0.0)))  # 23 mrad in a period that may be 1.5 ms
    assert implausible(answer)
    for k in range(21, 40):
        good(filter_.update(accepted(k, (0.012 * k, 1.0), (SPEED, 0.0))))
    assert not filter_.lost_track


def test_a_stamp_that_comes_too_early_costs_one_sample_and_no_more():
    """The stamps 19.2 and 20.8 in place of 20 and 21 ms: twelve times too fast, as it seems, but seen in time."""
    filter_ = estimator()
    watch(filter_, moving((SPEED, 0.0), (SPEED, 0.0), 0, 20))
    assert implausible(filter_.update(accepted(19.2, (0.24, 1.0), (SPEED, 0.0), seen_ms=20)))
    for k in range(21, 40):
        good(filter_.update(accepted(k, (0.012 * k, 1.0), (SPEED, 0.0))))
    assert not filter_.lost_track


def test_a_robot_that_moves_during_a_gap_is_found_again():
    filter_ = estimator()
    watch(filter_, moving((SPEED, 0.0), (SPEED, 0.0), 0, 20))
    answers = watch(filter_, moving((SPEED, 0.0), (SPEED, 0.0), 120, 140, start=(0.012 * 120, 1.0)))
    assert good(answers[0]).velocity == (SPEED, 0.0)
    assert not filter_.lost_track


def test_after_the_clock_of_the_sender_was_set_back_the_motion_is_followed_from_anew():
    filter_ = estimator()
    watch(filter_, moving((1.0, 1.0), (1.0, 1.0), 500, 520))
    again = good(filter_.update(accepted(400, (0.02, 1.02), (1.0, 1.0), seen_ms=600)))
    assert again.velocity == (1.0, 1.0)
    assert good(filter_.update(accepted(401, (0.021, 1.021), (1.0, 1.0), seen_ms=601))).velocity == (1.0, 1.0)


# --- frozen -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("said", [1.0, 3.0, -3.0, 12.0, 1e3])
@pytest.mark.parametrize("frozen", [0, 1])
def test_a_joint_that_stands_still_but_reports_motion_is_frozen_even_if_the_other_moves(said, frozen):
    """A report of 1 rad/s is within the slack of any single sample: the way that adds up gives it away. At most the
    way of a full braking from 8 rad/s, 0.08 rad, may be untold, and 20 ms may pass."""
    filter_ = estimator()
    rates = [2.0, 2.0]
    watch(filter_, moving(rates, rates, 0, 20))
    latest = 20 + max(20, 80 / abs(said)) + 3  # 0.08 rad take so many ms
    rates[frozen] = 0.0
    told = [2.0, 2.0]
    told[frozen] = said
    answers = watch(filter_, moving(rates, told, 20, 150, start=(0.04, 1.04)))
    first = next(k for k, answer in enumerate(answers, 20) if implausible(answer))
    assert 40 <= first <= latest
    assert all(implausible(answer) for answer in answers[first - 20 :])


@pytest.mark.parametrize("said", [0.25, -0.6, 1.0])
def test_however_slow_the_reported_motion_positions_that_stand_longer_than_the_stale_limit_are_frozen(said):
    """From 2 % of the speed limit, 0.24 rad/s, on; 50 ms are the shipped `stale_s`. They stay frozen when the motion
    ends, until the position changes, or nobody can know more but an operator."""
    filter_ = estimator()
    watch(filter_, moving((said, 0.0), (said, 0.0), 0, 20))
    stuck = (said * 0.019, 1.0)
    first = next(k for k in range(20, 100) if implausible(filter_.update(accepted(k, stuck, (said, 0.0)))))
    assert 20 + 50 <= first <= 20 + 50 + 2
    assert all(map(implausible, watch(filter_, [accepted(k, stuck, (0.0, 0.0)) for k in range(first + 1, 300)])))
    assert not filter_.lost_track
    good(filter_.update(accepted(300, (stuck[0] + 1e-4, 1.0), (0.0, 0.0))))
    assert not filter_.lost_track


def test_a_frozen_joint_that_has_come_to_rest_is_believed_again_but_not_the_branch():
    """It may have gone on; who commands the drives to stand for ever because of it would never get out."""
    filter_ = estimator()
    watch(filter_, moving((2.0, 2.0), (2.0, 2.0), 0, 20))
    stuck = (0.038, 1.038)
    assert implausible(watch(filter_, [accepted(k, stuck, (6.0, 0.0)) for k in range(20, 60)])[-1])
    assert all(map(implausible, watch(filter_, [accepted(k, stuck, (0.0, 0.0)) for k in range(60, 1058)])))
    assert not filter_.lost_track
    good(filter_.update(accepted(1061, stuck, (0.0, 0.0))))
    assert filter_.lost_track


def test_a_frozen_joint_whose_last_digit_flickers_is_frozen():
    """The shipped encoder resolution is 1e-5 rad; a message that says 6 rad/s for a second while the position stays
    within one of it."""
    filter_ = estimator(encoder_resolution=1e-5)
    watch(filter_, moving((6.0, 0.0), (6.0, 0.0), 0, 20))
    stuck = [(0.114 + 1e-5 * (k % 2), 1.0) for k in range(1000)]
    answers = [filter_.update(accepted(20 + k, q, (6.0, 0.0))) for k, q in enumerate(stuck)]
    first = next(k for k, answer in enumerate(answers) if implausible(answer))
    assert first <= 25
    assert all(good(answer).velocity[0] == 6.0 for answer in answers[2:first])
    assert all(map(implausible, answers[first:]))


def test_a_clock_that_is_set_back_does_not_make_a_jump_forgotten():
    filter_ = estimator()
    watch(filter_, moving((0.0, 0.0), (0.0, 0.0), 500, 520))
    for k in range(520, 530):
        assert implausible(filter_.update(accepted(k, (0.3, 1.0), (0.0, 0.0))))
    good(filter_.update(accepted(430, (0.3, 1.0), (0.0, 0.0), seen_ms=590)))
    assert filter_.lost_track


def test_late_stamps_at_full_speed_are_no_jumps():
    rng = np.random.default_rng(3)
    filter_ = estimator()
    late_ms = np.abs(rng.normal(0.0, 0.1, 2000))
    for k, late in enumerate(late_ms):
        good(filter_.update(accepted(k + late, (0.98 * SPEED * 1e-3 * k, 1.0), (0.98 * SPEED, 0.0), seen_ms=k + late)))


def speeding_up(velocity: Callable[[float], float], position: Callable[[float], float], samples: int) -> list[Estimate]:
    """Joint 1 as told for so many samples, after it stood for longer than the shipped latency of 10 ms."""
    filter_ = estimator()
    watch(filter_, moving((0.0, 0.0), (0.0, 0.0), 0, 20))
    times = [1e-3 * k for k in range(1, samples + 1)]
    return [
        good(filter_.update(accepted(19 + k, (position(t), 1.0), (velocity(t), 0.0)))) for k, t in enumerate(times, 1)
    ]


@pytest.mark.parametrize("gain", [150.0, -150.0])
def test_an_acceleration_that_has_just_begun_is_not_thinned_out(gain):
    answers = speeding_up(lambda t: gain * t, lambda t: 0.5 * gain * t * t, 29)
    for answer in answers[2:]:
        assert answer.acceleration[0] == pytest.approx(gain, rel=1e-6)


@pytest.mark.parametrize("late_ms", [0.0, 0.2, 0.5, 0.8])
@pytest.mark.parametrize("rate", [0.05, 0.15, 0.25, 0.35, 1.5, -0.25])
def test_a_rate_that_is_reached_with_a_constant_acceleration_is_not_expected_to_grow_on(rate, late_ms):
    """100 rad/s2, begun between two samples: the first ones differ in what they gain."""
    whole_s = abs(rate) / 100.0

    def way(t: float) -> float:
        going_s = max(t - 1e-3 * late_ms, 0.0)
        begun_s = min(going_s, whole_s)
        return (50.0 * begun_s**2 + 100.0 * whole_s * (going_s - begun_s)) * (1.0 if rate > 0.0 else -1.0)

    def pace(t: float) -> float:
        return 100.0 * min(max(t - 1e-3 * late_ms, 0.0), whole_s) * (1.0 if rate > 0.0 else -1.0)

    for answer in speeding_up(pace, way, 30):
        assert abs(answer.acceleration[0]) <= 100.0 * (1.0 + 1e-6)


@pytest.mark.parametrize("jerk", [1.5e4, -1.5e4])
def test_an_acceleration_that_grows_from_rest_goes_on_growing_until_the_brakes_act(jerk):
    """A constant jerk, as it is known from the fourth sample on."""
    answers = speeding_up(lambda t: 0.5 * jerk * t * t, lambda t: jerk * t**3 / 6.0, 10)
    for k, answer in enumerate(answers, 1):
        now_s, then_s = 1e-3 * k, 1e-3 * k + answer.ahead_s + 0.01
        mean = 0.5 * jerk * (then_s**2 - now_s**2) / (then_s - now_s)
        if k >= 4:
            assert answer.acceleration[0] == pytest.approx(mean, rel=1e-6), k
        if k == 3:
            assert 0.6 <= answer.acceleration[0] / mean <= 1.0


def test_an_acceleration_grows_no_further_than_drives_brake():
    answers = speeding_up(lambda t: 2.0e4 * t * t, lambda t: 2.0e4 * t**3 / 3.0, 8)
    assert answers[-1].acceleration[0] == BRAKE


def filtered(lag_s: float) -> Callable[[float], float]:
    """What a filter of first order makes of a rate that grows with all that the drives can do."""
    return lambda t: BRAKE * (t - lag_s * (1.0 - exp(-t / lag_s)))


@pytest.mark.parametrize("velocity", [lambda t: 0.0, lambda t: 0.5 * BRAKE * t, filtered(0.005), filtered(0.01)])
def test_rates_that_stay_behind_the_positions_hide_no_acceleration(velocity):
    """Zeros, the wrong unit, long filters: what the positions say counts, soon after a start from rest."""
    for k, answer in enumerate(speeding_up(velocity, lambda t: 0.5 * BRAKE * t * t, 8), 1):
        if k >= 3:
            assert "joint_1" in answer.degraded
            assert answer.velocity[0] == pytest.approx(BRAKE * (k - 0.5) * 1e-3)
        if k >= 4:
            assert answer.acceleration[0] == pytest.approx(BRAKE)


def test_where_rates_begin_to_be_wrong_no_joint_speeds_up():
    filter_ = estimator()
    watch(filter_, moving((6.0, 0.0), (6.0, 0.0), 0, 30))
    answers = [good(filter_.update(accepted(k, (6e-3 * k, 1.0), (3.0, 0.0)))) for k in range(30, 60)]
    assert all(answer.degraded for answer in answers[3:])
    for answer in answers:
        assert answer.acceleration[0] == pytest.approx(0.0, abs=1e-6) or not answer.degraded


@pytest.mark.parametrize("velocity", [lambda t: 0.95 * BRAKE * t, lambda t: 1.05 * BRAKE * t, filtered(0.0005)])
def test_rates_that_nearly_add_up_to_the_way_are_believed(velocity):
    for answer in speeding_up(velocity, lambda t: 0.5 * BRAKE * t * t, 25):
        assert not answer.degraded


@pytest.mark.parametrize("hz", [1000, 1500, 2500, 4000])
@pytest.mark.parametrize("rate", [7.0, 11.5])
@pytest.mark.parametrize("tells", [True, False])
def test_stamps_that_come_close_together_make_no_joint_run(hz, rate, tells):
    """Each is up to 0.3 ms off; the order stays."""
    rng = np.random.default_rng(8)
    times_ms = np.arange(0.0, 300.0, 1e3 / hz)
    stamps_ms = np.maximum.accumulate(
        times_ms + rng.uniform(-0.3, 0.3, len(times_ms)) + 1e-6 * np.arange(len(times_ms))
    )
    filter_, latest = estimator(), -1.0
    for t, stamp in zip(times_ms, stamps_ms, strict=True):
        if stamp > latest:
            latest, said = stamp, (rate, 0.0) if tells else ()
            answer = filter_.update(accepted(stamp, (1e-3 * rate * t, 1.0), said, seen_ms=t + 1.0))
            if tells:
                assert (good(answer).velocity, answer.degraded) == ((rate, 0.0), "")
            elif t > 10.0:  # until something is known of its pace
                assert abs(good(answer).velocity[0]) <= 1.25 * SPEED


@pytest.mark.parametrize(("first", "share"), [((), 1.0), ((0.0, 0.0), 0.0), ((0.0, 0.0), 1.0)])
def test_a_first_sample_hides_no_acceleration(first, share):
    """It has no velocities, or tells no way; it stays in the window for as long as the latency."""
    filter_ = estimator(latency_s=0.3, velocity_limit=1.0)
    good(filter_.update(accepted(0, (0.0, 1.0), first)))
    for k in range(1, 120):
        t = 1e-3 * k
        answer = good(filter_.update(accepted(k, (4.0 * t * t, 1.0), (share * 8.0 * t, 0.0))))
        if k >= 60:
            assert answer.acceleration[0] == pytest.approx(8.0, rel=1e-6)


@pytest.mark.parametrize("speed", [0.16, 0.2, 0.25, 0.4])
def test_a_slow_joint_whose_encoder_is_coarse_is_not_frozen(speed):
    """0.02 of full speed is 0.24 rad/s; an encoder of 9 bits stands still for up to 80 ms then."""
    resolution = tau / 512
    filter_ = estimator(encoder_resolution=resolution)
    for ms in range(1000):
        step = resolution * round(1e-3 * speed * ms / resolution)
        good(filter_.update(accepted(ms, (step, 1.0), (speed, 0.0))))


def test_noise_of_a_velocity_is_no_acceleration_of_its_own_size():
    """Noise of 1 % of full speed, 0.12 rad/s, over one sample would be 120 rad/s2."""
    rng = np.random.default_rng(5)
    filter_, found = estimator(), []
    for k in range(400):
        said = 6.0 + float(rng.uniform(-0.06, 0.06))
        found.append(good(filter_.update(accepted(k, (0.006 * k, 1.0), (said, 0.0)))).acceleration[0])
    assert max(map(abs, found[20:])) <= 0.12 / 0.002 + 1e-6


def test_noise_of_a_joint_that_stands_does_not_grow():
    """Within the shipped standstill speed, 0.02 rad/s, the most that two samples make of it is 0.04 rad/s in 2 ms."""
    rng = np.random.default_rng(6)
    filter_, found = estimator(), []
    for k in range(2000):
        said = float(rng.uniform(-0.02, 0.02))
        found.append(good(filter_.update(accepted(k, (0.0, 1.0), (said, 0.0)))).acceleration[0])
    assert max(map(abs, found[20:])) <= 0.04 / 0.002


def test_until_it_is_known_to_be_frozen_a_joint_is_taken_to_move_as_it_says():
    filter_ = estimator()
    watch(filter_, moving((10.0, 0.0), (10.0, 0.0), 0, 20))
    suspect = good(filter_.update(accepted(20, (0.19, 1.0), (10.0, 0.0))))
    assert suspect.velocity == (10.0, 0.0)
    assert suspect.degraded


@pytest.mark.parametrize("said", [1e308, -1e16, 180.0, 15.1, nan, inf])
def test_a_rate_that_no_joint_can_have_is_not_taken_for_the_motion_of_a_joint_that_stands(said):
    """15 rad/s are a quarter above the shipped limit."""
    filter_ = estimator()
    watch(filter_, moving((0.0, 0.0), (0.0, 0.0), 0, 20))
    answer = good(filter_.update(accepted(20, (0.0, 1.0), (said, 0.0))))
    assert answer.velocity == (0.0, 0.0)
    assert answer.degraded
    for ms in range(21, 100):  # nor is its position frozen
        good(filter_.update(accepted(ms, (0.0, 1.0), (0.0, 0.0))))


def test_the_second_joint_is_looked_at_although_the_first_contradicts_itself_too():
    filter_ = estimator()
    answers = watch(filter_, moving((8.0, 0.0), (-8.0, 9.0), 0, 40))
    assert implausible(answers[-1])
    assert "joint_2" in answers[-1].text


def test_a_filtered_rate_that_lags_behind_after_a_stop_is_no_frozen_encoder():
    """From 12 rad/s the joint brakes with 400 rad/s2 and stands after 30 ms. The rate that its drive reports went
    through a filter of first order with a time constant of 8 ms."""
    filter_, lag_s, reported, q = estimator(), 0.008, SPEED, 0.0
    for k in range(400):
        v = max(SPEED - BRAKE * k * 1e-3, 0.0)
        q += v * 1e-3
        reported += (v - reported) * (1.0 - exp(-1e-3 / lag_s))
        good(filter_.update(accepted(k, (q, 1.0), (reported, 0.0))))


def test_noise_of_the_rates_of_a_standing_robot_is_no_motion():
    rng = np.random.default_rng(5)
    filter_ = estimator()
    for k in range(5000):
        good(filter_.update(accepted(k, (0.5, 1.0), rng.normal(0.0, 0.3, 2))))


def test_an_offset_of_the_rates_below_standstill_is_no_motion():
    filter_ = estimator(standstill_speed=0.02)
    for k in range(10_000):
        good(filter_.update(accepted(k, (0.5, 1.0), (0.019, -0.019))))


@pytest.mark.parametrize(("moved", "lost"), [(0.6, False), (-0.6, False), (1.0, True), (-3.0, True)])
def test_when_the_clock_of_the_sender_was_set_back_a_jump_is_told_by_the_steady_clock(moved, lost):
    """In the 60 ms that pass a joint gets 0.72 rad far at 12 rad/s, and a quarter more is borne with."""
    filter_ = estimator()
    watch(filter_, moving((0.0, 0.0), (0.0, 0.0), 0, 50))
    good(filter_.update(accepted(-5000, (moved, 1.0), (0.0, 0.0), seen_ms=49 + 60)))
    assert bool(filter_.lost_track) is lost


@pytest.mark.parametrize("back_ms", [40, 45, 49, 60, 500])
def test_no_branch_is_lost_when_the_clock_of_the_sender_is_set_back_while_a_joint_moves(back_ms):
    """What was stamped before does not count again (the intake sees to it). Set back by less than the 50 ms of the
    stale limit, stamps go on right behind the last one, and the joint has moved all the while."""
    filter_ = estimator()
    watch(filter_, moving((6.0, 0.0), (6.0, 0.0), 0, 50))
    for ms in range(50, 300):
        if ms - back_ms > 49 or ms > 49 + 50:
            position = 0.006 * ms, 1.0
            filter_.update(accepted(ms - back_ms, position, (6.0, 0.0), seen_ms=ms))
            assert not filter_.lost_track
    good(filter_.update(accepted(300 - back_ms, (1.8, 1.0), (6.0, 0.0), seen_ms=300)))


# --- settings ---------------------------------------------------------------------------------------------------


def test_new_limits_hold_from_the_next_sample_and_the_last_sample_stays_known():
    filter_ = estimator()
    watch(filter_, moving((5.0, 0.0), (5.0, 0.0), 0, 20))
    filter_.configure(settings_of(velocity_limit=2.0)[0])
    assert implausible(filter_.update(accepted(20, (0.1, 1.0), (5.0, 0.0))))
    filter_.configure(settings_of()[0])
    assert good(filter_.update(accepted(21, (0.105, 1.0), ()))).velocity == pytest.approx((5.0, 0.0))
