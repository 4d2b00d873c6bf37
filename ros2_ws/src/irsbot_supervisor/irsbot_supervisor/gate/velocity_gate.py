"""The command gate for velocities: a commanded motion in, the allowed part of it out.

On approach a command is scaled so that the robot can be stopped before the gate's limits, whatever its drives do from
then on. These limits lie a little above the stop limits, so a robot commanded through the gate comes to rest before a
STOP. Motion tangential to a limit passes; the component towards it is removed. After a STOP the robot moves at recovery
speed. A margin that caused it and is below the end of its warning must not fall below the best value since; one that
is above that end stays above. Where a margin was lost although, as by brakes that give way, motion passes that raises
it. In doubt the answer is a hold.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from math import inf, isfinite
from typing import NamedTuple

from irsbot_kinematics import Mechanism, Posture, Status
from irsbot_msgs_py.gate_status import GateOutcome, GateReason
from irsbot_msgs_py.records import Cause, Floats, Level
from irsbot_supervisor.core.box_search import largest_margins, margins_of_bounds
from irsbot_supervisor.core.estimation.estimate import Speeds
from irsbot_supervisor.core.estimation.observer import excess
from irsbot_supervisor.core.margins import MARGIN_CAUSES, Margins, margins_of, slopes
from irsbot_supervisor.core.position_limits import PositionLimits
from irsbot_supervisor.core.reachable_box import position_error
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.stopping import StoppingPredictor, limits_of, raised, release_of
from irsbot_supervisor.core.view import View
from irsbot_supervisor.gate.answer import PASSED, Answer, held
from irsbot_supervisor.gate.shares import WHOLE, Shares

RESERVE = 0.02
"""1: share above the stop limits that a command keeps, so that the gate does not cause the stop that it should avoid:
the drives lag behind their commands, and the supervisor predicts from a later instant than the gate."""

DIP = 0.002
"""1: how far the bound of a way out may lie below the best margin since the stop. Bounds over boxes of joints are
slightly below the margins; in boxes around eighths of a slow path, by less than this."""

PREDICTIONS = 3
"""Largest number of shares of a command that are tried in one call: each may take as long as the worst sample."""

NOTHING_GAINED: Margins = (-inf, -inf, -inf, -inf)
"""Margins to keep on a way out that has not begun."""


class Allowed(NamedTuple):
    """Allowed motion of the joints. rates: rad/s or m/s."""

    rates: Floats
    answer: Answer


class Allowance(NamedTuple):
    """Speed and margins of a motion that begins now."""

    share: float
    """1: of the speed limits; 0 means hold."""
    limits: Margins
    """Margins that the motion must keep."""


class Limits(NamedTuple):
    """Margins that a motion must keep."""

    always: Margins
    """Every motion."""
    raising: Margins
    """A motion of the way out that raises the margin; not above `always`, and below it where a margin was lost."""


class Gate:
    """Passes the safe part of velocity commands of one robot, and computes the limits for trajectories."""

    def __init__(self, settings: Settings, mechanism: Mechanism) -> None:
        self._mechanism = mechanism
        self._best = NOTHING_GAINED  # since the robot stood after a stop, or since the gate's limit was crossed
        self._shares = WHOLE  # of the last command: allowed, or to be tried next
        self._kind = 0  # the margin that limited it
        self._stood = False  # since the stop that is in force
        self._last: Floats = ()  # the requested rates
        self.configure(settings)

    def configure(self, settings: Settings) -> None:
        """Take in new limits; the progress of a way out is kept."""
        self._settings = settings
        self._predictor = StoppingPredictor(settings, self._mechanism)
        self._speed = settings.velocity_limit
        self._share = settings.recovery_share
        self._beat_s, self._latency_s = settings.heartbeat_s, settings.latency_s
        self._lag_s = settings.heartbeat_s + settings.latency_s  # until the drives follow the next command
        self._stop = limits_of(settings, "stop")
        self._keep = raised(self._stop, RESERVE)
        self._inside = largest_margins(release_of(settings), self._keep)
        self._error = (position_error(settings),) * len(settings.velocity_limit)
        self._slack_m = settings.slack_m
        self._position = PositionLimits(settings, self._mechanism.joints)

    def velocity(self, wanted: Sequence[float], view: View | None) -> Allowed:
        """The part of commanded joint velocities (rad/s or m/s, robot order) that is allowed until the next call."""
        hold = (0.0,) * len(self._speed)
        if len(wanted) != len(hold) or not all(map(isfinite, wanted)):
            return Allowed(hold, held(GateReason.INVALID, f"{len(hold)} finite velocities are needed"))
        if view is None:
            return Allowed(hold, held(GateReason.UNKNOWN))
        stopped = view.judgement.level == Level.STOP
        share = self._allowed_share(view)
        if not share > 0.0:
            return Allowed(hold, held(GateReason.STOP if stopped else GateReason.UNKNOWN))
        limits = self._limits(view)
        excess = max(self._excess(wanted) / share, 1.0)
        rates = tuple(rate / excess for rate in wanted)
        kept = self._kept(view, rates, share, limits)
        inside = self._position.kept(view.at.joints, kept, partial(self._followed, view), view.prediction_delay_s)
        if inside != kept:
            kind = self._beyond(view, inside, limits) if stopped else None  # the path of a way out is another one now
            if kind is not None:
                return self._limited(hold, wanted, MARGIN_CAUSES[kind])
            return self._limited(inside, wanted, Cause.POSITION)
        if self._shares != WHOLE:
            return self._limited(kept, wanted, MARGIN_CAUSES[self._kind])
        if excess > 1.0:
            return Allowed(kept, Answer(GateOutcome.SLOWED, GateReason.SPEED, share=1.0 / excess))
        return Allowed(kept, PASSED)

    def _limited(self, rates: Floats, wanted: Sequence[float], cause: Cause) -> Allowed:
        """The allowed part of a command that leads beyond a limit."""
        if not any(rates):
            return Allowed(rates, held(GateReason.LIMIT, cause=int(cause)))
        share = self._excess(rates) / self._excess(wanted)
        return Allowed(rates, Answer(GateOutcome.LIMITED, GateReason.LIMIT, int(cause), share))

    def allowance(self, view: View) -> Allowance:
        """Speed share and margins of a trajectory that begins now. Every call counts: it remembers the best margins
        since a stop."""
        share = self._allowed_share(view)
        return Allowance(share, self._limits(view).always if share > 0.0 else self._keep)

    def _allowed_share(self, view: View) -> float:
        """Share of the speed limits that a command may use now; 0 means hold. After a STOP the robot has to stand
        first: the way out begins there, and the margin lost during braking was never gained."""
        level = view.judgement.level
        if level == Level.STOP:
            if not self._stood and view.standing:
                self._stood, self._best = True, NOTHING_GAINED
            return self._share if self._stood else 0.0
        self._stood = False
        return view.judgement.speed_scale if level < Level.STOP else 0.0

    def _limits(self, view: View) -> Limits:
        """Margins that a motion from here must keep: the gate's limits or, on the way out, the best margins since the
        stop as far as they are below the end of their warnings. The best margins stay what they were if they are lost:
        else every loss could be followed by another."""
        stopped_by = view.judgement.causes if view.judgement.level == Level.STOP else 0
        if view.judgement.level == Level.STOP:
            certified = margins_of_bounds(self._mechanism.certified_bounds(view.at, self._error, self._slack_m))
        else:  # the margins that it would keep at rest here
            rest = excess(self._settings, 0.5 * view.expected_s)
            certified = self._predictor.predict(view.at, Speeds(rest, rest), view.prediction_delay_s, self._keep)
        limits, raising, best = [], [], []
        for kind, now, last, keep, stop, inside in zip(
            MARGIN_CAUSES, certified, self._best, self._keep, self._stop, self._inside, strict=True
        ):
            caused = bool(stopped_by & kind)
            if view.judgement.bypassed & kind:  # it may be lost: an operator has said so
                best.append(-inf)
                limits.append(-inf)
                raising.append(-inf)
                continue
            gained = max(now, last) if caused or now < keep else -inf
            best.append(gained)
            least = gained - DIP
            limits.append(min(least, inside) if caused else min(keep, max(least, stop)) if gained > -inf else keep)
            raising.append(min(limits[-1], now - DIP if caused else max(now - DIP, stop)))
        self._best = (best[0], best[1], best[2], best[3])
        return Limits((limits[0], limits[1], limits[2], limits[3]), (raising[0], raising[1], raising[2], raising[3]))

    def _excess(self, rates: Sequence[float]) -> float:
        """Factor by which the fastest joint exceeds its limit."""
        return max(abs(rate) / limit for rate, limit in zip(rates, self._speed, strict=True))

    def _beyond(self, view: View, rates: Floats, limits: Limits) -> int | None:
        """The margin that cannot be kept at these rates; None if all can."""
        if not any(rates):
            return None
        if view.judgement.level == Level.STOP:  # a way out begins where nothing can be stopped: the slow command counts
            wanted = self._way_out(view, rates, limits)
            certified = self._predictor.along(view.at, rates, view.prediction_delay_s + self._lag_s, wanted)
        else:
            wanted, (speeds, moved) = limits.always, self._followed(view, rates)
            certified = self._predictor.predict(view.at, speeds, view.prediction_delay_s, wanted, moved)
        if all(have >= want for have, want in zip(certified, wanted, strict=True)):
            return None
        now = margins_of(view.at)  # where nothing can be bounded, the nearest limit speaks
        lack = [(have - want, have_now - want) for have, have_now, want in zip(certified, now, wanted, strict=True)]
        return lack.index(min(lack))

    def _way_out(self, view: View, rates: Floats, limits: Limits) -> Margins:
        """Margins that these rates must keep on the way out: a margin that was lost may be raised from where it is."""
        type1, type2, constraint, limb = (
            less if less < limit and self._raises(view, rates, kind) else limit
            for kind, (limit, less) in enumerate(zip(*limits, strict=True))
        )
        return type1, type2, constraint, limb

    def _raises(self, view: View, rates: Floats, kind: int) -> bool:
        """True if a margin is larger than here at the next heartbeat, and where joints at these rates brake at the
        latest. Its slopes do not show it: where two legs share the smallest margin they are means."""
        here = margins_of(view.at)[kind]
        for after_s in (self._beat_s, view.prediction_delay_s + self._lag_s):
            there = [q + rate * after_s for q, rate in zip(view.at.joints, rates, strict=True)]
            at = self._mechanism.track(tuple(there), view.at)
            if not (at.status == Status.SOLVED and margins_of(at)[kind] > here):
                return False
        return True

    def _followed(self, view: View, rates: Floats) -> tuple[Speeds, tuple[Floats, Floats]]:
        """Bounds of the joint speeds after the joints have followed a command for a heartbeat, and of the motion until
        then (rad or m). The joints keep their rates during the latency; joints that become slower brake then."""
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

    def _kept(self, view: View, rates: Floats, share: float, limits: Limits) -> Floats:
        """The part of the rates that keeps the limits. The whole of a new command is tried; else the last allowed share
        and a little more, or less. Samples wait meanwhile: what is not found with PREDICTIONS is sought further in the
        next call, and the robot is held until then."""
        left = PREDICTIONS
        if self._shares == WHOLE or rates != self._last:
            self._last, left = rates, left - 1
            if self._passes(view, rates, limits):
                self._shares = WHOLE
                return rates
        along, inward = self._split(view.at, rates, self._kind)
        if (faster := self._excess(along) / share) > 1.0:  # a part can have a component that the whole has not
            along, inward = tuple(r / faster for r in along), tuple(r / faster for r in inward)

        def part(shares: Shares) -> Floats:
            return tuple([shares.along * a + shares.inward * b for a, b in zip(along, inward, strict=True)])

        towards = any(inward)
        last = self._shares if towards or self._shares.along < 1.0 else WHOLE
        if left == PREDICTIONS or last != WHOLE or faster > 1.0:  # else it has been tried
            left -= 1
            if self._passes(view, part(last), limits):
                more = last.more
                self._shares = more if more != last and self._passes(view, part(more), limits) else last
                return part(self._shares)
        for shares in last.fewer(towards):
            self._shares, left = shares, left - 1
            if left < 0:
                break
            if self._passes(view, part(shares), limits):
                return part(shares)
        return (0.0,) * len(rates)

    def _passes(self, view: View, rates: Floats, limits: Limits) -> bool:
        """True if all margins can be kept at these rates."""
        kind = self._beyond(view, rates, limits)
        self._kind = self._kind if kind is None else kind
        return kind is None

    def _split(self, at: Posture, rates: Floats, kind: int) -> tuple[Floats, Floats]:
        """Rates along the level lines of a margin, and the part that decreases it. In units of the speed limits."""
        speed = self._speed
        slope = [s * limit for s, limit in zip(slopes(self._mechanism, at, kind), speed, strict=True)]
        square = sum([s * s for s in slope])
        towards = sum([s * rate / limit for s, rate, limit in zip(slope, rates, speed, strict=True)])
        if not (square > 0.0 and towards < 0.0):
            return rates, (0.0,) * len(rates)
        inward = tuple(towards / square * s * limit for s, limit in zip(slope, speed, strict=True))
        return tuple(rate - part for rate, part in zip(rates, inward, strict=True)), inward
