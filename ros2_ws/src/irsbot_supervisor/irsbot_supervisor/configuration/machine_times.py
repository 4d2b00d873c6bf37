"""Times that a computer keeps during supervision, and the settings that follow."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from math import ceil, inf
from typing import NamedTuple

from irsbot_supervisor.configuration.stopping_cost import longest_judging
from irsbot_supervisor.core.settings import Settings, time_for_cuts
from irsbot_supervisor.core.stopping import cuts_of

STALE, LATE = 2.0, 1.5
"""Factors on measured times: a longer run shows longer times."""

TEN_US = 1e-5
"""s: step of short proposed times."""

ROUNDING = 1e-6
"""1: part of a step that is no time, but the rounding of a product."""

MOST_HEARTBEAT_S, MOST_BOUNDING_S, MOST_JUDGING_S = (
    float(Settings.__dataclass_fields__[name].metadata["high"]) for name in ("heartbeat_s", "bounding_s", "judging_s")
)
"""s: the largest values that the settings allow; consumers brake after 0.1 s without verdicts."""


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


def bounding_for(longest_s: float, cuts: int) -> float:
    """The bounding_s with which a sample that has so many cuts has 1.5 times its longest time, s."""
    return _up(LATE * longest_s / time_for_cuts(1.0, cuts), TEN_US)


def proposed_bounding(settings: Settings, longest_s: Mapping[int, float], cuts: int) -> Proposed:
    """bounding_s for the number of cuts that pays; never below the value in force, kept if none is stated. longest_s:
    time to judge a sample, by the number of cuts; also of the settings."""
    now, needed, mine = settings.bounding_s, bounding_for(longest_s[cuts], cuts), cuts_of(settings)
    kept = now == 0.0 or bounding_for(longest_s[mine], mine) <= now
    met, why = longest_s[cuts] / time_for_cuts(1.0, cuts), "1.5 times the longest step, for each of its boxes"
    return Proposed("bounding_s", now, met, min(max(now, needed), MOST_BOUNDING_S), why, kept)


def proposals(settings: Settings, met: Times, period_s: float, bounding: Proposed, cuts: int) -> list[Proposed]:
    """stale_s, heartbeat_s, latency_s, bounding_s and judging_s from measured times; never below the values in force.
    period_s: between the samples of the run. cuts: that a sample has to have time for."""
    allowed_s = longest_judging(settings, period_s)
    judged = settings.judging_s if met.judging_s <= allowed_s else _up(LATE * met.judging_s)
    judging, why = _up(time_for_cuts(bounding.value, cuts), TEN_US), f"time for {cuts} cut{'s' * (cuts != 1)}"
    if judged >= judging:
        judging, why = judged, "1.5 times the longest judging of a sample"
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
        bounding,
        Proposed(
            "judging_s",
            settings.judging_s,
            met.judging_s,
            min(judging, MOST_JUDGING_S),
            why,
            judged <= settings.judging_s,
        ),
    ]


def _proposed(name: str, now: float, met: float, needed: float, why: str, most: float = inf) -> Proposed:
    return Proposed(name, now, met, min(needed, most), why, needed <= now)


def _up(seconds: float, step_s: float = 1e-3) -> float:
    """Rounded up to a whole number of steps."""
    per_s = round(1.0 / step_s)
    return ceil(seconds * per_s - ROUNDING) / per_s if seconds < inf else seconds
