"""The black box: what precedes a stop is there, the rest is not, and memory has a bound."""

from __future__ import annotations

import tracemalloc

import pytest

from irsbot_msgs_py.cdr import encode_verdict
from irsbot_msgs_py.records import Cause, Level, Verdict
from irsbot_supervisor.bag.blackbox import RECORD_BYTES, BlackBox, Kept, StopWatch

S = 10**9


def message(second: float, size: int = 1) -> Kept:
    return Kept(int(second * S), 0, 1, bytes(size))


def seconds(messages: list[Kept]) -> list[float]:
    return [kept.log_ns / S for kept in messages]


def test_nothing_is_passed_on_until_a_stop_asks_for_the_last_seconds():
    box = BlackBox(keep_ns=10 * S, after_ns=0, keep_bytes=10_000)
    assert [box.pass_on(message(second)) for second in range(100)] == [[]] * 100
    assert seconds(box.stop(99 * S)) == list(range(89, 100))  # 10 s back from the newest
    assert box.stop(99 * S) == []
    assert box.overflowed == 0


def test_the_box_stays_open_after_a_stop_and_closes_again():
    box = BlackBox(keep_ns=10 * S, after_ns=2 * S, keep_bytes=10_000)
    box.pass_on(message(1))
    box.stop(1 * S)
    assert seconds([kept for second in (2, 3, 3.5, 4) for kept in box.pass_on(message(second))]) == [2, 3]
    assert seconds(box.stop(4 * S)) == [3.5, 4]  # held again since the box closed: nothing is written twice or lost


def test_a_second_stop_prolongs_the_first():
    box = BlackBox(keep_ns=10 * S, after_ns=2 * S, keep_bytes=10_000)
    box.stop(0)
    box.pass_on(message(1))
    box.stop(1 * S)
    assert seconds(box.pass_on(message(3))) == [3]


def test_memory_is_bounded_and_messages_dropped_too_early_are_counted():
    box = BlackBox(keep_ns=10 * S, after_ns=0, keep_bytes=5 * (RECORD_BYTES + 10))
    for k in range(8):
        box.pass_on(message(k, size=10))
    assert seconds(box.stop(7 * S)) == [3, 4, 5, 6, 7]
    assert box.overflowed == 3


@pytest.mark.parametrize("size", [1, 96, 5000])
def test_the_bound_is_one_of_memory_not_of_data(size: int):
    bound = 1_000_000
    tracemalloc.start()
    try:
        box = BlackBox(keep_ns=10**6 * S, after_ns=0, keep_bytes=bound)
        before = tracemalloc.get_traced_memory()[0]
        for k in range(10 * bound // (RECORD_BYTES + size)):
            box.pass_on(Kept(10 * S + 2 * k, 10 * S + 2 * k + 1, 1, bytes(bytearray(size))))
        held = tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()
    assert box.overflowed
    assert 0.7 * bound < held <= 1.05 * bound


def test_a_message_larger_than_the_box_is_not_held():
    box = BlackBox(keep_ns=10 * S, after_ns=0, keep_bytes=5 * (RECORD_BYTES + 10))
    assert box.pass_on(message(0, size=5 * (RECORD_BYTES + 10))) == []
    assert box.stop(0) == []
    assert box.overflowed == 1


def verdict(level: Level, event: int) -> bytes:
    return encode_verdict(Verdict(0, level, Cause.NONE, False, event, (), "", 0, "", 0, 1.0, ()))


@pytest.mark.parametrize(
    ("story", "stops"),
    [
        ([(Level.OK, 0), (Level.STOP, 1)], [False, True]),
        ([(Level.OK, 0), (Level.UNKNOWN, 1)], [False, True]),
        ([(Level.WARN, 0), (Level.STOP, 0)], [False, True]),  # also without a number
        ([(Level.UNKNOWN, 0), (Level.OK, 0)], [False, False]),  # how every supervisor begins
        ([(Level.STOP, 1), (Level.STOP, 1)], [True, False]),  # the recorder came late; a stop is told again and again
        ([(Level.STOP, 1), (Level.UNKNOWN, 1), (Level.STOP, 2)], [True, False, True]),
        (
            [(Level.OK, 5), (Level.WARN, 5), (Level.STOP, 6), (Level.OK, 6), (Level.STOP, 7)],
            [False] * 2 + [True, False, True],
        ),
    ],
)
def test_a_stop_is_recognised_when_it_begins(story: list[tuple[Level, int]], stops: list[bool]):
    watch = StopWatch()
    assert [watch.is_new_stop(verdict(level, event)) for level, event in story] == stops


def test_an_unreadable_verdict_keeps_the_messages_before_it():
    assert StopWatch().is_new_stop(b"\x00\x01\x00\x00")
