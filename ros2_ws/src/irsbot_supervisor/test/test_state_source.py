"""Where views hear states: as summaries, and one by one where nobody sums them up, as beside a bag that is played."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from math import nan
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

import rclpy
from irsbot_msgs.msg import SingularityState as StateMessage
from irsbot_msgs.msg import StateSummary as SummaryMessage
from rclpy.node import Node

from irsbot_msgs_py.cdr import encode_state, encode_summary
from irsbot_msgs_py.records import SingularityState
from irsbot_msgs_py.summary import StateSummary
from irsbot_supervisor.processes.monitoring import Monitor
from irsbot_supervisor.processes.observed import Seen
from irsbot_supervisor.processes.suite import free_domain
from irsbot_supervisor.replay.recording import read_recording

pytestmark = pytest.mark.ros

PATIENCE_S = 120.0
STATE = read_recording(Path(__file__).resolve().parents[4] / "bags" / "type2").states[200]


class Player:
    """Publishes states and, if asked to, summaries, in another process's stead."""

    def __init__(self) -> None:
        self.domain = free_domain()
        self._context = rclpy.Context()
        rclpy.init(context=self._context, domain_id=self.domain)
        self.node: Node = rclpy.create_node("player", namespace="left", context=self._context)
        self.states: Any = self.node.create_publisher(StateMessage, "supervisor/state", 100)
        self.summaries: Any = None
        self._sent = 0

    def offer_summaries(self) -> None:
        self.summaries = self.node.create_publisher(SummaryMessage, "supervisor/summary", 10)

    def withdraw_summaries(self) -> None:
        self.node.destroy_publisher(self.summaries)
        self.summaries = None

    def play(self) -> None:
        """The next state, with a number of its own."""
        self._sent += 1
        state = STATE._replace(sequence=self._sent)
        self.states.publish(encode_state(state._replace(robot="one by one")))
        if self.summaries is not None:
            summary = StateSummary(state._replace(robot="summed up"), 1, self._sent, *(nan, nan, 0.2, 0.6), *(nan,) * 6)
            self.summaries.publish(encode_summary(summary))

    def wanted(self) -> bool:
        """True if somebody listens to the states themselves."""
        return self.states.get_subscription_count() > 0

    def close(self) -> None:
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)


@pytest.fixture
def player() -> Iterator[Player]:
    found = Player()
    yield found
    found.close()


@pytest.fixture
def monitor(player: Player) -> Iterator[Monitor]:
    with Monitor(player.domain, "left") as found:
        yield found


def shown(player: Player, monitor: Monitor, enough: Callable[[Seen], bool]) -> Seen:
    """The first look that is as wanted, while the player plays."""
    deadline = time.monotonic() + PATIENCE_S
    while True:
        player.play()
        seen = monitor.look(0.02)
        if enough(seen):
            return seen
        assert time.monotonic() < deadline


def robot_of(seen: Seen) -> str:
    state: SingularityState | None = seen.state
    return state.robot if state is not None else ""


def test_states_that_nobody_sums_up_are_heard_one_by_one(player: Player, monitor: Monitor) -> None:
    seen = shown(player, monitor, lambda seen: robot_of(seen) == "one by one" and len(seen.smallest) == 5)
    assert player.wanted()
    assert (seen.smallest[1], seen.largest[1]) == (STATE.type2_margin, STATE.type2_margin)
    assert seen.state_hz >= 1.0


def test_where_summaries_are_offered_no_state_is_listened_to(player: Player) -> None:
    player.offer_summaries()
    with Monitor(player.domain, "left") as monitor:
        seen = shown(player, monitor, lambda seen: robot_of(seen) == "summed up" and len(seen.smallest) == 5)
        assert (seen.smallest[1], seen.largest[1]) == (0.2, 0.6)
        shown(player, monitor, lambda _seen: not player.wanted())
        for _ in range(20):
            assert robot_of(shown(player, monitor, lambda _seen: True)) == "summed up"
        assert not player.wanted()


def test_the_source_follows_what_is_offered(player: Player, monitor: Monitor) -> None:
    """A supervisor that starts beside a played bag, and ends before it."""
    shown(player, monitor, lambda seen: robot_of(seen) == "one by one")
    player.offer_summaries()
    shown(player, monitor, lambda seen: robot_of(seen) == "summed up" and not player.wanted())
    player.withdraw_summaries()
    shown(player, monitor, lambda seen: robot_of(seen) == "one by one")
    assert player.wanted()
