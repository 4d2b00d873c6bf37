"""Leg forces from measured motor efforts."""

from __future__ import annotations

from math import nan

from irsbot_kinematics import Posture
from irsbot_msgs_py.records import Floats

OBSERVABLE = 0.1
"""1: leg forces are computed from motor efforts only if the Type 1 margin is above this. A smaller divisor multiplies
friction and current errors more than ten times."""


def leg_forces(effort: Floats, at: Posture) -> Floats:
    """N per leg, R = -tau / B: NaN near Type 1 or without efforts (sheet section 10). effort: N m or N, or empty."""
    if not effort:
        return (nan,) * len(at.joints)
    legs = zip(effort, at.levers, at.normalised_levers, strict=True)
    return tuple([-tau / lever if abs(sine) >= OBSERVABLE else nan for tau, lever, sine in legs])
