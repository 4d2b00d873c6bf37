"""What a robot keeps of its margins until it stands, whatever its drives do: certified minima over the reachable box.

`reach` says how far every joint can get until it stands. The mechanism bounds its margins from below over boxes of
joint positions. One box usually settles the question; where it does not, the box is cut, the worst part further. What
is not proved within the allowed number of cuts counts as lost.
"""

from __future__ import annotations

from math import inf
from operator import add, sub
from typing import TYPE_CHECKING, NamedTuple

from irsbot_kinematics import Guarantee, Mechanism, Posture
from irsbot_msgs_py.records import Floats
from irsbot_supervisor.core.assess import SOLVED, Margins, margins_of
from irsbot_supervisor.core.estimation.estimate import Speeds
from irsbot_supervisor.core.reach import Reach

if TYPE_CHECKING:
    from irsbot_supervisor.core.settings import Settings

HALVINGS, MORE_HALVINGS = 1, 3
"""How often the box of one sample may be halved across every joint to prove that no warning is due, and before a robot
is stopped for a bound alone: 2^n cuts each for n joints. While that is computed the robot goes on."""

WIDER = 0.1
"""1: a box is proved with this share of its size added at each end where that succeeds at once: the boxes of the next
samples lie in it, and nothing is to be computed for them."""

NEARLY = 1.5
"""1: what was proved of a box serves for boxes in it that are at most this many times smaller."""

PATIENT_CUTS = 60
"""The same where no robot waits for the answer."""


class Box(NamedTuple):
    """Joint positions around a posture."""

    at: Posture  # in the middle
    half: Floats  # rad or m, half extents
    floor: Margins  # certified


class Proved(NamedTuple):
    """A box of joint positions, rad or m, and what has been proved of it."""

    low: Floats
    high: Floats
    floor: Margins

    def holds(self, low: Floats, high: Floats) -> bool:
        """Whether another box lies in this one and is nearly as large: of a much smaller one more can be proved."""
        return all(
            a <= b and c >= d and c - a <= NEARLY * (d - b)
            for a, b, c, d in zip(self.low, low, self.high, high, strict=True)
        )


class BoxBounds:
    """Certified minima of the margins of one mechanism over boxes of joint positions."""

    def __init__(self, mechanism: Mechanism, slack_m: float) -> None:
        self._mechanism, self._slack_m = mechanism, slack_m

    def around(self, at: Posture, half: Floats) -> Margins:
        """The quickest bounds over the box around a posture."""
        return floor_of(self._mechanism.guarantee(at, half, self._slack_m))

    def least(self, near: Posture, low: Floats, high: Floats, goals: tuple[tuple[Margins, int], ...]) -> Margins:
        """Bounds over low..high (rad or m). near: a posture of the branch that goes on in the box. goals: bounds that
        suffice and how many cuts may be made for them, the highest first."""
        middle = tuple([0.5 * (a + b) for a, b in zip(low, high, strict=True)])
        first = self._box(near, middle, tuple([0.5 * (b - a) for a, b in zip(low, high, strict=True)]), goals[0][0])
        if first is None:
            return nothing_of(near)
        boxes, floor = [first], first.floor
        for goal, cuts in goals:
            wanted = goal
            for _ in range(cuts):
                worst = min(boxes, key=lambda box: spare_of(box.floor, wanted))
                wanted = _in_question(margins_of(worst.at), wanted)
                if spare_of(worst.floor, wanted) >= 0.0:
                    if spare_of(lowest([box.floor for box in boxes]), wanted) >= 0.0:
                        break
                    continue
                boxes.remove(worst)
                halves = self._cut(worst, wanted)
                if None in halves:
                    return nothing_of(near)
                boxes += [half for half in halves if half]
            floor = lowest([box.floor for box in boxes])
            if spare_of(floor, goal) >= 0.0:
                break
        return floor

    def _cut(self, box: Box, wanted: Margins) -> list[Box | None]:
        """Two halves, across the joint that moves its leg farthest."""
        levers = zip(box.half, box.at.levers, strict=True)
        lengths = [half * max(abs(lever), LEAST_LEVER * self._mechanism.length_m) for half, lever in levers]
        joint = lengths.index(max(lengths))
        half = tuple([0.5 * h if j == joint else h for j, h in enumerate(box.half)])
        return [
            self._box(
                box.at,
                tuple([q + sign * half[j] if j == joint else q for j, q in enumerate(box.at.joints)]),
                half,
                wanted,
            )
            for sign in (-1.0, 1.0)
        ]

    def _box(self, near: Posture, middle: Floats, half: Floats, wanted: Margins) -> Box | None:
        """The bounds of first order, and of second order where those do not suffice; None where there is no posture."""
        at = self._mechanism.track(middle, near)
        if at.status != SOLVED:
            return None
        floor = floor_of(self._mechanism.guarantee(at, half, self._slack_m))
        if spare_of(floor, wanted) < 0.0:
            floor = highest(floor, floor_of(self._mechanism.guarantee_sharp(at, half, self._slack_m)))
        return Box(at, half, floor)


LEAST_LEVER = 0.05
"""1: a joint whose lever is smaller than this share of the robot's length counts as if it had that one."""


class StoppingPredictor:
    """Certified margins of one robot until it stands, under given settings."""

    def __init__(self, settings: Settings, mechanism: Mechanism, patient: bool = False) -> None:
        """patient: no robot waits for the answer."""
        self._latency = settings.latency_s
        self._bounds = BoxBounds(mechanism, settings.slack_m)
        self._reach = Reach(settings)
        warn, stop = release_of(settings), limits_of(settings, "stop")
        whole = 2 ** len(mechanism.joints)
        cuts, more = (PATIENT_CUTS, PATIENT_CUTS) if patient else (HALVINGS * whole, MORE_HALVINGS * whole)
        self._usual, self._cuts = ((warn, cuts), (stop, more)), more
        self._proved: Proved | None = None
        self._looked: Proved | None = None  # what has been found where nothing could be proved

    def predict(
        self,
        at: Posture,
        speeds: Speeds,
        ahead_s: float,
        wanted: Margins | None = None,
        moved: tuple[Floats, Floats] | None = None,
    ) -> Margins:
        """Certified smallest margins until standstill from a solved posture, whatever the joints do for `ahead_s` and
        the latency before they brake; errors of encoders, stamps and geometry included.

        wanted: bounds that high are good enough; the warning limits, then the stop limits, if left out. moved: from
        where to where (rad or m, relative) the joints may get before `ahead_s` begins; none if left out.
        """
        forward, backward = self._reach.until_rest(speeds, ahead_s + self._latency)
        if not sum(forward) + sum(backward) < inf:
            return nothing_of(at)
        forward, backward = list(map(add, forward, self._reach.errors)), list(map(add, backward, self._reach.errors))
        if moved is not None:
            forward, backward = list(map(add, forward, moved[1])), list(map(sub, backward, moved[0]))
        floor = self._bounds.around(at, tuple(map(max, forward, backward)))
        if spare_of(floor, self._usual[0][0] if wanted is None else wanted) >= 0.0:
            return floor
        low, high = tuple(map(sub, at.joints, backward)), tuple(map(add, at.joints, forward))
        if wanted is not None:
            return self._bounds.least(at, low, high, ((wanted, self._cuts),))
        return self._sampled(at, low, high)

    def _sampled(self, at: Posture, low: Floats, high: Floats) -> Margins:
        """Bounds over a box that moves on a little with every sample."""
        if (proved := self._proved) is not None and proved.holds(low, high):
            return proved.floor
        wide, best = _wider(low, high), nothing_of(at)
        for goal in self._usual:
            floor = self._bounds.least(at, *wide, (goal,))
            if spare_of(floor, goal[0]) >= 0.0:
                self._proved = Proved(*wide, floor)
                return floor
            best = highest(best, floor, self._bounds.least(at, low, high, (goal,)))
            if spare_of(best, goal[0]) >= 0.0:
                self._proved = Proved(low, high, best)
                return best
        return best

    def once(self, at: Posture, speeds: Speeds, ahead_s: float) -> Margins:
        """What `predict` says, with less work: enough where a robot is being stopped anyway. For boxes that hardly move
        nothing is computed, whether anything was proved of them or not."""
        forward, backward = self._reach.until_rest(speeds, ahead_s + self._latency)
        if not sum(forward) + sum(backward) < inf:
            return nothing_of(at)
        low = tuple([q - way - e for q, way, e in zip(at.joints, backward, self._reach.errors, strict=True)])
        high = tuple([q + way + e for q, way, e in zip(at.joints, forward, self._reach.errors, strict=True)])
        if (looked := self._looked) is None or not looked.holds(low, high):
            wide = _wider(low, high)
            looked = self._looked = Proved(*wide, self._bounds.least(at, *wide, self._usual))
        return looked.floor

    def along(self, at: Posture, rates: Floats, ahead_s: float, wanted: Margins) -> Margins:
        """Certified smallest margins until standstill if every joint goes on at its rate (rad/s or m/s) for `ahead_s`
        and the latency, and then brakes: no guarantee against drives that do otherwise."""
        forward, backward = self._reach.until_rest_from(rates, ahead_s + self._latency)
        low, high = list(map(sub, at.joints, backward)), list(map(add, at.joints, forward))
        low, high = list(map(sub, low, self._reach.errors)), list(map(add, high, self._reach.errors))
        return self._bounds.least(at, tuple(low), tuple(high), ((wanted, self._cuts),))

    def travel(self, speeds: Speeds, ahead_s: float) -> tuple[list[float], list[float]]:
        """rad or m that the joints get forward and backward until they stand."""
        return self._reach.until_rest(speeds, ahead_s + self._latency)


def _wider(low: Floats, high: Floats) -> tuple[Floats, Floats]:
    more = [WIDER * (b - a) for a, b in zip(low, high, strict=True)]
    return tuple(map(sub, low, more)), tuple(map(add, high, more))


def lowest(floors: list[Margins]) -> Margins:
    """The smallest of each margin."""
    type1, type2, constraint, limb = map(min, zip(*floors, strict=True))
    return type1, type2, constraint, limb


def highest(*floors: Margins) -> Margins:
    """The largest of each margin: of several bounds of the same, the best."""
    type1, type2, constraint, limb = map(max, zip(*floors, strict=True))
    return type1, type2, constraint, limb


def _in_question(met: Margins, wanted: Margins) -> Margins:
    """What is wanted of the margins that are not already seen to be lower somewhere: of those nothing can be proved,
    and the others shall not be blamed for it."""
    type1, type2, constraint, limb = (want if have >= want else -inf for have, want in zip(met, wanted, strict=True))
    return type1, type2, constraint, limb


def spare_of(have: Margins, want: Margins) -> float:
    """What the worst margin has above what is wanted."""
    spare: float = min(map(sub, have, want))
    return spare


def floor_of(guarantee: Guarantee) -> Margins:
    """A guarantee as four margins; infinite where the mechanism has none."""
    type1, type2, constraint, limb = guarantee
    return min(type1), type2, constraint if constraint == constraint else inf, min(limb) if limb else inf


def nothing_of(at: Posture) -> Margins:
    """What is known where nothing can be bounded; infinite where the mechanism of a solved posture has no margin."""
    return 0.0, 0.0, 0.0 if at.constraint == at.constraint else inf, 0.0 if at.limb else inf


def limits_of(settings: Settings, which: str) -> Margins:
    """The `warn` or `stop` limits of the four margins."""
    kinds = ("type1", "type2", "constraint", "limb")
    type1, type2, constraint, limb = (getattr(settings, f"{kind}_{which}") for kind in kinds)
    return type1, type2, constraint, limb


def release_of(settings: Settings) -> Margins:
    """The limits at which a warning ends."""
    return raised(limits_of(settings, "warn"), settings.hysteresis)


def raised(limits: Margins, share: float) -> Margins:
    """Limits that are higher by a share, but not above 1, which no margin exceeds."""
    type1, type2, constraint, limb = (min(limit * (1.0 + share), 0.5 * (1.0 + limit)) for limit in limits)
    return type1, type2, constraint, limb
