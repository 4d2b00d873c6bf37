"""Certified minima of margins over boxes of joint positions, with further cuts where one bound does not suffice.

The mechanism bounds its margins from below over a box. Over half a box the bound is tighter. The worst part is cut
until the goal is proved, a posture in the box contradicts it, or the allowed number of cuts is used.

The reachable boxes of two samples differ little. So a search may begin with the parts into which the last one was
divided, which saves the bounds of the larger parts that did not suffice there.
"""

from __future__ import annotations

from math import copysign, inf
from operator import sub
from typing import NamedTuple

from irsbot_kinematics import CertifiedBounds, Mechanism, Posture
from irsbot_msgs_py.records import Floats
from irsbot_supervisor.core.assessment import SOLVED
from irsbot_supervisor.core.margins import Margins, least_of, margins_of, neighbours, slopes_among

LEAST_LEVER = 0.05
"""1: least lever of a joint, as a share of the robot's length, that the choice of a cut uses."""


Part = tuple[int, ...]
"""A part of a box: the cuts that lead to it, 2 j for the half below and 2 j + 1 for the half above, of joint j."""

WHOLE: tuple[Part, ...] = ((),)
"""A box without cuts."""


class Box(NamedTuple):
    """A part of the box, and its bounds."""

    at: Posture  # in its middle
    half: Floats  # rad or m, half extents
    certified: Margins  # certified
    part: Part
    sharp: bool  # True if second-order bounds are in it


class Search:
    """Bounds over low..high (rad or m) that improve with every cut; each cut divides the worst part."""

    def __init__(
        self,
        mechanism: Mechanism,
        slack_m: float,
        near: Posture,
        low: Floats,
        high: Floats,
        parts: tuple[Part, ...] = WHOLE,
    ) -> None:
        """near: a posture of the branch that continues in the box. parts: those to begin with, together the whole
        box."""
        self._mechanism, self._slack_m, self._near = mechanism, slack_m, near
        self._middle = tuple([0.5 * (a + b) for a, b in zip(low, high, strict=True)])
        self._half = tuple([0.5 * (b - a) for a, b in zip(low, high, strict=True)])
        self._boxes: list[Box] = []
        self._wanted: Margins | None = None
        self._spares: list[float] = []  # of the first boxes, from what is wanted
        self._at = near  # in the middle, once that is known
        self._around: list[tuple[Posture, Posture]] = []  # neighbours of the middle, once a descent needs them
        self._met: Margins = (inf,) * 4  # smallest margins of all postures that have been looked at
        self._looked: set[int] = set()  # margins whose descent has been followed to a corner
        self._nothing = False
        self._begun = parts
        self.cuts = len(parts) // 2  # each bounds two parts

    @property
    def certified(self) -> Margins:
        """Certified smallest margins."""
        return nothing_of(self._near) if self._nothing else smallest_margins([box.certified for box in self._boxes])

    def proves(self, goal: Margins, cuts: int) -> bool:
        """True if all margins are proved to be at least this high, with at most so many cuts in total. Cuts are not
        spent on a goal that a posture in the box contradicts."""
        if not self._boxes and not self._nothing:
            self._begin(goal)
        while not self._nothing:
            wanted = _in_question(self._met, goal)
            place = self._worst(wanted)
            worst, spare = self._boxes[place], self._spares[place]
            if spare >= 0.0:
                return wanted == goal
            if not spare < 0.0:
                return False
            if not worst.sharp:
                self._boxes[place] = sharpened = self._sharpened(worst)
                self._spares[place] = spare_of(sharpened.certified, wanted)
                continue
            if self.cuts >= cuts:
                return False
            short = {kind for kind, more in enumerate(map(sub, worst.certified, wanted)) if more < 0.0}
            if unseen := short - self._looked:  # a corner without a posture ends the search before any cut
                self._descend(min(unseen))
            else:
                self._cut(place, wanted)
        return False

    def _worst(self, wanted: Margins) -> int:
        """Place of the box with the least to spare."""
        if wanted != self._wanted:
            self._wanted, self._spares = wanted, []
        self._spares += [spare_of(box.certified, wanted) for box in self._boxes[len(self._spares) :]]
        return self._spares.index(min(self._spares))

    def keeps(self, limits: Margins) -> bool:
        """True if all postures that have been looked at have these margins at least."""
        return not self._nothing and spare_of(self._met, limits) >= 0.0

    def parts(self, goal: Margins, most: int) -> tuple[Part, ...]:
        """Parts for the next search, at most so many, and one less than now if no cut was needed. Of two halves that
        become one again, the worse has as much to spare as possible."""
        if self._nothing:
            return self._begun
        wanted = _in_question(self._met, goal)
        spare = {box.part: spare_of(box.certified, wanted) for box in self._boxes}
        if len(spare) == len(self._begun):
            most = min(most, len(spare) - 1)
        halves = [(part, _other_half(part)) for part in spare if part]
        worse = {part: min(spare[part], spare[other]) for part, other in halves if other in spare}
        while len(spare) > max(most, 1):
            one = max(worse, key=worse.__getitem__)
            other, whole = _other_half(one), one[:-1]
            del worse[one], worse[other]
            spare[whole] = min(spare.pop(one), spare.pop(other))
            if whole and (beside := _other_half(whole)) in spare:
                worse[whole] = worse[beside] = min(spare[whole], spare[beside])
        return tuple(spare)

    def _begin(self, goal: Margins) -> None:
        """Bound the parts to begin with."""
        self._at = self._mechanism.track(self._middle, self._near)
        if self._see(self._at):
            for part in sorted(self._begun):  # the halves of a part follow each other
                if part:
                    middle, half = self._extent(part)
                    self._add(self._nearest(part, middle), middle, half, goal, part)
                else:
                    self._bound(self._at, self._half, goal, part)

    def _nearest(self, part: Part, middle: Floats) -> Posture:
        """From where the branch is followed to the middle of a part: of the smallest part around it that has postures
        already, the nearest one. A short way needs few steps.

        Parts that are all free of Type 2 are then on one branch. For halves of a part: the way from one half to the
        other is straight, so it stays in the part, and crosses the face between the halves once. There both have the
        same posture, and so all over the face, because it is connected. The larger part is free of Type 2, too, and on
        one branch; the same holds for the part of which it is a half.
        """
        if self._mechanism.label_is_invariant or not self._boxes:
            return self._at  # where labels are invariant, no way is followed
        pairs = zip(part, self._boxes[-1].part, strict=False)
        depth = next(k for k, (one, other) in enumerate(pairs) if one != other)
        weights = [1.0 / half if half > 0.0 else 0.0 for half in self._half]  # of ways, as shares of the box
        found, least = self._at, inf
        for box in reversed(self._boxes):
            if box.part[:depth] != part[:depth]:
                break
            way = 0.0
            for q, start, weight in zip(middle, box.at.joints, weights, strict=True):
                way += weight * abs(q - start)
            if way < least:
                found, least = box.at, way
        return found

    def _extent(self, part: Part) -> tuple[Floats, Floats]:
        """Middle and half extents of a part."""
        middle, half = list(self._middle), list(self._half)
        for cut in part:
            joint, above = divmod(cut, 2)
            half[joint] *= 0.5
            middle[joint] += half[joint] if above else -half[joint]
        return tuple(middle), tuple(half)

    def _descend(self, kind: int) -> None:
        """Evaluate the corner to which a margin decreases from the middle: a goal that fails there need not be
        tried."""
        self._looked.add(kind)
        self._around = self._around or neighbours(self._mechanism, self._at)
        ways = zip(self._middle, self._half, slopes_among(self._around, self._at, kind), strict=True)
        self._see(self._mechanism.track(tuple([q - copysign(half, slope) for q, half, slope in ways]), self._at))

    def _see(self, at: Posture) -> bool:
        """Evaluate a posture. Where there is no posture, nothing can be proved."""
        if at.status != SOLVED:
            self._nothing = True
            return False
        self._met = smallest_margins([self._met, margins_of(at)])
        return True

    def _cut(self, place: int, wanted: Margins) -> None:
        """Cut a box in two halves, across the joint that moves its leg farthest."""
        self.cuts += 1
        box, _ = self._boxes.pop(place), self._spares.pop(place)
        levers = zip(box.half, box.at.levers, strict=True)
        lengths = [half * max(abs(lever), LEAST_LEVER * self._mechanism.length_m) for half, lever in levers]
        joint = lengths.index(max(lengths))
        half = tuple([0.5 * h if j == joint else h for j, h in enumerate(box.half)])
        for above, step in enumerate((-half[joint], half[joint])):
            middle = tuple([q + step if j == joint else q for j, q in enumerate(box.at.joints)])
            self._add(box.at, middle, half, wanted, (*box.part, 2 * joint + above))

    def _add(self, near: Posture, middle: Floats, half: Floats, wanted: Margins, part: Part) -> None:
        """Add a part."""
        at = self._mechanism.track(middle, near)
        if self._see(at):
            self._bound(at, half, wanted, part)

    def _bound(self, at: Posture, half: Floats, wanted: Margins, part: Part) -> None:
        """Add the first-order bounds of a part, and the second-order bounds if the first do not suffice. at: in its
        middle."""
        certified = margins_of_bounds(self._mechanism.certified_bounds(at, half, self._slack_m))
        box = Box(at, half, certified, part, sharp=False)
        suffices = spare_of(certified, _in_question(self._met, wanted)) >= 0.0
        self._boxes.append(box if suffices else self._sharpened(box))

    def _sharpened(self, box: Box) -> Box:
        """A part with its second-order bounds."""
        more = margins_of_bounds(self._mechanism.sharp_bounds(box.at, box.half, self._slack_m))
        return Box(box.at, box.half, largest_margins(box.certified, more), box.part, sharp=True)


def _other_half(part: Part) -> Part:
    """The part from which this one was cut off."""
    return (*part[:-1], part[-1] ^ 1)


class BoxBounds:
    """Certified minima of the margins of one mechanism over boxes of joint positions."""

    def __init__(self, mechanism: Mechanism, slack_m: float) -> None:
        self._mechanism, self._slack_m = mechanism, slack_m

    def around(self, at: Posture, half: Floats) -> Margins:
        """First bounds over the box around a posture, without cuts."""
        return margins_of_bounds(self._mechanism.certified_bounds(at, half, self._slack_m))

    def search(self, near: Posture, low: Floats, high: Floats, parts: tuple[Part, ...] = WHOLE) -> Search:
        """Bounds over low..high (rad or m). near: a posture of the branch that continues in the box. parts: those to
        begin with."""
        return Search(self._mechanism, self._slack_m, near, low, high, parts)

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
