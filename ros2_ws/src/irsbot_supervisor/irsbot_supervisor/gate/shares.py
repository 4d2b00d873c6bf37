"""Shares of a commanded motion that are tried where the whole of it does not pass."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

STEP = 1.25
"""1: largest increase of the allowed share from one command to the next."""

LEAST = 0.01
"""1: smaller shares of a command count as 0."""


class Shares(NamedTuple):
    """1: of the motion along the level lines of a margin, and of the motion towards its limit; the second is 0 where
    the first is not 1."""

    along: float
    inward: float

    @property
    def more(self) -> Shares:
        """A little more."""
        if self.along < 1.0:
            return Shares(min(max(self.along, LEAST) * STEP, 1.0), 0.0)
        return Shares(1.0, min(max(self.inward, LEAST) * STEP, 1.0))

    def fewer(self, towards: bool) -> Iterator[Shares]:
        """Less and less, first of the motion towards the limit, down to none. towards: False if there is no such
        motion."""
        if towards and self.inward > 0.0:
            yield from (Shares(1.0, share) for share in _falling(self.inward))
            yield Shares(1.0, 0.0)
        yield from (Shares(share, 0.0) for share in _falling(self.along))
        yield Shares(0.0, 0.0)


WHOLE = Shares(1.0, 1.0)


def _falling(share: float) -> Iterator[float]:
    """A little less, then halves: the limit may come near faster than a search in small steps ends."""
    share /= STEP
    while share >= LEAST:
        yield share
        share *= 0.5
