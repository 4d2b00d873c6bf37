"""Columns over time of a judged run, collected sample by sample."""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Sequence

import numpy as np

from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_msgs_py.records import SingularityState
from irsbot_supervisor.core.margins import MARGIN_CAUSES, MARGIN_TEXTS
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.replay.run_summary import margin_of

MARGINS = tuple(MARGIN_TEXTS[kind] for kind in MARGIN_CAUSES)

SettingsInForce = Sequence[tuple[float, Settings]]
"""Settings, each with the time from which it is in force, s."""


class Series:
    """Columns of one run. Add every sample in order, then read the arrays, (N,) each."""

    def __init__(self) -> None:
        self._rows: dict[str, array[float]] = {}
        self.count = 0

    def add(self, time_s: float, state: SingularityState, compute_s: float) -> None:
        """Add one judged sample. time_s: since the first joint state. compute_s: time to judge it, NaN if not known."""
        self.count += 1
        self._put("time", (time_s,))
        self._put("level", (state.level,))
        self._put("causes", (state.causes,))
        self._put("margin", [margin_of(state, kind) for kind in MARGIN_CAUSES])
        self._put("until rest", (state.stop_margin,))
        self._put("pose", state.pose)
        self._put("pose rate", state.pose_rate)
        self._put("joint", state.joint_position)
        self._put("joint rate", state.joint_velocity)
        self._put("pressure angle", state.pressure_angle)
        self._put("force", state.reaction)
        self._put("largest force", state.reaction_max)
        self._put("age", (state.sample_age,))
        self._put("computing", (compute_s,))

    def _put(self, kind: str, values: Iterable[float]) -> None:
        self._rows.setdefault(kind, array("d")).extend(values)

    @property
    def times(self) -> Array:
        """(N,) s since the first joint state."""
        return self["time"][:, 0]

    def __getitem__(self, kind: str) -> Array:
        """The columns of a kind, (N, n); NaN where the value is not known."""
        columns = np.array(self._rows.get(kind, ()), dtype=float).reshape(self.count, -1)
        columns[~np.isfinite(columns)] = np.nan
        return columns
