"""What a computer kept of the times that supervision stands on, and the settings that it could keep."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

from irsbot_supervisor.core.settings import Settings

STALE, LATE = 2.0, 1.5
"""Times what was met: a longer run meets more."""

MOST_HEARTBEAT_S = 0.02
"""s: the largest heartbeat that the settings allow; consumers brake after 0.1 s."""


class Times(NamedTuple):
    """The longest times of a run, s."""

    sample_gap_s: float
    """Between two samples as the supervisor saw them."""
    verdict_gap_s: float
    """Between two verdicts as a listener heard them."""
    delay_s: float
    """From the stamp of a sample to the verdict that knows it, as a listener heard it."""


class Proposed(NamedTuple):
    """One setting: its value now, what was met, and what this computer could keep."""

    name: str
    now: float
    met: float
    value: float
    why: str

    @property
    def kept(self) -> bool:
        """Whether the value now is one that this computer keeps."""
        return self.value <= self.now


def longest(seen_s: Sequence[float], heard_s: Sequence[float], delays_s: Sequence[float]) -> Times:
    """seen_s: when samples were seen; heard_s: when verdicts were heard; delays_s: of each verdict. Sorted, s."""

    def gap(times: Sequence[float]) -> float:
        return max((b - a for a, b in itertools.pairwise(times)), default=float("inf"))

    return Times(gap(seen_s), gap(heard_s), max(delays_s, default=float("inf")))


def proposals(settings: Settings, met: Times) -> list[Proposed]:
    """stale_s, heartbeat_s and latency_s from what was met: never below what is set."""
    stale = max(settings.stale_s, _up(STALE * met.sample_gap_s))
    heartbeat = min(max(settings.heartbeat_s, _up(met.verdict_gap_s / STALE)), MOST_HEARTBEAT_S)
    latency = max(settings.latency_s, _up(LATE * met.delay_s))
    return [
        Proposed("stale_s", settings.stale_s, met.sample_gap_s, stale, "twice the longest gap between samples"),
        Proposed(
            "heartbeat_s", settings.heartbeat_s, met.verdict_gap_s, heartbeat, "half the longest gap between verdicts"
        ),
        Proposed("latency_s", settings.latency_s, met.delay_s, latency, "1.5 times the longest way to a verdict"),
    ]


def _up(seconds: float) -> float:
    """Rounded up to a whole ms."""
    return -(-seconds * 1e3 // 1.0) / 1e3 if seconds < float("inf") else seconds
