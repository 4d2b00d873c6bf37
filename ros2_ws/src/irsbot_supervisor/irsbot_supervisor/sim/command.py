"""A JointTrajectory as it arrives, in the order of the robot's joints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from irsbot_kinematics.mechanism import Floats

from .errors import BadPath


class Command(NamedTuple):
    """Points for `Drives.follow`."""

    times: tuple[float, ...]  # s from now
    positions: tuple[Floats, ...]
    velocities: tuple[Floats, ...]  # empty where the points have none


def commanded(
    joints: Sequence[str],
    names: Sequence[str],
    times: Sequence[float],
    positions: Sequence[Sequence[float]],
    velocities: Sequence[Sequence[float]],
) -> Command:
    """Points of a message with the joints picked by name. Raises BadPath unless every joint is named once."""
    if not times:
        return Command((), (), ())
    if sorted(names) != sorted(joints):
        raise BadPath(f"the joints are {', '.join(joints)}, the command names {', '.join(names) or 'none'}")
    with_rates = any(velocities)
    for row in (*positions, *(velocities if with_rates else ())):
        if len(row) != len(names):
            raise BadPath(f"every point needs {len(names)} positions, and {len(names)} velocities or none")
    order = [list(names).index(joint) for joint in joints]
    picked = [[tuple(row[i] for i in order) for row in rows] for rows in (positions, velocities if with_rates else ())]
    return Command(tuple(times), tuple(picked[0]), tuple(picked[1]))
