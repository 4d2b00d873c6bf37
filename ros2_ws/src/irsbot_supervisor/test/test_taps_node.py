"""Which gaps in the numbers of messages count as losses: those of one publisher alone. Without DDS."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import chain

import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

from irsbot_supervisor.nodes.taps import SURE, Gaps

pytestmark = pytest.mark.ros


class Graph:
    """Who publishes, as far as can be known."""

    def __init__(self) -> None:
        self.publisher: str | None = "one"


@pytest.fixture
def graph() -> Graph:
    return Graph()


@pytest.fixture
def gaps(graph: Graph) -> Gaps:
    """After enough messages of one publisher, the last of them number 1000."""
    gaps = Gaps(lambda: graph.publisher)
    hear(gaps, range(1, 1001))
    return gaps


def hear(gaps: Gaps, numbers: Iterable[int]) -> None:
    for number in numbers:
        gaps.hear(number)


def test_without_a_gap_nothing_is_lost(gaps: Gaps):
    assert gaps.lost == 0


def test_gaps_of_the_only_publisher_are_losses_once_its_numbers_have_gone_on(gaps: Gaps):
    hear(gaps, range(1008, 1020))  # seven are missing
    hear(gaps, range(1023, 1023 + SURE))  # three more
    assert gaps.lost == 0
    gaps.hear(1023 + SURE)
    assert gaps.lost == 10
    hear(gaps, range(1124, 2000))
    hear(gaps, range(2100, 2300))
    assert gaps.lost == 110


@pytest.mark.parametrize("burst", [1, 2, SURE])
def test_numbers_of_two_publishers_are_never_losses_whatever_the_graph_says(gaps: Gaps, burst: int):
    others, own = iter(range(500_000, 600_000)), iter(range(1001, 100_000))
    for _ in range(100):
        hear(gaps, [next(others) for _ in range(burst)])
        hear(gaps, [next(own) for _ in range(burst)])
    hear(gaps, others)  # the first one is gone
    assert gaps.lost == 0


def test_a_publisher_that_takes_over_begins_anew(gaps: Gaps, graph: Graph):
    graph.publisher = "two"
    hear(gaps, chain(range(1500, 1700), range(1710, 1900)))
    assert gaps.lost == 10  # its own gap alone


def test_in_doubt_nothing_is_counted(gaps: Gaps, graph: Graph):
    gaps.hear(1010)
    gaps.doubt()  # a second publisher has been there
    hear(gaps, range(1011, 1300))
    assert gaps.lost == 0
    graph.publisher = None
    hear(gaps, range(1400, 1600))
    assert gaps.lost == 0


def test_a_restart_of_the_publisher_is_no_loss(gaps: Gaps):
    hear(gaps, range(1, 500))
    hear(gaps, range(600, 800))
    assert gaps.lost == 100
