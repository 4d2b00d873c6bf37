"""Margins next to their limits: what errors change of them there, and how fast a moving robot loses them."""

from __future__ import annotations

from collections.abc import Sequence
from math import copysign, inf
from typing import NamedTuple

import numpy as np

from irsbot_kinematics import Mechanism, Posture
from irsbot_kinematics.mechanism import Floats
from irsbot_supervisor.configuration.stoppable_speed import postures
from irsbot_supervisor.core.assessment import SOLVED
from irsbot_supervisor.core.box_search import margins_of_bounds
from irsbot_supervisor.core.margins import MARGIN_NAMES, margins_of, slopes
from irsbot_supervisor.core.reachable_box import position_error
from irsbot_supervisor.core.settings import Settings

STEEP = 90
"""Percentage of the postures next to a limit at which the margin is less steep than assumed."""

NEIGHBOURS = 64
"""Number of postures next to a limit from which errors and slopes of a margin are taken."""

PARTS = 8
"""Steps in which the branch is followed back from such a posture."""


class NearLimit(NamedTuple):
    """One margin next to its limit, over several postures.

    Every bound of the supervision already includes the errors of its posture. A limit only has to exceed their usual
    size, otherwise no posture would be left.
    """

    error: float  # 1: typical change by errors of encoders and geometry
    steep: Floats  # 1/rad or 1/m, slopes of a steep one
    lost: float  # 1: loss of a steep margin while the joints go on after a warning


def near_limits(base: Settings, mechanism: Mechanism, limits: Sequence[float], ways: Floats) -> list[NearLimit]:
    """For each margin, what holds next to its limit, in postures at which the other limits are kept.

    base: settings with the errors of the machine. limits: (margins,) in the order of MARGIN_NAMES. ways: (n,) rad or m
    that each joint goes on after a warning. Zeros for a margin that the robot does not have, or without such postures.
    """
    cloud, found = postures(base, mechanism), []
    kept = cloud.joints[(cloud.margins >= limits).all(axis=1)]
    margins = cloud.margins[(cloud.margins >= limits).all(axis=1)]
    for kind in range(len(MARGIN_NAMES)):
        rows = kept[np.argsort(margins[:, kind], kind="stable")[:NEIGHBOURS]]
        solved = [mechanism.posture(tuple(row.tolist()), base.assembly_mode) for row in rows]
        found.append(_next_to([at for at in solved if at.status == SOLVED], base, mechanism, kind, ways))
    return found


def _next_to(places: list[Posture], base: Settings, mechanism: Mechanism, kind: int, ways: Floats) -> NearLimit:
    if not places or margins_of(places[0])[kind] == inf:
        return NearLimit(0.0, (0.0,) * len(mechanism.joints), 0.0)
    reach = [position_error(base)] * len(mechanism.joints)
    slack = base.slack_m
    errors = [
        margins_of(at)[kind] - margins_of_bounds(mechanism.certified_bounds(at, reach, slack))[kind] for at in places
    ]
    signed = [slopes(mechanism, at, kind) for at in places]
    lost = sorted([_lost(mechanism, at, slope, kind, ways) for at, slope in zip(places, signed, strict=True)])
    steep = [tuple(map(abs, slope)) for slope in signed]
    steep.sort(key=lambda slope: sum(s * v for s, v in zip(slope, base.velocity_limit, strict=True)))
    return NearLimit(sorted(errors)[len(errors) // 2], steep[STEEP * len(steep) // 100], lost[STEEP * len(lost) // 100])


def _lost(mechanism: Mechanism, at: Posture, slope: Floats, kind: int, ways: Floats) -> float:
    """Loss of a margin while all joints move together down its slope to a posture, as far back as a posture exists. The
    worst corner of the reachable box moves like this, and no point of the box has a smaller margin."""
    back, then = at, margins_of(at)[kind]
    for part in range(1, PARTS + 1):
        there = zip(at.joints, ways, slope, strict=True)
        back = mechanism.track(tuple([q + copysign(part / PARTS * way, s) for q, way, s in there]), back)
        if back.status != SOLVED:
            break
        then = margins_of(back)[kind]
    return max(then - margins_of(at)[kind], 0.0)
