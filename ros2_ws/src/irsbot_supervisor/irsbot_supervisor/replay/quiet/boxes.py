"""Boxes of the stopping predictor for many samples.

Where the first bound over the reachable box does not suffice, the predictor tries a box that is a little wider, and
uses its bounds for the samples that follow, as long as their boxes lie in it. Which box serves a sample thus depends on
the samples before, but the bounds of a box depend on its own sample alone. So the wider boxes of all samples are
bounded as columns, and then the predictor's choice among them is followed, sample by sample.

The predictor wants the release limits. A box is proved here if its bounds are above them by more than GUARD; all others
are the predictor's, and serve if they prove the warning limits.
"""

from __future__ import annotations

from math import inf, nan
from operator import ge

import numpy as np

from irsbot_kinematics import Mechanism, Posture
from irsbot_msgs_py.records import Floats
from irsbot_supervisor.bag.joint_columns import Values
from irsbot_supervisor.core.margins import Margins
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.stopping import SMALLER, WIDER, Known, StoppingPredictor, limits_of, release_of
from irsbot_supervisor.replay.quiet.filters import Rows
from irsbot_supervisor.replay.quiet.postures import GUARD, assembled, four_margins
from irsbot_supervisor.replay.quiet.suspicion import Mask


class Boxes:
    """The reachable boxes of M samples for which the first bound does not suffice, and the wider ones."""

    def __init__(self, settings: Settings, mechanism: Mechanism, rows: Rows, low: Values, high: Values) -> None:
        """rows: (M,) of the samples in their block. low, high: (n, M) rad or m, of the boxes."""
        self._warn, self._rows, self._low, self._high = limits_of(settings, "warn"), rows, low, high
        size = high - low
        more = WIDER * size
        wide_low, wide_high = low - more, high + more
        # A box serves another one whose every number in `_sides` reaches that of the box in `_needs`: `Known.serves`.
        self._sides: list[list[float]] = np.vstack([low, -high, size]).T.tolist()
        self._needs = np.vstack([wide_low, -wide_high, SMALLER * size])
        proved, bounds = wide_bounds(mechanism, settings.assembly_mode, release_of(settings), wide_low, wide_high)
        self._proved: list[bool] = proved.tolist()
        self._bounds = np.vstack([bounds, np.full(4, nan)])  # the last row is of the box before all

    def proved_until(self, predictor: StoppingPredictor, at: Posture, begin: int, end: int, certified: Values) -> int:
        """The row before which the predictor proves the warning limits for all rows from `begin` on, at most `end`. Its
        memory of boxes is that after these rows, and their bounds are put in `certified`. at: a posture of the
        branch."""
        first, last = np.searchsorted(self._rows, (begin, end)).tolist()
        box, known, in_vain, kept = len(self._rows), predictor.known, predictor.in_vain, True
        needs, good = self._take(box, known)
        owners: list[int] = []
        for place in range(first, last):
            if not all(map(ge, self._sides[place], needs)):
                box = place
                kept = not self._proved[box] or (in_vain is not None and in_vain.serves(*self._ends(box)))
                if kept:
                    known = predictor.renew(at, *self._ends(box))
                    in_vain = predictor.in_vain
                    needs, good = self._take(box, known)
                else:
                    needs, good = self._needs[:, box].tolist(), True
            if not good:
                end = int(self._rows[place])
                break
            owners.append(box)
        if not kept:  # the last box, which the predictor does not know yet
            _, good = self._take(box, predictor.renew(at, *self._ends(box)))
            if not good:
                end = int(self._rows[box])
                del owners[box - first :]
        certified[self._rows[first : first + len(owners)]] = self._bounds[owners]
        return end

    def _ends(self, box: int) -> tuple[Floats, Floats]:
        return tuple(self._low[:, box].tolist()), tuple(self._high[:, box].tolist())

    def _take(self, box: int, known: Known | None) -> tuple[list[float], bool]:
        """What a box of the predictor needs of those that it serves, and whether it is proved."""
        if known is None:
            return [inf], False
        self._bounds[box] = known.certified
        needs = [*known.low, *(-side for side in known.high), *known.least]
        return needs, all(map(ge, known.certified, self._warn))


def wide_bounds(mechanism: Mechanism, assembly: int, goal: Margins, low: Values, high: Values) -> tuple[Mask, Values]:
    """Whether a goal is surely proved without cuts over boxes low..high, (n, M) rad or m, and the bounds (M, 4), as
    `box_search.Search` has them."""
    joints, travel = tuple(0.5 * (low + high)), list(0.5 * (high - low))
    with np.errstate(all="ignore"):
        pose, legs, gaps, proved = assembled(mechanism, joints, assembly)
        first = four_margins(mechanism.certified_bounds_many(legs, gaps, travel), low.shape[1])
        sharp = four_margins(mechanism.sharp_bounds_many(joints, pose, legs, gaps, travel), low.shape[1])
        spare = (first - goal).min(1)
        bounds = np.where((spare >= 0.0)[:, None], first, np.maximum(first, sharp))
        proved &= (np.abs(spare) > GUARD) & ((bounds - goal).min(1) > GUARD)
    return proved, bounds
