"""Times that a computer keeps during supervision, and the settings that follow."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from math import inf
from typing import NamedTuple

from irsbot_supervisor.core.estimation.sample_interval import judging_time
from irsbot_supervisor.core.settings import Settings

STALE, LATE = 2.0, 1.5
"""Factors on measured times: a longer run shows longer times."""

MOST_HEARTBEAT_S = 0.02
"""s: the largest heartbeat that the settings allow; consumers brake after 0.1 s."""


class Times(NamedTuple):
    """The longest times of a run, s."""

    sample_gap_s: float
    """Longest interval between two samples, as the supervisor received them."""
    verdict_gap_s: float
    """Longest interval between two verdicts, as a listener received them."""
    delay_s: float
    """Longest time from the stamp of a sample to its verdict, as a listener received it."""
    judging_s: float
    """Longest time to judge a sample, from its arrival."""


class Proposed(NamedTuple):
    """One setting: its value in force, the measured time, and the value that this computer can keep."""

    name: str
    now: float
    met: float
    value: float
    why: str
    kept: bool  # True if this computer keeps the value in force


def longest(
    seen_s: Sequence[float], heard_s: Sequence[float], delays_s: Sequence[float], judged_s: Sequence[float]
) -> Times:
    """Longest times. seen_s: arrivals of samples; heard_s: arrivals of verdicts, sorted, s. delays_s: of each verdict.
    judged_s: how long it took to judge each sample."""

    def gap(times: Sequence[float]) -> float:
        return max((b - a for a, b in itertools.pairwise(times)), default=inf)

    slowest = (max(times, default=inf) for times in (delays_s, judged_s))
    return Times(gap(seen_s), gap(heard_s), *slowest)


def proposals(settings: Settings, met: Times, period_s: float) -> list[Proposed]:
    """stale_s, heartbeat_s, latency_s and judging_s from measured times; never below the values in force. period_s:
    between the samples of the run."""
    allowed_s = judging_time(settings.judging_s, max(period_s, settings.sample_gap_s))
    judging = settings.judging_s if met.judging_s <= allowed_s else _up(LATE * met.judging_s)
    stale, silence = max(settings.stale_s, _up(STALE * met.sample_gap_s)), "twice the longest interval between samples"
    if judging > stale:
        stale, silence = judging, "as judging_s: while a sample is judged, no other is"
    heartbeat = max(settings.heartbeat_s, _up(met.verdict_gap_s / STALE))
    latency = max(settings.latency_s, _up(LATE * met.delay_s))
    beating = "half the longest interval between verdicts"
    if heartbeat > MOST_HEARTBEAT_S:
        beating = f"the largest that is allowed; {beating} needs {heartbeat:g} s"
    return [
        _proposed("stale_s", settings.stale_s, met.sample_gap_s, stale, silence),
        _proposed("heartbeat_s", settings.heartbeat_s, met.verdict_gap_s, heartbeat, beating, MOST_HEARTBEAT_S),
        _proposed("latency_s", settings.latency_s, met.delay_s, latency, "1.5 times the longest way to a verdict"),
        _proposed("judging_s", settings.judging_s, met.judging_s, judging, "1.5 times the longest judging of a sample"),
    ]


def _proposed(name: str, now: float, met: float, needed: float, why: str, most: float = inf) -> Proposed:
    return Proposed(name, now, met, min(needed, most), why, needed <= now)


def _up(seconds: float) -> float:
    """Rounded up to a whole ms."""
    return -(-seconds * 1e3 // 1.0) / 1e3 if seconds < inf else seconds
