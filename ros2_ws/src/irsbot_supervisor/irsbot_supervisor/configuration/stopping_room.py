"""Room to stop: the distance that each joint needs from its full speed, and the distance it has within the limits."""

from __future__ import annotations

from itertools import product
from math import nan
from typing import NamedTuple

from irsbot_kinematics import Mechanism
from irsbot_supervisor.configuration.feasibility import single_joint_patterns
from irsbot_supervisor.configuration.stoppable_speed import candidates, find_stoppable_speed
from irsbot_supervisor.configuration.stopping_cost import platform_way
from irsbot_supervisor.core.margins import MARGIN_NAMES
from irsbot_supervisor.core.settings import Settings

MOST = 8.0
"""Multiple of the velocity limits up to which the search for stoppable speeds goes."""


class Stopping(NamedTuple):
    """Stopping distance of a joint, alone and at its full speed, and the available distance. Both count from the last
    sample before the stop: they include one period and the judging time."""

    joint: str
    unit: str
    needs: float  # rad or m until standstill
    platform_m: float  # m of platform motion in this time, from the best posture; NaN if the path leaves the workspace
    room: float  # rad or m available there within the stop limits
    margin: str  # margin that ends it; empty if none does up to MOST times the speed
    share: float  # of the velocity limit that could be stopped


def room_to_stop(settings: Settings, mechanism: Mechanism, prediction_delay_s: float) -> tuple[list[Stopping], float]:
    """The room of each joint that moves alone, and the share of all velocity limits at once that could be stopped in
    the worst combination of directions. prediction_delay_s: that the robot moves without supervision."""
    count = len(mechanism.joints)
    places = list(candidates(settings, mechanism))
    rows = []
    for k, joint in enumerate(mechanism.joints):
        speed, brake = settings.velocity_limit[k], settings.deceleration_limit[k]
        needs = speed * (settings.latency_s + prediction_delay_s + 0.5 * speed / brake)
        if not places:
            rows.append(Stopping(settings.joint_names[k], joint.unit, needs, nan, 0.0, "all", 0.0))
            continue
        found = find_stoppable_speed(
            settings, mechanism, places, single_joint_patterns(k, count), prediction_delay_s, MOST
        )
        way = platform_way(mechanism, found.at, k, needs)
        margin = MARGIN_NAMES[found.kind] if found.kind >= 0 else ""
        has = (settings.joint_names[k], joint.unit, needs, way, abs(found.travel[k]), margin, found.share)
        rows.append(Stopping(*has))
    corners = [tuple(corner) for corner in product((1.0, -1.0), repeat=count)]
    together = (
        find_stoppable_speed(settings, mechanism, places, corners, prediction_delay_s, MOST).share if places else 0.0
    )
    return rows, together
