"""Bounds of joint velocities from positions and stamps alone: a bounded-error (set-membership) observer.

Assumptions, per joint: it accelerates with at most a and its speed never exceeds V; it may slow down at any rate.
Positions are wrong by at most e, stamps by at most tau; then a position belongs to its stamp within e + tau V.

A joint that moves at v now moved at v - a s or more at a time s ago, while this is positive. If v > a D, it moved by at
least v D - a D^2/2 in the time D. So from two positions D apart, D > 0,

    v <= max((p_now - p_then + 2 (e + tau V))/D + a D/2,  a D),    v <= v_before + a D,    v <= V

The second value of the first bound covers a joint that moved backward and was stopped hard within D. The bounds are
smallest for times of about sqrt(4 (e + tau V)/a); a few positions up to that time are kept.
"""

from __future__ import annotations

from collections import deque
from math import remainder, sqrt
from typing import NamedTuple

from irsbot_kinematics.mechanism import Coordinate
from irsbot_msgs_py.records import Floats
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.core.estimation.estimate import Speeds
from irsbot_supervisor.core.settings import Settings


class ObserverMemory(NamedTuple):
    """What `Observer` remembers."""

    kept: tuple[tuple[int, Floats], ...]  # stamps, ns, and positions, rad or m; oldest first
    speeds: Speeds  # bounds at the newest


class Observer:
    """Keeps the positions of the last few milliseconds. Angles are compared modulo a turn."""

    def __init__(self, settings: Settings, joints: tuple[Coordinate, ...]) -> None:
        self._turns = tuple(joint.turn for joint in joints)
        self._kept: deque[tuple[int, Floats]] = deque()
        self.configure(settings)

    def configure(self, settings: Settings) -> None:
        """Take in new limits; the positions are kept."""
        self._fastest, self._gains = settings.velocity_limit, settings.acceleration_limit
        errors = stamped_errors(settings)
        self._errors = tuple([2.0 * error for error in errors])
        window_s = max(sqrt(4.0 * e / a) for e, a in zip(errors, self._gains, strict=True))
        self._window_ns = round(window_s * NS_PER_S)
        joints = zip(self._turns, self._errors, self._fastest, strict=True)
        self._told_s = min((0.5 * turn - error) / fastest for turn, error, fastest in joints)
        self._any = Speeds(self._fastest, self._fastest)
        self._speeds = self._any

    @property
    def memory(self) -> ObserverMemory:
        """All that is remembered, for `remember`."""
        return ObserverMemory(tuple(self._kept), self._speeds)

    def remember(self, memory: ObserverMemory) -> None:
        """Go on from a memory."""
        self._kept, self._speeds = deque(memory.kept), memory.speeds

    def without_last(self, speeds: Speeds) -> None:
        """Remove the last position, which was wrong. speeds: the bounds before it."""
        if len(self._kept) > 1:
            self._kept.pop()
            self._speeds = speeds

    def clock_set(self, step_ns: int) -> None:
        """Shift earlier stamps after the clock of the stamps was set."""
        self._kept = deque((stamp_ns + step_ns, position) for stamp_ns, position in self._kept)

    def restart(self, stamp_ns: int, position: Floats) -> Speeds:
        """Forget all earlier samples: every joint may move at its velocity limit."""
        self._kept.clear()
        self._kept.append((stamp_ns, position))
        self._speeds = self._any
        return self._any

    def update(self, stamp_ns: int, position: Floats) -> Speeds | None:
        """Bounds with one more position, stamped later than the last; None if a joint moved farther than its earlier
        speed and its acceleration limit allow."""
        kept, last = self._kept, self._speeds
        if not kept:
            return self.restart(stamp_ns, position)
        dt = (stamp_ns - kept[-1][0]) / NS_PER_S
        gains, fastest = self._gains, self._fastest
        forward = [min(v + gain * dt, most) for v, gain, most in zip(last.forward, gains, fastest, strict=True)]
        backward = [min(v + gain * dt, most) for v, gain, most in zip(last.backward, gains, fastest, strict=True)]
        back, count = 1, len(kept)
        while True:
            then_ns, then = kept[-back]
            span = (stamp_ns - then_ns) / NS_PER_S
            if span > self._told_s:  # a joint may have gone half a turn: which way round is not known
                break
            for j, (now, before, turn, error, gain) in enumerate(
                zip(position, then, self._turns, self._errors, gains, strict=True)
            ):
                mean, gained = remainder(now - before, turn) / span, gain * span
                rest = error / span + 0.5 * gained
                up, down = mean + rest, rest - mean
                # mean - error/span - a D/2 is the least speed with which the joint can have set out.
                if back == 1 and not (-down <= last.forward[j] and -up <= last.backward[j]):
                    return None
                up, down = (up if up > gained else gained), (down if down > gained else gained)
                if up < forward[j]:
                    forward[j] = up
                if down < backward[j]:
                    backward[j] = down
            if back == count or stamp_ns - then_ns >= self._window_ns:
                break
            back = min(2 * back, count)
        while count > 1 and stamp_ns - kept[1][0] >= self._window_ns:
            kept.popleft()
            count -= 1
        kept.append((stamp_ns, position))
        self._speeds = Speeds(tuple(forward), tuple(backward))
        return self._speeds


STAMP_NS = 1
"""ns: resolution of stamps."""


def stamped_errors(settings: Settings) -> Floats:
    """rad or m: error of the distance between measured positions at each end, at the times of the stamps."""
    stamp_s = settings.stamp_jitter_s + STAMP_NS / NS_PER_S
    return tuple([0.5 * settings.encoder_resolution + stamp_s * v for v in settings.velocity_limit])


def excess(settings: Settings, period_s: float) -> Floats:
    """rad/s or m/s by which the bounds exceed the true speeds at most, if samples come every `period_s` and the joints
    brake no harder than configured: 4 e/D + (a + max(a, d)) D/2 for the best of the multiples D = 1, 2, 4, ... of the
    period. The bound is never below a D, so brakes that are weaker than the drives are do not help."""
    found = []
    limits = zip(settings.velocity_limit, settings.acceleration_limit, settings.deceleration_limit, strict=True)
    for (fastest, gain, brake), error in zip(limits, stamped_errors(settings), strict=True):
        span, best, change = period_s, fastest, 0.5 * (gain + max(gain, brake))
        while 0.0 < change * span < best:
            best, span = min(best, 4.0 * error / span + change * span), 2.0 * span
        found.append(best)
    return tuple(found)
