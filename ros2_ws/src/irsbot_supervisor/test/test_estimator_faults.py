"""What no motion explains is rejected or named: clocks that are set, jumps, frozen encoders."""

from __future__ import annotations

from math import exp, inf, nan

import numpy as np
import pytest
from estimates import (
    BRAKE,
    SPEED,
    STALE_MS,
    accepted,
    estimator,
    good,
    holds,
    implausible,
    moving,
    watch,
)
from hypothesis import given
from hypothesis import strategies as st
from supervised import settings_of

from irsbot_msgs_py.records import Cause
from irsbot_supervisor.core.estimation.estimate import Estimate, Speeds
from irsbot_supervisor.core.estimation.jumps import Jumps
from irsbot_supervisor.core.estimation.reported import Reported
from irsbot_supervisor.core.settings import OVERSPEED
from irsbot_supervisor.core.validation import Rejected

# --- clocks ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("late_ms", [1.2, 3.2, 10.2, 19.2])
@pytest.mark.parametrize("rate", [2.0, 8.0, 11.0])
@pytest.mark.parametrize("tells", [True, False])
def test_one_sample_that_was_stamped_late_makes_no_jump_of_those_that_follow(rate, late_ms, tells):
    """The sender was interrupted between reading and stamping; what follows is on time."""
    filter_, newest_ms = estimator(), -1.0
    for k in range(80):
        stamp_ms = k + late_ms * (k == 30)
        if stamp_ms > newest_ms:  # others are out of order, which the intake tells
            newest_ms = stamp_ms
            stated = (rate, 0.0) if tells else ()
            answer = good(filter_.update(accepted(stamp_ms, (1e-3 * rate * k, 1.0), stated, seen_ms=max(k, newest_ms))))
            assert not answer.branch_lost
            assert stamp_ms == 30 + late_ms or holds(answer, rate, 0.0)
            assert not answer.velocity[0] > answer.speeds.forward[0] + 1e-9  # unknown at the first sample
    assert answer.velocity == pytest.approx((rate, 0.0))


@pytest.mark.parametrize("early_ms", [0.25, 0.5])
def test_a_second_publisher_is_not_a_sender_that_is_interrupted_again_and_again(early_ms):
    """Its positions are as far away as a joint gets from one sample to the next, but not back in a part of the time."""
    filter_ = estimator()
    for k in range(30):
        good(filter_.update(accepted(k, (0.0, 1.0))))
    both = [
        filter_.update(accepted(k - early, (apart, 1.0), seen_ms=k))
        for k in range(30, 34)
        for early, apart in ((early_ms, 0.016), (0.0, 0.0))
    ]
    assert not isinstance(both[1], Rejected), "one sample may have been stamped late"
    assert any(isinstance(answer, Rejected) and answer.cause == Cause.IMPLAUSIBLE for answer in both[2:])


def test_a_stamp_that_comes_too_early_is_named_and_speeds_count_as_the_limits():
    """The stamps 19.2 and 20.8 in place of 20 and 21 ms: our steady clock explains the way, no drive explains it."""
    filter_ = estimator()
    watch(filter_, moving((SPEED, 0.0), (SPEED, 0.0), 0, 20))
    early = good(filter_.update(accepted(19.2, (0.24, 1.0), (SPEED, 0.0), seen_ms=20)))
    assert early.degraded
    assert early.speeds == ((SPEED,) * 2, (SPEED,) * 2)
    for k in range(21, 40):
        assert not good(filter_.update(accepted(k, (0.012 * k, 1.0), (SPEED, 0.0)))).branch_lost


@pytest.mark.parametrize("back_ms", [5, 19, 30, 45, 60, 500])
@pytest.mark.parametrize("rate", [0.5, 2.0, 8.0])
@pytest.mark.parametrize("tells", [True, False])
def test_when_the_clock_of_the_sender_is_set_back_while_a_joint_moves_no_branch_is_lost(back_ms, rate, tells):
    """What is stamped before does not count until nothing newer came for as long as the stale limit."""
    filter_, stated = estimator(), (rate, 0.0) if tells else ()
    watch(filter_, moving((rate, 0.0), stated, 0, 50))
    for ms in range(50, 200):
        if ms - back_ms > 49 or ms > 49 + STALE_MS:
            answer = filter_.update(accepted(ms - back_ms, (1e-3 * rate * ms, 1.0), stated, seen_ms=ms))
            if isinstance(answer, Estimate):
                assert not answer.branch_lost
                assert holds(answer, rate, 0.0)
    assert good(answer).velocity == pytest.approx((rate, 0.0))


@pytest.mark.parametrize("ahead_ms", [5.0, 45.0, 100.0, 1e4, 3.6e6])
@pytest.mark.parametrize("rate", [0.1, 2.0, 10.0])
def test_a_clock_that_was_set_forward_is_no_time_that_passed(rate, ahead_ms):
    """Both clocks of one machine; the message has no velocities."""
    filter_ = estimator()
    watch(filter_, moving((rate, 0.0), (), 0, 30))
    for k in range(30, 60):
        answer = good(filter_.update(accepted(k + ahead_ms, (1e-3 * rate * k, 1.0), (), seen_ms=k)))
        assert holds(answer, rate, 0.0)
        assert answer.prediction_delay_s <= 0.0026
        assert answer.silence is None
    assert answer.velocity == pytest.approx((rate, 0.0), abs=1e-6)


@pytest.mark.parametrize(("moved", "lost"), [(0.6, False), (-0.6, False), (1.0, True), (-3.0, True)])
def test_after_the_senders_clock_was_set_back_the_steady_clock_shows_a_jump(moved, lost):
    """In the 60 ms that pass a joint gets 0.72 rad far at 12 rad/s, and a quarter more is borne with."""
    filter_ = estimator()
    watch(filter_, moving((0.0, 0.0), (0.0, 0.0), 0, 50))
    answer = good(filter_.update(accepted(-5000, (moved, 1.0), seen_ms=49 + 60)))
    assert bool(answer.branch_lost) is lost


def test_a_clock_that_is_set_back_does_not_make_a_jump_forgotten():
    filter_ = estimator()
    watch(filter_, moving((0.0, 0.0), (0.0, 0.0), 500, 520))
    for k in range(520, 530):
        assert implausible(filter_.update(accepted(k, (0.3, 1.0))))
    assert good(filter_.update(accepted(430, (0.3, 1.0), seen_ms=590))).branch_lost


def test_late_stamps_at_full_speed_are_no_jumps():
    rng, filter_ = np.random.default_rng(3), estimator()
    for k, late in enumerate(np.abs(rng.normal(0.0, 0.1, 2000))):
        q = 0.98 * SPEED * 1e-3 * k
        assert not good(filter_.update(accepted(k + late, (q, 1.0), (0.98 * SPEED, 0.0), seen_ms=k + late))).branch_lost


# --- reported velocities ---------------------------------------------------------------------------------------------


def test_positions_are_compared_over_the_shortest_window_that_is_long_enough():
    """The oldest sample that is kept is at least a window old, the next one is not, however the samples come."""
    settings, robot = settings_of("irsbot2")
    rng, oldest, next_to_it = np.random.default_rng(8), inf, 0.0
    reported, ms, still = Reported(settings, robot.mechanism.joints), 0.0, Speeds((0.0, 0.0), (0.0, 0.0))
    for k in range(600):
        ms += rng.uniform(0.2, 3.0)
        reported.look(accepted(ms, (0.0, 1.0)), still)
        kept = [(reported.memory[-1].stamp_ns - one.stamp_ns) * 1e-6 for one in reported.memory]
        if k > 100:
            oldest, next_to_it = min(oldest, kept[0]), max(next_to_it, kept[1])
    assert 0.0 < next_to_it < oldest


# --- jumps -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_step_may_be_longer_by_what_an_encoder_and_two_stamps_leave_open(sign):
    settings, robot = settings_of("irsbot2", encoder_resolution=1e-3, stamp_jitter_s=2e-4)
    jumps, span_s, limit = Jumps(settings, robot.mechanism.joints), 1e-3, settings.velocity_limit[0]
    most = OVERSPEED * limit * span_s + 1e-3 + 2.0 * 2e-4 * limit
    assert jumps.too_far((sign * 0.999 * most, 0.0), span_s) == ""
    assert "'joint_1' jumped" in jumps.too_far((sign * 1.001 * most, 0.0), span_s)


@given(st.floats(0.02, 3.1), st.sampled_from([-1.0, 1.0]), st.integers(0, 1), st.integers(1, 20))
def test_a_glitch_is_rejected_and_leaves_no_trace(size, sign, joint, length):
    """The fastest that 1.25 times the limit allows in a period is 15 mrad, and 1.2 mrad what stamps leave open."""
    filter_ = estimator()
    (*_, before) = watch(filter_, moving((1.0, 1.0), (1.0, 1.0), 0, 20))
    for k in range(20, 20 + length):
        q = [0.001 * k, 1.0 + 0.001 * k]
        q[joint] += sign * (size + 0.02 * length)  # beyond all that can be gone in the time of the glitch
        assert implausible(filter_.update(accepted(k, q, (1.0, 1.0))))
    for k in range(20 + length, 60 + length):
        back = good(filter_.update(accepted(k, (0.001 * k, 1.0 + 0.001 * k), (1.0, 1.0))))
        assert (back.velocity, back.degraded, back.branch_lost) == ((1.0, 1.0), "", "")
    assert back.speeds.forward == pytest.approx(before.speeds.forward, abs=0.1)


@pytest.mark.parametrize("size", [0.035, 0.1, 0.3, 0.7, 2.0])
def test_a_jump_that_stays_is_a_loss_of_the_branch_however_much_time_passes(size):
    """0.3 rad could be gone in 20 ms; but nobody has seen the joint go, it was there at once."""
    filter_ = estimator()
    watch(filter_, moving((0.0, 0.0), (0.0, 0.0), 0, 20))
    for k in range(20, 70):
        assert implausible(filter_.update(accepted(k, (size, 1.0)))), f"{k} ms"
    assert good(filter_.update(accepted(70, (size, 1.0)))).branch_lost
    assert not good(filter_.update(accepted(71, (size, 1.0)))).branch_lost  # told once, latched by others


def test_noise_at_full_speed_that_is_once_too_large_does_no_lasting_harm():
    filter_ = estimator()
    watch(filter_, moving((SPEED, 0.0), (SPEED, 0.0), 0, 20))
    assert implausible(filter_.update(accepted(20, (0.24 + 0.011, 1.0), (SPEED, 0.0))))
    for k in range(21, 40):
        assert not good(filter_.update(accepted(k, (0.012 * k, 1.0), (SPEED, 0.0)))).branch_lost


@pytest.mark.parametrize("stated", [(10.0, 0.0), (10.0, nan), ()])
def test_a_fast_joint_is_known_again_after_a_glitch_however_far_it_went_meanwhile(stated):
    """30 ms at 10 rad/s: it went farther than the glitch jumped. joint_2 may say nothing of its speed."""
    filter_ = estimator()
    watch(filter_, moving((10.0, 0.0), stated, 0, 50))
    for k in range(50, 80):
        assert implausible(filter_.update(accepted(k, (0.01 * k + 0.25, 1.0), stated)))
    assert not good(filter_.update(accepted(80, (0.8, 1.0), stated))).branch_lost


# --- frozen encoders -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("stated", [1.0, 3.0, -3.0, 12.0])
@pytest.mark.parametrize("frozen", [0, 1])
def test_a_joint_that_stands_still_but_reports_motion_is_frozen_even_if_the_other_moves(stated, frozen):
    """At most the way of a full braking from 8 rad/s, 0.08 rad, may be untold, and 20 ms may pass."""
    filter_, rates = estimator(), [2.0, 2.0]
    watch(filter_, moving(rates, rates, 0, 20))
    latest = 20 + min(max(20, 80 / abs(stated)), STALE_MS) + 3  # 0.08 rad take so many ms
    rates[frozen] = 0.0
    told = [2.0, 2.0]
    told[frozen] = stated
    answers = watch(filter_, moving(rates, told, 20, 150, start=(0.04, 1.04)))
    first = next(k for k, answer in enumerate(answers, 20) if implausible(answer))
    assert 40 <= first <= latest
    assert all(implausible(answer) for answer in answers[first - 20 :])
    for answer in answers[4 : first - 20]:  # until then it counts as moving as it says
        bounds = good(answer).speeds.forward if stated > 0.0 else answer.speeds.backward
        assert bounds[frozen] >= min(abs(stated), SPEED)


@pytest.mark.parametrize("stated", [0.021, 0.1, 0.25, -0.6, 1.0])
def test_however_slow_the_reported_motion_positions_that_stand_longer_than_the_stale_limit_are_frozen(stated):
    """From the standstill speed, 0.02 rad/s, on, once the way told is beyond flickering digits, 4e-5 rad. They stay
    frozen when the motion ends, until the position changes, or nobody can know more but an operator."""
    filter_ = estimator()
    watch(filter_, moving((stated, 0.0), (stated, 0.0), 0, 20))
    stuck = (stated * 0.019, 1.0)
    first = next(k for k in range(20, 100) if implausible(filter_.update(accepted(k, stuck, (stated, 0.0)))))
    assert 20 + STALE_MS <= first <= 20 + STALE_MS + 2
    assert all(map(implausible, watch(filter_, [accepted(k, stuck) for k in range(first + 1, 300)])))
    assert not good(filter_.update(accepted(300, (stuck[0] + 1e-4, 1.0)))).branch_lost


@pytest.mark.parametrize("stated", [6.0, -6.0])
def test_motion_that_was_told_is_not_taken_back_by_the_opposite_while_the_position_stands(stated):
    """0.09 rad were told in 15 ms, more than the 0.08 rad of a full braking."""
    filter_ = estimator()
    watch(filter_, moving((stated, 0.0), (stated, 0.0), 0, 20))
    stuck = (stated * 0.019, 1.0)
    watch(filter_, [accepted(k, stuck, (stated, 0.0)) for k in range(20, 35)])
    first = next(k for k in range(35, 100) if implausible(filter_.update(accepted(k, stuck, (-stated, 0.0)))))
    assert first <= 20 + 20 + 3


def test_a_frozen_joint_at_rest_is_accepted_again_but_its_branch_is_lost():
    """It may have gone on; who commands the drives to stand for ever because of it would never get out."""
    filter_ = estimator()
    watch(filter_, moving((2.0, 2.0), (2.0, 2.0), 0, 20))
    stuck = (0.038, 1.038)
    assert implausible(watch(filter_, [accepted(k, stuck, (6.0, 0.0)) for k in range(20, 60)])[-1])
    assert all(map(implausible, watch(filter_, [accepted(k, stuck) for k in range(60, 1058)])))
    assert good(filter_.update(accepted(1061, stuck))).branch_lost


def test_a_clock_that_is_set_does_not_make_a_frozen_joint_sound():
    filter_ = estimator()
    watch(filter_, moving((2.0, 2.0), (2.0, 2.0), 0, 20))
    stuck = (0.038, 1.038)
    assert implausible(watch(filter_, [accepted(k, stuck, (6.0, 0.0)) for k in range(20, 60)])[-1])
    answers = watch(filter_, [accepted(k - 5000, stuck, seen_ms=k) for k in range(120, 200)])
    assert all(map(implausible, answers)), "it may have gone anywhere meanwhile"


def test_a_gap_does_not_make_a_joint_that_stands_and_reports_motion_sound():
    filter_ = estimator()
    watch(filter_, moving((1.0, 0.0), (1.0, 0.0), 0, 20))
    stuck = (0.019, 1.0)
    watch(filter_, [accepted(k, stuck, (1.0, 0.0)) for k in range(20, 50)])
    good(filter_.update(accepted(65, stuck, (1.0, 0.0))))
    answers = watch(filter_, [accepted(k, stuck, (1.0, 0.0)) for k in range(66, 73)])
    assert implausible(answers[-1]), f"{STALE_MS} ms after it began to stand"


def test_a_frozen_joint_whose_last_digit_flickers_is_frozen():
    filter_ = estimator(encoder_resolution=1e-5)
    watch(filter_, moving((6.0, 0.0), (6.0, 0.0), 0, 20))
    answers = [filter_.update(accepted(20 + k, (0.114 + 1e-5 * (k % 2), 1.0), (6.0, 0.0))) for k in range(1000)]
    first = next(k for k, answer in enumerate(answers) if implausible(answer))
    assert first <= 25
    assert all(map(implausible, answers[first:]))


@pytest.mark.parametrize("stated", [1e308, -1e16, 180.0, 15.1, nan, inf])
def test_a_rate_that_no_joint_can_have_is_not_taken_for_the_motion_of_a_joint_that_stands(stated):
    """15 rad/s are a quarter above the shipped limit."""
    filter_ = estimator()
    watch(filter_, moving((0.0, 0.0), (0.0, 0.0), 0, 20))
    answer = good(filter_.update(accepted(20, (0.0, 1.0), (stated, 0.0))))
    assert answer.velocity == (0.0, 0.0)
    assert answer.degraded
    for ms in range(21, 100):  # nor is its position frozen
        good(filter_.update(accepted(ms, (0.0, 1.0))))


def test_a_filtered_rate_that_lags_behind_after_a_stop_is_no_frozen_encoder():
    """From 12 rad/s with 400 rad/s2; the rate that its drive reports went through a filter of 8 ms."""
    filter_, lag_s, reported, q = estimator(), 0.008, SPEED, 0.0
    for k in range(400):
        v = max(SPEED - BRAKE * k * 1e-3, 0.0)
        q += v * 1e-3
        reported += (v - reported) * (1.0 - exp(-1e-3 / lag_s))
        good(filter_.update(accepted(k, (q, 1.0), (reported, 0.0))))


def test_noise_and_offsets_of_the_rates_of_a_standing_robot_are_no_motion():
    rng = np.random.default_rng(5)
    noisy, off = estimator(), estimator(standstill_speed=0.02)
    for k in range(5000):
        good(noisy.update(accepted(k, (0.5, 1.0), rng.normal(0.0, 0.3, 2))))
        good(off.update(accepted(k, (0.5, 1.0), (0.019, -0.019))))
