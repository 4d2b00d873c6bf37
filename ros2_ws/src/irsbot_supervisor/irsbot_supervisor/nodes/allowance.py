"""How much of something may be used up: it comes at a steady rate, and some of it can be saved."""

from __future__ import annotations

from irsbot_msgs_py.stamps import NS_PER_S


class Allowance:
    """`left` grows by `per_s` each second, up to `most`; whoever uses something subtracts it, also below 0."""

    def __init__(self, per_s: float, most: float, now_ns: int) -> None:
        """now_ns: steady clock; in the beginning all of `most` is there."""
        self.left = most
        self._per_ns, self._most, self._since_ns = per_s / NS_PER_S, most, now_ns

    def grow(self, now_ns: int) -> float:
        """What is left at this time."""
        self.left = min(self.left + (now_ns - self._since_ns) * self._per_ns, self._most)
        self._since_ns = now_ns
        return self.left
