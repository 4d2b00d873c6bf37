"""The clock of a demo: its length counts from the first judged sample, however long the joints take to start."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from irsbot_supervisor.cli import demo
from irsbot_supervisor.cli.common import Failed


class Watch:
    """Every look takes a second; the first sample is judged in the look of this number."""

    def __init__(self, timeline: demo._Timeline, first: int, monkeypatch: pytest.MonkeyPatch) -> None:
        self.timeline, self.first, self.looks = timeline, first, 0
        monkeypatch.setattr(demo.time, "monotonic", lambda: float(self.looks))

    def look(self, seconds: float) -> None:
        self.looks += 1
        if self.looks == self.first:
            self.timeline.begin(SimpleNamespace(stamp_ns=1))


SUITE = SimpleNamespace(check=lambda: None)


@pytest.mark.parametrize("first", [1, 25])
@pytest.mark.parametrize("stops", [True, False])
def test_the_planned_length_counts_from_the_first_sample(
    first: int, stops: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = SimpleNamespace(expect=SimpleNamespace(stop=stops))
    timeline = demo._Timeline()
    watch = Watch(timeline, first, monkeypatch)
    demo._await(SUITE, watch, lambda: timeline.began, "no joint state was judged")
    demo._follow(SUITE, watch, timeline, demo._limit(plan, 20.0))
    longer_s = demo.GRACE_S if stops else demo.AFTERWARDS_S  # a robot that should be stopped may be stuck
    assert watch.looks - first == demo.START_DELAY_S + 20.0 + longer_s


def test_joints_that_publish_nothing_are_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    timeline = demo._Timeline()
    watch = Watch(timeline, 10_000, monkeypatch)
    with pytest.raises(Failed, match="no joint state was judged in 30 s"):
        demo._await(SUITE, watch, lambda: timeline.began, "no joint state was judged")
