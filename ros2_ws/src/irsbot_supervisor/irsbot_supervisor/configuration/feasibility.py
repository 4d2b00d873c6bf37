"""Feasibility of limits: a robot must be stoppable from its velocity limit.

If a joint cannot be stopped from its velocity limit before a stop limit is reached, in any posture, it can never be
that fast without a STOP. Each joint is checked alone, in both directions, the others at rest. All joints together may
be too fast in every posture, for example three slides that all move apart, but no task drives them so. A speed that one
joint cannot have alone is impossible in every task. Encoder and geometry errors are included, and so is the speed that
every joint, also a resting one, can gain until the brakes act. The time between samples is not included, because the
settings do not contain it: refused settings would not work at any rate.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Any

from irsbot_kinematics import Mechanism, Robot
from irsbot_kinematics.mechanism import Floats
from irsbot_supervisor.configuration.stoppable_speed import StoppableSpeed, candidates, find_stoppable_speed, postures
from irsbot_supervisor.core.box_search import BoxBounds
from irsbot_supervisor.core.estimation.estimate import Speeds
from irsbot_supervisor.core.margins import MARGIN_NAMES, margins_of
from irsbot_supervisor.core.reachable_box import position_error
from irsbot_supervisor.core.settings import InvalidSettings, Settings, completed
from irsbot_supervisor.core.stopping import StoppingPredictor, limits_of

FEWEST = 50
"""Least number of postures in the configured modes: with fewer nothing is concluded, because a better posture may lie
between them."""


def settings_from(values: Mapping[str, Any], robot: Robot) -> Settings:
    """Settings from a mapping (YAML, parameters, journal), completed for a robot and checked as a whole.

    Raises InvalidSettings naming every fault.
    """
    settings = completed(values, robot)
    if faults := infeasibilities(settings, robot.mechanism):
        raise InvalidSettings("; ".join(faults))
    return settings


def infeasibilities(settings: Settings, mechanism: Mechanism) -> list[str]:
    """Contradictions between settings that are valid one by one: at most one, with both numbers."""
    if settings.compliance == "counted" and not settings.compliance_slack_m > 0.0:
        return [
            "compliance is counted, but compliance_slack_m is 0.0: state it, or name the robot's tubes at its start"
        ]
    found = postures(settings, mechanism)
    if len(found.joints) < FEWEST:
        return []
    if next(candidates(settings, mechanism), None) is None:
        stops = list(zip(MARGIN_NAMES, limits_of(settings, "stop"), found.margins.max(axis=0), strict=True))
        above = [stop for stop in stops if not stop[1] <= stop[2]] or [stop for stop in stops if stop[2] < inf]
        stated = [f"{kind}_stop ({limit!r}, largest {kind} margin {top:.3g})" for kind, limit, top in above]
        return [f"no posture keeps {', '.join(stated)}"]
    count = len(mechanism.joints)
    for joint in range(count):
        roomiest = find_stoppable_speed(
            settings, mechanism, candidates(settings, mechanism), single_joint_patterns(joint, count)
        )
        if not roomiest.share >= 1.0:
            return [_stated(settings, mechanism, joint, roomiest)]
    return []


def single_joint_patterns(joint: int, joints: int) -> list[Floats]:
    """Patterns of speed: one joint moves in one direction, the others are at rest."""
    return [tuple([sign if k == joint else 0.0 for k in range(joints)]) for sign in (1.0, -1.0)]


def _stated(settings: Settings, mechanism: Mechanism, joint: int, found: StoppableSpeed) -> str:
    name, unit = settings.joint_names[joint], mechanism.joints[joint].unit
    speed, brake = settings.velocity_limit[joint], settings.deceleration_limit[joint]
    predictor = StoppingPredictor(settings, mechanism)
    needs = predictor.travel(Speeds(settings.velocity_limit, settings.velocity_limit), 0.0)[0][joint]
    kind, margin, stop = (
        MARGIN_NAMES[found.kind],
        margins_of(found.at)[found.kind],
        limits_of(settings, "stop")[found.kind],
    )
    if found.share == 0.0:
        errors = (position_error(settings),) * len(mechanism.joints)
        bounds = BoxBounds(mechanism, settings.slack_m).around(found.at, errors)
        if not bounds[found.kind] >= stop:
            stated = f"encoder_resolution {settings.encoder_resolution!r}, encoder_offset {settings.encoder_offset!r}"
            stated += f" and geometry_tolerance_m {settings.geometry_tolerance_m!r}"
            if settings.slack_m > settings.geometry_tolerance_m:
                stated += f" and compliance_slack_m {settings.compliance_slack_m!r}"
            return f"{stated} alone take the {kind} margin of {margin:.3g}, at its best, below {kind}_stop ({stop!r})"
        gains, latency, least = settings.acceleration_limit, settings.latency_s, settings.deceleration_limit
        return (
            f"already from rest, the speed that joints can gain until they are stopped (acceleration_limit {gains!r}, "
            f"latency_s {latency!r}, deceleration_limit {least!r}) takes the {kind} margin of {margin:.3g}, at its "
            f"best, below {kind}_stop ({stop!r})"
        )
    brakes = f"deceleration_limit {brake!r}, latency_s {settings.latency_s!r}"
    return (
        f"joint '{name}' needs {needs:.3g} {unit} to stop from velocity_limit ({speed!r}; {brakes}), but at its best "
        f"the robot loses its {kind} margin of {margin:.3g} to {kind}_stop ({stop!r}) within "
        f"{found.travel[joint]:.3g} {unit}: {found.share * speed:.3g} {unit}/s can be stopped"
    )
