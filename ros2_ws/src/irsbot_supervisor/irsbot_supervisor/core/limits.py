"""Whether limits hold together: a robot that cannot be stopped from its velocity limit contradicts itself.

A joint that cannot be stopped from its velocity limit before a stop limit is reached, whatever the posture, can never
be that fast without a STOP. Each joint is judged by itself, the others at rest, forth and back. Together the joints may
well be faster than any room they have, as three slides that all run apart, and no task drives them so; but what no
joint can do alone, no task can do. Encoder and geometry errors count, and so does what every joint, the resting ones
too, can gain of speed until the brakes act. The time between samples does not, because the settings do not know it:
what is refused here could not work with any.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Any

from irsbot_kinematics import Mechanism, Robot
from irsbot_kinematics.mechanism import Floats
from irsbot_supervisor.core.assess import margins_of
from irsbot_supervisor.core.estimation.estimate import Speeds
from irsbot_supervisor.core.reach import position_error
from irsbot_supervisor.core.room import Room, candidates, postures, room
from irsbot_supervisor.core.settings import InvalidSettings, Settings, completed
from irsbot_supervisor.core.stopping import BoxBounds, StoppingPredictor, limits_of

FEWEST = 50
"""Postures in the configured modes: with fewer nothing is concluded, there may be a roomier place between them."""

KINDS = ("type1", "type2", "constraint", "limb")
"""How the settings call the margins, in the order of `assess.Margins`."""


def settings_from(values: Mapping[str, Any], robot: Robot) -> Settings:
    """Settings from a mapping (YAML, parameters, journal), completed for a robot and checked as a whole.

    Raises InvalidSettings naming every fault.
    """
    settings = completed(values, robot)
    if faults := contradictions(settings, robot.mechanism):
        raise InvalidSettings("; ".join(faults))
    return settings


def contradictions(settings: Settings, mechanism: Mechanism) -> list[str]:
    """What cannot hold together in settings that are valid one by one: at most one fault, with both its numbers."""
    if settings.compliance == "counted" and not settings.compliance_slack_m > 0.0:
        return [
            "compliance is counted, but compliance_slack_m is 0.0: state it, or name the robot's tubes at its start"
        ]
    found = postures(settings, mechanism)
    if len(found.joints) < FEWEST:
        return []
    if next(candidates(settings, mechanism), None) is None:
        stops = list(zip(KINDS, limits_of(settings, "stop"), found.margins.max(axis=0), strict=True))
        above = [stop for stop in stops if not stop[1] <= stop[2]] or [stop for stop in stops if stop[2] < inf]
        said = [f"{kind}_stop ({limit!r}, largest {kind} margin {top:.3g})" for kind, limit, top in above]
        return [f"no posture keeps {', '.join(said)}"]
    count = len(mechanism.joints)
    for joint in range(count):
        roomiest = room(settings, mechanism, candidates(settings, mechanism), alone(joint, count))
        if not roomiest.share >= 1.0:
            return [_said(settings, mechanism, joint, roomiest)]
    return []


def alone(joint: int, joints: int) -> list[Floats]:
    """Patterns of speed: one joint forth and back while the others stand."""
    return [tuple([sign if k == joint else 0.0 for k in range(joints)]) for sign in (1.0, -1.0)]


def _said(settings: Settings, mechanism: Mechanism, joint: int, found: Room) -> str:
    name, unit = settings.joint_names[joint], mechanism.joints[joint].unit
    speed, brake = settings.velocity_limit[joint], settings.deceleration_limit[joint]
    predictor = StoppingPredictor(settings, mechanism)
    needs = predictor.travel(Speeds(settings.velocity_limit, settings.velocity_limit), 0.0)[0][joint]
    kind, margin, stop = KINDS[found.kind], margins_of(found.at)[found.kind], limits_of(settings, "stop")[found.kind]
    if found.share == 0.0:
        errors = (position_error(settings),) * len(mechanism.joints)
        alone = BoxBounds(mechanism, settings.slack_m).around(found.at, errors)
        if not alone[found.kind] >= stop:
            said = f"encoder_resolution {settings.encoder_resolution!r}, encoder_offset {settings.encoder_offset!r}"
            said += f" and geometry_tolerance_m {settings.geometry_tolerance_m!r}"
            if settings.slack_m > settings.geometry_tolerance_m:
                said += f" and compliance_slack_m {settings.compliance_slack_m!r}"
            return f"{said} alone take the {kind} margin of {margin:.3g}, at its best, below {kind}_stop ({stop!r})"
        gains, latency, least = settings.acceleration_limit, settings.latency_s, settings.deceleration_limit
        return (
            f"from rest already, what the joints can gain until they are stopped (acceleration_limit {gains!r}, "
            f"latency_s {latency!r}, deceleration_limit {least!r}) takes the {kind} margin of {margin:.3g}, at its "
            f"best, below {kind}_stop ({stop!r})"
        )
    brakes = f"deceleration_limit {brake!r}, latency_s {settings.latency_s!r}"
    return (
        f"joint '{name}' needs {needs:.3g} {unit} to stop from velocity_limit ({speed!r}; {brakes}), but at its best "
        f"the robot loses its {kind} margin of {margin:.3g} to {kind}_stop ({stop!r}) within "
        f"{found.travel[joint]:.3g} {unit}: {found.share * speed:.3g} {unit}/s can be stopped"
    )
