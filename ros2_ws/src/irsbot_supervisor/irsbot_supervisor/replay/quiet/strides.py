"""Judges samples in strides: as columns where nothing can change, one by one by the supervisor elsewhere.

A sample is judged as a column if the supervisor surely finds nothing in it, by its own comparisons:

- `motion`: the estimator finds nothing; its numbers are exact.
- `postures`: the posture is solved, in the configured modes, away from Type 2, by more than GUARD.
- the first bound over the reachable box is above the release limits by more than GUARD, so that the supervisor takes
  it; or it is below them by more than GUARD, and the bounds that the supervisor then uses are at least the warning
  limits: `boxes`.

Everything else is judged by the supervisor, which first takes over the state at the end of the stride.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from irsbot_kinematics import Mechanism
from irsbot_msgs_py.records import JointSample
from irsbot_supervisor.bag.joint_columns import JointColumns, Times, Values
from irsbot_supervisor.core.settings import UNTRUSTED
from irsbot_supervisor.core.stopping import release_of
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.replay.quiet.boxes import Boxes
from irsbot_supervisor.replay.quiet.handover import agrees, hand_over, history
from irsbot_supervisor.replay.quiet.motion import History, MotionColumns
from irsbot_supervisor.replay.quiet.postures import GUARD, PostureColumns, four_margins, postures

SHIPPED = "irsbot_kinematics.mechanisms."
"""Begin of the names of modules with shipped mechanisms."""

LEAST_BLOCK, BLOCK = 256, 16384
"""Samples that are computed together: few after a surprise, then twice as many each time."""


@dataclass(frozen=True, eq=False)
class QuietRows:
    """Consecutive samples that the supervisor finds OK. joints: in the order of the robot. certified: (N, 4) margins
    until standstill. rows: of the postures. last: number of the last sample for the supervisor."""

    joints: JointColumns
    certified: Values
    postures: PostureColumns
    rows: slice
    last: int


def suits(supervisor: Supervisor) -> bool:
    """True if samples of this robot can be judged as columns under its settings."""
    settings, mechanism = supervisor.settings, supervisor.robot.mechanism
    # Only of a shipped class is it known that its columns are its postures: a class of yours may change one of them.
    form = type(mechanism).__module__.startswith(SHIPPED)
    form &= type(mechanism).certified_bounds_many is not Mechanism.certified_bounds_many
    form &= type(mechanism).sharp_bounds_many is not Mechanism.sharp_bounds_many
    plain = min(settings.velocity_tolerance) >= UNTRUSTED and settings.reaction_check == "none"
    return form and plain and settings.slack_m == 0.0 and mechanism.label_is_invariant


class Strides:
    """Judges the samples of one supervisor under its present settings."""

    def __init__(
        self,
        supervisor: Supervisor,
        one: Callable[[JointSample], None],
        quiet: Callable[[QuietRows], None],
        may_stride: Callable[[], bool],
    ) -> None:
        """one: lets the supervisor judge one sample. quiet: takes samples that need no judgement. may_stride: False
        while the caller needs the samples one by one."""
        self._supervisor, self._one, self._quiet, self._may_stride = supervisor, one, quiet, may_stride
        settings, self._mechanism = supervisor.settings, supervisor.robot.mechanism
        self._suits = suits(supervisor)
        self._motion = MotionColumns(settings, self._mechanism.joints)
        self._names = settings.joint_names
        self._modes = settings.working_mode, settings.assembly_mode
        self._release = np.array(release_of(settings))
        self._size = LEAST_BLOCK

    def judge(self, columns: JointColumns) -> None:
        """Judge consecutive samples."""
        fits = self._suits and columns.velocity.shape[1] and sorted(columns.names) == sorted({*columns.names})
        fits = fits and set(self._names) <= set(columns.names)
        at = 0
        while at < len(columns):
            before = history(self._supervisor, columns.names) if fits and self._may_stride() else None
            size = 0 if before is None else _ascending(columns.stamp_ns[at : at + self._size], before)
            if before is None or size == 0:
                self._one(columns.sample(at))
                at += 1
                continue
            done = self._block(columns[at : at + size], before)
            self._size = min(2 * self._size, BLOCK) if done == size else max(self._size // 4, LEAST_BLOCK)
            at += done

    def _block(self, columns: JointColumns, before: History) -> int:
        """Judge samples of one block; returns how many."""
        supervisor, joints = self._supervisor, columns.of_joints(self._names)
        memory = supervisor.memory
        with np.errstate(all="ignore"):
            motion = self._motion.over(joints, before)
            found = postures(self._mechanism, joints.position, self._modes, memory.contact_m)
            bounds = self._mechanism.certified_bounds_many(found.legs, list(found.gaps.T), list(motion.half))
            certified = four_margins(bounds, len(joints))
            spare = (certified - self._release).min(1)
            quiet = motion.regular & found.clear & (np.abs(spare) > GUARD)
        wanting = np.flatnonzero(quiet & (spare < 0.0))
        low, high = (side.take(wanting, axis=1) for side in (motion.low, motion.high))
        boxes = Boxes(supervisor.settings, self._mechanism, wanting, low, high)
        row, ends = 0, np.append(np.flatnonzero(~quiet), len(quiet))
        while row < len(quiet):
            if quiet[row] and self._may_stride() and supervisor.quiet:
                end = int(ends[np.searchsorted(ends, row)])
                memory = supervisor.memory
                assert memory.at is not None
                end = boxes.proved_until(memory.predictor, memory.at, row, end, certified)
                if end > row:
                    hand_over(supervisor, joints, motion, row, end)
                    rows = slice(row, end)
                    self._quiet(QuietRows(joints[rows], certified[rows], found, rows, supervisor.memory.samples))
                    row = end
                    continue
            self._one(columns.sample(row))
            row += 1
            if not agrees(supervisor, motion, row - 1):
                break
        return row


def _ascending(stamps: Times, before: History) -> int:
    """Number of samples whose stamps are newer than all before: rows are searched by stamp."""
    back = np.diff(stamps, prepend=before.stamp_ns[-1]) <= 0
    return int(back.argmax()) if back.any() else len(stamps)
