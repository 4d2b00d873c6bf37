"""Limits of joint positions: the robot is stopped before a joint leaves its range, whatever its drive does."""

from __future__ import annotations

from collections.abc import Callable
from operator import add

from irsbot_kinematics.mechanism import Coordinate
from irsbot_msgs_py.records import Cause, Finding, Floats, Level
from irsbot_supervisor.core.estimation.estimate import Estimate, Speeds
from irsbot_supervisor.core.estimation.sample_interval import SETTLING
from irsbot_supervisor.core.reach import Reach
from irsbot_supervisor.core.settings import UNLIMITED, Settings

SHARES = (0.0, *[0.5**k for k in range(7, -1, -1)])
"""1: of a commanded rate that leads out of a range, what is tried."""

Followed = Callable[[Floats], tuple[Speeds, tuple[Floats, Floats]]]
"""How fast the joints are when they have followed rates, and where they have got by then at least and at most."""


class PositionLimits:
    """The ranges of one robot, applied. The tests are written for what is accepted, so that NaN is refused."""

    def __init__(self, settings: Settings, joints: tuple[Coordinate, ...]) -> None:
        self.lower, self.upper = settings.position_lower, settings.position_upper
        self.given = any(abs(limit) < UNLIMITED for limit in (*self.lower, *self.upper))
        self._names, self._units = settings.joint_names, [joint.unit for joint in joints]
        self._reach, self._latency_s = Reach(settings), settings.latency_s
        self._settling = SETTLING * settings.stale_s

    def judge(self, estimate: Estimate, first: bool = False) -> list[Finding]:
        """Joints that are out of their range, or that cannot be stopped in it. first: of a first sample, and after a
        silence, only where the joints are counts: nobody knows how fast they are, and the level is UNKNOWN for that."""
        if not self.given:
            return []
        errors = self._reach.errors
        forward, backward = errors, errors
        if not first and estimate.steady_s >= self._settling:
            forward, backward = self._until_rest(estimate.speeds, estimate.ahead_s)
        findings = []
        for joint, (q, up, down) in enumerate(zip(estimate.position, forward, backward, strict=True)):
            low, high = self.lower[joint], self.upper[joint]
            if low <= q - down and q + up <= high:
                continue
            name, unit = self._names[joint], self._units[joint]
            limit, value = (high, q + up) if not q + up <= high else (low, q - down)
            inside = low <= q <= high
            cause = Cause.POSITION | Cause.BRAKING if inside else Cause.POSITION
            may = f" may get to {value:.4g} {unit} before standstill," if inside else ""
            text = f"joint '{name}' at {q:.4g} {unit}{may or ','} limit {limit:.4g}"
            findings.append(Finding(cause, Level.STOP, value if inside else q, limit, unit, text))
        return findings

    def kept(self, position: Floats, rates: Floats, followed: Followed, ahead_s: float) -> Floats:
        """Commanded rates (rad/s or m/s), those that lead out of a range made smaller. Joints that are out may return.
        ahead_s: for how long the robot goes on unseen."""
        if not self.given:
            return rates
        kept = [0.0] * len(rates)
        for share in SHARES:
            tried = tuple([share * rate for rate in rates])
            speeds, (low, high) = followed(tried)
            forward, backward = self._until_rest(speeds, ahead_s)
            for joint, (rate, q) in enumerate(zip(tried, position, strict=True)):
                outwards = q + high[joint] + forward[joint] <= self.upper[joint] if rate > 0.0 else True
                inwards = self.lower[joint] <= q + low[joint] - backward[joint] if rate < 0.0 else True
                if outwards and inwards:
                    kept[joint] = rate
        return tuple(kept)

    def _until_rest(self, speeds: Speeds, ahead_s: float) -> tuple[Floats, Floats]:
        """rad or m forward and backward until the joints stand, errors of encoders and stamps included."""
        forward, backward = self._reach.until_rest(speeds, ahead_s + self._latency_s)
        errors = self._reach.errors
        return tuple(map(add, forward, errors)), tuple(map(add, backward, errors))
