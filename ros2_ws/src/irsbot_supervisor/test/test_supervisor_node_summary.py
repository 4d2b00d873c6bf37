"""~/summary of supervisor_node, over DDS: its states are those of ~/state, and for nobody nothing is summed up."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

from cell import GOOD, Cell, Wire, bad, resting, silent, swinging
from irsbot_msgs.msg import StateSummary as SummaryMessage
from lifecycle_msgs.msg import Transition
from rclpy.subscription import Subscription

from irsbot_msgs_py.cdr import decode_summary
from irsbot_msgs_py.records import Level, SingularityState
from irsbot_msgs_py.summary import StateSummary
from irsbot_supervisor.core.margins import MARGIN_CAUSES
from irsbot_supervisor.nodes.supervisor import SHOWN_NS
from irsbot_supervisor.replay.run_summary import margin_of

pytestmark = pytest.mark.ros


class Summaries:
    """What a viewer hears."""

    def __init__(self, cell: Cell) -> None:
        self._cell, self.heard = cell, list[StateSummary]()
        self._subscription: Subscription | None = None

    def listen(self) -> None:
        self._subscription = self._cell.node.create_subscription(
            SummaryMessage, "supervisor/summary", lambda data: self.heard.append(decode_summary(data)), 100, raw=True
        )

    def stop(self) -> None:
        assert self._subscription is not None
        self._cell.node.destroy_subscription(self._subscription)
        self._subscription = None

    def more(self, count: int) -> list[StateSummary]:
        """So many, from now on."""
        start = len(self.heard)
        self._cell.wire.until(lambda: len(self.heard) >= start + count, f"{count} summaries")
        return self.heard[start:]


@pytest.fixture
def summaries(cell: Cell) -> Iterator[Summaries]:
    found = Summaries(cell)
    found.listen()
    yield found
    if found._subscription is not None:
        found.stop()


def test_a_summary_holds_the_newest_state_and_the_extremes_of_those_in_between(
    cell: Cell, summaries: Summaries
) -> None:
    begin_ns = time.time_ns()
    swing = swinging(GOOD, begin_ns)
    cell.say = lambda t: bad(t, position=(math.nan, math.nan)) if t // 10**6 % 200 < 20 else swing(t)
    found = summaries.more(40)
    last = found[-1].state.sequence
    cell.wire.until(lambda: cell.states[-1].sequence >= last, "the states of the summaries")
    cell.say = swinging(GOOD, begin_ns, time.time_ns() + 10**9)
    cell.wire.until(lambda: cell.states[-1].joint_velocity == (0.0, 0.0) and cell.states[-1].joint_position == GOOD)
    states = {state.sequence: state for state in cell.states}
    spans = []
    for before, summary in pairwise(found):
        assert summary.state_total == before.state_total + summary.state_count
        numbers = range(before.state.sequence + 1, summary.state.sequence + 1)
        assert summary.state_count == len(numbers)
        assert repr(summary.state) == repr(states[summary.state.sequence])  # with the time of computing
        margins = np.array([columns_of(states[number]) for number in numbers])
        for place, column in enumerate(margins.T):
            known = column[np.isfinite(column)]
            expected = [known.min(), known.max()] if len(known) else [math.nan, math.nan]
            ends = [summary.smallest[place], summary.largest[place]]
            assert ends == pytest.approx(expected, abs=0.0, rel=0.0, nan_ok=True)
            spans.append(ends[1] - ends[0])
    assert max(summary.state_count for summary in found) > 5
    assert np.nanmax(spans) > 1e-4  # the newest value alone would not have told


def columns_of(state: SingularityState) -> list[float]:
    return [*[margin_of(state, kind) for kind in MARGIN_CAUSES], state.stop_margin]


def test_for_nobody_nothing_is_summed_up(cell: Cell, summaries: Summaries) -> None:
    before = summaries.more(3)[-1]
    summaries.stop()
    cell.wire.until(lambda: not cell.node.count_subscribers("supervisor/summary"), "nobody listens")
    heard = cell.states[-1].sequence
    cell.wire.until(lambda: cell.states[-1].sequence > heard + 2000)
    summaries.listen()
    after = summaries.more(3)
    unheard = after[0].state.sequence - before.state.sequence
    assert unheard > 2000
    assert (
        after[0].state_total - before.state_total < unheard - 400
    )  # but for those until it notices that nobody listens
    assert after[0].state_count < 100


def test_without_samples_no_summary_comes_and_then_the_next_one_does(cell: Cell, summaries: Summaries) -> None:
    summaries.more(2)
    cell.say = lambda t: None
    cell.heard_level(Level.UNKNOWN)
    start = len(summaries.heard)
    cell.heard_many(20)  # 0.2 s of heartbeats
    assert len(summaries.heard) <= start + 1  # that was on its way
    cell.say = resting(GOOD)
    summaries.more(2)
    cell.heard_level(Level.OK)


def test_a_listener_to_summaries_alone_gets_them_whole(wire: Wire) -> None:
    """Nobody wants states: they are made for the summaries alone, and all samples count."""
    cell = Cell(wire)
    cell.heard_level(Level.OK)
    (states,) = [one for one in cell.node.subscriptions if one.topic_name == "/supervisor/state"]
    cell.node.destroy_subscription(states)
    wire.until(lambda: not cell.node.count_subscribers("supervisor/state"))
    cell.say = swinging(GOOD, time.time_ns())
    summaries = Summaries(cell)
    summaries.listen()
    found = summaries.more(30)
    for before, summary in pairwise(found):
        assert summary.state_count == summary.state.sequence - before.state.sequence
        assert summary.state_total == before.state_total + summary.state_count
        assert 0.0 < summary.state.compute_time < 1.0
        if math.isfinite(summary.state.type2_margin):  # else the newest sample was too old to be judged
            assert summary.smallest[1] <= summary.state.type2_margin <= summary.largest[1]
        assert summary.smallest[1] < summary.largest[1] or summary.state_count == 1
    assert max(summary.state_count for summary in found) > 2
    assert min(b.state.seen_ns - a.state.seen_ns for a, b in pairwise(found)) < SHOWN_NS  # not only with the markers


def test_only_an_active_supervisor_offers_summaries(wire: Wire) -> None:
    cell = Cell(wire)
    summaries = Summaries(cell)
    summaries.listen()
    before = summaries.more(2)[-1]
    assert cell.change(Transition.TRANSITION_DEACTIVATE)
    wire.until(lambda: silent(cell), "silence")
    assert not cell.node.count_publishers("supervisor/summary")
    assert cell.change(Transition.TRANSITION_ACTIVATE)
    after = summaries.more(2)[-1]
    assert after.state_total > before.state_total
