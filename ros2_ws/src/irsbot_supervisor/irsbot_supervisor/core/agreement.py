"""Whether the rates that a message reports add up to the way that its positions go.

One difference of positions says little: its stamps may be off, and it lags. The sum over a while says more: what a late
stamp adds the next one takes away, but rates that are zeros, scaled, or filtered for long stay behind for good.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

from irsbot_msgs_py.records import Floats

MEMORY_S = 0.01
"""s: how fast it is forgotten that rates and positions disagreed."""

JITTER_S = 0.0005
"""s by which a stamp may be off without saying that a joint jumped, as far as the message says that the joint moves:
senders without real time stamp late at times."""


class Agreement:
    """Adds up, per joint, what positions go beyond what was reported."""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """From now on everything agrees."""
        self.begun = False
        self._said: Sequence[float] = ()
        self._apart: Sequence[float] = ()
        self._fast: Sequence[float] = ()

    def doubts(
        self,
        moved: Floats,
        said: Floats,
        before: Floats,
        times_s: tuple[float, float],
        fastest: Floats,
        brakes: Floats,
        play: float,
    ) -> list[bool]:
        """Which of the reported rates have not added up, with one more sample.

        moved: rad or m since the last sample. said: rates now, rad/s or m/s; before: with the last sample, of which
        nothing is known here. times_s: since the last sample, by the sender's clock and by ours; what one of them
        explains needs no doubt, as clocks are set and messages wait. fastest, brakes: what the joints can do, rad/s and
        rad/s2 or m/s and m/s2. play: rad or m that positions may be off. A rate that is not finite adds nothing.
        """
        count = len(said)
        last = self._said if self.begun else [_within(rate, most) for rate, most in zip(before, fastest, strict=True)]
        apart, fast = (self._apart, self._fast) if self.begun else ([0.0] * count, [0.0] * count)
        now = [_within(rate, most) for rate, most in zip(said, fastest, strict=True)]
        dt, passed_s = times_s
        kept = max(1.0 - dt / MEMORY_S, 0.0)
        joints = zip(apart, moved, [0.5 * (a + b) for a, b in zip(last, now, strict=True)], strict=True)
        self._apart = [
            kept * away + min(step - dt * mean, step - passed_s * mean, key=abs) for away, step, mean in joints
        ]
        self._fast = [max(abs(a), abs(b), kept * most) for a, b, most in zip(last, now, fast, strict=True)]
        self._said, self.begun = now, True
        # Two stamps may be off; between two samples rates change by no more than the brakes can do.
        return [
            not abs(away) <= 2.0 * JITTER_S * most + play + 0.25 * brake * dt * dt
            for away, most, brake in zip(self._apart, self._fast, brakes, strict=True)
        ]


def _within(rate: float, most: float) -> float:
    return max(-most, min(rate, most)) if isfinite(rate) else 0.0
