"""Whether the joints move no faster than a way out of a stop, or a bypass, allows: `recovery_share` of V.

The reported velocities alone do not tell it: a message may say 0. So the positions have to agree, by the mean speeds
over `stale_s`.
"""

from __future__ import annotations

from irsbot_kinematics.mechanism import Coordinate
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.core.estimation.estimate import Estimate
from irsbot_supervisor.core.estimation.jumps import Jumps
from irsbot_supervisor.core.reachable_box import recovery_speeds
from irsbot_supervisor.core.settings import Settings


class Pace:
    """Watches a robot that may only move slowly."""

    def __init__(self, settings: Settings, joints: tuple[Coordinate, ...]) -> None:
        self._jumps = Jumps(settings, joints)
        self._begin: Estimate | None = None  # of the present interval
        self._slow = False
        self.configure(settings)

    def configure(self, settings: Settings) -> None:
        """Take in new limits."""
        self._jumps.configure(settings)
        self._most = recovery_speeds(settings)
        self._errors = tuple(
            [settings.encoder_resolution + 2.0 * settings.stamp_jitter_s * v for v in settings.velocity_limit]
        )
        self._stale_s, self._interval_ns = settings.stale_s, round(settings.stale_s * NS_PER_S)

    @property
    def watching(self) -> bool:
        """True from the first estimate on."""
        return self._begin is not None

    def restart(self) -> None:
        """Forget earlier positions: the robot may move fast again."""
        self._begin, self._slow = None, False

    def look(self, estimate: Estimate) -> None:
        """Take in the estimate of the next sample."""
        begin = self._begin
        passed_ns = estimate.seen_ns - begin.seen_ns if begin is not None else 0
        if begin is None or passed_ns > 2 * self._interval_ns:  # the mean speed over a silence shows little
            self._begin, self._slow = estimate, False
            return
        if passed_ns < self._interval_ns:
            return
        # A message may come early or late; a clock that was set at most doubles the time.
        span_s = max(passed_ns, min(estimate.stamp_ns - begin.stamp_ns, 2 * passed_ns)) / NS_PER_S
        moved = self._jumps.moved(estimate.position, begin.position)
        rows = zip(moved, self._most, self._errors, strict=True)
        self._slow = all(abs(way) <= most * span_s + error for way, most, error in rows)
        self._begin = estimate

    def is_slow(self, estimate: Estimate) -> bool:
        """True if no joint is faster than allowed, neither by its velocity nor over the last interval of positions."""
        if not (self._slow or estimate.standing_s >= self._stale_s):
            return False
        return all(abs(rate) <= most for rate, most in zip(estimate.velocity, self._most, strict=True))
