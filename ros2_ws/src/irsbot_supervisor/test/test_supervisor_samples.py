"""Samples that say nothing, and silence: what is not known is never called good."""

from __future__ import annotations

from functools import partial
from math import exp, isfinite, isnan

import numpy as np
import pytest
from supervised import (
    BAD,
    BOUNDARY,
    DWELL_MS,
    MS,
    SETTLING_MS,
    STALE_MS,
    STEADY_NS,
    bad,
    configure,
    expectation,
    feed,
    joints_of,
    level_in_force,
    newest,
    ready,
    resting,
    sample,
    supervisor_of,
    tick,
)

from irsbot_msgs_py.records import Cause, Level
from irsbot_supervisor.validation.harness.oracle import limits, margins

# --- data that says nothing -------------------------------------------------------------------------------------


@bad
@pytest.mark.parametrize("dwell_s", [0.0, 0.005, 0.05])
def test_bad_samples_are_unknown_and_no_verdict_is_ok_until_a_good_one_comes(make, cause, dwell_s):
    """Ten of them at once, then nothing but ticks: whatever the dwell time, nobody may call this good."""
    supervisor, q = ready(dwell_s=dwell_s)
    steps = feed(supervisor, [make(ms, q) for ms in range(10)])
    for step in steps:
        assert step.state.level == Level.UNKNOWN
        assert step.state.causes == cause
        assert isnan(step.state.type2_margin)
        assert isnan(step.state.stop_margin)
    assert supervisor.rejections == {cause: 10}
    steps += feed(supervisor, [tick(ms) for ms in np.arange(9.5, 400, 0.5)])
    assert {step.verdict.level for step in steps if step.verdict is not None} == {Level.UNKNOWN}
    assert newest(steps[:11]).causes & cause
    steps = feed(supervisor, resting(400, 700, q))
    assert level_in_force(steps) == Level.OK
    good = next(one for one in expectation(steps) if one.level == Level.OK)
    assert good.since_ns - STEADY_NS == pytest.approx((400 + SETTLING_MS + 1e3 * dwell_s) * MS)


@pytest.mark.parametrize("make", [make for name, (make, _cause) in BAD.items() if name != "a jump"])
def test_a_supervisor_that_has_only_seen_bad_samples_knows_nothing(make):
    supervisor = supervisor_of(dwell_s=0.0)
    steps = feed(supervisor, [make(0, joints_of(supervisor, 0.0, -0.85)), *(tick(ms) for ms in range(1, 300))])
    assert {step.verdict.level for step in steps if step.verdict is not None} == {Level.UNKNOWN}


def test_repeated_and_overtaken_samples_neither_help_nor_harm():
    """As long as a newer one may still come: 1 ms until the next, 1 ms of judging."""
    supervisor, q = ready()
    for ms in (0.0, 0.3, 1.0, 1.5, 2.9):  # the last good sample came at -1 ms
        step = supervisor.step(sample(min(ms, 1.0), q, age_ms=5.0))
        assert step.state.level == Level.UNKNOWN  # nothing follows from this sample ...
        assert step.state.causes == Cause.STAMP
        assert step.verdict is None or step.verdict.level == Level.OK  # ... and the one before still counts
    assert level_in_force(feed(supervisor, [tick(1.0), *resting(1, 60, q)])) == Level.OK


@pytest.mark.parametrize("ahead_ms", [45.0, 19.0], ids=["sender's clock set back", "one stamp ahead"])
def test_samples_that_are_all_older_than_the_last_one_are_not_ok(ahead_ms):
    """Nobody judges how the robot moves meanwhile, although samples come all the time."""
    supervisor, q = ready()
    first = sample(0.0, q) if ahead_ms > 20.0 else sample(0.0, q, age_ms=-ahead_ms)
    back_ms = ahead_ms if ahead_ms > 20.0 else 0.0
    steps = feed(supervisor, [first, *(sample(ms, q, age_ms=back_ms) for ms in range(1, 19))])
    began = expectation(steps)[0]
    assert (began.level, began.causes) == (Level.UNKNOWN, Cause.STAMP)
    assert (began.since_ns - STEADY_NS) / MS <= 3.0  # 2 ms are allowed, and samples come every millisecond
    assert "no newer one has come" in newest(steps).text
    assert level_in_force(feed(supervisor, resting(50, 400, q))) == Level.OK


@pytest.mark.parametrize("phase_ms", [0.0, 0.3, 7.7])
def test_silence_is_unknown_from_the_moment_on_when_the_last_sample_got_too_old(phase_ms):
    supervisor, q = ready()
    steps = feed(supervisor, [sample(0, q), *(tick(ms + phase_ms) for ms in range(10, 210, 10))])
    silent = expectation(steps)[-1]
    assert (silent.level, silent.causes) == (Level.UNKNOWN, Cause.STALE)
    assert silent.since_ns - STEADY_NS == STALE_MS * MS
    first = next(step.verdict for step in steps if step.verdict is not None and step.verdict.level == Level.UNKNOWN)
    assert first.speed_scale == 0.0
    steps = feed(supervisor, resting(210, 400, q))
    end_ms = 210 + SETTLING_MS + DWELL_MS
    assert [(one.since_ns - STEADY_NS, one.level) for one in expectation(steps)] == [(end_ms * MS, Level.OK)]


def test_a_robot_that_goes_on_after_an_outage_is_not_stopped_for_it():
    """What waited in a queue meanwhile comes first, so there are two long gaps: the silence, and to what is new. The
    robot goes on as soon as it may, with 250 rad/s2 up to 10 rad/s."""
    supervisor, (a, b) = ready()
    steps = feed(supervisor, [sample(500, (a, b), age_ms=45.0), sample(501, (a, b))])
    began_ms, levels = 1000, []
    for ms in range(502, 900):
        if level_in_force(steps) == Level.OK:
            began_ms = min(began_ms, ms)
        on_s = min(max(ms - began_ms, 0), 60) * 1e-3
        up_s = min(on_s, 0.04)
        velocity = 250.0 * up_s if on_s < 0.06 else 0.0
        position = a - 125.0 * up_s * up_s - 10.0 * (on_s - up_s)
        steps.append(supervisor.step(sample(ms, (position, b), (-velocity, 0.0))))
        levels.append(steps[-1].state.level)
        if velocity == 0.0 and on_s > 0.0:
            break
    assert on_s == 0.06
    assert Level.STOP not in levels


@pytest.mark.parametrize("end_ms", range(0, 160, 20))
def test_after_a_silence_where_the_robot_is_counts_at_once(end_ms):
    """It stands beyond a stop limit: that is latched, however little is known of what it will do."""
    supervisor, _q = ready()
    beyond = joints_of(supervisor, 1.08, -0.49)
    verdict = newest(feed(supervisor, resting(1000, 1001 + end_ms, beyond)))
    assert (verdict.level, verdict.latched) == (Level.UNKNOWN, True)
    assert verdict.causes & Cause.STALE


def test_new_settings_do_not_shorten_the_learning_after_a_silence():
    supervisor, q = ready()
    feed(supervisor, resting(400, 430, q))
    supervisor.step(configure(430, supervisor, latency_s=0.011))
    assert {step.state.level for step in feed(supervisor, resting(430, 400 + SETTLING_MS, q))} == {Level.UNKNOWN}


@pytest.mark.parametrize(("stale_s", "ok_ms"), [(0.5, 1000), (0.02, SETTLING_MS)])
def test_new_settings_may_lengthen_the_learning_at_the_beginning(stale_s, ok_ms):
    supervisor = supervisor_of()
    q = joints_of(supervisor, 0.0, -0.85)
    feed(supervisor, resting(0, 10, q))
    supervisor.step(configure(10, supervisor, stale_s=stale_s))
    steps = feed(supervisor, resting(10, 1200, q))
    (ok, *later) = [turn for step in steps for turn in step.transitions if turn.level == Level.OK]
    assert not later
    assert ok.since_ns - STEADY_NS == (ok_ms + DWELL_MS) * MS


@pytest.mark.parametrize(("stream_ms", "gap_ms"), [(20, 45), (1, 49), (5, 30)])
def test_who_watches_a_robot_that_already_moves_judges_only_when_the_gaps_between_samples_are_known(stream_ms, gap_ms):
    supervisor = supervisor_of(acceleration_limit=10.0)  # joints that do not get far in such a gap
    q = joints_of(supervisor, 0.0, -0.85)
    supervisor.step(tick(0))
    for ms in range(1, 400):
        supervisor.step(tick(ms - 0.5))
        if ms % (stream_ms + gap_ms) < stream_ms:
            supervisor.step(sample(ms, (q[0] + 1e-4 * ms, q[1]), (0.1, 0.0)))
        if supervisor.view is not None:
            break
    assert supervisor.view.judgement.level <= Level.WARN
    assert supervisor.view.prediction_delay_s >= 1e-3 * gap_ms
    assert ms <= SETTLING_MS + DWELL_MS + 2 * gap_ms


def test_a_stop_that_the_first_sample_shows_is_latched_at_once():
    supervisor = supervisor_of()
    first = supervisor.step(sample(0, joints_of(supervisor, 0.0, -1.198)))
    assert (first.state.level, first.verdict.level, first.verdict.latched) == (Level.STOP, Level.UNKNOWN, True)


@pytest.mark.parametrize(("gap_ms", "held"), [(10, False), (25, False), (30, True), (45, True)])
def test_two_gaps_hold_a_resting_robot_from_thirty_milliseconds_on_and_are_counted(gap_ms, held):
    """Near the edge of the workspace, whose limits are within reach of drives at 400 rad/s2 in that time."""
    supervisor, q = ready(pose=(0.0, -1.02))
    ms, steps = 0, []
    for _ in range(2):
        steps += feed(supervisor, resting(ms, ms + 20, q))
        ms += 19 + gap_ms
    steps += feed(supervisor, resting(ms, ms + 20, q))
    assert not any(one.latched for one in expectation(steps))
    assert (level_in_force(steps) == Level.UNKNOWN) == held
    assert supervisor.seen_too_rarely == held
    if held:
        assert f"the next may be judged {gap_ms + 5} ms after this one" in newest(steps).text


def test_one_long_interval_does_not_stop_the_robot():
    supervisor, q = ready()
    steps = feed(supervisor, [*resting(0, 20, q), *resting(64, 84, q)])
    assert not any(one.latched for one in expectation(steps))


def test_ten_lost_samples_change_nothing():
    supervisor, q = ready()
    steps = feed(supervisor, [sample(ms, q) for ms in range(0, 400) if ms % 37 > 10])
    assert expectation(steps) == []


def test_a_driver_that_sends_its_last_message_again_and_again_is_silent():
    supervisor, q = ready(dwell_s=0.005)
    last = sample(0, q)
    steps = feed(supervisor, [last])
    steps += feed(supervisor, [sample(ms, q, age_ms=ms) for ms in range(1, 190)])
    assert {one.level for one in expectation(steps)} == {Level.UNKNOWN}
    assert expectation(steps)[0].causes == Cause.STAMP
    assert expectation(steps)[-1].causes & Cause.STALE


def test_velocities_that_are_missing_are_a_warning_once_they_can_be_derived():
    supervisor = supervisor_of()
    q = joints_of(supervisor, 0.0, -0.85)
    first = supervisor.step(sample(0, q, ()))
    assert (first.state.level, first.state.causes) == (Level.UNKNOWN, Cause.DEGRADED)
    assert isnan(first.state.joint_velocity[0])
    assert first.state.stop_margin >= 0.0  # as if it were as fast as it can
    later = [supervisor.step(sample(ms, (q[0] + 1e-3 * ms, q[1]), ())) for ms in range(1, 200)]
    for step in later:
        assert (step.state.level, step.state.causes) == (Level.WARN, Cause.DEGRADED)
        assert step.state.joint_velocity == pytest.approx((1.0, 0.0), abs=1e-6)
        assert isfinite(step.state.stop_margin)
    assert level_in_force(later) == Level.WARN


def test_velocities_that_contradict_the_positions_do_not_hide_a_run_at_the_boundary():
    """The message says that the robot rests; its positions run at Type 1 with 6 rad/s."""
    supervisor, q = ready(pose=BOUNDARY)
    steps = []
    for ms in range(1, 400):
        steps.append(supervisor.step(sample(ms, (q[0] - 6e-3 * ms, q[1]), (0.0, 0.0))))
        if steps[-1].state.level == Level.STOP:
            break
    assert steps[-1].state.level == Level.STOP
    assert steps[-1].state.causes & Cause.DEGRADED
    assert min(steps[-1].state.type1_margin) > 0.15


def late(lag_s: float, gain: np.ndarray, t: float) -> np.ndarray:
    """What a filter of first order makes of rates that grow from rest."""
    return gain * (t - lag_s * (1.0 - exp(-t / lag_s)))


@pytest.mark.parametrize(
    "told",
    [lambda a, t: a * t, lambda a, t: 0.0 * a, lambda a, t: 0.5 * a * t, partial(late, 0.005), partial(late, 0.01)],
)
@pytest.mark.parametrize(
    ("start", "gain"),
    [
        ((-2.5738641062924645, 3.091037635204732), (-400.0, 397.83)),
        ((-0.2734197522941799, -0.984241433769991), (-400.0, 247.73)),
    ],
)
def test_wrong_velocities_hide_no_start_from_rest_towards_a_limit(start, gain, told):
    """All that the drives can do, from near a limit of Type 1: zeros, halved and filtered velocities are seen through
    before it is too late. After the latency each joint brakes by itself."""
    supervisor, a = supervisor_of(), np.array(gain)
    feed(supervisor, resting(-300, 1, start))
    for ms in range(1, 50):
        t = 1e-3 * ms
        step = supervisor.step(sample(ms, tuple(start + 0.5 * a * t * t), tuple(told(a, t))))
        if step.state.level >= Level.STOP:
            break
    settings, brakes = supervisor.settings, np.array(supervisor.settings.deceleration_limit)
    going_s = 1e-3 * ms + settings.latency_s
    times = np.linspace(0.0, going_s + (np.abs(a) * going_s / brakes).max(), 500)[:, None]
    going, braking = np.minimum(times, going_s), np.clip(times - going_s, 0.0, np.abs(a) * going_s / brakes)
    way = start + 0.5 * a * going**2 + a * going_s * braking - 0.5 * np.sign(a) * brakes * braking**2
    assert (margins(supervisor.robot, settings, way) >= limits(settings, "stop")).all()


@pytest.mark.parametrize("rate", [3.0, 6.0, 12.0])
def test_a_frozen_encoder_is_found_while_the_other_joint_moves(rate):
    supervisor, q = ready()
    for ms in range(200):
        step = supervisor.step(sample(ms, (q[0], q[1] + 5e-4 * ms), (rate, 0.5)))
        if step.state.level == Level.UNKNOWN:
            break
    assert step.state.causes == Cause.IMPLAUSIBLE
    assert ms <= max(20, 80 / rate) + 2
