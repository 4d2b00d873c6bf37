"""Plain twin of StateSummary.msg."""

from __future__ import annotations

from typing import NamedTuple

from irsbot_msgs_py.records import Floats, SingularityState


class StateSummary(NamedTuple):
    """The newest state and the extremes of several, with the fields of StateSummary.msg, which states their meaning."""

    state: SingularityState
    state_count: int
    state_total: int
    type1_margin_min: float
    type1_margin_max: float
    type2_margin_min: float
    type2_margin_max: float
    constraint_margin_min: float
    constraint_margin_max: float
    limb_margin_min: float
    limb_margin_max: float
    stop_margin_min: float
    stop_margin_max: float

    @property
    def smallest(self) -> Floats:
        """Smallest Type 1, Type 2, constraint, limb and stop margin, (5,); NaN where none is known."""
        return tuple(self[3::2])

    @property
    def largest(self) -> Floats:
        """The largest, likewise."""
        return tuple(self[4::2])
