"""Events in, states and verdicts out: what is known is judged, what is not known is never called good."""

from __future__ import annotations

from math import nan

import numpy as np
import pytest
from supervised import (
    DWELL_MS,
    HEARTBEAT_MS,
    JOINTS,
    MS,
    SETTLING_MS,
    STEADY_NS,
    approach,
    configure,
    expectation,
    feed,
    joints_of,
    level_in_force,
    newest,
    ready,
    resting,
    sample,
    settings_of,
    stopped,
    supervisor_of,
    tick,
)

import irsbot_kinematics as irs
from irsbot_msgs_py.records import Cause, Level
from irsbot_supervisor.core.settings import InvalidSettings

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
    state = supervisor.step(sample(4, q, effort=(1.0, 2.0), age_ms=3.0)).state
    assert state.sample_age == pytest.approx(3e-3)
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
