"""The interval of samples that is learned, against all intervals of the window."""

from __future__ import annotations

from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from irsbot_supervisor.core.estimation.sample_interval import SampleIntervals, SecondLargest, judging_time

SPAN_NS = 100

# --- the second-largest value ---------------------------------------------------------------------------------------


def second(values: list[float]) -> float:
    """The second-largest of all, at least 0."""
    return sorted([0.0, 0.0, *values])[-2]


@given(st.lists(st.tuples(st.integers(1, 20), st.integers(0, 9)), min_size=1, max_size=80))
def test_the_second_largest_value_is_that_of_one_to_two_spans(steps: list[tuple[int, int]]) -> None:
    """A span ends with the first value after it, at most 20 ns later."""
    window, seen, now_ns = SecondLargest(), [], 7
    for gap_ns, value in steps:
        now_ns += gap_ns
        seen.append((now_ns, float(value)))
        found = window.second(now_ns, float(value), SPAN_NS)
        recent, older = (
            second([one for at_ns, one in seen if now_ns - at_ns <= spans]) for spans in (SPAN_NS, 2 * SPAN_NS + 20)
        )
        assert recent <= found <= older
        assert not window.any or max(one for _at_ns, one in seen) > 0.0


@pytest.mark.parametrize(("gap_ns", "left"), [(SPAN_NS, 3.0), (SPAN_NS + 1, 3.0), (200, 3.0), (201, 0.0)])
def test_values_are_forgotten_two_spans_after_they_began(gap_ns: int, left: float) -> None:
    window = SecondLargest()
    for value in (5.0, 3.0):
        window.second(1000, value, SPAN_NS)
    assert window.second(1000 + gap_ns, 0.0, SPAN_NS) == left
    assert window.any is (left > 0.0)


def test_a_value_of_each_of_two_spans_makes_the_smaller_one_the_second() -> None:
    for first, later in ((5.0, 3.0), (3.0, 5.0)):
        window = SecondLargest()
        assert window.second(1000, first, SPAN_NS) == 0.0
        assert window.second(1101, later, SPAN_NS) == 3.0


def test_values_that_are_kept_are_limited_and_last_for_one_more_window_from_the_next_one_on() -> None:
    window = SecondLargest()
    for at_ns, value in ((1000, 9.0), (1000, 8.0), (1101, 7.0), (1101, 6.0)):
        window.second(at_ns, value, SPAN_NS)
    window.keep(6.5)
    assert window.second(9000, 0.0, SPAN_NS) == 6.5
    assert window.memory.now == (6.5, 6.0)
    assert window.memory.before == (6.5, 6.5)
    assert window.second(9000 + SPAN_NS, 0.0, SPAN_NS) == 6.5
    assert window.second(9000 + SPAN_NS + 1, 0.0, SPAN_NS) == 6.0


def test_what_is_forgotten_or_was_never_there_is_nothing() -> None:
    window = SecondLargest()
    fresh = window.memory
    assert not window.any
    for value in (5.0, 3.0):
        window.second(1000, value, SPAN_NS)
    assert window.any
    window.second(1101, 0.0, SPAN_NS)
    assert window.any, "those of the span before"
    window.forget()
    assert not window.any
    assert window.memory == fresh


# --- intervals ------------------------------------------------------------------------------------------------------


def intervals(silence_s: float = 0.05, stated_s: float = 0.0, beat_s: float = 0.01) -> SampleIntervals:
    learned = SampleIntervals()
    learned.configure(silence_s, stated_s, beat_s)
    return learned


def fed(learned: SampleIntervals, *gaps_ms: float) -> list[tuple[float, float, bool, bool]]:
    """Results for intervals that both clocks show alike, ms; the steady clock begins at 1 s."""
    now_ns, found = 10**9, []
    for gap_ms in gaps_ms:
        now_ns += round(gap_ms * 1e6)
        longest_s, usual_s, late, rare = learned.expected(now_ns, 1e-3 * gap_ms, 1e-3 * gap_ms)
        found.append((pytest.approx(1e3 * longest_s), pytest.approx(1e3 * usual_s), late, rare))
    return found


def test_the_longest_interval_is_the_second_longest_and_the_usual_one_the_shorter_of_the_last_two() -> None:
    assert fed(intervals(), 1, 1, 4, 1, 5, 20, 30, 1, 1) == [
        (1, 1, False, False),
        (1, 1, False, False),
        (1, 1, True, False),  # one alone is not expected again, but it was late
        (1, 1, False, False),
        (4, 1, True, False),
        (5, 5, True, True),
        (20, 20, True, True),
        (20, 1, True, True),
        (20, 1, True, True),
    ]


def test_an_interval_that_is_stated_is_expected_and_not_late() -> None:
    assert fed(intervals(stated_s=0.006), 1, 5, 5, 8, 9) == [
        (6, 6, False, False),
        (6, 6, False, False),
        (6, 6, False, False),
        (6, 6, True, False),
        (8, 8, True, False),
    ]


def test_what_comes_within_a_heartbeat_is_not_rare() -> None:
    for beat_ms, rare in ((10.0, True), (20.0, False), (15.0, False), (14.9, True)):
        *_, last = fed(intervals(beat_s=1e-3 * beat_ms), 1, 1, 15, 15, 1)
        assert last == (15, 1, True, rare)


def test_a_silence_is_no_interval_and_the_interval_is_learned_anew_after_it() -> None:
    learned = intervals()
    assert learned.steady_s(10**9) == inf
    assert fed(learned, 30, 30, 51, 1, 1)[2:] == [(50, 50, False, False), (1, 1, False, False), (1, 1, False, False)]
    assert learned.steady_s(10**9 + 113 * 10**6) == pytest.approx(0.002)
    assert fed(intervals(), 30, 30, 50)[-1] == (30, 30, True, True), "as long as a silence must be exceeded"


def test_the_clock_that_shows_the_longer_interval_counts_unless_it_shows_a_silence() -> None:
    for passed_s, stamped_s, counts_s in ((0.002, 0.004, 0.004), (0.004, 0.002, 0.004), (0.002, 0.5, 0.002)):
        learned = intervals()
        for k in range(1, 4):
            longest_s = learned.expected(10**9 + k, passed_s, stamped_s).longest_s
        assert longest_s == counts_s
    assert intervals().expected(10**9, 0.002, 0.05).longest_s == 0.05, "the longest that is none"


def test_new_settings_limit_what_was_learned_to_the_new_silence() -> None:
    learned = intervals(silence_s=0.5)
    fed(learned, 300, 200, 30, 30)
    learned.configure(0.5, 0.0, 0.01)
    assert fed(learned, 1)[-1][0] == 200
    learned.configure(0.05, 0.0, 0.01)
    assert fed(learned, 1)[-1][0] == 50


@pytest.mark.parametrize(
    ("stated_s", "interval_s", "expected_s"),
    [(0.0, 0.001, 0.001), (0.0, 0.005, 0.005), (0.0, 0.04, 0.005), (0.02, 0.04, 0.02), (0.002, 0.04, 0.005)],
)
def test_a_sample_is_judged_within_its_interval_or_five_milliseconds_or_the_stated_time(
    stated_s: float, interval_s: float, expected_s: float
) -> None:
    assert judging_time(stated_s, interval_s) == expected_s
