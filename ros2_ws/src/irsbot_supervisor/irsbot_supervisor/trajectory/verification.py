"""Certifies that a planned motion keeps its margins above the stop limits, also between its points.

The joints of a segment lie in a box; the mechanism bounds its margins over boxes. Long stretches are tried first and
cut where their bound does not suffice, in the order of time, so that the first violation is reported.

A supervisor stops a robot earlier: as soon as drives that do their worst could not be stopped in time. If the
prediction delay is given, the motion is certified for that too: the box of a part is extended by the motion that the
joints can make from it.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, inf, nan

import numpy as np

from irsbot_kinematics import Posture, Robot, Status
from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_msgs_py.records import Cause
from irsbot_supervisor.core.box_search import BoxBounds, margins_of_bounds
from irsbot_supervisor.core.estimation.estimate import Speeds
from irsbot_supervisor.core.estimation.observer import excess
from irsbot_supervisor.core.margins import MARGIN_CAUSES, MARGIN_TEXTS, Margins, margins_of
from irsbot_supervisor.core.position_limits import PositionLimits
from irsbot_supervisor.core.reachable_box import ReachableBox, position_error
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.stopping import cuts_of, limits_of
from irsbot_supervisor.trajectory.certificate import Certificate, Minima, Violation
from irsbot_supervisor.trajectory.joint_path import BadTrajectory
from irsbot_supervisor.trajectory.segments import JointSegments

STRETCH = 64
"""Number of segments that are first tried in one box."""

SMALL = 0.1
"""1: parts of a motion that are shorter than this share of the joints' reach from them are not cut further."""

CUTS = 24
"""Number of times a segment is halved at most: 2^-24 of it is far below the resolution of any controller."""

RANGE_CUTS = 10
"""Number of halvings of a segment to find where a joint leaves its range."""


ACROSS, WIDE = 16, 0.02
"""A segment with a violation is divided into at most so many parts, each as wide as this, rad or m."""


def certify(
    robot: Robot,
    settings: Settings,
    times_s: Sequence[float],
    positions: Sequence[Sequence[float]],
    velocities: Sequence[Sequence[float]] = (),
    assembly_mode: int = 0,
    limits: Margins | None = None,
    begin: Posture | None = None,
    prediction_delay_s: float | None = None,
) -> Certificate:
    """Certify a motion of the joints, also between its points.

    times_s: (N,) s, increasing. positions: (N, n) rad or m. velocities: (N, n) rad/s or m/s; empty: straight segments.
    assembly_mode: of the start; 0: that of the settings. limits: least values of the margins; left out: the stop
    limits. begin: a posture near the start on the branch of the motion, if it is known better than by a label.
    prediction_delay_s: time that the robot moves without supervision, at least two sample periods, if the motion has to
    pass a supervisor; left out: only the path itself is certified. Returns the smallest certified margins and the first
    violation, of a margin or of a joint range; speeds are not compared with velocity_limit. Raises BadTrajectory for
    malformed points, and for an assembly mode that the mechanism does not have.
    """
    motion = JointSegments(len(robot.mechanism.joints), times_s, positions, velocities)
    walk = Walk(robot, settings, motion, assembly_mode, limits, begin, prediction_delay_s)
    found = [one for one in (walk.start() or walk.onwards(0), walk.leaving()) if one is not None]
    return Certificate(min(found, key=lambda one: one.time_s, default=None), walk.minima)


class Walk:
    """Goes along a motion, stretch by stretch, and keeps the smallest certified margins."""

    def __init__(
        self,
        robot: Robot,
        settings: Settings,
        motion: JointSegments,
        assembly_mode: int,
        limits: Margins | None = None,
        begin: Posture | None = None,
        prediction_delay_s: float | None = None,
    ) -> None:
        self._mechanism = robot.mechanism
        self._bounds = BoxBounds(robot.mechanism, settings.slack_m)
        self._box, self._ahead_s, self._latency_s = ReachableBox(settings), prediction_delay_s, settings.latency_s
        self._excess = (
            np.array(excess(settings, 0.5 * prediction_delay_s)) if prediction_delay_s is not None else np.zeros(0)
        )
        self._assembly = assembly_mode or settings.assembly_mode
        if self._assembly not in self._mechanism.assembly_modes:
            raise BadTrajectory(f"assembly mode {assembly_mode} is not one of {self._mechanism.assembly_modes}")
        self._working = settings.working_mode
        self._position = PositionLimits(settings, robot.mechanism.joints)
        self._motion = motion
        self._stop = limits or limits_of(settings, "stop")
        self._error = position_error(settings)
        self._slack_m = settings.slack_m
        self._cuts = cuts_of(settings)  # as many as before a robot is stopped
        self._minima = [(inf, 0.0)] * len(MARGIN_CAUSES)
        self._here = begin  # at the end of the certified part

    @property
    def minima(self) -> Minima:
        """Minima of all certified parts, and of the segments that `across` passed."""
        return tuple(self._minima)

    def leaving(self) -> Violation | None:
        """The first point at which a joint leaves its range, or could not be stopped within it; a joint that begins
        outside may return."""
        if not self._position.given:
            return None
        for segment in range(len(self._motion.low)):
            if (found := self._leaves(segment, 0.0, 1.0, RANGE_CUTS)) is not None:
                return found
        return None

    def _leaves(self, segment: int, start: float, end: float, cuts: int) -> Violation | None:
        motion, position = self._motion, self._position
        begin, errors = motion.q[0], np.array(self._box.errors)
        lower, upper = np.minimum(position.lower, begin - errors), np.maximum(position.upper, begin + errors)
        low, high = motion.part(segment, start, end)
        down, up = self._until_rest(*motion.rates(segment, start, end))
        under, over = ~(low - down >= lower), ~(high + up <= upper)
        if not (under | over).any():
            return None
        if cuts:
            middle = 0.5 * (start + end)
            first = self._leaves(segment, start, middle, cuts - 1)
            return first or self._leaves(segment, middle, end, cuts - 1)
        joint = int(np.flatnonzero(under | over)[0])
        joints = tuple(motion.part(segment, start, start)[0].tolist())
        time_s = float((1.0 - start) * motion.times[segment] + start * motion.times[segment + 1])
        limit = (position.upper if over[joint] else position.lower)[joint]
        text = f"joint {joint + 1} at {joints[joint]:.4g} at {time_s:.4f} s leaves its range, limit {limit:.4g}"
        nowhere = (nan,) * len(self._mechanism.task)
        return Violation(time_s, int(Cause.POSITION), joints[joint], limit, joints, nowhere, text)

    def _until_rest(self, slow: Array, fast: Array) -> tuple[Array, Array]:
        """rad or m: displacement of the joints backward and forward until they stand, from rates between slow and fast;
        their errors alone if only the path itself is certified."""
        if self._ahead_s is None:
            error = np.full(len(slow), self._error)
            return error, error
        forward = tuple((np.maximum(fast, 0.0) + self._excess).tolist())
        backward = tuple((np.maximum(-slow, 0.0) + self._excess).tolist())
        ahead, back = self._box.until_rest(Speeds(forward, backward), self._ahead_s + self._latency_s)
        errors = np.array(self._box.errors)
        return np.array(back) + errors, np.array(ahead) + errors

    def onwards(self, segment: int) -> Violation | None:
        """The first violation from a segment on."""
        for first in range(segment, len(self._motion.low), STRETCH):
            violation = self._segments(first, min(first + STRETCH, len(self._motion.low)))
            if violation is not None:
                return violation
        return None

    def across(self, segment: int) -> tuple[Violation, float] | None:
        """Pass a segment with a violation: the point of the smallest margins, and the end of the violation; None if all
        limits are kept."""
        worst, until_s = None, nan
        begin = float(self._motion.times[segment])
        length = float(self._motion.times[segment + 1]) - begin
        width = float((self._motion.high[segment] - self._motion.low[segment]).max())
        parts = ceil(min(max(width / WIDE, 1.0), ACROSS))
        for number in range(parts):
            start, end = number / parts, (number + 1) / parts
            box, rates = self._motion.part(segment, start, end), self._motion.rates(segment, start, end)
            at, certified, _ = self._bound(*box, *rates, 0)
            time_s = begin + 0.5 * (start + end) * length
            if not self._settled(certified, time_s):
                self._lower(certified, time_s)
                found, until_s = self._violation(at, certified, time_s), begin + end * length
                worst = min(worst or found, found, key=lambda one: one.value - one.limit)
            self._advance(at, self._motion.part(segment, end, end)[0])
        return None if worst is None else (worst, until_s)

    def start(self) -> Violation | None:
        """Check that the motion begins in the configured branch; afterwards positive margins keep it there."""
        first = self._motion.q[0]
        at, certified, _ = self._bound(first, first, np.zeros_like(first), np.zeros_like(first), self._cuts)
        begin = float(self._motion.times[0])
        if at.status != Status.SOLVED or at.working_mode != self._working:
            what = "no pose belongs to the joints" if at.status != Status.SOLVED else f"working mode {at.working_mode}"
            text = f"the motion begins in another branch than configured: {what}"
            return Violation(begin, int(Cause.BRANCH), nan, nan, at.joints, at.pose, text)
        self._here = at
        return None if self._settled(certified, begin) else self._violation(at, certified, begin)

    def _segments(self, first: int, last: int) -> Violation | None:
        """The first violation in a row of segments."""
        motion = self._motion
        rates = [motion.rates(k, 0.0, 1.0) for k in range(first, last)] if self._ahead_s is not None else []
        slow = np.min([low for low, _ in rates], axis=0) if rates else np.zeros(motion.q.shape[1])
        fast = np.max([high for _, high in rates], axis=0) if rates else slow
        box = motion.low[first:last].min(axis=0), motion.high[first:last].max(axis=0)
        at, certified, _ = self._bound(*box, slow, fast, 0)
        if self._settled(certified, 0.5 * float(motion.times[first] + motion.times[last])):
            self._advance(at, motion.q[last])
            return None
        if last - first == 1:
            return self._parts(first, 0.0, 1.0, CUTS)
        middle = (first + last) // 2
        return self._segments(first, middle) or self._segments(middle, last)

    def _parts(self, segment: int, start: float, end: float, cuts: int) -> Violation | None:
        """The first violation in a part of a segment, given in shares of its time."""
        motion = self._motion
        begin, length = float(motion.times[segment]), float(motion.times[segment + 1] - motion.times[segment])
        box, rates = motion.part(segment, start, end), motion.rates(segment, start, end)
        at, certified, small = self._bound(*box, *rates, 0)
        middle = 0.5 * (start + end)
        if not self._settled(certified, begin + middle * length) and small:
            at, certified, _ = self._bound(*box, *rates, self._cuts)
        if self._settled(certified, begin + middle * length):
            self._advance(at, motion.part(segment, end, end)[0])
            return None
        if cuts == 0 or small:
            return self._violation(at, certified, begin + start * length)
        return self._parts(segment, start, middle, cuts - 1) or self._parts(segment, middle, end, cuts - 1)

    def _bound(self, low: Array, high: Array, slow: Array, fast: Array, cuts: int) -> tuple[Posture, Margins, bool]:
        """The posture in the middle of a box of joints, lower bounds of the margins over the box and the motion that
        the joints can make from it, and whether that motion is nearly all of the box. slow, fast: bounds of the joint
        velocities there."""
        middle, here = tuple((0.5 * (low + high)).tolist()), self._here
        if here is None:
            at = self._mechanism.posture(middle, self._assembly)
        else:
            at = self._mechanism.track(middle, here) if here.status == Status.SOLVED else here
        if at.status != Status.SOLVED:
            return at, (0.0, 0.0, 0.0, 0.0), False
        down, up = self._until_rest(slow, fast)
        if self._ahead_s is None:
            return at, self._bounds.around(at, tuple((0.5 * (high - low) + self._error).tolist())), False
        small = bool((high - low <= SMALL * (down + up)).all())
        box = tuple((low - down).tolist()), tuple((high + up).tolist())
        return at, self._bounds.least(at, *box, self._stop, cuts), small

    def _advance(self, at: Posture, joints: Array) -> None:
        """Follow the branch inside a box with the middle `at`, if labels are not invariant."""
        if not self._mechanism.label_is_invariant:
            self._here = self._mechanism.track(tuple(joints.tolist()), at)

    def _settled(self, certified: Margins, time_s: float) -> bool:
        """True if the bounds suffice; then they count for the minima."""
        if not all(value >= limit for value, limit in zip(certified, self._stop, strict=True)):
            return False
        self._lower(certified, time_s)
        return True

    def _lower(self, certified: Margins, time_s: float) -> None:
        for kind, value in enumerate(certified):
            if value < self._minima[kind][0]:
                self._minima[kind] = value, time_s

    def _violation(self, at: Posture, certified: Margins, time_s: float) -> Violation:
        now, sure = certified, certified
        if at.status == Status.SOLVED:  # margins of this posture are known even if the box around it is not certified
            errors = [self._error] * len(at.joints)
            now, sure = margins_of(at), margins_of_bounds(self._mechanism.certified_bounds(at, errors, self._slack_m))
        lack = [value - limit for value, limit in zip(certified, self._stop, strict=True)]
        kind = lack.index(min(lack))
        limit = self._stop[kind]
        why = ""
        if now[kind] >= limit and self._ahead_s is not None and sure[kind] >= limit:
            why = f", may fall to {certified[kind]:.4f} before the robot can be stopped"
        elif now[kind] >= limit:
            why = f", {now[kind] - sure[kind]:.2g} less with errors of encoders and geometry"
            if sure[kind] - certified[kind] > now[kind] - sure[kind]:  # the shortest part of the motion is too long
                why = ", cannot be bounded until the next moment"
        text = f"{MARGIN_TEXTS[MARGIN_CAUSES[kind]]} {now[kind]:.4f} at {time_s:.4f} s{why}, limit {limit:.4f}"
        return Violation(time_s, int(MARGIN_CAUSES[kind]), now[kind], limit, at.joints, at.pose, text)
