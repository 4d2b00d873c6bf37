"""The stopping prediction: certified minima of the margins over the reachable box, until the robot stands, whatever its
drives do.

`reachable_box` bounds the displacement of every joint until it stands. The mechanism bounds its margins from below over
boxes of joint positions. One box usually suffices; where it does not, the worst part is cut further. A margin that is
not proved within the allowed number of cuts counts as 0. This number follows from the time in which the sample has to
be judged, where the settings state how long one box takes.
"""

from __future__ import annotations

from math import inf
from operator import add, sub
from typing import NamedTuple

from irsbot_kinematics import Mechanism, Posture
from irsbot_msgs_py.records import Floats
from irsbot_supervisor.core.box_search import (
    WHOLE,
    BoxBounds,
    Part,
    Search,
    largest_margins,
    nothing_of,
    smallest_margins,
    spare_of,
)
from irsbot_supervisor.core.estimation.estimate import Speeds
from irsbot_supervisor.core.margins import Margins
from irsbot_supervisor.core.reachable_box import ReachableBox
from irsbot_supervisor.core.settings import Settings, is_time_for

CUTS_OF_A_SAMPLE = 12
"""Number of cuts for one sample in total, if its time is not limited: the robot moves during the computation."""

CUTS_IF_CLEAR = 120
"""The same where no posture that was looked at comes near the limits. A stop would be false there, so it is worth more
time; near a limit a stop is due soon, and more cuts would only delay it. Also where no robot waits for the answer."""

CLEAR_OF_STOP, CLEAR_OF_WARNING = 1.1, 1.25
"""1: multiples of the stop and warning limits that are not near. Half way to those from which row `clean` of the faults
calls a stop or a warning false (1.2, 1.5), because a box is larger than what the joints can really reach."""

FOR_A_WARNING = 0.75
"""1: share of the cuts that the goal of no warning may use; the others are for the goal of no stop."""

KEPT = 0.75
"""1: of the bounds for one sample, the share that may go to the parts of the last box; the others are for new cuts."""

WIDER = 0.1
"""1: a box is first tried with this share of its size added at each end: the boxes of the next samples then lie in it,
and need no computation."""

SMALLER, HARDLY_SMALLER = 0.8, 0.98
"""1: bounds are reused for boxes of at least this share of the size: if the goal was proved, and if a smaller box may
give more."""

HALVINGS = 3
"""Number of times that a path with constant rates is halved where its bounds do not suffice."""


class Known(NamedTuple):
    """A box of joint positions, rad or m, and its bounds."""

    low: Floats
    high: Floats
    certified: Margins  # certified
    least: Floats  # rad or m: of boxes smaller than that more may be known

    def serves(self, low: Floats, high: Floats) -> bool:
        """True if another box lies in this one, and is not so small that its own bounds may be better."""
        return all(
            a <= b and c >= d and d - b >= least
            for a, b, c, d, least in zip(self.low, low, self.high, high, self.least, strict=True)
        )


class Goal(NamedTuple):
    """What bounds over a box are to prove, and with how many cuts in total."""

    margins: Margins
    cuts: int
    clear: Margins  # if all postures that were looked at have these margins ..
    more: int  # .. so many cuts

    def is_proved_by(self, search: Search) -> bool:
        """Improve bounds until they reach the goal; True if they do."""
        proved = search.proves(self.margins, self.cuts)
        return proved or (search.keeps(self.clear) and search.proves(self.margins, self.more))


class StoppingPredictor:
    """Certified margins of one robot until it stands, under given settings."""

    def __init__(self, settings: Settings, mechanism: Mechanism, patient: bool = False) -> None:
        """patient: True if no robot waits for the answer."""
        self._latency = settings.latency_s
        self._bounds = BoxBounds(mechanism, settings.slack_m)
        self._box = ReachableBox(settings)
        self._settings = settings
        self._flicker = (settings.encoder_resolution,) * len(mechanism.joints)  # rad or m, of a resting joint
        self.known: Known | None = None  # the last box
        self.in_vain: Known | None = None  # a wider box whose proof failed
        self.allow(CUTS_IF_CLEAR if patient else cuts_of(settings))
        self._cut: tuple[tuple[Floats, Floats], tuple[Part, ...]] | None = None  # the last box that was cut

    def allow(self, cuts: int) -> None:
        """Set the number of cuts for one sample. Bounds that were found with another number are forgotten."""
        self._spend(cuts)
        self.known = self.in_vain = None

    def hurry(self) -> None:
        """From now on a robot waits for the answers. What is known of the last box stays."""
        self._spend(cuts_of(self._settings))

    def _spend(self, cuts: int) -> None:
        self._cuts, self._goals = cuts, goals_of(self._settings, cuts)

    def predict(
        self,
        at: Posture,
        speeds: Speeds,
        prediction_delay_s: float,
        wanted: Margins | None = None,
        moved: tuple[Floats, Floats] | None = None,
        search: bool = True,
    ) -> Margins:
        """Certified smallest margins until standstill from a solved posture, whatever the joints do for
        `prediction_delay_s` and the latency before they brake; errors of encoders, stamps and geometry included.

        wanted: goal of the bounds; if left out, the warning limits, then the stop limits. moved: lowest and highest
        displacement (rad or m) of the joints before `prediction_delay_s` begins; none if left out. search: False for
        the first bounds alone, whatever they prove: for a sample whose prediction does not count.
        """
        forward, backward = self._box.until_rest(speeds, prediction_delay_s + self._latency)
        if not sum(forward, 0.0) + sum(backward, 0.0) < inf:
            return nothing_of(at)
        errors = self._box.errors
        forward = [way + error for way, error in zip(forward, errors, strict=True)]
        backward = [way + error for way, error in zip(backward, errors, strict=True)]
        if moved is not None:
            forward, backward = list(map(add, forward, moved[1])), list(map(sub, backward, moved[0]))
        half = tuple([max(ahead, back) for ahead, back in zip(forward, backward, strict=True)])
        certified = self._bounds.around(at, half)
        if not search or spare_of(certified, self._goals[0].margins if wanted is None else wanted) >= 0.0:
            return certified
        low = tuple([q - way for q, way in zip(at.joints, backward, strict=True)])
        high = tuple([q + way for q, way in zip(at.joints, forward, strict=True)])
        if wanted is not None:
            return self._bounds.least(at, low, high, wanted, self._cuts)
        return self._sampled(at, low, high)

    def _sampled(self, at: Posture, low: Floats, high: Floats) -> Margins:
        """Bounds over a box that moves a little with every sample: those of the last box are reused for boxes
        inside."""
        known = self.known
        if known is None or not known.serves(low, high):
            known = self.renew(at, low, high)
        return known.certified

    def renew(self, at: Posture, low: Floats, high: Floats) -> Known:
        """Bound a reachable box that the last one does not serve, and keep its bounds for the next samples. A failed
        proof over the wider box is repeated, unless the box differs only by flicker."""
        no_warning, no_stop = self._goals
        ends = wider(low, high, WIDER)
        wide = None if self.in_vain is not None and self.in_vain.serves(low, high) else self._bounds.search(at, *ends)
        if wide is not None and wide.proves(no_warning.margins, 0):
            return self._keep(ends, wide.certified, _shares(low, high, SMALLER))
        here = tuple(map(sub, low, self._flicker)), tuple(map(add, high, self._flicker))
        search = self._bounds.search(at, *here, self._parts(low, high))
        goal = next((goal for goal in self._goals if goal.is_proved_by(search)), None)
        clear = goal is not None and search.keeps(no_stop.clear)
        most = max(self._cuts, search.cuts) if clear else self._cuts
        self._cut = here, search.parts((goal or no_stop).margins, 1 + int(KEPT * 2 * most))
        share = SMALLER if goal == no_warning else HARDLY_SMALLER
        if goal is not None and wide is not None:
            if wide.proves(goal.margins, self._cuts - search.cuts):
                return self._keep(ends, wide.certified, _shares(low, high, share))
            self.in_vain = Known(*ends, wide.certified, _shares(low, high, HARDLY_SMALLER))
        return self._keep(here, search.certified, _shares(low, high, share))

    def _parts(self, low: Floats, high: Floats) -> tuple[Part, ...]:
        """Parts to begin with: those of the last box that was cut, if the middle of this one lies in it."""
        if self._cut is None:
            return WHOLE
        ends, parts = self._cut
        middle = [0.5 * (a + b) for a, b in zip(low, high, strict=True)]
        return parts if all(a <= q <= b for a, q, b in zip(ends[0], middle, ends[1], strict=True)) else WHOLE

    def _keep(self, ends: tuple[Floats, Floats], certified: Margins, least: Floats) -> Known:
        """Keep the bounds for the next samples."""
        self.known = known = Known(*ends, certified, least)
        return known

    def along(self, at: Posture, rates: Floats, prediction_delay_s: float, wanted: Margins) -> Margins:
        """Certified smallest margins until standstill if all joints keep their rates (rad/s or m/s) and brake at the
        same time, at the latest after `prediction_delay_s` and the latency; each as hard as it likes, but not less than
        its limit. Other behaviour of the drives is not covered: for the way out of a stop only."""
        return self._between(at, rates, 0.0, prediction_delay_s + self._latency, wanted, HALVINGS)

    def _between(
        self, at: Posture, rates: Floats, first_s: float, last_s: float, wanted: Margins, halvings: int
    ) -> Margins:
        """The same of the part of the path from `first_s` on, braking included. The joints move together: boxes around
        halves of the path are much smaller than halves of a box."""
        errors, (low, high) = self._box.errors_at(rates), self._box.following(rates, first_s, last_s)
        lowest, highest = map(sub, map(add, at.joints, low), errors), map(add, map(add, at.joints, high), errors)
        certified = self._bounds.least(at, tuple(lowest), tuple(highest), wanted, 0)
        if spare_of(certified, wanted) >= 0.0 or halvings == 0:
            return certified
        middle_s = 0.5 * (first_s + last_s)
        begin = self._between(at, rates, first_s, middle_s, wanted, halvings - 1)
        if not spare_of(begin, wanted) >= 0.0:
            return certified
        end = self._between(at, rates, middle_s, last_s, wanted, halvings - 1)
        return largest_margins(certified, smallest_margins([begin, end]))

    def travel(self, speeds: Speeds, prediction_delay_s: float) -> tuple[list[float], list[float]]:
        """rad or m: displacement of the joints forward and backward until they stand."""
        return self._box.until_rest(speeds, prediction_delay_s + self._latency)


def cuts_of(settings: Settings) -> int:
    """Number of cuts for one sample: those for which there is time."""
    return cuts_in(settings.judging_s, settings.bounding_s)


def cuts_in(time_s: float, bounding_s: float) -> int:
    """Number of cuts for one sample that has to be judged in `time_s`, where one box takes `bounding_s`."""
    return sum(is_time_for(cuts, bounding_s, time_s) for cuts in range(1, CUTS_OF_A_SAMPLE + 1))


def goals_of(settings: Settings, cuts: int) -> tuple[Goal, Goal]:
    """No warning, and no stop, with so many cuts for one sample. More where no limit is near, unless the time of a
    sample is limited."""
    more = CUTS_IF_CLEAR if cuts == CUTS_OF_A_SAMPLE and settings.bounding_s == 0.0 else cuts
    warn, stop = limits_of(settings, "warn"), limits_of(settings, "stop")
    clear_of_warning, clear_of_stop = _multiple(CLEAR_OF_WARNING, warn), _multiple(CLEAR_OF_STOP, stop)
    return (
        Goal(release_of(settings), int(FOR_A_WARNING * cuts), clear_of_warning, int(FOR_A_WARNING * more)),
        Goal(stop, cuts, clear_of_stop, more),
    )


def _shares(low: Floats, high: Floats, share: float) -> Floats:
    return tuple([share * (b - a) for a, b in zip(low, high, strict=True)])


def wider(low: Floats, high: Floats, share: float) -> tuple[Floats, Floats]:
    """A box with this share of its size added at each end."""
    more = _shares(low, high, share)
    below = tuple([a - step for a, step in zip(low, more, strict=True)])
    return below, tuple([b + step for b, step in zip(high, more, strict=True)])


def limits_of(settings: Settings, which: str) -> Margins:
    """The `warn` or `stop` limits of the four margins."""
    kinds = ("type1", "type2", "constraint", "limb")
    type1, type2, constraint, limb = (getattr(settings, f"{kind}_{which}") for kind in kinds)
    return type1, type2, constraint, limb


def _multiple(factor: float, limits: Margins) -> Margins:
    type1, type2, constraint, limb = limits
    return factor * type1, factor * type2, factor * constraint, factor * limb


def release_of(settings: Settings) -> Margins:
    """The limits at which a warning ends."""
    return raised(limits_of(settings, "warn"), settings.hysteresis)


def raised(limits: Margins, share: float) -> Margins:
    """Limits raised by a share, but not above 1: beyond 1 no margin needs a limit."""
    type1, type2, constraint, limb = (min(limit * (1.0 + share), 0.5 * (1.0 + limit)) for limit in limits)
    return type1, type2, constraint, limb
