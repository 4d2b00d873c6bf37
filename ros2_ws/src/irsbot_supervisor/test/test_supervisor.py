"""Events in, states and verdicts out: what is known is judged, what is not known is never called good."""

from __future__ import annotations

from functools import partial
from math import exp, inf, isfinite, isnan, nan

import numpy as np
import pytest
from supervised import (
    JOINTS,
    MS,
    STEADY_NS,
    at_ns,
    configure,
    expectation,
    feed,
    joints_of,
    ready,
    reset,
    resting,
    sample,
    settings_of,
    supervisor_of,
    tick,
)

import irsbot_kinematics as irs
from irsbot_msgs_py.records import Cause, JointSample, Level, Restart, Verdict
from irsbot_supervisor.bag.journal import JournalError, read_entry, write_entry
from irsbot_supervisor.core.events import Step
from irsbot_supervisor.core.settings import InvalidSettings
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.validation.harness.oracle import limits, margins

STALE_MS, DWELL_MS, HEARTBEAT_MS = 50, 50, 10
"""ms: shipped settings, which the tests write out."""

SETTLING_MS = 2 * STALE_MS
"""ms for which samples must have come after a silence, as docs/explanation/verdicts.md says."""


BOUNDARY = (1.04, -0.49)
"""m: leg I of irsbot2 is 0.6 rad from straight, and gets nearer while q_1 falls."""


def level_in_force(steps: list[Step]) -> Level:
    """Of the newest verdict."""
    return [step.verdict for step in steps if step.verdict is not None][-1].level


def newest(steps: list[Step]) -> Verdict:
    return [step.verdict for step in steps if step.verdict is not None][-1]


def approach(q, ms: int, rates=(6.0, -6.0), begin_ms: int = 0) -> JointSample:
    """A sample of joints that move steadily from q since `begin_ms`."""
    return sample(ms, [a + v * (ms - begin_ms) / 1e3 for a, v in zip(q, rates, strict=True)], rates)


# --- the good way -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", irs.robots())
def test_a_robot_that_rests_in_a_good_posture_is_ok_when_samples_have_settled_and_after_the_dwell_time(name):
    supervisor = supervisor_of(name)
    rng = np.random.default_rng(2)
    mechanism = supervisor.robot.mechanism
    low = [max(j.lower, -3.0) if j.is_angle else j.lower for j in mechanism.joints]
    high = [min(j.upper, 3.0) if j.is_angle else j.upper for j in mechanism.joints]
    Q = rng.uniform(low, high, (20000, len(low)))
    found = supervisor.robot.evaluate_many(Q)
    usual = (found.working_mode == mechanism.usual_working_mode).all(axis=1)
    margins = [found.type1_margin.T, found.type2_margin[np.newaxis], found.limb_margin.T]
    quality = np.nan_to_num(np.concatenate(margins)).min(axis=0)
    q = tuple(Q[np.argmax(np.where(usual, quality, 0.0))].tolist())
    assert np.where(usual, quality, 0.0).max() > 0.4, "no good posture: the fixture proves nothing"
    names = supervisor.settings.joint_names
    steps = feed(supervisor, [tick(0), *(sample(ms, q, names=names) for ms in range(1, 180))])
    assert [(one.since_ns - STEADY_NS, one.level) for one in expectation(steps)] == [
        (0, Level.UNKNOWN),
        ((1 + SETTLING_MS + DWELL_MS) * MS, Level.OK),
    ]
    assert all(step.state is not None and step.state.level == Level.OK for step in steps[1:])


def test_the_state_of_a_sample_agrees_with_the_library():
    supervisor, q = ready(pose=(0.1, -0.8))
    state = supervisor.step(sample(0, q, effort=(1.0, 2.0))).state
    found = supervisor.robot.evaluate(q, force=10.0)
    assert state.pose == pytest.approx((0.1, -0.8), abs=1e-12)
    assert state.type1_margin == pytest.approx(found.type1_margin, abs=1e-12)
    assert state.type2_margin == pytest.approx(found.type2_margin, abs=1e-12)
    assert state.constraint_margin == pytest.approx(found.constraint_margin, abs=1e-12)
    assert state.pressure_angle == pytest.approx(found.pressure_angle, abs=1e-9)
    assert state.clearance == pytest.approx(found.clearance)
    assert (state.working_mode, state.assembly_mode) == (found.working_mode, found.assembly_mode)
    forces = np.array([-1.0, -2.0]) / np.diag(supervisor.robot.jacobians(found.pose, q)[1])
    assert state.reaction == pytest.approx(forces)
    assert state.stop_margin <= min(*state.type1_margin, state.type2_margin, state.constraint_margin)


def test_a_verdict_comes_with_every_change_and_at_least_every_heartbeat():
    supervisor, q = ready()
    spoken = [ms for ms in range(300) if supervisor.step(sample(ms, q)).verdict is not None]
    assert np.diff([-HEARTBEAT_MS, *spoken]).max() <= HEARTBEAT_MS
    stopped = supervisor.step(sample(300, (nan, nan)))
    assert stopped.verdict is not None
    assert stopped.verdict.level == Level.UNKNOWN


@pytest.mark.parametrize("early_ms", [0.0, 0.2, 3.0])
def test_no_tick_of_the_timer_is_dropped_for_coming_early(early_ms: float):
    """Timers keep their average period: a tick that was late is followed by one that seems early."""
    supervisor, _q = ready()
    due = [HEARTBEAT_MS * number - early_ms * (number % 2) for number in range(1, 40)]
    spoken = [ms for ms in due if supervisor.step(tick(ms)).verdict is not None]
    assert spoken == due


def test_a_tick_repeats_no_verdict_that_was_spoken_just_now():
    supervisor, _q = ready()
    assert supervisor.step(sample(100.0, (nan, nan))).verdict is not None
    assert supervisor.step(tick(100.5)).verdict is None
    assert supervisor.step(tick(102.0)).verdict is not None


def test_verdicts_are_numbered_and_carry_the_hash_of_the_settings():
    supervisor, q = ready()
    verdicts = [step.verdict for step in feed(supervisor, resting(0, 100, q)) if step.verdict is not None]
    assert len(verdicts) >= 9
    assert set(np.diff([verdict.sequence for verdict in verdicts])) == {1}
    assert {verdict.config_hash for verdict in verdicts} == {supervisor.settings.config_hash}


def test_joints_in_another_order_are_the_same_robot():
    one, q = ready()
    other, _ = ready()
    for ms in range(20):
        given = approach(q, ms, (1.0, 0.5))
        turned = given._replace(
            names=JOINTS[::-1], position=given.position[::-1], velocity=given.velocity[::-1], effort=given.effort[::-1]
        )
        assert repr(one.step(given)) == repr(other.step(turned))


# --- samples that come late -------------------------------------------------------------------------------------


def with_pauses(supervisor: Supervisor, make, pause_ms: int = 26, number: int = 3) -> list[Step]:
    """Samples every millisecond, and pauses of the machine, after each of which only the newest sample is judged."""
    times = [ms for k in range(number) for ms in range(k * (20 + pause_ms), k * (20 + pause_ms) + 20)]
    return feed(supervisor, [make(ms) for ms in times])


@pytest.mark.parametrize("z", [-0.85, -1.1, -1.15])
def test_late_samples_do_not_stop_a_robot_at_rest_but_its_state_is_unknown(z):
    """At 400 rad/s2 a joint could get 0.6 rad far in two pauses: no posture has that room."""
    supervisor, q = ready(pose=(0.0, z))
    steps = with_pauses(supervisor, lambda ms: sample(ms, q))
    late = newest(steps)
    assert (late.level, late.latched, late.event) == (Level.UNKNOWN, False, 0)
    assert late.causes & Cause.STALE
    assert "samples come late, by now the next may be judged 32 ms after this one" in late.text  # 27 and 5 for judging
    steps += feed(supervisor, resting(112, 500, q))
    assert level_in_force(steps) <= Level.WARN
    assert not any(step.verdict.latched for step in steps if step.verdict is not None)


def test_a_busy_start_latches_no_stop_of_a_robot_at_rest():
    """Its first samples come as rarely as those of a sender that is too slow, until the interval is known."""
    supervisor = supervisor_of("irsbot2")
    q = joints_of(supervisor, 0.0, -0.85)
    steps = feed(supervisor, [sample(ms, q) for ms in (0, 45, 85, *range(90, 600))])
    assert newest(steps).level == Level.OK
    assert not any(turn.latched for step in steps for turn in step.transitions)


def test_a_sender_that_is_as_slow_as_that_stops_the_robot():
    supervisor, q = ready()
    slow = newest([supervisor.step(sample(27 * k, q)) for k in range(10)])
    assert (slow.level, slow.latched) == (Level.STOP, True)


def test_samples_that_jitter_within_a_heartbeat_are_not_late():
    supervisor, q = ready(pose=BOUNDARY)
    times = [ms for ms in range(80) if ms % 20 not in range(1, 7)]
    transitions = [turn for ms in times for turn in supervisor.step(approach(q, ms, (-3.0, 3.0))).transitions]
    assert [turn.level for turn in transitions][-1] == Level.STOP
    assert Level.UNKNOWN not in [turn.level for turn in transitions]


def test_a_robot_that_moves_towards_a_limit_is_stopped_however_late_samples_come():
    supervisor, q = ready(pose=BOUNDARY)
    steps = with_pauses(supervisor, lambda ms: approach(q, ms, (-3.0, 3.0)), number=4)
    seen = [(step.state, newest(steps[: k + 1]).level) for k, step in enumerate(steps)]
    stop = supervisor.settings.type1_stop
    assert all(level >= Level.STOP for state, level in seen if min(state.type1_margin) < stop + 0.05)
    assert min(min(state.type1_margin) for state, _level in seen) < stop, "it never got there: the test proves nothing"
    assert newest(steps).latched


# --- data that says nothing -------------------------------------------------------------------------------------

BAD = {
    "a NaN position": (lambda ms, q: sample(ms, (nan, q[1])), Cause.NONFINITE),
    "an infinite position": (lambda ms, q: sample(ms, (q[0], -inf)), Cause.NONFINITE),
    "a position beyond all reason": (lambda ms, q: sample(ms, (q[0], 1e308)), Cause.IMPLAUSIBLE),
    "no names": (lambda ms, q: JointSample(*sample(ms, q)[:3], (), ()), Cause.NAMES),
    "a missing joint": (lambda ms, q: sample(ms, q[:1], names=JOINTS[:1]), Cause.NAMES),
    "a doubled joint": (lambda ms, q: sample(ms, (*q, q[0]), names=(*JOINTS, JOINTS[0])), Cause.NAMES),
    "too few positions": (lambda ms, q: sample(ms, q[:1], names=JOINTS), Cause.NAMES),
    "too many velocities": (lambda ms, q: sample(ms, q, (0.0, 0.0, 0.0)), Cause.NAMES),
    "an old stamp": (lambda ms, q: sample(ms, q, age_ms=201.0), Cause.STAMP),
    "a stamp of the future": (lambda ms, q: sample(ms, q, age_ms=-21.0), Cause.STAMP),
    "a stamp of zero": (lambda ms, q: sample(ms, q)._replace(stamp_ns=0), Cause.STAMP),
    "a jump": (lambda ms, q: sample(ms, (q[0] + 0.5, q[1])), Cause.IMPLAUSIBLE),
}
bad = pytest.mark.parametrize(("make", "cause"), BAD.values(), ids=BAD)


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
    supervisor, q = ready()
    for ms in range(40):
        step = supervisor.step(sample(ms, q, age_ms=ms + 5.0))
        assert step.state.level == Level.UNKNOWN  # nothing follows from this sample ...
        assert step.state.causes == Cause.STAMP
        assert step.verdict is None or step.verdict.level == Level.OK  # ... and the one before still counts
    assert level_in_force(feed(supervisor, [tick(ms) for ms in range(40, 60)])) == Level.UNKNOWN


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
    """Within 40 ms drives at 400 rad/s2 reach their full speed: where nothing is known for so long nothing is safe."""
    supervisor, q = ready()
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
    assert expectation(steps)[0].causes == Cause.STALE


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


# --- the branch -------------------------------------------------------------------------------------------------


def test_another_working_mode_is_a_loss_of_the_branch_that_a_look_does_not_cure():
    supervisor = supervisor_of()
    wrong = tuple(supervisor.robot.inverse((0.0, -0.85), (-1, -1)).tolist())
    steps = feed(supervisor, resting(0, 200, wrong))
    assert (level_in_force(steps), newest(steps).latched) == (Level.UNKNOWN, True)
    assert newest(steps).causes & Cause.BRANCH
    assert "mode" in supervisor.step(reset(200, newest(steps).event)).refusal
    assert supervisor.step(sample(201, wrong)).state.level == Level.UNKNOWN


@pytest.mark.parametrize("gap_m", [0.0, 1e-12, 1e-9, 1e-7, 9e-7, 1.1e-6, 1e-4, 1e-2])
def test_near_a_type_2_locus_nothing_is_ok_and_contact_is_latched_as_a_loss_of_the_branch(gap_m):
    """Elbows of irsbot2_beta45 that are `gap_m` apart: the cranks stand mirrored with b0 + l1 cos q2 = gap/2."""
    supervisor = supervisor_of("irsbot2_beta45")
    geometry = supervisor.robot.mechanism.geometry
    q2 = -np.arccos((0.5 * gap_m - geometry.b0) / geometry.l1)
    q = (float(-np.pi - q2), float(q2))
    steps = feed(supervisor, resting(0, 100, q))
    for step in steps:
        assert step.state.level in (Level.STOP, Level.UNKNOWN)
        assert step.state.causes & (Cause.TYPE2 | Cause.NOT_ASSEMBLED)
    verdict = newest(steps)
    assert verdict.latched
    touched = bool(verdict.causes & Cause.BRANCH)
    assert touched == (gap_m <= 1e-6)
    away = joints_of(supervisor, 0.0, -0.8)
    steps = feed(supervisor, resting(2000, 2200, away))
    assert newest(steps).latched
    assert newest(steps).level == Level.UNKNOWN  # who knows what it met in two seconds, so near to the locus
    assert newest(steps).causes & Cause.BRANCH


def test_legs_that_come_apart_have_passed_type_2_and_the_branch_is_lost():
    """Rods in line: the elbows of irsbot2 are farther apart than both rods reach."""
    supervisor = supervisor_of("irsbot2")
    geometry = supervisor.robot.mechanism.geometry
    assert 2.0 * (geometry.l1 + geometry.b0) < 2.0 * geometry.l2eq, "the fixture needs a design that cannot come apart"
    csc = supervisor_of("irsbot2_csc")
    wide = (float(np.pi), 0.0)  # both cranks point outwards
    assert csc.robot.mechanism.posture(wide, -1).status == irs.Status.UNREACHABLE
    steps = feed(csc, [sample(ms, wide) for ms in range(100)])
    assert newest(steps).latched
    assert newest(steps).causes & Cause.BRANCH
    assert all(step.state.causes == Cause.BRANCH | Cause.NOT_ASSEMBLED for step in steps)
    assert all(isnan(step.state.type2_margin) for step in steps)


def test_a_jump_that_stays_is_latched_until_a_reset():
    supervisor, q = ready()
    steps = feed(supervisor, resting(0, 250, (q[0] + 0.2, q[1])))
    verdict = newest(steps)
    assert verdict.latched
    assert verdict.causes & Cause.BRANCH
    assert supervisor.step(reset(250, verdict.event)).refusal == ""
    assert level_in_force(feed(supervisor, resting(251, 300, (q[0] + 0.2, q[1])))) == Level.OK


@pytest.mark.parametrize("back_ms", [0.0, 5000.0], ids=["same clock", "clock set back"])
def test_a_silence_in_which_the_robot_may_have_met_a_type_2_singularity_latches_the_loss_of_the_branch(back_ms):
    """From z = -0.9 m to +0.7 m in 0.4 s; each of both postures by itself is good."""
    supervisor = supervisor_of()
    first, then = (2.7, 0.44), (0.0, 3.14)
    feed(supervisor, resting(-300, 0, first))
    assert supervisor.step(sample(0, first)).state.level == Level.OK
    ends = [supervisor.robot.direct(q, supervisor.settings.assembly_mode)[1] for q in (first, then)]
    assert ends[0] * ends[1] < 0.0, "the platform has not changed sides: the fixture proves nothing"
    steps = feed(supervisor, [set_back(one, back_ms) for one in resting(400, 700, then)])
    assert newest(steps).latched
    assert newest(steps).causes & Cause.BRANCH
    assert all(one.level != Level.OK for one in expectation(steps))


def set_back(one: JointSample, back_ms: float) -> JointSample:
    """A sample as it comes after the ROS clock, which sender and receiver share, was set back."""
    back_ns = round(back_ms * MS)
    return one._replace(stamp_ns=one.stamp_ns - back_ns, received_ns=one.received_ns - back_ns)


@pytest.mark.parametrize("silence_ms", [60, 400, 5000])
@pytest.mark.parametrize("back_ms", [0.0, 5000.0], ids=["same clock", "clock set back"])
def test_a_silence_in_a_good_posture_at_rest_loses_no_branch(silence_ms, back_ms):
    """Also where the clocks are set meanwhile."""
    supervisor, q = ready()
    steps = feed(supervisor, [set_back(one, back_ms) for one in resting(silence_ms, silence_ms + 300, q)])
    assert not newest(steps).latched
    assert level_in_force(steps) == Level.OK


# --- stop and reset ---------------------------------------------------------------------------------------------


def stopped() -> tuple[Supervisor, tuple[float, ...], Verdict]:
    """A supervisor that has stopped a run at the boundary, and where the robot then rests, well inside again."""
    supervisor, q = ready(pose=BOUNDARY)
    steps = feed(supervisor, [approach(q, ms, (-6.0, 0.0)) for ms in range(1, 75)])
    verdict = newest(steps)
    assert verdict.level == Level.STOP, "the run was not stopped: the fixture proves nothing"
    steps = feed(supervisor, resting(2000, 2400, q))  # the operator has moved it back meanwhile
    assert newest(steps).latched
    return supervisor, q, newest(steps)


def test_a_stop_names_cause_value_limit_and_a_way_out():
    supervisor, q = ready(pose=BOUNDARY)
    steps = feed(supervisor, [approach(q, ms, (-6.0, 0.0)) for ms in range(1, 75)])
    stop = next(step.verdict for step in steps if step.verdict is not None and step.verdict.level == Level.STOP)
    assert stop.latched
    assert stop.event == 1
    assert stop.speed_scale == 0.0
    assert stop.causes & Cause.BRAKING
    finding = next(one for one in stop.findings if one.level == Level.STOP)
    assert finding.value < finding.limit == 0.15
    assert finding.text in stop.text
    assert np.hypot(*stop.escape_direction) == pytest.approx(1.0)
    at = next(step.state for step in steps if step.verdict is stop)
    kind = 0 if finding.cause & Cause.TYPE1 else 1
    ahead = supervisor.robot.evaluate(np.add(at.joint_position, np.multiply(1e-3, stop.escape_direction)))
    now = supervisor.robot.evaluate(at.joint_position)
    assert (min(ahead.type1_margin), ahead.type2_margin)[kind] > (min(now.type1_margin), now.type2_margin)[kind]


def test_a_stop_is_ended_by_its_number_and_work_goes_on():
    supervisor, q, verdict = stopped()
    answer = supervisor.step(reset(2400, verdict.event))
    assert answer.refusal == ""
    assert (answer.verdict.level <= Level.WARN, answer.verdict.latched) == (True, False)
    assert all(one.level <= Level.WARN for one in expectation(feed(supervisor, resting(2401, 2600, q))))


@pytest.mark.parametrize("offset", [-1, 1, 7])
def test_another_number_ends_nothing(offset):
    supervisor, q, verdict = stopped()
    assert str(verdict.event) in supervisor.step(reset(2400, verdict.event + offset)).refusal
    assert newest(feed(supervisor, resting(2401, 2450, q))).latched


def test_a_robot_that_moves_is_not_reset():
    supervisor, q, verdict = stopped()
    feed(supervisor, [approach(q, ms, (0.5, 0.0), 2400) for ms in range(2400, 2450)])
    assert "standing" in supervisor.step(reset(2450, verdict.event)).refusal


@bad
def test_no_stop_is_reset_while_the_newest_data_is_bad(make, cause):
    supervisor, q, verdict = stopped()
    feed(supervisor, [make(ms, q) for ms in range(2400, 2410)])
    answer = supervisor.step(reset(2410, verdict.event))
    assert "not known" in answer.refusal
    assert newest([answer, *feed(supervisor, resting(2411, 2500, q))]).latched


def test_no_stop_is_reset_in_silence():
    supervisor, _q, verdict = stopped()
    assert "no good sample" in supervisor.step(reset(2451, verdict.event)).refusal
    assert "no good sample" in supervisor_of().step(reset(0, 0)).refusal


def test_no_stop_is_reset_while_its_cause_is_there():
    supervisor, q = ready(pose=BOUNDARY)
    steps = feed(supervisor, [approach(q, ms, (-6.0, 0.0)) for ms in range(1, 85)])
    near = steps[-1].state.joint_position
    steps = feed(supervisor, resting(100, 400, near))
    assert min(steps[-1].state.type1_margin) < 0.15, "the robot is not near: the fixture proves nothing"
    assert "still there" in supervisor.step(reset(400, newest(steps).event)).refusal


def test_a_refused_reset_confirms_nothing():
    """The branch is lost and the posture bad: the operator may not reset, and his try must not be remembered."""
    supervisor = supervisor_of("irsbot2_beta45")
    geometry = supervisor.robot.mechanism.geometry
    q2 = float(-np.arccos(-geometry.b0 / geometry.l1))
    contact = (-np.pi - q2, q2)
    event = newest(feed(supervisor, resting(0, 60, contact))).event
    beside = (contact[0] + 0.01, contact[1] - 0.01)
    feed(supervisor, resting(60, 160, beside))
    assert supervisor.step(reset(160, event)).refusal
    assert supervisor.step(sample(161, beside)).state.causes & Cause.BRANCH


@pytest.mark.parametrize("event", [0, 1, 2])
def test_a_reset_cannot_be_armed_beforehand(event):
    supervisor, q = ready(pose=BOUNDARY)
    for ms in range(1, 75):
        assert supervisor.step(reset(ms, event)).refusal
        step = supervisor.step(approach(q, ms, (-6.0, 0.0)))
    assert step.state.level == Level.STOP
    assert newest([supervisor.step(tick(100))]).latched


def test_the_seed_pose_of_a_reset_determines_the_assembly_mode():
    supervisor, q, verdict = stopped()
    other = supervisor.robot.direct(q, 1)
    assert "assembly mode" in supervisor.step(reset(2400, verdict.event)._replace(seed_pose=tuple(other))).refusal
    for nonsense in ((nan, nan), (1.0,), (0.0, -0.8, 0.0), (inf, 0.0)):
        assert supervisor.step(reset(2401, verdict.event)._replace(seed_pose=nonsense)).refusal
    for elsewhere in ((300.0, -700.0), (40.0, 3.0)):  # millimetres; another frame
        refusal = supervisor.step(reset(2401, verdict.event)._replace(seed_pose=elsewhere)).refusal
        assert "too far from every pose" in refusal
    assert (
        supervisor.step(reset(2402, verdict.event)._replace(seed_pose=(1.0, -0.6))).refusal == ""
    )  # it is at (1.04, -0.49)


# --- a restart ---------------------------------------------------------------------------------------------------


def test_after_a_restart_nothing_is_known_until_a_reset_and_no_old_number_resets_it():
    supervisor = supervisor_of()
    q = joints_of(supervisor, 0.0, -0.85)
    first = supervisor.step(Restart(*at_ns(-300), 1_700_000_000)).verdict
    assert first is not None
    assert (first.level, first.latched, first.event) == (Level.UNKNOWN, True, 1_700_000_000)
    steps = feed(supervisor, resting(-300, 200, q))
    assert all(one.latched and one.level == Level.UNKNOWN for one in expectation(steps))
    assert newest(steps).causes & Cause.BRANCH
    assert "started again" in newest(steps).text
    assert "is not the stop in force" in supervisor.step(reset(200, 1)).refusal
    assert supervisor.step(reset(200, first.event)).refusal == ""
    assert level_in_force(feed(supervisor, resting(201, 260, q))) == Level.OK


def test_a_restart_is_replayed_from_its_line_of_the_journal():
    event = Restart(1, 2, 3)
    assert read_entry(write_entry(event)) == event
    with pytest.raises(JournalError):
        read_entry('{"kind": "restart", "received_ns": 1, "seen_ns": 2}')


# --- settings and errors ----------------------------------------------------------------------------------------


def test_new_settings_hold_from_the_next_sample_and_are_named_by_the_verdict():
    supervisor, q = ready()
    margin = supervisor.step(sample(0, q)).state.type2_margin
    answer = supervisor.step(configure(1, supervisor, type2_warn=margin + 0.05, type2_stop=0.1))
    assert answer.verdict.config_hash == supervisor.settings.config_hash
    assert supervisor.step(sample(2, q)).state.causes & Cause.TYPE2


def test_settings_that_are_refused_leave_the_old_ones_in_force():
    supervisor, q = ready()
    before = supervisor.settings
    with pytest.raises(InvalidSettings, match=r"type1_warn \(0\.01\).*type1_stop \(0\.15\)"):
        supervisor.step(configure(0, supervisor, type1_warn=0.01))
    assert supervisor.settings is before
    assert supervisor.step(sample(1, q)).state.level == Level.OK


@pytest.mark.parametrize(
    "change",
    [{"joint_names": ["joint_2", "joint_1"]}, {"working_mode": [-1, 1]}, {"assembly_mode": 1}, {"robot": "five_bar"}],
)
def test_a_read_only_setting_does_not_change_while_supervising(change):
    """With names in another order the joints would go on being taken in the old one."""
    supervisor, q = ready()
    with pytest.raises(InvalidSettings, match="cannot become"):
        supervisor.step(configure(0, supervisor, **change))
    assert supervisor.step(sample(1, q)).state.level == Level.OK


def test_no_change_of_settings_clears_a_stop():
    supervisor, q, verdict = stopped()
    for ms, change in enumerate(({"type1_stop": 0.001}, {"dwell_s": 0.0}, {"stale_s": 10.0}), 2400):
        answer = supervisor.step(configure(ms, supervisor, **change))
        assert (answer.verdict.latched, answer.verdict.event) == (True, verdict.event)
    assert newest(feed(supervisor, resting(2410, 2600, q))).latched


def test_the_findings_of_a_bad_sample_end_with_the_silence_after_it():
    """A joint that was missing five seconds ago: by now nobody speaks at all, and that is the reason."""
    supervisor, q = ready(dwell_s=0.0)
    newest(feed(supervisor, [sample(ms, q[:1], names=JOINTS[:1]) for ms in range(100)]))
    missing = supervisor.step(tick(110)).verdict
    assert missing is not None
    assert missing.causes & Cause.NAMES
    later = supervisor.step(tick(5000)).verdict
    assert later is not None
    assert (later.level, later.causes) == (Level.UNKNOWN, Cause.STALE)


def test_a_joint_that_was_never_there_is_no_reason_once_nothing_comes():
    supervisor = supervisor_of(dwell_s=0.0)
    q = joints_of(supervisor, 0.0, -0.85)
    feed(supervisor, [sample(ms, q[:1], names=JOINTS[:1]) for ms in range(100)])
    later = supervisor.step(tick(5000)).verdict
    assert later is not None
    assert (later.level, later.causes) == (Level.UNKNOWN, Cause.NO_DATA)


def test_an_error_inside_is_unknown_until_a_sample_is_judged_without_one():
    supervisor, q = ready(dwell_s=0.0)
    verdict = supervisor.fail(sample(0, q).seen_ns, ZeroDivisionError("division by zero")).verdict
    assert (verdict.level, verdict.causes) == (Level.UNKNOWN, Cause.INTERNAL)
    assert "division by zero" in verdict.text
    steps = feed(supervisor, [tick(ms / 10) for ms in range(1, 400)])
    assert {step.verdict.level for step in steps if step.verdict is not None} == {Level.UNKNOWN}
    assert level_in_force(feed(supervisor, resting(40, 43, q))) == Level.OK


def test_only_a_change_of_content_alters_the_hash():
    supervisor, _q = ready()
    assert supervisor.settings.config_hash == settings_of()[0].config_hash
