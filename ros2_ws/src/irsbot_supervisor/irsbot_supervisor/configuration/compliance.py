"""Error of the geometry by bending, computed once from the tubes when settings are read from a file.

From then on the settings contain the number: the core, a journal and a replay need no tubes.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from irsbot_kinematics import KinematicsError, Robot, stiffness
from irsbot_kinematics.analysis.rectangle import Limits
from irsbot_supervisor.core.settings import InvalidSettings, Settings, completed

NO_TUBES = "none"

LOADS = ("load_force_n", "load_moment_nm", "payload_kg", "platform_acceleration_m_s2", "gravity_m_s2")
STOPS = ("type1_stop", "type2_stop", "constraint_stop")


def with_bending(values: Mapping[str, Any], robot: Robot) -> Mapping[str, Any]:
    """The values, with `compliance_slack_m` computed from the tubes if bending counts and the number is left open.

    Raises InvalidSettings if there are no tubes or no bound, or if the load is not stated.
    """
    settings = completed(values, robot)
    if settings.compliance != "counted" or settings.compliance_slack_m > 0.0:
        return values
    try:
        return {**values, "compliance_slack_m": _slack_m(settings, robot)}
    except KinematicsError as error:
        raise InvalidSettings(f"compliance is counted, but {error}; or state compliance_slack_m") from None


def _slack_m(settings: Settings, robot: Robot) -> float:
    """m, over all poses whose margins reach the stop limits."""
    if settings.tubes == NO_TUBES:
        raise InvalidSettings(
            "compliance is counted, but the robot's tubes are not known: set tubes to an elastic design, or state "
            "compliance_slack_m"
        )
    if settings.payload_kg > 0.0 and not settings.platform_acceleration_m_s2 > 0.0:
        raise InvalidSettings(
            f"compliance is counted, but platform_acceleration_m_s2 is 0.0 with payload_kg {settings.payload_kg!r}"
        )
    if settings.assembly_mode != robot.mechanism.usual_assembly_mode:
        raise InvalidSettings(
            f"compliance is counted, but bending has no bound in assembly mode {settings.assembly_mode}: state "
            "compliance_slack_m"
        )
    design = stiffness.load(settings.tubes)
    if not isinstance(design, stiffness.Structure):
        raise InvalidSettings(f"compliance is counted, but the design '{settings.tubes}' has one posture only")
    load = stiffness.Load(
        settings.load_force_n,
        settings.load_moment_nm,
        settings.payload_kg,
        settings.platform_acceleration_m_s2,
        settings.gravity_m_s2,
    )
    limits = Limits(settings.type1_stop, settings.type2_stop, settings.constraint_stop)
    return stiffness.compliance_error(design.fitted(robot.mechanism, settings.working_mode), load, limits).slack_m


def require_bending_said(now: Settings, wanted: Settings, stated: Collection[str]) -> None:
    """Raise InvalidSettings if a change of settings increases bending without stating its slack. stated: names of the
    settings that were given."""
    if wanted.compliance != "counted" or "compliance_slack_m" in stated:
        return
    more = [name for name in LOADS if getattr(wanted, name) > getattr(now, name)]
    more += [name for name in STOPS if getattr(wanted, name) < getattr(now, name)]
    if more:
        raise InvalidSettings(f"{more[0]} lets the robot bend more: set compliance_slack_m in the same call")
