"""Limits of joint positions: stops the robot before a joint leaves its range, whatever its drive does."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from operator import add

from irsbot_kinematics.mechanism import Coordinate
from irsbot_msgs_py.records import Cause, Finding, Floats, Level
from irsbot_supervisor.core.estimation.estimate import Estimate, Speeds
from irsbot_supervisor.core.estimation.sample_interval import SETTLING
from irsbot_supervisor.core.reachable_box import ReachableBox
from irsbot_supervisor.core.settings import UNLIMITED, Settings

SHARES = tuple([0.5**k for k in range(7, -1, -1)])
"""1: shares of a commanded rate that are tried; the joint is held if all of them lead out of a range."""

Followed = Callable[[Floats], tuple[Speeds, tuple[Floats, Floats]]]
"""Speeds of the joints after they have followed rates, and their least and largest displacement until then."""


class PositionLimits:
    """Applies the ranges of one robot. Tests are written for accepted values, so that NaN is refused."""

    def __init__(self, settings: Settings, joints: tuple[Coordinate, ...]) -> None:
        self.lower, self.upper = settings.position_lower, settings.position_upper
        self.given = any(abs(limit) < UNLIMITED for limit in (*self.lower, *self.upper))
        self._names, self._units = settings.joint_names, [joint.unit for joint in joints]
        self._box, self._latency_s = ReachableBox(settings), settings.latency_s
        self._settling = SETTLING * settings.stale_s

    def judge(self, estimate: Estimate, waits: bool = False) -> list[Finding]:
        """Findings for joints that are out of their range, or cannot be stopped within it. waits: for a robot at rest
        while the sample interval is learned, and for any robot after a silence, only the positions count: the speeds
        are hardly known, and the level is UNKNOWN for that reason."""
        if not self.given:
            return []
        findings = []
        for joint, (q, up, down) in enumerate(self._reached(estimate, waits)):
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

    def into_range(self, estimate: Estimate) -> Floats:
        """Per joint the sign of the motion back from the limit that `judge` finds; 0 if it finds none, or both."""
        reached = zip(self._reached(estimate), self.lower, self.upper, strict=True)
        return tuple([float(not low <= q - down) - float(not q + up <= high) for (q, up, down), low, high in reached])

    def _reached(self, estimate: Estimate, waits: bool = False) -> Iterator[tuple[float, float, float]]:
        """Position of each joint, and its largest displacement forward and backward until it stands, rad or m."""
        errors = self._box.errors
        forward, backward = errors, errors
        if not waits and estimate.steady_s >= self._settling:
            forward, backward = self._until_rest(estimate.speeds, estimate.prediction_delay_s)
        return zip(estimate.position, forward, backward, strict=True)

    def kept(self, position: Floats, rates: Floats, followed: Followed, prediction_delay_s: float) -> Floats:
        """Commanded rates (rad/s or m/s), reduced where they lead out of a range. Joints outside their range may
        return. prediction_delay_s: time that the robot moves without supervision."""
        if not self.given:
            return rates
        kept = [0.0] * len(rates)
        for share in SHARES:
            tried = tuple([share * rate for rate in rates])
            speeds, (low, high) = followed(tried)
            forward, backward = self._until_rest(speeds, prediction_delay_s)
            for joint, (rate, q) in enumerate(zip(tried, position, strict=True)):
                outwards = q + high[joint] + forward[joint] <= self.upper[joint] if rate > 0.0 else True
                inwards = self.lower[joint] <= q + low[joint] - backward[joint] if rate < 0.0 else True
                if outwards and inwards:
                    kept[joint] = rate
        return tuple(kept)

    def _until_rest(self, speeds: Speeds, prediction_delay_s: float) -> tuple[Floats, Floats]:
        """rad or m forward and backward until the joints stand, errors of encoders and stamps included."""
        forward, backward = self._box.until_rest(speeds, prediction_delay_s + self._latency_s)
        errors = self._box.errors
        return tuple(map(add, forward, errors)), tuple(map(add, backward, errors))
