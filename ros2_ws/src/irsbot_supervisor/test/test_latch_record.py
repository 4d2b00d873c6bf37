"""What a latch tells of itself: its first judgement, whether anything changed, numbers of stops, a bypass in force."""

from __future__ import annotations

import pytest
from bypassed import bypass
from hypothesis import given
from hypothesis import strategies as st
from supervised import at_ns, settings_of

from irsbot_msgs_py.records import Cause, Finding, Level
from irsbot_supervisor.core.latch import Judgement, Latch

DWELL_MS = 50


def latch() -> Latch:
    held = Latch(settings_of(dwell_s=DWELL_MS / 1e3)[0])
    held.update([], at_ns(-1000)[1])
    held.take_transitions()
    return held


def finding(level: Level, cause: Cause) -> Finding:
    return Finding(cause, level, 0.1, 0.2, "1", f"{cause.name} {level.name}")


WARN, OTHER = finding(Level.WARN, Cause.TYPE2), finding(Level.WARN, Cause.SPEED)
STOP, ELSE = finding(Level.STOP, Cause.TYPE1), finding(Level.STOP, Cause.TYPE2)
UNKNOWN, LOST = finding(Level.UNKNOWN, Cause.STALE), finding(Level.UNKNOWN, Cause.BRANCH)


def at(held: Latch, ms: float, *findings: Finding) -> Judgement:
    held.update(list(findings), at_ns(ms)[1])
    return held.now


def bypassed(*warnings: Finding) -> Latch:
    """Stopped at 0, bypassed from 100 ms on for 10 s."""
    held = latch()
    for ms in range(0, 100, 10):
        at(held, ms, STOP, *warnings)
    assert held.bypass(bypass(100), True, [STOP, *warnings]) == ""
    return held


# --- the judgement --------------------------------------------------------------------------------------------------


def test_before_anything_was_found_nothing_is_known_and_no_stop_is_counted():
    now = Latch(settings_of()[0]).now
    assert now == Judgement(Level.UNKNOWN, 0, False, 0, 0, 0.0, (), 0)


@pytest.mark.parametrize("found", [(WARN,), (WARN, OTHER), (ELSE,), (LOST, OTHER), (STOP, ELSE, WARN)])
def test_causes_are_those_of_the_findings_and_the_latch(found):
    expected = sum({one.cause for one in found}, 0) | (Cause.LATCHED if found[0] in (STOP, ELSE, LOST) else 0)
    assert at(latch(), 0, *found).causes == expected


@given(
    st.lists(
        st.tuples(
            st.integers(1, 80), st.lists(st.sampled_from([WARN, OTHER, STOP, UNKNOWN, LOST]), max_size=2, unique=True)
        ),
        max_size=20,
    )
)
def test_an_update_says_that_the_judgement_changed_if_another_one_came_into_force(looks):
    held, ms = latch(), 0
    for gap_ms, findings in looks:
        ms += gap_ms
        changed = held.update(findings, at_ns(ms)[1])
        transitions = held.take_transitions()
        assert changed == bool(transitions)
        assert not transitions or transitions[-1][:6] == held.now[:6]


def test_findings_that_end_together_end_in_one_judgement():
    held = latch()
    at(held, 10, WARN, UNKNOWN, OTHER)
    held.take_transitions()
    at(held, 1000)
    (turn,) = held.take_transitions()
    assert (turn.since_ns, turn.level) == (at_ns(10 + DWELL_MS)[1], Level.OK)


def test_a_latch_is_clear_if_nothing_is_held_latched_or_waits_to_be_taken():
    held = latch()
    assert held.clear
    at(held, 0, WARN)
    assert not held.clear
    held.take_transitions()
    assert not held.clear
    at(held, 100)
    assert not held.clear, "its end was not taken yet"
    held.take_transitions()
    assert held.clear
    at(held, 200, STOP)
    at(held, 300)
    held.take_transitions()
    assert not held.held
    assert not held.clear, "the stop is latched"
    held.reset(1, at_ns(400)[1], True, [])
    held.take_transitions()
    assert held.clear
    assert not Latch(settings_of()[0]).clear, "nothing was judged yet"


# --- numbers of stops -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("number", "expected"), [(0, 2), (1, 2), (2, 2), (3, 3), (7, 7)])
def test_after_a_restart_the_next_stop_has_at_least_the_number_that_is_asked_for(number, expected):
    held = latch()
    at(held, 0, STOP)
    held.reset(1, at_ns(100)[1], True, [])
    held.count_on(number)
    assert at(held, 200, STOP).event == expected


# --- a bypass in force ----------------------------------------------------------------------------------------------


def test_the_end_of_a_bypass_is_told_while_it_is_in_force():
    held = latch()
    assert held.bypassed_until_ns is None
    held = bypassed()
    assert held.bypassed_until_ns == at_ns(100 + 10_000)[1]
    assert not held.clear
    held.end_bypass()
    assert held.bypassed_until_ns is None


def test_during_a_bypass_the_cause_warns_and_the_robot_is_slow():
    now = bypassed().now
    assert (now.level, now.bypassed, now.latched) == (Level.WARN, Cause.TYPE1, False)
    assert now.speed_scale == settings_of()[0].recovery_share
    assert (now.since_ns, now.causes, now.event) == (at_ns(100)[1], Cause.TYPE1, 1)


def test_a_bypass_whose_cause_is_gone_is_told_while_the_level_is_good():
    held = bypassed()
    held.take_transitions()
    now = at(held, 200)
    assert (now.level, now.bypassed, now.speed_scale) == (Level.OK, Cause.TYPE1, settings_of()[0].recovery_share)
    assert now.since_ns == at_ns(100 + DWELL_MS)[1]
    assert len(held.take_transitions()) == 1
    now = at(held, 10_101)
    assert (now.level, now.bypassed, now.speed_scale) == (Level.OK, 0, 1.0)


@pytest.mark.parametrize("other", [ELSE, UNKNOWN])
def test_another_stop_or_no_knowledge_ends_a_bypass_and_a_warning_does_not(other):
    held = bypassed()
    assert at(held, 101, STOP, WARN).bypassed == Cause.TYPE1
    now = at(held, 102, STOP, other)
    assert (now.level, now.bypassed, now.latched, now.event) == (other.level, 0, True, 2)
    assert WARN in now.findings, "a warning of another cause keeps its dwell time"
    assert not any(one.cause == STOP.cause and one.level == Level.WARN for one in now.findings)


@pytest.mark.parametrize(("ms", "level"), [(10_099.999, Level.WARN), (10_100.0, Level.STOP)])
def test_a_bypass_ends_at_its_time_and_the_cause_that_is_still_there_stops_again(ms, level):
    held = bypassed()
    at(held, 10_090, STOP)
    now = at(held, ms, STOP)
    assert (now.level, now.latched, now.event) == (level, level == Level.STOP, 1 + (level == Level.STOP))


@pytest.mark.parametrize(("ms", "refused"), [(DWELL_MS, True), (DWELL_MS + 1, False)])
def test_what_was_not_known_until_just_now_is_bypassed_only_after_the_dwell_time(ms, refused):
    held = latch()
    at(held, 0, STOP, UNKNOWN)
    assert bool(held.bypass(bypass(ms), True, [STOP])) is refused


@pytest.mark.parametrize(
    ("changes", "standing", "active"),
    [({"event": 2}, True, [STOP]), ({}, False, [STOP]), ({}, True, [STOP, UNKNOWN]), ({}, True, [WARN])],
)
def test_a_refused_bypass_changes_no_judgement(changes, standing, active):
    held = latch()
    before = at(held, 0, STOP)
    assert held.bypass(bypass(100, **changes), standing, active)
    assert held.now == before
    assert held.bypassed_until_ns is None


def test_a_stop_that_was_bypassed_is_held_no_longer_and_warnings_are():
    held = latch()
    at(held, 90, STOP, WARN)
    assert held.bypass(bypass(100), True, [STOP]) == ""
    assert {(one.cause, one.level) for one in held.held} == {(STOP.cause, Level.WARN), (WARN.cause, Level.WARN)}
