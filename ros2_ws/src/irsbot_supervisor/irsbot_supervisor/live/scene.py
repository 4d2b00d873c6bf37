"""What the live page draws of a robot: the parts that stand still, found once, and those of every look."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations, product
from math import isfinite
from typing import Any

import numpy as np

from irsbot_kinematics.description.robot_record import robot_from_record
from irsbot_kinematics.mechanism import Mechanism, Signs, Status
from irsbot_msgs_py.records import Floats, SingularityState
from irsbot_supervisor.core.estimation.estimate import Speeds
from irsbot_supervisor.core.reachable_box import ReachableBox
from irsbot_supervisor.core.settings import completed
from irsbot_supervisor.core.stopping import limits_of
from irsbot_supervisor.replay.series import MARGINS
from irsbot_supervisor.report.drawing import view
from irsbot_supervisor.report.json_values import plain
from irsbot_supervisor.report.series import UNTIL_REST

COLUMNS = (*MARGINS, UNTIL_REST)
"""What is plotted, in this order."""

EDGE_STEPS = 4
"""Parts into which an edge of the reachable box is cut where it is drawn in a plane: there edges are curves."""


class Scene:
    """One robot and its settings, as the journal tells them."""

    def __init__(self, values: Mapping[str, Any], record: Mapping[str, Any]) -> None:
        """Raises what `robot_from_record` raises, and InvalidSettings."""
        robot = robot_from_record(record)
        self.record, self.name, self.mechanism = record, robot.name, robot.mechanism
        self.settings = completed(values, robot)
        self._skeleton = self.mechanism.skeleton()
        self._box = ReachableBox(self.settings)
        self.has_sections = self.mechanism.loci(self.settings.working_mode) is None

    def setup(self) -> dict[str, Any]:
        """Names, units and limits."""
        limits = [
            {"of": name, "kind": kind, "value": value}
            for kind in ("stop", "warn")
            for name, value in zip(MARGINS, limits_of(self.settings, kind), strict=True)
            if isfinite(value)
        ]
        return {"robot": self.name, "columns": COLUMNS, "limits": limits}

    def joints(self, state: SingularityState) -> dict[str, float]:
        """Positions of all joints by name, rad or m; those that no encoder sees, only where the pose is known."""
        known = dict(zip((one.name for one in self.mechanism.joints), state.joint_position, strict=True))
        if self._skeleton is None or not all(map(isfinite, (*state.joint_position, *state.pose))):
            return known
        return {**known, **self._skeleton.closing(state.joint_position, state.pose)}

    def reachable(self, state: SingularityState, period_s: float) -> list[list[Floats]]:
        """Where the platform may get until the joints stand, as lines of task coordinates, m: the edges of the
        reachable box at the reported rates, for a next sample after `period_s`. Empty where no pose is known, and where
        a corner of the box belongs to no posture."""
        rates, free_s = state.joint_velocity, state.sample_age + period_s + self.settings.latency_s
        if not state.assembly_mode or not all(map(isfinite, (*state.pose, *rates, free_s))):
            return []
        speeds = Speeds(tuple([max(v, 0.0) for v in rates]), tuple([max(-v, 0.0) for v in rates]))
        forward, backward = self._box.until_rest(speeds, free_s)
        ends = [(q - back, q + ahead) for q, back, ahead in zip(state.joint_position, backward, forward, strict=True)]
        steps = EDGE_STEPS if len(ends) == 2 else 1
        places = {corner: self._place(corner, state.assembly_mode) for corner in product(*ends)}
        lines = []
        for corner, other in combinations(places, 2):
            if sum(a != b for a, b in zip(corner, other, strict=True)) == 1:
                inner = [self._place(_between(corner, other, k / steps), state.assembly_mode) for k in range(1, steps)]
                lines.append([places[corner], *inner, places[other]])
        return lines if all(map(all, lines)) else []

    def _place(self, joints: Sequence[float], assembly: int) -> Floats:
        """Task coordinates of a posture; empty where there is none."""
        at = self.mechanism.posture(joints, assembly)
        return at.pose if at.status == Status.SOLVED else ()


def _between(corner: Floats, other: Floats, share: float) -> list[float]:
    return [a + share * (b - a) for a, b in zip(corner, other, strict=True)]


def drawn(record: Mapping[str, Any], mode: Signs, pose: Sequence[float]) -> dict[str, Any]:
    """The parts that stand still, as JSON has them: links, base, loci. It takes seconds for some robots."""
    mechanism: Mechanism = robot_from_record(record).mechanism
    found: dict[str, Any] = plain(view(mechanism, mode, np.array([pose])))
    return found
