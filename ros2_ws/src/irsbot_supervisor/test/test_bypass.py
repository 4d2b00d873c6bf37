"""A bypass: who gets one, what it lets pass, what ends it, and that all of it replays."""

from __future__ import annotations

from dataclasses import replace
from math import inf, nan
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from supervised import MS, at_ns, configure, expectation, feed, joints_of, reset, resting, sample, supervisor_of, tick

from irsbot_msgs_py.records import Bypass, Cause, Floats, JointSample, Level, Verdict
from irsbot_supervisor.bag.bag_writer import BagWriter
from irsbot_supervisor.bag.journal import configured, read_entry, write_entry
from irsbot_supervisor.core.bypass import LONGEST_S, STOPPING, InForce
from irsbot_supervisor.core.events import Configure, Event
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.gate.velocity_gate import Gate
from irsbot_supervisor.replay.comparison import against_recording
from irsbot_supervisor.replay.recording import read_recording
from irsbot_supervisor.replay.rejudge import judge_again

BEYOND = 0.6, -1.0273
"""m: the Type 1 margin of the IRSBot-2 is 0.1496 here, the stop limit 0.15; the Type 2 margin is 0.182."""


ALONE = {"type2_warn": 0.02, "type2_stop": 0.01, "constraint_warn": 0.002, "constraint_stop": 0.001}
"""So that Type 1 is the only cause there."""

SHARE = 0.05
"""Shipped recovery_share."""


def stopped(**changes: object) -> tuple[Supervisor, Floats]:
    """A supervisor of a robot that stands beyond the Type 1 limit since -400 ms, and where it stands."""
    supervisor = supervisor_of(**{**ALONE, **changes})
    joints = joints_of(supervisor, *BEYOND)
    feed(supervisor, resting(-400, 0, joints))
    now = verdict(supervisor, 0)
    assert (now.level, now.causes, now.event) == (Level.STOP, Cause.TYPE1 | Cause.LATCHED, 1)
    return supervisor, joints


def verdict(supervisor: Supervisor, ms: float) -> Verdict:
    """What is in force at a time: the next heartbeat says it."""
    found = supervisor.step(tick(ms)).verdict
    return found if found is not None else supervisor._verdict(at_ns(ms)[1])


def bypass(ms: float, **changes: object) -> Bypass:
    wish = Bypass(*at_ns(ms), 1, int(Cause.TYPE1), 10.0, "Ada", "free the gripper")
    return wish._replace(**changes)


def run(supervisor: Supervisor, begin: int, end: int, joints: Floats) -> None:
    feed(supervisor, resting(begin, end, joints))


def leave(supervisor: Supervisor, begin: int, number: int) -> Floats:
    """So many samples of a slow way from there to where no limit is near; where it ends."""
    start, end = (joints_of(supervisor, BEYOND[0], y) for y in (BEYOND[1], -0.96))
    rates = [(b - a) * 1e3 / number for a, b in zip(start, end, strict=True)]
    for k in range(number):
        at = tuple(a + k * 1e-3 * rate for a, rate in zip(start, rates, strict=True))
        supervisor.step(sample(begin + k, at, rates))
    return at


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


# --- the command gate ----------------------------------------------------------------------------------------------


def test_the_gate_enforces_every_limit_except_the_bypassed_one():
    supervisor, joints = stopped()
    gate = Gate(supervisor.settings, supervisor.robot.mechanism)
    deeper = joints_of(supervisor, BEYOND[0], BEYOND[1] - 1e-3)
    inward = [100.0 * (b - a) for a, b in zip(joints, deeper, strict=True)]

    def passes() -> float:
        """Speed inward, as a share of the velocity limits, when the command has been repeated for a while."""
        for _ in range(30):
            rates = gate.velocity(inward, supervisor.view).rates
        size = float(np.hypot(*inward))
        return float(np.dot(rates, inward)) / size / max(supervisor.settings.velocity_limit)

    held = passes()
    supervisor.step(bypass(1))
    run(supervisor, 2, 10, joints)
    slow = passes()
    assert 0.0 <= 4.0 * held < slow <= np.sqrt(2.0) * SHARE  # both joints
    limits = gate.allowance(supervisor.view).limits
    assert limits[0] == -inf
    assert all(a >= b for a, b in zip(limits[1:3], (0.01, 0.001), strict=True))
    tight = replace(supervisor.settings, type2_stop=0.07, type2_warn=0.2)  # little more is left of it until standstill
    supervisor.step(Configure(*at_ns(10), tight))
    run(supervisor, 11, 15, joints)
    gate.configure(tight)
    assert verdict(supervisor, 15).bypassed == Cause.TYPE1
    assert 4.0 * passes() < slow


# --- the record ----------------------------------------------------------------------------------------------------


def test_a_journal_keeps_it_word_by_word():
    wish = bypass(1, reason="Grüße\n", duration_s=0.1)
    assert read_entry(write_entry(wish)) == wish


def test_a_bag_with_bypasses_is_judged_again_to_the_same_verdicts(tmp_path: Path):
    supervisor = supervisor_of(**ALONE)
    joints = joints_of(supervisor, *BEYOND)
    events: list[Event] = [*resting(-400, 0, joints), bypass(0.5, duration_s=0.2), *resting(1, 300, joints)]
    events += [bypass(300.5, event=2, duration_s=90.0), bypass(301.5, event=2, duration_s=30.0)]
    events += [*resting(302, 500, joints), sample(500, (nan, nan)), *resting(501, 800, joints)]
    first = configured(supervisor.settings, supervisor.robot, *at_ns(-401))
    heard: list[Verdict] = []
    with BagWriter(tmp_path / "bag.mcap") as writer:
        writer.add("supervisor/journal", write_entry(first), first.received_ns)
        for event in [Configure(*at_ns(-401), supervisor.settings), *events]:
            step = supervisor.step(event)
            if isinstance(event, JointSample):
                writer.add("joint_states", event, event.received_ns)
            if isinstance(event, Bypass):
                writer.add("supervisor/journal", write_entry(event), event.received_ns)
            if step.state is not None:
                writer.add("supervisor/state", step.state, event.received_ns)
            if step.verdict is not None:
                heard.append(step.verdict)
                writer.add("supervisor/verdict", step.verdict, event.received_ns)
    assert {one.event for one in heard} == {0, 1, 2, 3}
    assert {one.bypassed for one in heard} == {Cause.NONE, Cause.TYPE1}
    recording = read_recording(tmp_path / "bag.mcap")
    assert [repr(one.bypass_left) for _log_ns, one in recording.verdicts] == [repr(one.bypass_left) for one in heard]
    judged = judge_again(recording)
    assert [check.faults for check in against_recording(recording, judged)] == [(), ()]
    levels = [interval.level for interval in judged.intervals if interval.event]
    assert levels[:3] == [Level.UNKNOWN, Level.STOP, Level.WARN] or levels[:3] == [Level.STOP, Level.WARN, Level.STOP]


# --- whatever happens ----------------------------------------------------------------------------------------------

moves = st.one_of(
    st.tuples(st.just("stand"), st.integers(1, 150)),
    st.tuples(st.just("drift"), st.integers(1, 60)),
    st.tuples(st.just("bad"), st.sampled_from([nan, inf, 1e9, 0.7])),
    st.tuples(st.just("wait"), st.floats(1.0, 90.0)),
    st.tuples(st.just("bypass"), st.sampled_from([0.001, 0.05, 0.3, 60.0, 61.0, nan])),
    st.tuples(st.just("reset"), st.booleans()),
    st.tuples(st.just("settings"), st.sampled_from([0.009, 0.15])),
)


def played(script: list[tuple[str, object]]) -> tuple[list[Event], list[Event]]:
    """What a script does to a stopped robot, held against what may be known at every step. Returns what came before
    it, and its events."""
    supervisor, joints = stopped()
    before: list[Event] = [*resting(-400, 0, joints), tick(0)]
    events: list[Event] = []
    now, at, sound, seen, accepted_until, verdict_now = 1.0, list(joints), True, -1.0, -inf, verdict(supervisor, 0.5)

    def give(event: Event) -> str:
        nonlocal verdict_now, accepted_until
        step = supervisor.step(event)
        events.append(event)
        verdict_now = step.verdict or verdict_now
        if isinstance(event, Bypass) and not step.refusal:
            assert 0.0 < event.duration_s <= LONGEST_S
            assert sound
            accepted_until = now + 1e3 * event.duration_s
        if step.verdict is not None:
            known = sound and now - seen <= 50.0
            assert known or verdict_now.level == Level.UNKNOWN
            if verdict_now.bypassed:
                assert verdict_now.level <= Level.WARN
                assert verdict_now.speed_scale <= SHARE
                assert now <= accepted_until
                assert 0.0 <= verdict_now.bypass_left <= LONGEST_S
            elif verdict_now.level <= Level.WARN:
                raise AssertionError(f"motion beyond the limit without a bypass: {verdict_now}")
            if verdict_now.level == Level.UNKNOWN:
                assert not verdict_now.bypassed
        return step.refusal

    for kind, what in script:
        if kind in ("stand", "drift"):
            for _ in range(int(str(what))):
                if kind == "drift":
                    at = [q + 1e-6 for q in at]
                sound, seen = True, now
                give(sample(now, at, (0.001, 0.001) if kind == "drift" else (0.0, 0.0)))
                now += 1.0
        elif kind == "bad":
            sound = False
            give(sample(now, (float(str(what)), at[1])))
            now += 1.0
        elif kind == "wait":
            now += float(str(what))
            give(tick(now))
        elif kind == "bypass":
            give(bypass(now, event=verdict_now.event, duration_s=float(str(what))))
            now += 0.1
        elif kind == "reset":
            give(reset(now, verdict_now.event))
            now += 0.1
        else:
            stop = float(str(what))
            give(configure(now, supervisor, type2_stop=stop, type2_warn=max(stop, 0.02)))
            now += 0.1
    return before, events


@settings(max_examples=8, deadline=None)
@given(script=st.lists(moves, max_size=12), shares=st.lists(st.floats(0.001, 0.999), max_size=40))
def test_never_is_motion_allowed_beyond_a_limit_but_by_a_bypass_nor_where_anything_is_unknown(
    script: list[tuple[str, object]], shares: list[float]
):
    before, events = played([("stand", 5), ("bypass", 60.0), *script])
    given_again = [event for event in events if not hasattr(event, "_fields") or len(event) > 2]  # without ticks
    end_ms = (events[-1].seen_ns - tick(0).seen_ns) / MS
    expectations = []
    for phases in ([], shares):
        ticks = [tick(0.6 + (end_ms - 0.6) * share) for share in phases]
        mixed = sorted([*before, *given_again, *ticks], key=lambda event: event.seen_ns)
        supervisor = supervisor_of(**ALONE)
        expectations.append(expectation(feed(supervisor, [*mixed, tick(end_ms + 1e4)])))
    assert expectations[0] == expectations[1]  # when the timer ticks does not show


def test_a_bypass_covers_its_cause_now_or_before_standstill():
    supervisor, _joints = stopped()
    (finding,) = (one for one in supervisor._latch.now.findings if one.level == Level.STOP)
    force = InForce(int(Cause.TYPE1), 0, "words")
    assert force.covers(finding._replace(cause=Cause.TYPE1 | Cause.BRAKING))
    assert not force.covers(finding._replace(cause=Cause.TYPE2))
    assert force.is_ended_by(finding._replace(cause=Cause.TYPE1, level=Level.UNKNOWN))
    assert not force.is_ended_by(finding._replace(cause=Cause.TYPE2, level=Level.WARN))
