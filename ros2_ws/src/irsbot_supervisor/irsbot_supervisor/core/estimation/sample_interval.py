"""How often samples come, learned from those that came."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from irsbot_supervisor.core.intake import S

SETTLING = 2.0
"""1: how many times the longest time without a sample is looked back, and waited after a silence, until it is known how
often samples come: two gaps of any length are in it."""


class SecondLargest:
    """The second largest value of the last while, one to two spans: what was there once may be an accident."""

    def __init__(self) -> None:
        self._since_ns: int | None = None  # when this span began; None: with the next value
        self._now = self._before = 0.0, 0.0  # the two largest of this span and of the one before

    @property
    def any(self) -> bool:
        """Whether anything is remembered."""
        return self._now[0] > 0.0 or self._before[0] > 0.0

    def second(self, at_ns: int, value: float, span_ns: float) -> float:
        """With a new value, at least 0; 0 if there is only one."""
        since_ns = self._since_ns
        if since_ns is None:
            self._since_ns = since_ns = at_ns
        if at_ns - since_ns > span_ns:
            self._before = self._now if at_ns - since_ns <= 2.0 * span_ns else (0.0, 0.0)
            self._now, self._since_ns = (0.0, 0.0), at_ns
        a, b = self._now
        if value > b:
            self._now = a, b = (value, a) if value > a else (a, value)
        c, d = self._before
        return max(b, c) if a >= c else max(a, d)

    def forget(self) -> None:
        """Everything."""
        self._since_ns, self._now, self._before = None, (0.0, 0.0), (0.0, 0.0)

    def keep(self, most: float) -> None:
        """From now on for a while, whatever the span becomes; nothing counts for more than `most`."""
        (a, b), (c, d) = self._now, self._before
        self._now, self._before = (min(a, most), min(b, most)), (min(c, most), min(d, most))
        self._since_ns = None


class Interval(NamedTuple):
    """Time until the next sample, s."""

    longest_s: float  # as late as it may come
    usual_s: float  # as the sender goes on now; at most as long
    late: bool  # whether samples have come more rarely than that
    rare: bool  # and more rarely than heartbeats


class Gaps:
    """How long nothing may come. One gap does not announce another, but two do: the second longest of the last while
    counts, by the sender's stamps or by our clock, so that samples in bursts are as rare as their bursts. A silence is
    no gap: it is known when it lasts, and how often samples come is learned anew after it."""

    def __init__(self) -> None:
        self._silence_s, self._stated_s, self._beat_s = inf, 0.0, 0.0
        self._sent_s = inf  # between the last two samples, for the sender
        self._learned_ns: int | None = None  # when the last silence ended
        self._longest = SecondLargest()

    def configure(self, silence_s: float, stated_s: float, beat_s: float) -> None:
        """silence_s: a gap that is longer is a silence. stated_s: a gap of this length is always expected. beat_s: the
        longest time between verdicts; samples that come within it are not late."""
        self._stated_s, self._beat_s = stated_s, beat_s
        if silence_s != self._silence_s:
            self._silence_s = silence_s
            self._longest.keep(silence_s)

    def expected(self, seen_ns: int, passed_s: float, stamped_s: float) -> Interval:
        """When the next sample may come, after a gap that has just ended. passed_s, stamped_s: how long it was by our
        clock and by the sender's, which may also have been set."""
        silence_s, usual_s = self._silence_s, max(min(stamped_s, self._sent_s), self._stated_s)
        self._sent_s = stamped_s
        if passed_s > silence_s:
            self._longest.forget()
            self._learned_ns = seen_ns
            return Interval(silence_s, silence_s, False, False)
        gap_s = stamped_s if passed_s < stamped_s <= silence_s else passed_s
        longest_s = self._longest.second(seen_ns, gap_s, SETTLING * silence_s * S) or gap_s
        longest_s = max(longest_s, self._stated_s)
        met_s = max(longest_s, stamped_s)
        return Interval(longest_s, min(usual_s, longest_s), met_s > usual_s, met_s > max(usual_s, self._beat_s))

    def steady_s(self, seen_ns: int) -> float:
        """s since the last silence."""
        return (seen_ns - self._learned_ns) / S if self._learned_ns is not None else inf
