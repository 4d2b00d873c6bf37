"""The simulated drives: they follow a motion within their limits, and brake on an order or without any order.

Braking is as the supervisor assumes: after the latency every joint slows down on its own with its constant deceleration
until it stands. Then the joints hold. When they are released, they return to the point where they left their motion and
continue, never faster than allowed.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from math import copysign, inf

from irsbot_kinematics.mechanism import Floats
from irsbot_supervisor.sim.trajectory import joint_move, stand
from irsbot_supervisor.trajectory.joint_path import (
    BadTrajectory,
    JointLimits,
    JointPath,
    JointPoint,
    Motion,
    path_through,
)

HALVINGS = 8
"""Number of times a change of pace is halved to keep accelerations within limits, before it is given up for one
step."""

ROOM = 1.0 + 1e-9
"""1: share by which a commanded rate at its limit may exceed it by rounding."""

PACE_SHARE = 0.99
"""1: share of the acceleration limits up to which the pace may change. The two ends of a step are checked; between them
the acceleration may be slightly higher, by far less than the remaining share."""


class Drives:
    """The joints of one robot. `step` moves them; `now` is their position."""

    def __init__(self, motion: Motion, limits: JointLimits, latency_s: float = 0.0) -> None:
        """motion: begins at rest. latency_s: from an order to its effect."""
        self.limits = limits
        rest = (0.0,) * len(limits.velocity)
        self.now = JointPoint(motion.at(0.0).position, rest, rest)
        self._gentle = tuple(PACE_SHARE * limit for limit in limits.acceleration)
        self._latency_s = latency_s
        self._motion, self._motion_s = motion, 0.0
        self._pace = 0.0  # seconds of motion per second, 0..1
        self._astray = False  # not where the motion was left
        self._detour: JointPath | None = None  # back to where the motion was left
        self._detour_s = 0.0
        self._next: JointPath | None = None  # a new motion that begins at standstill
        self._jog: tuple[Floats, float] | None = None  # commanded rates, and until when
        self._time_s = 0.0
        self._ordered = self._allowed = 0.0
        self._orders: deque[tuple[float, float]] = deque()  # (when it takes effect, allowed), the oldest first

    @property
    def stands(self) -> bool:
        """True if no joint moves."""
        return not any(self.now.velocity)

    def step(self, seconds: float, allowed: float) -> JointPoint:
        """Advance by a period. allowed: share of full speed, 0..1; the joints brake unless it is above 0."""
        end = self._time_s + seconds
        order = min(allowed, 1.0) if allowed > 0.0 else 0.0
        if order != self._ordered:
            self._ordered = order
            self._orders.append((self._time_s + self._latency_s, order))
        while self._orders and self._orders[0][0] < end:
            due, order = self._orders.popleft()
            self._move(due - self._time_s)
            self._time_s, self._allowed = max(due, self._time_s), order
        self._move(end - self._time_s)
        self._time_s = end
        return self.now

    def follow(self, times: Sequence[float], positions: Sequence[Floats], velocities: Sequence[Floats]) -> None:
        """Leave the present motion for commanded points: without a stop if the limits allow it, else from standstill.

        times: s from now, increasing. velocities: may be empty; then derived from the positions. Without points the
        joints stop and stay. Raises BadTrajectory for points that are not a motion of these joints.
        """
        self._jog = None
        if not times:
            self._next = stand(self._halt())
            return
        way = path_through(times, positions, velocities, len(self.now.position))
        later = [i for i, time in enumerate(times) if time > 0.0]
        joined = JointPath(
            (0.0, *[times[i] for i in later]),
            (self.now.position, *[way.positions[i] for i in later]),
            (self.now.velocity, *[way.velocities[i] for i in later]),
        )
        obeying = self.stands or (self._allowed > 0.0 and not self._astray)
        if later and obeying and joined.excess(self.limits) <= 1.0:
            self._motion, self._motion_s, self._detour, self._next = joined, 0.0, None, None
            self._pace, self._astray = 0.0 if self.stands else 1.0, False
        else:
            self._next = way.stretched(max(way.excess(self.limits), 1.0))

    def jog(self, rates: Floats, seconds: float) -> None:
        """Leave the present motion and move at these rates until `seconds` have passed without another command; then
        stop and stay. The limits apply to the change of rates. Raises BadTrajectory."""
        limits = self.limits.velocity
        if len(rates) != len(limits) or not all(abs(v) <= ROOM * most for v, most in zip(rates, limits, strict=True)):
            raise BadTrajectory(f"rates must be {len(limits)} numbers within {limits}, got {rates}")
        self._jog = rates, self._time_s + seconds
        self._next = None

    def _halt(self) -> Floats:
        """Positions at which the joints stand if they brake now."""
        q, v, limits = self.now.position, self.now.velocity, self.limits.deceleration
        return tuple([q + 0.5 * v * abs(v) / limit for q, v, limit in zip(q, v, limits, strict=True)])

    def _move(self, seconds: float) -> None:
        if not seconds > 0.0:
            return
        if self._jog is not None:
            self._move_by_jog(seconds, *self._jog)
            return
        if self._next is not None and self.stands:
            self._motion, self._motion_s, self._next = self._next, 0.0, None
            self._astray = True
        if self._allowed > 0.0 and self._next is None and (self.stands or not self._astray):
            self._travel(seconds)
        else:
            self._brake(seconds)

    def _brake(self, seconds: float) -> None:
        """Each joint alone, exactly: v t - a t^2/2 until it stands."""
        self._pace = 0.0
        self._astray = self._astray or not self.stands
        position, velocity, acceleration = [], [], []
        for q, v, limit in zip(self.now.position, self.now.velocity, self.limits.deceleration, strict=True):
            brake = copysign(limit, v)
            t = abs(v) / limit
            moving = t > seconds
            t = min(t, seconds)
            position.append(q + t * (v - 0.5 * brake * t))
            velocity.append(v - brake * t if moving else 0.0)
            acceleration.append(-brake if moving else 0.0)
        self.now = JointPoint(tuple(position), tuple(velocity), tuple(acceleration))

    def _move_by_jog(self, seconds: float, rates: Floats, until_s: float) -> None:
        """Move each joint towards its commanded rate, with constant acceleration."""
        if not (self._allowed > 0.0 and self._time_s < until_s):
            self._jog, self._next = None, stand(self._halt())  # a command does not outlive a stop
            self._brake(seconds)
            return
        position, velocity, acceleration = [], [], []
        limits = zip(self.now.position, self.now.velocity, rates, self.limits.acceleration, strict=True)
        for q, v, rate, limit in limits:
            change = rate - v
            t = min(abs(change) / limit, seconds)
            a = copysign(limit, change) if change else 0.0
            reached = v + a * t
            position.append(q + t * (v + 0.5 * a * t) + reached * (seconds - t))
            velocity.append(reached)
            acceleration.append(a if t == seconds else 0.0)
        self.now = JointPoint(tuple(position), tuple(velocity), tuple(acceleration))

    def _travel(self, seconds: float) -> None:
        """Advance along the motion, or along the way back to it."""
        if self._astray:
            self._detour = joint_move(self.now.position, self._motion.at(self._motion_s).position, self.limits)
            self._detour_s, self._astray = 0.0, False
        if self._detour is not None:
            self._detour_s = self._follow(self._detour, self._detour_s, seconds)
            if self._detour_s >= self._detour.duration_s:
                self._detour, self._pace = None, 0.0
        else:
            self._motion_s = self._follow(self._motion, self._motion_s, seconds)

    def _follow(self, motion: Motion, clock_s: float, seconds: float) -> float:
        """Move the joints along a motion whose time runs at `pace`; returns the new time of the motion."""
        if self._pace == self._allowed == 1.0:
            self.now = motion.at(clock_s + seconds)
            return clock_s + seconds
        change = 0.0
        if self._pace != self._allowed:
            begin = motion.at(clock_s)
            if any(begin.velocity):
                change = self._change_of_pace(begin, seconds)
            else:
                self._pace = self._allowed
        for attempt in range(HALVINGS + 1):
            pace = self._pace + change
            ahead = clock_s + 0.5 * (self._pace + pace) * seconds
            at = motion.at(ahead)
            velocity = tuple([pace * v for v in at.velocity])
            square, slope = pace * pace, change / seconds
            acceleration = tuple([square * a + slope * v for a, v in zip(at.acceleration, at.velocity, strict=True)])
            if change == 0.0 or _within(acceleration, self._gentle):
                break
            change = 0.5 * change if attempt < HALVINGS - 1 else 0.0
        self._pace = pace
        self.now = JointPoint(at.position, velocity, acceleration)
        return ahead

    def _change_of_pace(self, at: JointPoint, seconds: float) -> float:
        """Change the pace towards the allowed pace r, as far as |r^2 q'' + r' q'| stays within every joint's limit."""
        low, high = -inf, inf
        square = self._pace * self._pace
        for v, a, limit in zip(at.velocity, at.acceleration, self._gentle, strict=True):
            if v != 0.0:
                bounds = ((-limit - square * a) / v, (limit - square * a) / v)
                low, high = max(low, min(bounds)), min(high, max(bounds))
        wanted = (self._allowed - self._pace) / seconds
        return max(min(wanted, max(high, 0.0)), min(low, 0.0)) * seconds


def _within(values: Floats, limits: Floats) -> bool:
    return all(-limit <= value <= limit for value, limit in zip(values, limits, strict=True))
