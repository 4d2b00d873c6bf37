"""Columns over time of a judged run, collected sample by sample."""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Sequence

import numpy as np

from irsbot_kinematics import statics
from irsbot_kinematics.numerics.arithmetic import ARRAYS, Array
from irsbot_msgs_py.records import SingularityState
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.core.margins import MARGIN_CAUSES, MARGIN_TEXTS
from irsbot_supervisor.core.reaction import OBSERVABLE
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.stopping import limits_of
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.replay.quiet.strides import QuietRows
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

    def add_rows(self, times: Array, supervisor: Supervisor, rows: QuietRows, compute_s: Array) -> None:
        """Add samples that were judged as columns. times, compute_s: (N,) as of `add`."""
        joints, found, part = rows.joints, rows.postures, rows.rows
        settings, legs, nothing = supervisor.settings, found.legs, np.zeros(len(times))
        screws = [[column[part] for column in row] for row in legs.screws]
        levers = [lever[part] for lever in legs.levers]
        drive = [-(lever * rate) for lever, rate in zip(levers, joints.velocity.T, strict=True)]
        force = settings.load_force_n + settings.payload_kg * settings.gravity_m_s2
        turns = bool(legs.attachments)
        largest = statics.reaction_max(ARRAYS, screws, force, settings.load_moment_nm, turns=turns)
        kind = (rows.certified - np.array(limits_of(settings, "stop"))).argmin(1)
        measured = np.full(joints.position.shape, np.nan)
        if joints.effort.shape[1]:
            sines = np.abs([sine[part] for sine in legs.normalised_levers]).T
            measured = np.where(sines >= OBSERVABLE, -joints.effort / np.array(levers).T, np.nan)
        self.count += len(times)
        self._put_rows("time", times)
        self._put_rows("level", nothing)
        self._put_rows("causes", nothing)
        self._put_rows("margin", found.margins[part])
        self._put_rows("until rest", np.take_along_axis(rows.certified, kind[:, None], 1))
        self._put_rows("pose", found.pose[part])
        self._put_rows("pose rate", np.stack(statics.twist(screws, drive), axis=1))
        self._put_rows("joint", joints.position)
        self._put_rows("joint rate", joints.velocity)
        self._put_rows("pressure angle", np.arccos([cosine[part] for cosine in found.cosines]).T)
        self._put_rows("force", measured)
        self._put_rows("largest force", np.stack(largest, axis=1))
        self._put_rows("age", (joints.received_ns - joints.stamp_ns) / NS_PER_S)
        self._put_rows("computing", compute_s)

    def _put_rows(self, kind: str, values: Array) -> None:
        self._rows.setdefault(kind, array("d")).frombytes(np.ascontiguousarray(values, dtype=float).tobytes())

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
