"""The command gate: a commanded motion in, the part of it that is allowed out.

On approach a command is scaled so that the robot could still be stopped before the gate's limits if its drives did
their worst from then on; these limits lie a little above the stop limits. So a robot commanded through the gate is not
stopped, it comes to rest where it can be stopped. What points inward is blocked,
what goes along stays. After a STOP only motion away from what caused it passes, at recovery speed, and nothing that
gives back what was gained. In doubt the answer is to hold.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from math import inf, isfinite
from typing import NamedTuple

from irsbot_kinematics import Mechanism, Posture
from irsbot_msgs_py.records import Floats, Level
from irsbot_supervisor.core.assess import Margins, margins_of, slopes
from irsbot_supervisor.core.estimation.estimate import Speeds
from irsbot_supervisor.core.estimation.observer import excess
from irsbot_supervisor.core.intake import S
from irsbot_supervisor.core.latch import Judgement
from irsbot_supervisor.core.policy import KINDS, WORDS
from irsbot_supervisor.core.position_limits import PositionLimits
from irsbot_supervisor.core.reach import position_error
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.stopping import StoppingPredictor, floor_of, limits_of, raised

RESERVE = 0.02
"""1: share above the stop limits that a command keeps, so that the gate does not lead to the stop it is there to avoid:
the drives lag behind what they are told, and the supervisor sees an instant more than the gate foresaw."""

DIP = 0.002
"""1: how far below the best margin since a stop a motion away may be bounded. Bounds over boxes of joints lie a little
below the margins; cut eight times, the boxes of a slow path are finer than this."""

STEP = 1.25
"""1: by how much the allowed share of a command grows at most from one to the next."""

LEAST = 0.01
"""1: smaller shares of a command are none."""

NOTHING_GAINED: Margins = (-inf, -inf, -inf, -inf)
"""What has to be kept of the margins on a way out that has not begun."""


class View(NamedTuple):
    """What is known of the robot now."""

    at: Posture
    velocity: Floats  # rad/s or m/s, NaN where not known
    speeds: Speeds  # certain
    ahead_s: float  # age of the sample, and until the next can be expected
    expected_s: float  # of these until the next can be expected
    judgement: Judgement
    seen_ns: int  # when the sample came, steady clock

    def aged(self, now_ns: int) -> View:
        """The same at a later time: what is known is older by then."""
        return self._replace(ahead_s=self.ahead_s + max(now_ns - self.seen_ns, 0) / S)


class Allowed(NamedTuple):
    """What the joints may do. rates: rad/s or m/s. text: empty if all that was wanted, else what was taken away."""

    rates: Floats
    text: str


class Gate:
    """Passes velocity commands of one robot, as far as they are safe, and says what limits hold for longer motions."""

    def __init__(self, settings: Settings, mechanism: Mechanism) -> None:
        self._mechanism = mechanism
        self._best = NOTHING_GAINED  # since the robot stood after a stop, or since the gate's limit was crossed
        self._along = self._inward = 1.0  # shares of the last command that were allowed
        self._kind = 0  # the margin that limited it
        self._stood = False  # since the stop that is in force
        self._last: Floats = ()  # what was asked for
        self.configure(settings)

    def configure(self, settings: Settings) -> None:
        """New limits; how far a robot has come out of a stop stays known."""
        self._settings = settings
        self._predictor = StoppingPredictor(settings, self._mechanism)
        self._speed = settings.velocity_limit
        self._slow = settings.standstill_speed
        self._share = settings.recovery_share
        self._beat_s, self._latency_s = settings.heartbeat_s, settings.latency_s
        self._lag_s = settings.heartbeat_s + settings.latency_s  # until the drives follow the next command
        self._stop = limits_of(settings, "stop")
        self._keep = raised(self._stop, RESERVE)
        self._error = (position_error(settings),) * len(settings.velocity_limit)
        self._slack_m = settings.slack_m
        self._position = PositionLimits(settings, self._mechanism.joints)

    def velocity(self, wanted: Sequence[float], view: View | None) -> Allowed:
        """The part of commanded joint velocities (rad/s or m/s, robot order) that is allowed until the next call."""
        hold = (0.0,) * len(self._speed)
        if len(wanted) != len(hold) or not all(map(isfinite, wanted)):
            return Allowed(hold, f"held: {len(hold)} finite velocities are needed")
        share = self.share(view)
        if view is None or not share > 0.0:
            return Allowed(hold, "held: the state of the robot does not allow motion")
        limits = self.limits(view)
        excess = max(self._excess(wanted) / share, 1.0)
        rates = tuple(rate / excess for rate in wanted)
        text = f"scaled to {1.0 / excess:.3g}: speed limit" if excess > 1.0 else ""
        kept = self._kept(view, rates, share, limits)
        inside = self._position.kept(view.at.joints, kept, partial(self._followed, view), view.ahead_s)
        if inside != kept:
            return Allowed(inside, f"{'limited by' if any(inside) else 'held:'} the range of a joint")
        if self._along == self._inward == 1.0:
            return Allowed(kept, text)
        return Allowed(kept, f"{'limited by' if any(kept) else 'held:'} the {WORDS[KINDS[self._kind]]}")

    def share(self, view: View | None) -> float:
        """Share of the speed limits that a command may use now; 0 means hold. After a STOP the robot has to stand
        first: the way out begins there, and what is lost of a margin while it brakes was never gained."""
        if view is None:
            return 0.0
        level = view.judgement.level
        if level == Level.STOP:
            if not self._stood and all(abs(rate) <= self._slow for rate in view.velocity):
                self._stood, self._best = True, NOTHING_GAINED
            return self._share if self._stood else 0.0
        self._stood = False
        return view.judgement.speed_scale if level < Level.STOP else 0.0

    def limits(self, view: View) -> Margins:
        """What the margins must keep along a motion from here: the gate's limits, or, on the way out, what was gained.

        To be asked for every motion, after the share: the best margins since a stop are remembered here.
        """
        stopped_by = view.judgement.causes if view.judgement.level == Level.STOP else 0
        if view.judgement.level == Level.STOP:
            floor = floor_of(self._mechanism.guarantee(view.at, self._error, self._slack_m))
        else:  # what it would keep if it stood here
            rest = excess(self._settings, 0.5 * view.expected_s)
            floor = self._predictor.predict(view.at, Speeds(rest, rest), view.ahead_s, self._keep)
        limits, best = [], []
        for kind, now, last, keep, stop in zip(KINDS, floor, self._best, self._keep, self._stop, strict=True):
            caused = bool(stopped_by & kind)
            if view.judgement.bypassed & kind:  # it may be lost: an operator has said so
                best.append(-inf)
                limits.append(-inf)
                continue
            gained = max(now, last) if caused or now < keep else -inf
            best.append(gained)
            limits.append(gained - DIP if caused else min(keep, max(gained - DIP, stop)) if gained > -inf else keep)
        self._best = (best[0], best[1], best[2], best[3])
        return limits[0], limits[1], limits[2], limits[3]

    def _excess(self, rates: Sequence[float]) -> float:
        """By how much the fastest joint exceeds its limit."""
        return max(abs(rate) / limit for rate, limit in zip(rates, self._speed, strict=True))

    def _beyond(self, view: View, rates: Floats, limits: Margins) -> int | None:
        """Which margin cannot be kept at these rates; None if all can."""
        if not any(rates):
            return None
        if view.judgement.level == Level.STOP:  # a way out begins where nothing can be stopped: the slow command counts
            floor = self._predictor.along(view.at, rates, view.ahead_s + self._lag_s, limits)
        else:
            speeds, moved = self._followed(view, rates)
            floor = self._predictor.predict(view.at, speeds, view.ahead_s, limits, moved)
        if all(have >= want for have, want in zip(floor, limits, strict=True)):
            return None
        now = margins_of(view.at)  # where nothing can be bounded, the nearest limit speaks
        lack = [(have - want, have_now - want) for have, have_now, want in zip(floor, now, limits, strict=True)]
        return lack.index(min(lack))

    def _followed(self, view: View, rates: Floats) -> tuple[Speeds, tuple[Floats, Floats]]:
        """How fast the supervisor will take the joints to be at most when they have followed a command for a heartbeat,
        and from where to where (rad or m) they can have got by then. They go on as they are for the latency; what is to
        be slower brakes then."""
        forward: list[float] = []
        backward: list[float] = []
        low: list[float] = []
        high: list[float] = []
        more, limits = excess(self._settings, 0.5 * view.expected_s), self._settings.deceleration_limit
        for now, rate, up, down, brake, e in zip(view.velocity, rates, *view.speeds, limits, more, strict=True):
            known = now == now
            for sign, most, speeds, ways in ((1.0, up, forward, high), (-1.0, down, backward, low)):
                begin = max(sign * now, 0.0) if known else most
                end = max(sign * rate, begin - brake * self._beat_s, 0.0)
                speeds.append(end + e)
                ways.append(sign * (begin * self._latency_s + max(0.5 * (begin + end), end) * self._beat_s))
        return Speeds(tuple(forward), tuple(backward)), (tuple(low), tuple(high))

    def _kept(self, view: View, rates: Floats, share: float, limits: Margins) -> Floats:
        """The part of the rates that keeps the limits. All of a new command is tried; else the search begins with what
        was allowed last: a little more, the same, less. So a command costs a few looks ahead, not a search."""
        if self._along == self._inward == 1.0 or rates != self._last:
            kind = self._beyond(view, rates, limits)
            self._last = rates
            if kind is None:
                self._along = self._inward = 1.0
                return rates
            self._kind = kind
        along, inward = self._split(view.at, rates, self._kind)
        if (faster := self._excess(along) / share) > 1.0:  # a part can have a component that the whole has not
            along, inward = tuple(r / faster for r in along), tuple(r / faster for r in inward)
        for shares in _fewer(self._along, self._inward):
            self._along, self._inward = shares
            kept = tuple(shares[0] * a + shares[1] * b for a, b in zip(along, inward, strict=True))
            kind = self._beyond(view, kept, limits)
            if kind is None:
                return kept
            self._kind = kind
        raise AssertionError("standing still is always allowed")

    def _split(self, at: Posture, rates: Floats, kind: int) -> tuple[Floats, Floats]:
        """Rates along the level lines of a margin, and the part that makes it shrink. In units of the speed limits."""
        speed = self._speed
        slope = [s * limit for s, limit in zip(slopes(self._mechanism, at, kind), speed, strict=True)]
        square = sum([s * s for s in slope])
        towards = sum([s * rate / limit for s, rate, limit in zip(slope, rates, speed, strict=True)])
        if not (square > 0.0 and towards < 0.0):
            return rates, (0.0,) * len(rates)
        inward = tuple(towards / square * s * limit for s, limit in zip(slope, speed, strict=True))
        return tuple(rate - part for rate, part in zip(rates, inward, strict=True)), inward


def _fewer(along: float, inward: float) -> Iterator[tuple[float, float]]:
    """Shares of the motion along a limit and towards it: from a little more than now down to none."""
    if along == 1.0:
        towards = inward
        yield 1.0, min(max(inward, LEAST) * STEP, 1.0)
        while towards >= LEAST:
            yield 1.0, towards
            towards /= STEP
    elif along >= LEAST:
        yield min(along * STEP, 1.0), 0.0
    else:
        along = LEAST * STEP
    while along >= LEAST:
        yield along, 0.0
        along /= STEP
    yield 0.0, 0.0
