"""Learns the interval of samples from those that came."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from irsbot_msgs_py.stamps import NS_PER_S

SETTLING = 2.0
"""1: multiple of the longest time without a sample over which intervals are remembered, and for which the interval is
learned after a silence: the window contains two intervals of any length."""

JUDGING_S = 0.005
"""s: longest time to judge a sample, if `judging_s` does not state it and samples come more rarely."""


def judging_time(stated_s: float, interval_s: float) -> float:
    """Longest time to judge a sample, s: `judging_s`, or what an interval between samples leaves
    (docs/explanation/guarantee.md, assumption 9)."""
    return max(stated_s, min(interval_s, JUDGING_S))


class SecondLargestMemory(NamedTuple):
    """What `SecondLargest` remembers."""

    since_ns: int | None  # when this span began; None: with the next value
    now: tuple[float, float]  # the two largest values of this span
    before: tuple[float, float]  # and of the one before


class SecondLargest:
    """The second-largest value of a window of one to two spans: the largest may be an outlier."""

    def __init__(self) -> None:
        self._since_ns: int | None = None  # when this span began; None: with the next value
        self._now = self._before = 0.0, 0.0  # the two largest of this span and of the one before

    @property
    def any(self) -> bool:
        """True if anything is remembered."""
        return self._now[0] > 0.0 or self._before[0] > 0.0

    @property
    def memory(self) -> SecondLargestMemory:
        """All that is remembered, for `remember`."""
        return SecondLargestMemory(self._since_ns, self._now, self._before)

    def remember(self, memory: SecondLargestMemory) -> None:
        """Go on from a memory."""
        self._since_ns, self._now, self._before = memory

    def second(self, at_ns: int, value: float, span_ns: float) -> float:
        """The second-largest value after adding one, at least 0; 0 if there is only one."""
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
        """Forget all values."""
        self._since_ns, self._now, self._before = None, (0.0, 0.0), (0.0, 0.0)

    def keep(self, most: float) -> None:
        """Keep the values for one more window, whatever its span becomes; each is limited to `most`."""
        (a, b), (c, d) = self._now, self._before
        self._now, self._before = (min(a, most), min(b, most)), (min(c, most), min(d, most))
        self._since_ns = None


class SampleInterval(NamedTuple):
    """Time until the next sample, s."""

    longest_s: float  # longest expected
    usual_s: float  # present interval of the sender; at most as long
    late: bool  # True if samples have come more rarely than that
    rare: bool  # and more rarely than heartbeats


class IntervalMemory(NamedTuple):
    """What `SampleIntervals` remembers."""

    sent_s: float  # between the last two samples, for the sender
    learned_ns: int | None  # when the last silence ended
    longest: SecondLargestMemory


class SampleIntervals:
    """Longest expected interval between samples: the second-longest in the window, so that a single outlier is ignored.
    Intervals count by the sender's stamps or by the receiver's clock, whichever is longer, so that for samples in
    bursts the interval of the bursts counts. A silence is not an interval: it is noticed while it lasts, and the
    interval is learned anew after it."""

    def __init__(self) -> None:
        self._silence_s, self._stated_s, self._beat_s = inf, 0.0, 0.0
        self._sent_s = inf  # between the last two samples, for the sender
        self._learned_ns: int | None = None  # when the last silence ended
        self._longest = SecondLargest()

    def configure(self, silence_s: float, stated_s: float, beat_s: float) -> None:
        """silence_s: a longer interval is a silence. stated_s: interval that is always expected. beat_s: longest time
        between verdicts; samples within it are not late."""
        self._stated_s, self._beat_s = stated_s, beat_s
        if silence_s != self._silence_s:
            self._silence_s = silence_s
            self._longest.keep(silence_s)

    @property
    def memory(self) -> IntervalMemory:
        """All that is remembered, for `remember`."""
        return IntervalMemory(self._sent_s, self._learned_ns, self._longest.memory)

    def remember(self, memory: IntervalMemory) -> None:
        """Go on from a memory."""
        self._sent_s, self._learned_ns = memory.sent_s, memory.learned_ns
        self._longest.remember(memory.longest)

    def expected(self, seen_ns: int, passed_s: float, stamped_s: float) -> SampleInterval:
        """Time until the next sample, after an interval that has just ended. passed_s, stamped_s: its length by the
        receiver's clock and by the sender's, which may also have been set."""
        silence_s, usual_s = self._silence_s, max(min(stamped_s, self._sent_s), self._stated_s)
        self._sent_s = stamped_s
        if passed_s > silence_s:
            self._longest.forget()
            self._learned_ns = seen_ns
            return SampleInterval(silence_s, silence_s, False, False)
        gap_s = stamped_s if passed_s < stamped_s <= silence_s else passed_s
        longest_s = self._longest.second(seen_ns, gap_s, SETTLING * silence_s * NS_PER_S) or gap_s
        longest_s = max(longest_s, self._stated_s)
        met_s = max(longest_s, stamped_s)
        return SampleInterval(longest_s, min(usual_s, longest_s), met_s > usual_s, met_s > max(usual_s, self._beat_s))

    def steady_s(self, seen_ns: int) -> float:
        """s since the last silence."""
        return (seen_ns - self._learned_ns) / NS_PER_S if self._learned_ns is not None else inf
