"""Joints that hardly move although the message reports motion: `Frozen`, asked where it matters.

At every turning point a joint is that slow for a sample or two. `Frozen` then suspects its encoder, until it moves by
more than a flickering digit. It is asked from the first such sample until it suspects nothing; elsewhere it has no
effect.
"""

from __future__ import annotations

from math import remainder
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from irsbot_kinematics.mechanism import Coordinate
from irsbot_msgs_py.records import Floats
from irsbot_supervisor.bag.joint_columns import JointColumns, Values
from irsbot_supervisor.core.estimation.frozen import Frozen, Still
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.validation import Accepted

Mask = NDArray[np.bool_]


class Suspicions(NamedTuple):
    """What `Frozen` says of samples, by row."""

    faults: list[int]
    """Rows that it rejects or that lose the branch. It then begins anew, which the supervisor's does not."""
    rates: dict[int, Floats]
    """rad/s or m/s as reported of joints that may be frozen, 0 of the others, where there are such joints."""
    memory: dict[int, dict[int, Still]]
    """What it remembers after the row, where it remembers anything."""


def suspicions(
    settings: Settings, joints: tuple[Coordinate, ...], block: JointColumns, moved: Values, sent_s: Values, slow: Mask
) -> Suspicions:
    """moved: (n, N) rad or m since the sample before. sent_s: (N,) s since that one. slow: (N,) True where a joint may
    stand while the message reports motion. Nothing is suspected before the first row."""
    frozen, turns, found, row = Frozen(settings, joints), [joint.turn for joint in joints], Suspicions([], {}, {}), 0
    for begin in np.flatnonzero(slow).tolist():
        row = max(row, begin)
        while row < len(block) and (frozen.still or row == begin):
            step = tuple(map(remainder, moved[:, row].tolist(), turns))
            sample = block.sample(row)
            accepted = Accepted(*sample[:3], sample.position, sample.velocity, sample.effort)
            said = frozen.look(accepted, step, float(sent_s[row]))
            if said.fault or said.branch_lost:
                found.faults.append(row)
                frozen.restart()
            if said.speeds:
                found.rates[row] = said.speeds
            if frozen.still:
                found.memory[row] = dict(frozen.still)
            row += 1
    return found
