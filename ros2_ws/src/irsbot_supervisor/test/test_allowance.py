"""How much may be used up: against the same sum with fractions."""

from __future__ import annotations

from fractions import Fraction

from hypothesis import given
from hypothesis import strategies as st

from irsbot_supervisor.nodes.allowance import Allowance

SECOND_NS = 1_000_000_000


def test_all_of_it_is_there_in_the_beginning_and_no_more_after_a_rest():
    allowed = Allowance(2500.0, 50.0, 7)
    assert allowed.left == 50.0
    assert allowed.grow(7 + 100 * SECOND_NS) == 50.0


def test_what_is_used_comes_back_at_the_rate():
    allowed = Allowance(0.5, 0.05, 0)
    allowed.left -= 0.15
    assert allowed.grow(SECOND_NS // 10) == 0.05 - 0.15 + 0.05
    assert abs(allowed.grow(SECOND_NS // 5)) < 1e-15
    assert abs(allowed.grow(SECOND_NS // 4) - 0.025) < 1e-15


@given(st.lists(st.tuples(st.integers(0, SECOND_NS), st.integers(0, 20)), max_size=30))
def test_it_is_the_sum_of_what_came_and_went_cut_at_the_most(turns: list[tuple[int, int]]):
    allowed, now_ns, left = Allowance(10.0, 5.0, 0), 0, Fraction(5)
    for passed_ns, used in turns:
        now_ns += passed_ns
        left = min(left + Fraction(10 * passed_ns, SECOND_NS), Fraction(5))
        assert abs(allowed.grow(now_ns) - left) < 1e-9
        allowed.left -= used
        left -= used
