"""The command gate for trajectories: a commanded trajectory in, the allowed motion out.

The motion is certified between its points too. It is slowed down until the robot can be stopped before the gate's
limits from every moment of it, whatever its drives do. If that fails even at low speed, the motion ends at rest, on its
path, at the last point from which the robot can be stopped.

A moving robot goes on from its present velocity, however slow the motion is: the controller joins the first point by a
cubic. So a slower motion has another first part, which is certified as it is driven, within the limits of the joints.
"""

from __future__ import annotations

from dataclasses import replace
from math import isfinite
from typing import NamedTuple

from irsbot_kinematics import Posture, Robot
from irsbot_msgs_py.gate_status import GateOutcome, GateReason
from irsbot_msgs_py.records import Floats
from irsbot_supervisor.core.margins import Margins
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.gate.answer import PASSED, Answer, held
from irsbot_supervisor.trajectory.certificate import Certificate
from irsbot_supervisor.trajectory.joint_path import (
    BadTrajectory,
    Command,
    JointLimits,
    JointPath,
    joint_limits_of,
    path_through,
)
from irsbot_supervisor.trajectory.verification import certify

PACES = (1.0, 0.8, 0.63, 0.5, 0.4, 0.32, 0.25, 0.2, 0.16, 0.125, 0.1)
"""Shares of the commanded speed that are tried."""

SEARCHES = 8
"""Bisections for the end of a shortened motion: to 1/256 of the path."""

ROOM = 0.01
"""1: distance to its limits that the end of a shortened way out of a stop keeps."""

REST_POINTS = 12
"""Points of the cubics that bring a shortened motion to rest."""

ROUNDING = 1e-6
"""1: share by which a path that was made to fit the limits of the joints may exceed them."""


class Situation(NamedTuple):
    """Start of a motion, and the margins that it must keep."""

    at: Posture  # on the branch that is followed
    velocity: Floats  # rad/s or m/s
    share: float  # of the speed limits; 0 while a stop does not allow motion yet
    limits: Margins
    prediction_delay_s: (
        float | None
    )  # s of motion without supervision; None on the way out of a stop, where only the path counts


class GatedMotion(NamedTuple):
    """An allowed motion; None: hold."""

    path: JointPath | None
    answer: Answer


class MotionGate:
    """Passes trajectories of one robot."""

    def __init__(self, settings: Settings, robot: Robot) -> None:
        self._settings, self._robot = settings, robot

    def motion(self, command: Command, situation: Situation) -> GatedMotion:
        """The allowed part of a commanded motion. Never raises for values."""
        if not command.times:
            return GatedMotion(None, held(GateReason.NONE))
        if not situation.share > 0.0:
            return GatedMotion(None, held(GateReason.STOP))
        try:
            path, slower = self._joined(command, situation)
            return GatedMotion(None, held(GateReason.JOINING)) if path is None else self._safe(path, slower, situation)
        except BadTrajectory as error:
            return GatedMotion(None, held(GateReason.INVALID, str(error)))

    def _joined(self, command: Command, situation: Situation) -> tuple[JointPath | None, float]:
        """Motion from the present position of the robot along the commanded points, within the limits of the joints,
        and the factor by which it is slower than commanded; None if a moving robot cannot join the points. Raises
        BadTrajectory."""
        at, velocity, share = situation.at, situation.velocity, situation.share
        position = at.joints
        way = path_through(command.times, command.positions, command.velocities, len(position))
        later = [i for i, time in enumerate(command.times) if time > 0.0]
        if not later:
            raise BadTrajectory("its only point is at time 0, and no motion is so fast: state time_from_start")
        path = JointPath(
            (0.0, *[command.times[i] for i in later]),
            (position, *[way.positions[i] for i in later]),
            (velocity, *[way.velocities[i] for i in later]),
        )
        excess = path.excess(self._joint_limits(share))
        if excess <= 1.0:
            return path, 1.0
        if self._moves(situation):
            return None, excess
        return path.stretched(excess), excess

    def _joint_limits(self, share: float) -> JointLimits:
        """Limits of the joints at a share of their speed limits."""
        limits = joint_limits_of(self._settings)
        return replace(limits, velocity=tuple([share * limit for limit in limits.velocity]))

    def _moves(self, situation: Situation) -> bool:
        """True if a joint is faster than standstill."""
        return any(abs(rate) > self._settings.standstill_speed for rate in situation.velocity)

    def _driven(self, path: JointPath, pace: float, situation: Situation) -> JointPath | None:
        """A path at a share of its speed, as the joints drive it; None if a moving robot cannot join it."""
        slower = path.stretched(1.0 / pace)
        if not self._moves(situation):
            return slower
        driven = JointPath(slower.times, slower.positions, (path.velocities[0], *slower.velocities[1:]))
        return driven if driven.excess(self._joint_limits(situation.share)) <= 1.0 + ROUNDING else None

    def _safe(self, path: JointPath, slower: float, situation: Situation) -> GatedMotion:
        """slower: factor by which the path is already slower than commanded."""
        if (found := self._fastest(path, situation)) is not None:
            gated, pace = found
            if pace == slower == 1.0:
                return GatedMotion(gated, PASSED)
            reason = GateReason.STOPPING if pace < 1.0 else GateReason.SPEED
            return GatedMotion(gated, Answer(GateOutcome.SLOWED, reason, share=pace / slower))
        last = self._last_pace(situation)
        violation = self._certified(path.stretched(1.0 / last), situation).violation
        if violation is not None:
            shortened = self._shortened(path, violation.time_s * last, situation)
            if shortened is None:
                return GatedMotion(None, held(GateReason.LIMIT, violation.text, violation.cause))
            if (found := self._fastest(shortened, situation)) is not None:
                gated, pace = found
                limit = GateReason.LIMIT, violation.cause, pace / slower, violation.text
                return GatedMotion(gated, Answer(GateOutcome.SHORTENED, *limit))
        return GatedMotion(None, held(GateReason.STOPPING, "the robot could not be stopped on this way however slow"))

    def _fastest(self, path: JointPath, situation: Situation) -> tuple[JointPath, float] | None:
        """The path as it is driven at the largest share of its speed at which it is safe, and that share; None if there
        is none."""
        if not self._moves(situation) and not self._certified(path.stretched(1.0 / PACES[-1]), situation).safe:
            return None  # where it leads is not safe, however slow
        for pace in PACES:
            gated = self._driven(path, pace, situation)
            if gated is not None and self._certified(gated, situation).safe:
                return gated, pace
        return None

    def _last_pace(self, situation: Situation) -> float:
        """Share of its speed at which a path is ended early: the smallest, but a moving robot drives the path itself
        at its full speed only."""
        return 1.0 if self._moves(situation) else PACES[-1]

    def _certified(self, path: JointPath, situation: Situation) -> Certificate:
        """Certified margins along a path, also for drives that do their worst from any point of it."""
        return certify(
            self._robot,
            self._settings,
            path.times,
            path.positions,
            path.velocities,
            limits=situation.limits,
            begin=situation.at,
            prediction_delay_s=situation.prediction_delay_s,
        )

    def _shortened(self, path: JointPath, violation_s: float, situation: Situation) -> JointPath | None:
        """The longest part of a path, brought to rest, that keeps the limits; None if there is none."""
        low, high, best, last = 0.0, violation_s, None, self._last_pace(situation)
        if situation.prediction_delay_s is None:
            type1, type2, constraint, limb = (limit + ROOM for limit in situation.limits)
            situation = situation._replace(limits=(type1, type2, constraint, limb))
        for _ in range(SEARCHES):
            end_s = 0.5 * (low + high)
            rest = self._at_rest(path, end_s)
            if rest is not None and self._certified(rest.stretched(1.0 / last), situation).safe:
                low, best = end_s, rest
            else:
                high = end_s
        return best

    def _at_rest(self, path: JointPath, end_s: float) -> JointPath | None:
        """The path until `end_s`, with a pace that falls evenly to 0; None if the joints cannot brake like that."""
        limits = joint_limits_of(self._settings)
        braking_s = 2.0 * max(peak / brake for peak, brake in zip(path.peaks[0], limits.acceleration, strict=True))
        braking_s = min(braking_s, 2.0 * end_s)
        if not (braking_s > 0.0 and isfinite(braking_s)):
            return None
        begin_s = end_s - 0.5 * braking_s
        kept = [i for i, time in enumerate(path.times) if time < begin_s]
        times = [path.times[i] for i in kept]
        positions = [path.positions[i] for i in kept]
        velocities = [path.velocities[i] for i in kept]
        for point in range(0 if begin_s > 0.0 or not kept else 1, REST_POINTS + 1):
            share = point / REST_POINTS
            at = path.at(begin_s + braking_s * share * (1.0 - 0.5 * share))
            times.append(begin_s + braking_s * share)
            positions.append(at.position)
            velocities.append(tuple([(1.0 - share) * rate for rate in at.velocity]))
        rest = JointPath(tuple(times), tuple(positions), tuple(velocities))
        return rest if rest.excess(limits) <= 1.0 + ROUNDING else None
