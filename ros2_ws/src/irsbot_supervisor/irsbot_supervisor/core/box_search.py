"""Certified minima of margins over boxes of joint positions, with further cuts where one bound does not suffice.

The mechanism bounds its margins from below over a box. Over half a box the bound is tighter. The worst part is cut
until the goal is proved, a posture in the box contradicts it, or the allowed number of cuts is used.
"""

from __future__ import annotations

from math import copysign, inf
from operator import sub
from typing import NamedTuple

from irsbot_kinematics import CertifiedBounds, Mechanism, Posture
from irsbot_msgs_py.records import Floats
from irsbot_supervisor.core.assessment import SOLVED
from irsbot_supervisor.core.margins import Margins, least_of, margins_of, slopes

LEAST_LEVER = 0.05
"""1: least lever of a joint, as a share of the robot's length, that the choice of a cut uses."""


class Box(NamedTuple):
    """Joint positions around a posture."""

    at: Posture  # in the middle
    half: Floats  # rad or m, half extents
    certified: Margins  # certified


class Search:
    """Bounds over low..high (rad or m) that improve with every cut; each cut divides the worst part."""

    def __init__(self, mechanism: Mechanism, slack_m: float, near: Posture, low: Floats, high: Floats) -> None:
        """near: a posture of the branch that continues in the box."""
        self._mechanism, self._slack_m, self._near = mechanism, slack_m, near
        self._middle = tuple([0.5 * (a + b) for a, b in zip(low, high, strict=True)])
        self._half = tuple([0.5 * (b - a) for a, b in zip(low, high, strict=True)])
        self._boxes: list[Box] = []
        self._at = near  # in the middle, once that is known
        self._met: Margins = (inf,) * 4  # smallest margins of all postures that have been looked at
        self._looked: set[int] = set()  # margins whose descent has been followed to a corner
        self._nothing = False
        self.cuts = 0

    @property
    def certified(self) -> Margins:
        """Certified smallest margins."""
        return nothing_of(self._near) if self._nothing else smallest_margins([box.certified for box in self._boxes])

    def proves(self, goal: Margins, cuts: int) -> bool:
        """True if all margins are proved to be at least this high, with at most so many cuts in total. Cuts are not
        spent on a goal that a posture in the box contradicts."""
        if not self._boxes and not self._nothing and self._add(self._near, self._middle, self._half, goal):
            self._at = self._boxes[0].at
        while not self._nothing:
            wanted = _in_question(self._met, goal)
            worst = min(self._boxes, key=lambda box: spare_of(box.certified, wanted))
            if (spare := spare_of(worst.certified, wanted)) >= 0.0:
                return wanted == goal
            if self.cuts >= cuts or not spare < 0.0:
                return False
            short = {kind for kind, more in enumerate(map(sub, worst.certified, wanted)) if more < 0.0}
            if unseen := short - self._looked:  # a corner without a posture ends the search before any cut
                self._descend(min(unseen))
            else:
                self._cut(worst, wanted)
        return False

    def _descend(self, kind: int) -> None:
        """Evaluate the corner to which a margin decreases from the middle: a goal that fails there need not be
        tried."""
        self._looked.add(kind)
        ways = zip(self._middle, self._half, slopes(self._mechanism, self._at, kind), strict=True)
        self._see(self._mechanism.track(tuple([q - copysign(half, slope) for q, half, slope in ways]), self._at))

    def _see(self, at: Posture) -> bool:
        """Evaluate a posture. Where there is no posture, nothing can be proved."""
        if at.status != SOLVED:
            self._nothing = True
            return False
        self._met = smallest_margins([self._met, margins_of(at)])
        return True

    def _cut(self, box: Box, wanted: Margins) -> None:
        """Cut a box in two halves, across the joint that moves its leg farthest."""
        self.cuts += 1
        self._boxes.remove(box)
        levers = zip(box.half, box.at.levers, strict=True)
        lengths = [half * max(abs(lever), LEAST_LEVER * self._mechanism.length_m) for half, lever in levers]
        joint = lengths.index(max(lengths))
        half = tuple([0.5 * h if j == joint else h for j, h in enumerate(box.half)])
        for way in (-half[joint], half[joint]):
            self._add(box.at, tuple([q + way if j == joint else q for j, q in enumerate(box.at.joints)]), half, wanted)

    def _add(self, near: Posture, middle: Floats, half: Floats, wanted: Margins) -> bool:
        """Add the first-order bounds of a box, and the second-order bounds if the first do not suffice."""
        at = self._mechanism.track(middle, near)
        if not self._see(at):
            return False
        certified = margins_of_bounds(self._mechanism.certified_bounds(at, half, self._slack_m))
        if spare_of(certified, _in_question(self._met, wanted)) < 0.0:
            certified = largest_margins(
                certified, margins_of_bounds(self._mechanism.sharp_bounds(at, half, self._slack_m))
            )
        self._boxes.append(Box(at, half, certified))
        return True


class BoxBounds:
    """Certified minima of the margins of one mechanism over boxes of joint positions."""

    def __init__(self, mechanism: Mechanism, slack_m: float) -> None:
        self._mechanism, self._slack_m = mechanism, slack_m

    def around(self, at: Posture, half: Floats) -> Margins:
        """First bounds over the box around a posture, without cuts."""
        return margins_of_bounds(self._mechanism.certified_bounds(at, half, self._slack_m))

    def search(self, near: Posture, low: Floats, high: Floats) -> Search:
        """Bounds over low..high (rad or m). near: a posture of the branch that continues in the box."""
        return Search(self._mechanism, self._slack_m, near, low, high)

    def least(self, near: Posture, low: Floats, high: Floats, goal: Margins, cuts: int) -> Margins:
        """The same in one call: bounds that reach the goal, or the best after the allowed number of cuts."""
        search = self.search(near, low, high)
        search.proves(goal, cuts)
        return search.certified


def smallest_margins(bounds: list[Margins]) -> Margins:
    """The smallest of each margin."""
    type1, type2, constraint, limb = bounds[0]
    for a, b, c, d in bounds[1:]:
        type1, type2, constraint, limb = min(type1, a), min(type2, b), min(constraint, c), min(limb, d)
    return type1, type2, constraint, limb


def largest_margins(one: Margins, other: Margins) -> Margins:
    """The largest of each margin: the best of two bounds of the same box."""
    type1, type2, constraint, limb = one
    a, b, c, d = other
    return max(type1, a), max(type2, b), max(constraint, c), max(limb, d)


def _in_question(met: Margins, wanted: Margins) -> Margins:
    """The goal without the margins that a posture in the box contradicts: for those nothing can be proved, and they
    must not prevent the proof of the others."""
    type1, type2, constraint, limb = wanted
    a, b, c, d = met
    return (
        type1 if a >= type1 else -inf,
        type2 if b >= type2 else -inf,
        constraint if c >= constraint else -inf,
        limb if d >= limb else -inf,
    )


def spare_of(have: Margins, want: Margins) -> float:
    """Least difference between the margins and the goal."""
    type1, type2, constraint, limb = have
    a, b, c, d = want
    return min(min(min(type1 - a, type2 - b), constraint - c), limb - d)


def margins_of_bounds(certified_bounds: CertifiedBounds) -> Margins:
    """A certified bound as four margins; infinite where the mechanism has none."""
    type1, type2, constraint, limb = certified_bounds
    return least_of(type1), type2, constraint if constraint == constraint else inf, least_of(limb) if limb else inf


def nothing_of(at: Posture) -> Margins:
    """Bounds where nothing can be proved: 0, and infinite where the mechanism of a solved posture has no margin."""
    return 0.0, 0.0, 0.0 if at.constraint == at.constraint else inf, 0.0 if at.limb else inf
