"""The way out of a stop: a direction in joint space that leads away from the limit that stopped the robot."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, sqrt
from typing import NamedTuple

from irsbot_kinematics import Mechanism, Posture
from irsbot_msgs_py.records import Cause, Finding, Floats, Level
from irsbot_supervisor.core.margins import MARGIN_CAUSES, slopes


class Escape(NamedTuple):
    """direction: unit vector in joint space, robot order; empty: none is known. cause: the Cause bit of the limit that
    it leads away from; 0 if there is no direction."""

    direction: Floats
    cause: int


NO_ESCAPE = Escape((), 0)


def escape_of(mechanism: Mechanism, at: Posture, found: Sequence[Finding], into_range: Floats) -> Escape:
    """The way out of a stop. Of several causes it uses the first that has a direction. Margins come before joint
    ranges: a joint beyond its range still has a drive, a platform at a singularity has none.

    found: all findings of the posture `at`. into_range: per joint the sign of the motion back into its range.
    """
    for finding in found:
        if finding.level != Level.STOP:
            continue
        kind = next((index for index, bit in enumerate(MARGIN_CAUSES) if finding.cause & bit), None)
        if kind is not None:
            cause, way = MARGIN_CAUSES[kind], slopes(mechanism, at, kind)
        elif finding.cause & Cause.POSITION:
            cause, way = Cause.POSITION, into_range
        else:
            continue
        size = sqrt(sum([part * part for part in way]))
        if 0.0 < size < inf:
            return Escape(tuple([part / size for part in way]), int(cause))
    return NO_ESCAPE
