"""The worst finding wins and is kept for a dwell time; a stop is held until the operator names it."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from supervised import MS, settings_of

from irsbot_msgs_py.records import Cause, Finding, Level
from irsbot_supervisor.core.latch import Judgement, Latch

DWELL_MS = 50


def latch(**changes) -> Latch:
    held = Latch(settings_of(dwell_s=DWELL_MS / 1e3, **changes)[0])
    held.update([], 0)
    return held


def finding(level: Level, cause: Cause = Cause.TYPE2, value: float = 0.1) -> Finding:
    return Finding(cause, level, value, 0.2, "1", f"{cause.name} {value}")


WARN, STOP = finding(Level.WARN), finding(Level.STOP)
UNKNOWN, LOST = finding(Level.UNKNOWN, Cause.NONFINITE), finding(Level.UNKNOWN, Cause.BRANCH)


def at(held: Latch, ms: float, *findings: Finding) -> Judgement:
    held.update(list(findings), round(ms * MS))
    return held.now


# --- worst wins, for the dwell time -----------------------------------------------------------------------------


def test_before_the_first_finding_the_level_is_unknown():
    assert Latch(settings_of()[0]).now.level == Level.UNKNOWN
    assert Latch(settings_of()[0]).now.speed_scale == 0.0


@pytest.mark.parametrize(
    ("findings", "level"),
    [
        ((), Level.OK),
        ((WARN,), Level.WARN),
        ((WARN, finding(Level.WARN, Cause.SPEED)), Level.WARN),
        ((STOP, WARN), Level.STOP),
        ((WARN, STOP, UNKNOWN), Level.UNKNOWN),
        ((UNKNOWN, STOP), Level.UNKNOWN),
    ],
)
def test_the_worst_finding_is_the_level_and_every_cause_is_kept(findings, level):
    now = at(latch(), 1, *findings)
    assert now.level == level
    for one in findings:
        assert now.causes & one.cause
        assert one in now.findings
    assert now.speed_scale == (1.0 if level < Level.STOP else 0.0)


@pytest.mark.parametrize(("one", "level"), [(WARN, Level.WARN), (UNKNOWN, Level.UNKNOWN)])
def test_a_level_falls_only_after_the_dwell_time(one, level):
    held = latch()
    at(held, 10, one)
    for ms in (11, 30, 59.999):
        assert at(held, ms).level == level
    assert at(held, 60).level == Level.OK
    assert held.now.since_ns == 60 * MS


def test_a_finding_that_comes_back_begins_its_dwell_time_anew():
    held = latch()
    for ms in (10, 55, 100, 145):
        assert at(held, ms, WARN).level == Level.WARN
    assert at(held, 194.9).level == Level.WARN
    assert held.now.since_ns == 10 * MS
    assert at(held, 195).level == Level.OK


def test_a_lower_level_is_listed_while_a_higher_one_dwells_and_follows_it():
    held = latch()
    at(held, 10, UNKNOWN)
    for ms in range(11, 80):
        now = at(held, ms, WARN)
        assert now.level == (Level.UNKNOWN if ms < 60 else Level.WARN)
    assert now.since_ns == 60 * MS


def test_the_reported_value_is_the_newest():
    held = latch()
    at(held, 1, finding(Level.WARN, value=0.3))
    assert at(held, 2, finding(Level.WARN, value=0.2)).findings == (finding(Level.WARN, value=0.2),)
    assert held.now.since_ns == 1 * MS


@given(
    seen=st.lists(st.tuples(st.integers(1, 30), st.sampled_from([(), (WARN,), (UNKNOWN,), (WARN, UNKNOWN)]))),
    looks=st.lists(st.integers(1, 2000)),
)
def test_times_of_evaluation_do_not_change_the_judgements(seen, looks):
    """The same findings, once judged alone and once with glances in between that find nothing new: `keep` says that
    what was found last has held until then. Both are looked at once more in the end."""

    def transitions(with_looks: bool) -> list[tuple[int, Level, int]]:
        held = Latch(settings_of(dwell_s=DWELL_MS / 1e3)[0])
        times: list[tuple[int, tuple[Finding, ...] | None]] = []
        now = 0
        for gap, found in seen:
            now += gap * MS
            times.append((now, found))
        if with_looks:
            times += [(look * MS // 3, None) for look in looks if look * MS // 3 < now]
        last: tuple[Finding, ...] = ()
        for when, found in sorted(times, key=lambda entry: (entry[0], entry[1] is not None)):
            held.keep(last, when)
            if found is not None:
                held.update(list(found), when)
                last = found
            else:
                held.update(list(last), when)
        held.update(list(last), now + 10**10)
        return [(turn.since_ns, turn.level, turn.causes) for turn in held.take_transitions() if turn.since_ns]

    # A glance before the first finding finds nothing and says so: OK from then on. It is left out of the comparison.
    plain, glanced = transitions(False), transitions(True)
    assert [turn for turn in glanced if turn[1] != Level.OK] == [turn for turn in plain if turn[1] != Level.OK]


def test_judgements_come_into_force_in_the_order_of_their_time():
    held = latch()
    at(held, 10, WARN)
    at(held, 20, UNKNOWN)
    held.take_transitions()
    at(held, 1000)  # nobody looked meanwhile: 60 ms ended the warning, 70 ms the rest
    assert [(turn.since_ns, turn.level) for turn in held.take_transitions()] == [
        (60 * MS, Level.UNKNOWN),
        (70 * MS, Level.OK),
    ]


# --- latch ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("one", [STOP, LOST, finding(Level.UNKNOWN, Cause.BRANCH | Cause.TYPE2)])
def test_a_stop_is_held_without_end(one):
    held = latch()
    first = at(held, 10, one)
    assert first.latched
    assert first.event == 1
    for ms in (11, 100, 10**9):
        now = at(held, ms)
        assert (now.level, now.latched, now.event, now.speed_scale) == (one.level, True, 1, 0.0)
        assert now.causes & Cause.LATCHED
        assert now.causes & one.cause
        assert one in now.findings


@pytest.mark.parametrize("one", [WARN, UNKNOWN, finding(Level.UNKNOWN, Cause.STALE)])
def test_other_levels_are_not_latched(one):
    assert not at(latch(), 10, one).latched


def test_a_stop_within_a_stop_is_the_same_event_and_a_stop_after_a_reset_the_next():
    held = latch()
    at(held, 10, STOP)
    assert at(held, 11, STOP, finding(Level.STOP, Cause.TYPE1)).event == 1
    assert held.reset(1, 500 * MS, True, []) == ""
    assert at(held, 501).event == 1
    assert at(held, 502, STOP).event == 2


def test_settings_that_change_clear_nothing():
    held = latch()
    at(held, 10, STOP, UNKNOWN)
    before = held.now
    held.configure(settings_of(dwell_s=0.0)[0])
    assert held.now == before
    assert at(held, 11).latched


# --- reset ------------------------------------------------------------------------------------------------------


def stopped() -> Latch:
    held = latch()
    at(held, 10, STOP)
    at(held, 100)
    return held


@pytest.mark.parametrize("event", [0, 2, -1, 2**32 - 1])
def test_a_reset_that_names_another_event_is_refused(event):
    held = stopped()
    before = held.now
    assert "1" in held.reset(event, 200 * MS, True, [])
    assert held.now == before


def test_a_reset_while_the_robot_moves_is_refused():
    held = stopped()
    assert "standing" in held.reset(1, 200 * MS, False, [])
    assert held.now.latched


@pytest.mark.parametrize("active", [STOP, UNKNOWN, LOST])
def test_a_reset_while_a_cause_is_there_is_refused_with_the_cause(active):
    held = stopped()
    assert active.text in held.reset(1, 200 * MS, True, [WARN, active])
    assert held.now.latched


def test_a_reset_with_a_warning_leaves_the_warning():
    held = stopped()
    at(held, 199, WARN)
    assert held.reset(1, 200 * MS, True, [WARN]) == ""
    assert (held.now.level, held.now.latched, held.now.since_ns) == (Level.WARN, False, 200 * MS)


def test_a_reset_ends_the_stop_at_once_and_only_once():
    held = stopped()
    assert held.reset(1, 200 * MS, True, []) == ""
    assert (held.now.level, held.now.causes, held.now.latched, held.now.since_ns) == (Level.OK, 0, False, 200 * MS)
    assert "nothing to reset" in held.reset(1, 201 * MS, True, [])


@pytest.mark.parametrize("event", range(5))
def test_no_reset_before_the_stop_ends_it(event):
    held = latch()
    assert held.reset(event, 1 * MS, True, [])
    for ms in range(2, 5):
        assert at(held, ms, STOP).latched
        assert held.reset(0, ms * MS, True, [])
        assert held.now.latched


def test_an_old_number_does_not_end_a_new_stop():
    held = stopped()
    held.reset(1, 200 * MS, True, [])
    at(held, 300, STOP)
    assert held.reset(1, 400 * MS, True, [])
    assert held.now.latched
    assert held.reset(2, 401 * MS, True, []) == ""


@given(
    st.lists(
        st.one_of(
            st.lists(st.sampled_from([WARN, STOP, UNKNOWN, LOST]), max_size=3, unique=True),
            st.tuples(st.integers(0, 6), st.booleans(), st.lists(st.sampled_from([WARN, STOP, UNKNOWN]), max_size=2)),
        ),
        max_size=40,
    )
)
def test_a_latched_stop_ends_by_a_reset_with_its_number_at_rest_without_cause_and_by_nothing_else(actions):
    held = latch()
    judgements = [held.now]
    known = True  # from the beginning, or for the dwell time; there are fewer actions than that lasts
    for ms, action in enumerate(actions, 1):
        if isinstance(action, list):
            at(held, ms, *action)
            known, allowed = known and UNKNOWN not in action, False
        else:
            event, standing, active = action
            allowed = known and event == held.now.event and standing
            allowed = allowed and not any(one.level >= Level.STOP for one in active)
            assert (held.reset(event, ms * MS, standing, active) == "") == (allowed and judgements[-1].latched)
        judgements.append(held.now)
        if judgements[-2].latched and not held.now.latched:
            assert allowed
        if held.now.latched:
            assert held.now.level >= Level.STOP
    for before, after in pairwise(judgements):
        assert after.event - before.event in (0, 1)
        assert after.since_ns >= before.since_ns


def test_a_branch_that_is_lost_within_a_stop_is_another_event_which_the_old_number_does_not_end():
    held = stopped()
    assert held.now.event == 1
    at(held, 150, LOST)
    assert (held.now.event, held.now.level, held.now.latched) == (2, Level.UNKNOWN, True)
    assert held.reset(1, 300 * MS, True, [])
    assert at(held, 400).level == Level.UNKNOWN, "no later sample brings the branch back"
    assert held.reset(2, 500 * MS, True, []) == ""
    assert held.now.level == Level.OK


def test_a_branch_that_is_confirmed_where_the_robot_must_not_stay_leaves_a_stop():
    held = latch()
    at(held, 10, LOST, STOP)
    assert (held.now.event, held.now.level) == (1, Level.UNKNOWN)
    refusal = held.reset(1, 300 * MS, True, [STOP])
    assert "confirmed" in refusal
    assert (held.now.event, held.now.level, held.now.latched) == (2, Level.STOP, True)
    assert held.reset(2, 301 * MS, True, [STOP])
    assert held.reset(2, 400 * MS, True, []) == ""


def test_data_that_was_not_good_until_just_now_is_no_good_data():
    held = stopped()
    at(held, 150, UNKNOWN)
    assert "not known until just now" in held.reset(1, 151 * MS, True, [])
    at(held, 160)
    assert held.now.latched
    at(held, 150 + DWELL_MS + 1)
    assert held.reset(1, (150 + DWELL_MS + 1) * MS, True, []) == ""
