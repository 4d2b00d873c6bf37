"""Longer motions through the command gate: a commanded trajectory in, the motion that is allowed out.

The motion is certified between its points too. It is slowed down until from every moment of it the robot could be
stopped before the gate's limits, whatever its drives do; where that cannot be had even slowly, the motion is followed
to the last place from which it can, and ends there at rest, on the way that was commanded.
"""

from __future__ import annotations

from math import isfinite
from typing import NamedTuple

from irsbot_kinematics import Posture, Robot
from irsbot_msgs_py.records import Floats
from irsbot_supervisor.core.assess import Margins
from irsbot_supervisor.core.certify import Certificate, certify
from irsbot_supervisor.core.motion import BadTrajectory, Command, JointLimits, JointPath, path_through
from irsbot_supervisor.core.settings import Settings

PACES = (1.0, 0.8, 0.63, 0.5, 0.4, 0.32, 0.25, 0.2, 0.16, 0.125, 0.1)
"""Shares of the commanded speed that are tried."""

SEARCHES = 8
"""How finely the end of a shortened motion is found: to 1/256 of the way."""

ROOM = 0.01
"""1: what the end of a shortened way out of a stop keeps above its limits."""

REST_POINTS = 12
"""Points of the cubics that bring a shortened motion to rest."""

ROUNDING = 1e-6
"""1: share by which limits of the joints may be exceeded in a path that was made to fit them."""


class Situation(NamedTuple):
    """Where a motion begins, and what it must keep."""

    at: Posture  # on the branch that is followed
    velocity: Floats  # rad/s or m/s
    share: float  # of the speed limits; 0 means hold
    limits: Margins
    ahead_s: float | None  # for how long it goes on unseen; None on the way out of a stop, where only the way counts


class GatedMotion(NamedTuple):
    """A motion that is allowed; None: hold. text: empty if all that was wanted, else what was taken away."""

    path: JointPath | None
    text: str


class MotionGate:
    """Passes trajectories of one robot."""

    def __init__(self, settings: Settings, robot: Robot) -> None:
        self._settings, self._robot = settings, robot

    def motion(self, command: Command, situation: Situation) -> GatedMotion:
        """The allowed part of a commanded motion. Never raises for values."""
        if not command.times:
            return GatedMotion(None, "")
        if not situation.share > 0.0:
            return GatedMotion(None, "held: the state of the robot does not allow motion")
        try:
            path = self._joined(command, situation)
            return self._safe(path, situation)
        except BadTrajectory as error:
            return GatedMotion(None, f"held: {error}")

    def _joined(self, command: Command, situation: Situation) -> JointPath:
        """From where the robot is along the commanded points, within what the joints can do."""
        at, velocity, share = situation.at, situation.velocity, situation.share
        position = at.joints
        way = path_through(command.times, command.positions, command.velocities, len(position))
        later = [i for i, time in enumerate(command.times) if time > 0.0]
        path = JointPath(
            (0.0, *[command.times[i] for i in later]),
            (position, *[way.positions[i] for i in later]),
            (velocity, *[way.velocities[i] for i in later]),
        )
        brakes = self._settings.deceleration_limit
        speed = tuple(share * limit for limit in self._settings.velocity_limit)
        excess = path.excess(JointLimits(speed, brakes, brakes)) if later else 0.0
        if excess <= 1.0:
            return path
        if any(abs(rate) > self._settings.standstill_speed for rate in velocity):
            raise BadTrajectory("what is commanded cannot be joined from the present speed within the joints' limits")
        return path.stretched(excess)

    def _safe(self, path: JointPath, situation: Situation) -> GatedMotion:
        slowest = path.stretched(1.0 / PACES[-1])
        found, text = self._certified(slowest, situation), ""
        if found.violation is not None:
            shortened = self._shortened(path, found.violation.time_s * PACES[-1], situation)
            if shortened is None:
                return GatedMotion(None, f"held: {found.violation.text}")
            path, text = shortened, f"ends early: {found.violation.text}"
        for pace in PACES:
            slower = path.stretched(1.0 / pace)
            if self._certified(slower, situation).safe:
                reasons = [text, f"slowed down to {pace:.3g}" if pace < 1.0 else ""]
                return GatedMotion(slower, "; ".join(reason for reason in reasons if reason))
        return GatedMotion(None, "held: the robot could not be stopped on this way even if it were slow")

    def _certified(self, path: JointPath, situation: Situation) -> Certificate:
        """What the robot keeps along a path, and if its drives do their worst from anywhere on it."""
        return certify(
            self._robot,
            self._settings,
            path.times,
            path.positions,
            path.velocities,
            limits=situation.limits,
            begin=situation.at,
            ahead_s=situation.ahead_s,
        )

    def _shortened(self, path: JointPath, violation_s: float, situation: Situation) -> JointPath | None:
        """The longest part of a path, brought to rest, that keeps the limits; None if there is none."""
        low, high, best = 0.0, violation_s, None
        if situation.ahead_s is None:
            type1, type2, constraint, limb = (limit + ROOM for limit in situation.limits)
            situation = situation._replace(limits=(type1, type2, constraint, limb))
        for _ in range(SEARCHES):
            end_s = 0.5 * (low + high)
            rest = self._at_rest(path, end_s)
            if rest is not None and self._certified(rest.stretched(1.0 / PACES[-1]), situation).safe:
                low, best = end_s, rest
            else:
                high = end_s
        return best

    def _at_rest(self, path: JointPath, end_s: float) -> JointPath | None:
        """The path until `end_s`, its pace falling evenly to 0 before; None if the joints cannot brake like that."""
        brakes = self._settings.deceleration_limit
        limits = JointLimits(self._settings.velocity_limit, brakes, brakes)
        braking_s = 2.0 * max(peak / brake for peak, brake in zip(path.peaks[0], brakes, strict=True))
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
