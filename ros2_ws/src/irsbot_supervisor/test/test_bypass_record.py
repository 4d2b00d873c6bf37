"""Bypasses in the command gate, in the journal and in a replay; motion is never allowed beyond a limit but by one."""

from __future__ import annotations

from dataclasses import replace
from math import inf, nan
from pathlib import Path

import numpy as np
from bypassed import ALONE, BEYOND, SHARE, bypass, run, stopped, verdict
from hypothesis import given, settings
from hypothesis import strategies as st
from supervised import MS, at_ns, configure, expectation, feed, joints_of, reset, resting, sample, supervisor_of, tick

from irsbot_msgs_py.records import Bypass, Cause, JointSample, Level, Verdict
from irsbot_supervisor.bag.bag_writer import BagWriter
from irsbot_supervisor.bag.journal import configured, read_entry, write_entry
from irsbot_supervisor.core.bypass import LONGEST_S, InForce
from irsbot_supervisor.core.events import Configure, Event
from irsbot_supervisor.gate.velocity_gate import Gate
from irsbot_supervisor.replay.comparison import against_recording
from irsbot_supervisor.replay.recording import read_recording
from irsbot_supervisor.replay.rejudge import judge_again

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
