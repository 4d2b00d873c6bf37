"""Proves that a robot has kept its branch between two samples: that no Type 2 singularity is where its joints may have
been."""

from __future__ import annotations

from math import inf

from irsbot_kinematics import Mechanism, Posture
from irsbot_msgs_py.records import Floats
from irsbot_supervisor.core.box_search import BoxBounds
from irsbot_supervisor.core.estimation.estimate import Silence
from irsbot_supervisor.core.settings import LEAST_LIMIT, Settings
from irsbot_supervisor.core.stopping import WIDER, cuts_of, wider

APART = (-inf, LEAST_LIMIT, -inf, -inf)
"""Goal of the bounds: no Type 2 singularity is met."""


class BranchProof:
    """Keeps the last region, in which the next ones of a robot that hardly moves lie too."""

    def __init__(self, settings: Settings, mechanism: Mechanism) -> None:
        self._bounds = BoxBounds(mechanism, settings.slack_m)
        self.cuts = cuts_of(settings)
        """Number of cuts for one sample."""
        self._free: tuple[Floats, Floats] | None = None  # low and high ends, rad or m

    def forget(self) -> None:
        """Forget the region: the robot may have left it, and may come back on another branch."""
        self._free = None

    def holds(self, at: Posture, silence: Silence) -> bool:
        """True if the branch of a posture is that of the robot after a silence. at: at its begin."""
        if self._free is not None and _lies_in((silence.low, silence.high), self._free):
            return True
        self._free = None
        if silence.in_time:  # as may be the samples that follow
            wide = wider(silence.low, silence.high, WIDER)
            if self._is_free(at, *wide, self.cuts // 2):
                self._free = wide
                return True
        cuts = self.cuts // 2 if silence.in_time else self.cuts
        return self._is_free(at, silence.low, silence.high, cuts)

    def _is_free(self, at: Posture, low: Floats, high: Floats, cuts: int) -> bool:
        return self._bounds.least(at, low, high, APART, cuts)[1] >= LEAST_LIMIT


def _lies_in(region: tuple[Floats, Floats], other: tuple[Floats, Floats]) -> bool:
    (low, high), (least, most) = region, other
    return all(a <= b for a, b in zip(least, low, strict=True)) and all(a >= b for a, b in zip(most, high, strict=True))
