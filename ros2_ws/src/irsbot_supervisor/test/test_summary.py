"""Summaries of states: they hide no extreme, and who hears them sees what it would see of every state."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import pairwise
from math import inf, isfinite, nan
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import irsbot_kinematics as irs
from irsbot_kinematics.conformance.samples import Machine
from irsbot_msgs_py.cdr import encode_state, encode_summary
from irsbot_msgs_py.records import Floats, JointSample, SingularityState
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_msgs_py.summary import StateSummary
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.core.margins import MARGIN_CAUSES
from irsbot_supervisor.core.summary import PERIOD_NS, Summariser, extremes_of
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.processes.observed import RATE_S, Observed
from irsbot_supervisor.replay.recording import Recording, read_recording
from irsbot_supervisor.replay.run_summary import margin_of

BAGS = Path(__file__).resolve().parents[4] / "bags"
MS = NS_PER_S // 1000


@pytest.fixture(scope="module")
def run() -> Recording:
    return read_recording(BAGS / "type2")


def columns_of(state: SingularityState) -> Floats:
    return (*[margin_of(state, kind) for kind in MARGIN_CAUSES], state.stop_margin)


def summaries_of(states: Iterable[SingularityState]) -> Iterator[StateSummary]:
    """What a supervisor publishes of them, with the state for which each is due."""
    summariser = Summariser()
    for state in states:
        summariser.add(columns_of(state))
        if summariser.is_due(state.seen_ns):
            yield summariser.take(state, state.seen_ns)


@pytest.mark.parametrize("name", irs.robots())
def test_margins_of_a_sample_are_those_of_its_state(name: str) -> None:
    settings, robot = read_settings(name)
    names = tuple(joint.name for joint in robot.mechanism.joints)
    postures = [at.joints for at in Machine(robot, 40, 11).postures]
    known = []
    for joints in postures:
        supervisor = Supervisor(settings, robot)  # one that has been there before would take it for a glitch
        for now_ns, position in ((MS, joints), (2 * MS, joints), (3 * MS, (nan,) * len(names)), (4 * MS, joints)):
            sample = JointSample(now_ns, now_ns, now_ns, names, position, (0.0,) * len(names))
            state = supervisor.step(sample).state
            assert state is not None
            margins = supervisor.margins
            assert finite(margins or (nan,) * 5) == pytest.approx(finite(columns_of(state)), abs=0.0, nan_ok=True)
            assert bool(margins) == isfinite(state.type2_margin)
            known.append(bool(margins))
    assert {True, False} == set(known)


def finite(values: Floats) -> list[float]:
    """NaN for infinite: a margin that the robot does not have."""
    return [value if isfinite(value) else nan for value in values]


@given(st.lists(st.lists(st.one_of(st.floats(), st.sampled_from([nan, inf])), min_size=3, max_size=3), max_size=9))
def test_extremes_are_of_the_finite_values_alone(rows: list[list[float]]) -> None:
    columns = list(zip(*rows, strict=True))
    smallest, largest = extremes_of(columns)
    for number, column in enumerate(columns):
        values = np.array(column)[np.isfinite(column)]
        expected = [values.min(), values.max()] if len(values) else [nan, nan]
        assert [smallest[number], largest[number]] == pytest.approx(expected, abs=0.0, rel=0.0, nan_ok=True)


def test_a_summary_has_the_extremes_of_all_states_since_the_one_before(run: Recording) -> None:
    states, covered = run.states, 0
    for summary in summaries_of(states):
        group = states[covered : covered + summary.state_count]
        covered += summary.state_count
        assert summary.state == group[-1]
        assert summary.state_total == covered
        margins = np.array(list(map(columns_of, group)))
        for place in range(margins.shape[1]):
            values = margins[:, place][np.isfinite(margins[:, place])]
            expected = [values.min(), values.max()] if len(values) else [nan, nan]
            assert [summary.smallest[place], summary.largest[place]] == pytest.approx(expected, abs=0.0, nan_ok=True)
    assert len(states) - covered < PERIOD_NS // MS


def test_states_without_a_pose_count_and_have_no_margins(run: Recording) -> None:
    summariser = Summariser()
    summariser.add(())
    summary = summariser.take(run.states[0], 0)
    assert (summary.state_count, summary.state_total) == (1, 1)
    assert all(value != value for value in (*summary.smallest, *summary.largest))
    for margins in ((0.3, 0.2, inf, nan, 0.1), (), (0.4, 0.1, inf, nan, 0.2)):
        summariser.add(margins)
    summary = summariser.take(run.states[0], 1)
    assert summary.smallest == pytest.approx((0.3, 0.1, nan, nan, 0.1), nan_ok=True)
    assert summary.largest == pytest.approx((0.4, 0.2, nan, nan, 0.2), nan_ok=True)
    assert (summary.state_count, summary.state_total) == (3, 4)


def test_what_nobody_listened_to_is_in_no_summary(run: Recording) -> None:
    summariser = Summariser()
    summariser.add((0.1,) * 5)
    summariser.forget()
    summariser.add((0.2,) * 5)
    summary = summariser.take(run.states[0], 0)
    assert (summary.state_count, summary.state_total, summary.smallest) == (1, 1, (0.2,) * 5)


@pytest.mark.parametrize(("sample_hz", "least", "most"), [(1000, 31.9, 32.1), (2500, 31.9, 32.1), (20, 19.9, 20.1)])
def test_summaries_come_32_times_a_second_and_no_more_often_than_states(
    run: Recording, sample_hz: int, least: float, most: float
) -> None:
    seconds = 20
    states = [run.states[0]._replace(seen_ns=k * NS_PER_S // sample_hz) for k in range(seconds * sample_hz)]
    found = list(summaries_of(states))
    assert least <= len(found) / seconds <= most
    assert len({summary.state.seen_ns for summary in found}) == len(found)


def test_every_frame_of_the_live_page_has_news_of_a_robot_at_1_khz(run: Recording) -> None:
    page = pytest.importorskip("irsbot_supervisor.live.server", reason="needs websockets", exc_type=ImportError)
    states = [run.states[0]._replace(seen_ns=k * MS) for k in range(20_000)]
    times = [summary.state.seen_ns * 1e-9 for summary in summaries_of(states)]
    assert max(b - a for a, b in pairwise(times)) <= page.FRAME_S


def test_after_a_silence_one_summary_is_due_at_once_and_the_next_a_period_later(run: Recording) -> None:
    times = [*range(0, 100 * MS, MS), *range(5000 * MS, 5100 * MS, MS)]
    due = [one.state.seen_ns for one in summaries_of([run.states[0]._replace(seen_ns=ns) for ns in times])]
    first, second = [ns for ns in due if ns >= 5000 * MS][:2]
    assert first == 5000 * MS
    assert 0 <= second - first - PERIOD_NS < MS


def test_who_hears_summaries_sees_what_it_would_see_of_every_state(run: Recording) -> None:
    """Between two looks at the same summaries: newest state, extremes, rate; and the same over the whole run."""
    one_by_one, summed, states = Observed(), Observed(), run.states
    covered, ends = 0, []
    for summary in summaries_of(states):
        group = states[covered : covered + summary.state_count]
        covered += summary.state_count
        now_s = summary.state.seen_ns * 1e-9
        one_by_one.hear_states(list(map(encode_state, group)), [state.seen_ns * 1e-9 for state in group])
        summed.hear_summaries([encode_summary(summary)], [now_s])
        expected, seen = one_by_one.look(now_s), summed.look(now_s)
        assert repr(seen.state) == repr(expected.state)
        assert seen.smallest == pytest.approx(expected.smallest, abs=0.0, nan_ok=True)
        assert seen.largest == pytest.approx(expected.largest, abs=0.0, nan_ok=True)
        assert (seen.state_age_s, expected.state_age_s) == (0.0, 0.0)
        assert seen.state_hz == pytest.approx(expected.state_hz, abs=3.0)  # spread evenly between two summaries
        ends += [seen.smallest[1], seen.largest[1]]
    finite = [state.type2_margin for state in states[:covered] if isfinite(state.type2_margin)]
    assert (np.nanmin(ends), np.nanmax(ends)) == (min(finite), max(finite))
    assert seen.state_hz > 100.0
    assert summed.look(now_s + 0.09).state_hz == seen.state_hz  # the next one has not come yet
    assert summed.look(now_s + 0.6).state_hz == pytest.approx(0.4 * seen.state_hz, abs=5.0)
    assert summed.look(now_s + 2.0).state_hz == 0.0
    silent = summed.look(now_s + 2.0)
    assert (silent.smallest, silent.largest) == ((), ())
    assert silent.state_age_s == pytest.approx(2.0)


def test_several_summaries_and_states_between_two_looks_hide_no_extreme(run: Recording) -> None:
    def summary(low: float, high: float, total: int) -> bytes:
        return encode_summary(StateSummary(run.states[0], 2, total, *(low, high) * 5))

    seen = Observed()
    seen.hear_states([encode_state(run.states[1])], [0.5])
    seen.hear_summaries([summary(0.4, 0.5, 2), summary(-0.3, 0.4, 4), summary(0.4, 7.0, 6)], [0.97, 1.0, 1.03])
    found = seen.look(1.03)
    assert (found.smallest[1], found.largest[1]) == (-0.3, 7.0)
    assert repr(found.state) == repr(run.states[0])
    seen.hear_summaries([summary(0.4, 0.5, 8)], [1.06])
    low = run.states[1]._replace(type2_margin=0.01)
    seen.hear_states([encode_state(low)], [1.07])
    found = seen.look(1.07)
    assert (found.smallest[1], found.largest[1]) == (0.01, 0.5)
    assert repr(found.state) == repr(low)


def told_at(run: Recording, seen: Observed, counts: Iterable[tuple[float, int, int]]) -> None:
    """Summaries of so many states at these times, s, with the number of all states until then."""
    for time_s, count, total in counts:
        seen.hear_summaries([encode_summary(StateSummary(run.states[0], count, total, *(nan,) * 10))], [time_s])


def test_the_rate_of_states_is_exact_where_summaries_are_lost(run: Recording) -> None:
    seen = Observed()
    told_at(run, seen, [(k * 0.032, 32, 32 * k) for k in range(1, 100) if k % 4])
    assert seen.look(99 * 0.032).state_hz == pytest.approx(1000.0, abs=1.5)


def test_a_supervisor_that_is_started_again_counts_from_its_first_state(run: Recording) -> None:
    seen = Observed()
    told_at(run, seen, [(k * 0.032, 32, 32 * k) for k in range(1, 100)])
    told_at(run, seen, [(10.0 + k * 0.032, 32, 32 * k) for k in range(20)])
    assert seen.look(10.0 + 19 * 0.032).state_hz == pytest.approx(20 * 32, abs=33.0)


def test_a_long_gap_counts_only_in_the_part_of_it_that_a_rate_covers(run: Recording) -> None:
    seen = Observed()
    told_at(run, seen, [(1.0, 32, 32), (3601.0, 32, 32 + 3_600_000)])  # an hour of lost summaries at 1 kHz
    assert seen.look(3601.0).state_hz == pytest.approx(1000.0 * RATE_S, abs=1.5)


def test_damaged_summaries_change_nothing_and_take_no_memory(run: Recording) -> None:
    seen = Observed()
    seen.hear_summaries([b"nonsense"], [1.0])
    assert seen.look(1.0).state is None
    told_at(run, seen, [(1.0, 0, 2**64 - 1), (1.01, 2**32 - 1, 0), (1.02, 0, 2**64 - 1)])
    assert repr(seen.look(1.02).state) == repr(run.states[0])
