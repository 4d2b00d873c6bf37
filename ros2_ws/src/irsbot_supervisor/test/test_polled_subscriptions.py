"""Which gaps in the numbers of messages count as losses: those of one publisher alone. Without DDS."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import chain

import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

from irsbot_supervisor.nodes.polled_subscriptions import SURE, LostMessages

pytestmark = pytest.mark.ros


class Graph:
    """Who publishes, as far as can be known."""

    def __init__(self) -> None:
        self.publisher: str | None = "one"


@pytest.fixture
def graph() -> Graph:
    return Graph()


@pytest.fixture
def lost(graph: Graph) -> LostMessages:
    """After enough messages of one publisher, the last of them number 1000."""
    lost = LostMessages(lambda: graph.publisher)
    hear(lost, range(1, 1001))
    return lost


def hear(lost: LostMessages, numbers: Iterable[int]) -> None:
    for number in numbers:
        lost.hear(number)


def test_without_a_gap_nothing_is_lost(lost: LostMessages):
    assert lost.lost == 0


def test_gaps_of_the_only_publisher_are_losses_once_its_numbers_have_gone_on(lost: LostMessages):
    hear(lost, range(1008, 1020))  # seven are missing
    hear(lost, range(1023, 1023 + SURE))  # three more
    assert lost.lost == 0
    lost.hear(1023 + SURE)
    assert lost.lost == 10
    hear(lost, range(1124, 2000))
    hear(lost, range(2100, 2300))
    assert lost.lost == 110


@pytest.mark.parametrize("burst", [1, 2, SURE])
def test_numbers_of_two_publishers_never_count_as_losses(lost: LostMessages, burst: int):
    others, own = iter(range(500_000, 600_000)), iter(range(1001, 100_000))
    for _ in range(100):
        hear(lost, [next(others) for _ in range(burst)])
        hear(lost, [next(own) for _ in range(burst)])
    hear(lost, others)  # the first one is gone
    assert lost.lost == 0


def test_a_publisher_that_takes_over_begins_anew(lost: LostMessages, graph: Graph):
    graph.publisher = "two"
    hear(lost, chain(range(1500, 1700), range(1710, 1900)))
    assert lost.lost == 10  # its own gap alone


def test_in_doubt_nothing_is_counted(lost: LostMessages, graph: Graph):
    lost.hear(1010)
    lost.doubt()  # a second publisher has been there
    hear(lost, range(1011, 1300))
    assert lost.lost == 0
    graph.publisher = None
    hear(lost, range(1400, 1600))
    assert lost.lost == 0


def test_a_restart_of_the_publisher_is_no_loss(lost: LostMessages):
    hear(lost, range(1, 500))
    hear(lost, range(600, 800))
    assert lost.lost == 100
