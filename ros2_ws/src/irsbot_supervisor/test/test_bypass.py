"""An operator bypasses one cause: who gets a bypass, what it lets pass, what ends it."""

from __future__ import annotations

from math import inf, nan

import pytest
from bypassed import ALONE, BEYOND, SHARE, bypass, leave, run, stopped, verdict
from supervised import at_ns, configure, feed, joints_of, reset, resting, sample, supervisor_of, tick

from irsbot_msgs_py.records import Cause, Floats, Level
from irsbot_supervisor.core.bypass import STOPPING

# --- who gets one --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"event": 0}, "event 0 is not the stop in force, which is 1"),
        ({"event": 2}, "event 2"),
        ({"cause": 0}, "cannot be bypassed"),
        ({"cause": int(Cause.TYPE1 | Cause.TYPE2)}, "cannot be bypassed"),
        ({"cause": int(Cause.TYPE1 | Cause.BRAKING)}, "cannot be bypassed"),
        ({"cause": -1}, "cannot be bypassed"),
        ({"cause": int(Cause.TYPE2)}, "TYPE2 does not stop now: Type 1 margin"),
        ({"duration_s": 0.0}, "duration"),
        ({"duration_s": -1.0}, "duration"),
        ({"duration_s": 60.001}, "at most 60 s"),
        ({"duration_s": nan}, "duration is nan"),
        ({"duration_s": inf}, "duration is inf"),
        ({"operator": ""}, "name"),
        ({"operator": " \t"}, "name"),
        ({"reason": ""}, "reason"),
        ({"reason": "\n\0"}, "reason"),
    ],
)
def test_a_wish_that_is_not_exact_is_refused_and_changes_nothing(changes: dict[str, object], words: str):
    supervisor, _joints = stopped()
    before = supervisor._latch.now
    step = supervisor.step(bypass(1, **changes))
    assert words in step.refusal
    assert supervisor._latch.now == before
    now = verdict(supervisor, 2)
    assert (now.level, now.latched, now.event, now.bypassed, now.bypass_left) == (Level.STOP, True, 1, 0, 0.0)


@pytest.mark.parametrize("cause", [c for c in Cause if c and c not in STOPPING], ids=lambda c: c.name)
def test_no_cause_of_unknown_can_be_bypassed(cause: Cause):
    supervisor, _joints = stopped()
    assert "cannot be bypassed" in supervisor.step(bypass(1, cause=int(cause))).refusal


def test_all_that_policies_stop_for_can_be_bypassed_and_nothing_else():
    assert {*STOPPING} == {Cause.TYPE1, Cause.TYPE2, Cause.CONSTRAINT, Cause.LIMB, Cause.REACTION}


def test_a_robot_that_moves_gets_none():
    supervisor, joints = stopped()
    for ms in range(1, 30):
        supervisor.step(sample(ms, [q + 5e-5 * ms for q in joints], (0.05, 0.05)))
    assert supervisor.step(bypass(30)).refusal == "the robot is not standing still"
    assert verdict(supervisor, 31).latched


def test_without_a_stop_there_is_nothing_to_bypass():
    supervisor = supervisor_of(**ALONE)
    assert supervisor.step(bypass(-500)).refusal == "no good sample to judge by"
    feed(supervisor, resting(-400, 0, joints_of(supervisor, 0.0, -1.1)))
    assert "no stop is latched" in supervisor.step(bypass(1, event=0)).refusal


def test_a_cause_of_unknown_is_never_bypassed():
    supervisor, joints = stopped()
    supervisor.step(sample(1, (nan, nan)))
    assert "not known" in supervisor.step(bypass(1.5)).refusal
    run(supervisor, 2, 20, joints)
    assert "not known until just now" in supervisor.step(bypass(20)).refusal
    run(supervisor, 20, 100, joints)
    supervisor.step(tick(200))  # silence
    assert supervisor.step(bypass(201)).refusal == "no good sample to judge by"


def test_a_lost_branch_is_never_bypassed():
    supervisor, joints = stopped()
    jumped = joints_of(supervisor, 0.1, -1.19)
    feed(supervisor, resting(1, 300, jumped))
    now = verdict(supervisor, 300)
    assert now.causes & Cause.BRANCH, "a jump loses the branch"
    assert "the branch is lost" in supervisor.step(bypass(301, event=now.event)).refusal
    assert joints != jumped


def test_a_second_cause_that_stops_forbids_it():
    warned = supervisor_of(**{**ALONE, "type2_warn": 0.25})
    run(warned, -400, 0, joints_of(warned, *BEYOND))
    assert warned.step(bypass(1)).refusal == ""  # a second one that warns does not
    other = supervisor_of(constraint_stop=0.001)  # the other limits are at 0.15
    run(other, -400, 0, joints_of(other, *BEYOND))
    for cause in (Cause.TYPE1, Cause.TYPE2):
        assert "another cause than" in other.step(bypass(1, cause=int(cause))).refusal


def test_a_cause_that_is_gone_needs_a_reset_and_no_bypass():
    supervisor, _joints = stopped()
    run(supervisor, 1001, 1300, leave(supervisor, 1, 1000))
    assert "TYPE1 does not stop now: reset the stop" in supervisor.step(bypass(1300)).refusal
    assert supervisor.step(reset(1301, 1)).refusal == ""


# --- what it lets pass, and until when -----------------------------------------------------------------------------


def test_while_it_is_in_force_its_cause_warns_and_motion_is_slow():
    supervisor, joints = stopped()
    step = supervisor.step(bypass(1))
    assert step.refusal == ""
    assert step.verdict is not None
    assert [turn.level for turn in step.transitions] == [Level.WARN]
    run(supervisor, 2, 2001, joints)
    now = verdict(supervisor, 2001)
    assert (now.level, now.causes, now.latched, now.event) == (Level.WARN, Cause.TYPE1, False, 1)
    assert (now.bypassed, now.speed_scale) == (Cause.TYPE1, SHARE)
    assert now.bypass_left == pytest.approx(8.0)
    # 1 700 000 000 s is 2023-11-14 22:13:20 UTC
    assert now.text.startswith("bypassed by Ada until 22:13:30 UTC, free the gripper: Type 1 margin 0.1496, limit 0.15")
    assert [(finding.level, finding.cause) for finding in now.findings] == [(Level.WARN, Cause.TYPE1)]


def test_when_its_time_is_over_the_cause_stops_again_as_another_event_from_that_moment_on():
    supervisor, joints = stopped()
    supervisor.step(bypass(1, duration_s=0.5))
    feed(supervisor, resting(2, 530, joints)[:480])  # the last sample at 481 ms
    assert verdict(supervisor, 500.9).level == Level.WARN
    step = supervisor.step(tick(520))
    assert step.verdict is not None
    assert step.verdict.since_ns == at_ns(501)[1]
    now = step.verdict
    assert (now.level, now.causes, now.latched, now.event) == (Level.STOP, Cause.TYPE1 | Cause.LATCHED, True, 2)
    assert (now.bypassed, now.bypass_left) == (0, 0.0)
    assert "bypassed" not in now.text
    run(supervisor, 521, 600, joints)
    assert "event 1" in supervisor.step(bypass(600)).refusal  # the old number is of no use
    assert supervisor.step(bypass(601, event=2)).refusal == ""  # whoever looks again may go on


def test_a_robot_that_has_left_by_then_goes_on():
    supervisor, _joints = stopped()
    supervisor.step(bypass(1, duration_s=2.0))
    inside = leave(supervisor, 2, 1000)
    run(supervisor, 1002, 1500, inside)
    passed = verdict(supervisor, 1500)
    assert (passed.level, passed.bypassed, passed.speed_scale) == (Level.OK, Cause.TYPE1, SHARE)
    run(supervisor, 1501, 2100, inside)
    now = verdict(supervisor, 2100)
    assert (now.level, now.bypassed, now.speed_scale, now.latched, now.event) == (Level.OK, 0, 1.0, False, 1)
    assert now.since_ns == at_ns(2001)[1]


def test_slow_motion_deeper_into_it_passes_and_fast_motion_ends_it():
    supervisor, joints = stopped()
    slow = SHARE * supervisor.settings.velocity_limit[0]
    supervisor.step(bypass(1))
    deeper = joints_of(supervisor, BEYOND[0], BEYOND[1] - 1e-3)
    step = [
        (b - a) / max(abs(b - a) for a, b in zip(joints, deeper, strict=True))
        for a, b in zip(joints, deeper, strict=True)
    ]
    at = list(joints)
    for ms in range(2, 12):
        supervisor.step(sample(ms, at, [0.5 * slow * s for s in step]))
        at = [q + 0.5e-3 * slow * s for q, s in zip(at, step, strict=True)]
    now = verdict(supervisor, 12)
    assert (now.level, now.bypassed) == (Level.WARN, Cause.TYPE1)
    assert any(finding.cause == Cause.TYPE1 | Cause.BRAKING or finding.cause == Cause.TYPE1 for finding in now.findings)
    for ms in range(12, 24):
        supervisor.step(sample(ms, at, [1.5 * slow * s for s in step]))
        at = [q + 1.5e-3 * slow * s for q, s in zip(at, step, strict=True)]
    now = verdict(supervisor, 24)
    assert (now.level, now.latched, now.event, now.bypassed) == (Level.STOP, True, 2, 0)


# --- what ends it --------------------------------------------------------------------------------------------------


def test_another_cause_that_stops_ends_it():
    supervisor, joints = stopped()
    supervisor.step(bypass(1))
    run(supervisor, 2, 100, joints)
    supervisor.step(configure(100, supervisor, type2_stop=0.15, type2_warn=0.25))
    run(supervisor, 101, 103, joints)
    now = verdict(supervisor, 104)
    assert (now.level, now.latched, now.event, now.bypassed) == (Level.STOP, True, 2, 0)
    assert now.causes & Cause.TYPE1
    assert now.causes & Cause.TYPE2


@pytest.mark.parametrize("bad", [(nan, nan), (0.0, inf)])
def test_a_rejected_sample_ends_it_and_the_cause_stops_again(bad: Floats):
    supervisor, joints = stopped()
    supervisor.step(bypass(1))
    run(supervisor, 2, 100, joints)
    supervisor.step(sample(100, bad))
    now = verdict(supervisor, 100.5)
    assert (now.level, now.bypassed, now.speed_scale) == (Level.UNKNOWN, 0, 0.0)
    run(supervisor, 101, 400, joints)
    now = verdict(supervisor, 400)
    assert (now.level, now.latched, now.event, now.bypassed) == (Level.STOP, True, 2, 0)


def test_silence_ends_it_at_its_limit_and_an_error_at_once():
    supervisor, joints = stopped()
    supervisor.step(bypass(1))
    run(supervisor, 2, 100, joints)
    now = verdict(supervisor, 160)
    assert (now.level, now.bypassed, now.since_ns) == (Level.UNKNOWN, 0, at_ns(149)[1])
    supervisor, joints = stopped()
    supervisor.step(bypass(1))
    failed = supervisor.fail(at_ns(2)[1], "an error")
    assert (failed.verdict.level, failed.verdict.bypassed) == (Level.UNKNOWN, 0)


def test_other_settings_change_its_speed_and_not_its_end():
    supervisor, joints = stopped()
    supervisor.step(bypass(1, duration_s=0.2))
    run(supervisor, 2, 50, joints)
    supervisor.step(configure(50, supervisor, recovery_share=0.02))
    run(supervisor, 51, 100, joints)
    assert verdict(supervisor, 100).speed_scale == 0.02
    run(supervisor, 101, 210, joints)
    assert verdict(supervisor, 210).since_ns == at_ns(201)[1]
