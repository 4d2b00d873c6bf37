"""Detects frozen encoders: a position that stands still while the message reports motion.

Only the message shows this: its velocities have another source than its positions, or a filter that continues. A filter
lags behind a stop, so the velocities reported after a stop are allowed for.
"""

from __future__ import annotations

from math import inf, isfinite, remainder
from typing import NamedTuple

from irsbot_kinematics.mechanism import Coordinate
from irsbot_msgs_py.records import Floats
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.core.settings import OVERSPEED, Settings
from irsbot_supervisor.core.validation import Accepted

FROZEN_S = 0.02
"""s: a position that stands still this long while the message reports motion is frozen. Filtered velocities lag by
less: the motion that they report after a stop is less than the path of a joint at full braking in this time."""

RESTED_S = 1.0
"""s: after this time of reported rest, an encoder that was frozen and still stands may be sound (a stop that was faster
than the filter of the velocities) or not. An operator has to look."""


class Still(NamedTuple):
    """A joint whose position stands while the message reports motion."""

    where: float  # rad or m
    since_ns: int  # since when it stands; of a frozen one since when the message reports rest
    way: float  # rad or m: motion that the message has reported in this time; infinite once it is frozen


class Suspicion(NamedTuple):
    """Doubts about the positions of a sample."""

    fault: str = ""  # why they are no knowledge
    branch_lost: str = ""  # why nobody knows the branch any more
    speeds: Floats = ()  # rad/s or m/s as reported of joints that may be frozen, 0 of the others; empty for none


NO_DOUBT = Suspicion()


class Frozen:
    """Examines one sample after the other."""

    def __init__(self, settings: Settings, joints: tuple[Coordinate, ...]) -> None:
        self._turns = tuple(joint.turn for joint in joints)
        self.still: dict[int, Still] = {}  # by number of the joint
        self.configure(settings)

    def configure(self, settings: Settings) -> None:
        """Take in new limits; positions that stand still are remembered."""
        self._names = settings.joint_names
        self._slow, self._step = settings.standstill_speed, 2.0 * settings.encoder_resolution
        self._fastest = tuple(OVERSPEED * speed for speed in settings.velocity_limit)
        self._most = tuple([0.5 * d * FROZEN_S * FROZEN_S + self._step for d in settings.deceleration_limit])
        self._stale_ns = round(settings.stale_s * NS_PER_S)

    def restart(self) -> None:
        """Forget all earlier samples."""
        self.still = {}

    def look(self, sample: Accepted, moved: Floats, dt: float) -> Suspicion:
        """Doubts about a sample whose positions changed by `moved` (rad or m) in `dt` s since the last one."""
        stated = sample.velocity
        if not stated or (not self.still and all(abs(step) > self._step for step in moved)):
            return NO_DOUBT
        lost, fault, speeds = "", "", [0.0] * len(moved)
        for k, (step, rate, fastest) in enumerate(zip(moved, stated, self._fastest, strict=True)):
            now, still = sample.position[k], self.still.pop(k, None)
            before = still or Still(now - step, sample.seen_ns, 0.0)
            if (
                abs(remainder(now - before.where, self._turns[k])) > self._step
            ):  # more than a flickering digit: it moves
                continue
            moves = isfinite(rate) and self._slow < abs(rate) <= fastest
            if before.way == inf:
                since_ns = sample.seen_ns if moves else before.since_ns
                if sample.seen_ns - since_ns > RESTED_S * NS_PER_S:
                    lost = f"joint '{self._names[k]}' may have moved while its position was frozen"
                    continue
                self.still[k] = before._replace(since_ns=since_ns)
                fault = fault or self._frozen(k)
                continue
            way, most = before.way, self._most[k]
            if abs(way) <= most:
                way = way + rate * dt if moves and rate * way >= 0.0 else 0.0
            if way == 0.0:
                continue
            self.still[k] = before._replace(way=way)
            speeds[k] = rate if moves else 0.0
            still_ns = sample.seen_ns - before.since_ns
            long_way = abs(way) > most and still_ns > FROZEN_S * NS_PER_S
            if long_way or (abs(way) > 2.0 * self._step and moves and still_ns > self._stale_ns):
                self.still[k] = Still(before.where, sample.seen_ns, inf)
                fault = fault or self._frozen(k)
        return Suspicion(fault, lost, tuple(speeds) if any(speeds) else ())

    def _frozen(self, k: int) -> str:
        return f"the position of joint '{self._names[k]}' is frozen while the message reports motion"
