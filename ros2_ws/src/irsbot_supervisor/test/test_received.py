"""Which samples a supervisor received, and when, where not every sample has a state."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from irsbot_msgs_py.records import JointSample
from irsbot_supervisor.replay.received import Received

AHEAD_NS = 10**18
"""ns that ROS time is ahead of the steady clock."""


def sample(stamp_ns: int) -> JointSample:
    return JointSample(stamp_ns, 0, 0, ("joint",), (0.0,))


def state(sequence: int, stamp_ns: int, seen_ns: int) -> Any:
    return SimpleNamespace(sequence=sequence, stamp_ns=stamp_ns, seen_ns=seen_ns, received_ns=seen_ns + AHEAD_NS)


def session(*states: Any) -> Any:
    return SimpleNamespace(states=list(states))


def test_ages_on_arrival_lie_between_those_of_the_neighbours() -> None:
    received = Received([sample(stamp) for stamp in (1000, 2000, 3000, 4000, 5000)])
    found = received.of(session(state(7, 1000, 1100), state(11, 5000, 5500)))
    assert {number: (one.stamp_ns, one.seen_ns) for number, one in found.items()} == {
        7: (1000, 1100),
        8: (2000, 2200),
        9: (3000, 3300),
        10: (4000, 4400),
        11: (5000, 5500),
    }
    assert all(one.received_ns == one.seen_ns + AHEAD_NS for one in found.values())
    assert (received.between, received.left) == (3, 0)


def test_no_stamp_puts_a_sample_before_or_behind_its_neighbours() -> None:
    received = Received([sample(stamp) for stamp in (1000, 0, 9_000_000, 2000, 5000)])
    found = received.of(session(state(1, 1000, 1100), state(5, 5000, 5100)))
    assert [found[number].seen_ns for number in (2, 3, 4)] == [1100, 5100, 5100]


def test_a_sample_belongs_to_one_supervisor() -> None:
    """The second one began while the first one still worked: between its states lie a sample of the first one."""
    received = Received([sample(stamp) for stamp in (1000, 2000, 3000)])
    first = received.of(session(state(1, 2000, 2100)))
    second = received.of(session(state(1, 1000, 1100), state(3, 3000, 3100)))
    assert [one.stamp_ns for one in first.values()] == [2000]
    assert sorted(second) == [1, 3]
    assert (received.between, received.left) == (0, 0)


def test_of_equal_stamps_each_counts_once() -> None:
    received = Received([sample(stamp) for stamp in (1000, 2000, 2000, 3000)])
    found = received.of(session(state(1, 1000, 1100), state(4, 3000, 3100)))
    assert [one.stamp_ns for one in found.values()] == [1000, 2000, 2000, 3000]
    assert received.left == 0
