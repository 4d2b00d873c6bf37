"""Measures every stop: whether the joints kept to the configured brakes and latency."""

from __future__ import annotations

from math import remainder
from typing import NamedTuple

from irsbot_kinematics.mechanism import Coordinate
from irsbot_msgs_py.records import Cause, Finding, Level
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.core.estimation.estimate import Estimate
from irsbot_supervisor.core.reachable_box import ReachableBox
from irsbot_supervisor.core.settings import Settings


class MeasuredStop(NamedTuple):
    """Displacement during a stop, and the displacement that the settings allow."""

    joint: str  # the joint that used most of its allowance
    unit: str
    way: float  # rad or m from the sample that stopped the robot on
    allowed: float  # rad or m
    time_s: float  # until no joint moved, standstill detection included
    allowed_s: float  # until the last joint stands


class StopMonitor:
    """Follows one stop after the other."""

    def __init__(self, settings: Settings, joints: tuple[Coordinate, ...]) -> None:
        self._turns = tuple(joint.turn for joint in joints)
        self._units = tuple(joint.unit for joint in joints)
        self._begin: Estimate | None = None
        self._allowed: list[tuple[float, float]] = []  # per joint, backward and forward
        self._allowed_s = 0.0
        self._ways: list[tuple[float, float]] = []
        self.last: MeasuredStop | None = None
        """The last stop that came to rest."""
        self.configure(settings)

    def configure(self, settings: Settings) -> None:
        """Take in new limits; a stop in progress is measured with the old ones."""
        self._box, self._latency_s = ReachableBox(settings), settings.latency_s
        self._names, self._rest_s = settings.joint_names, settings.stale_s

    @property
    def measuring(self) -> bool:
        """True from the begin of a stop until the joints stand."""
        return self._begin is not None

    def begin(self, estimate: Estimate) -> None:
        """Begin to measure: the verdict about this sample stops the robot. It is published before the next sample: half
        of the expected interval."""
        free_s = estimate.prediction_delay_s - 0.5 * estimate.expected_s + self._latency_s
        forward, backward = self._box.until_rest(estimate.speeds, free_s)
        pairs = zip(backward, forward, self._box.errors, strict=True)
        self._begin = estimate
        self._allowed = [(down + 2.0 * e, up + 2.0 * e) for down, up, e in pairs]
        self._allowed_s = self._box.stop_s(estimate.speeds, free_s)
        self._ways = [(0.0, 0.0)] * len(self._names)

    def look(self, estimate: Estimate) -> list[Finding]:
        """Findings of a later sample: one for every joint that moved farther than the settings allow."""
        begin = self._begin
        if begin is None:
            return []
        findings = []
        for j, (now, then, turn, (back, ahead)) in enumerate(
            zip(estimate.position, begin.position, self._turns, self._allowed, strict=True)
        ):
            way = remainder(now - then, turn)
            low, high = self._ways[j]
            low, high = min(low, way), max(high, way)
            self._ways[j] = low, high
            if not (-back <= low and high <= ahead):
                most, allowed = (high, ahead) if high > ahead else (-low, back)
                unit = self._units[j]
                text = (
                    f"joint '{self._names[j]}' went {most:.4g} {unit} after the stop, deceleration_limit and latency_s "
                    f"allow {allowed:.4g} {unit}"
                )
                findings.append(Finding(Cause.BRAKING, Level.WARN, most, allowed, unit, text))
        if estimate.standing_s >= self._rest_s:
            self._measure(estimate, begin)
        return findings

    def _measure(self, estimate: Estimate, begin: Estimate) -> None:
        shares = [
            max(-low / back, high / ahead) for (low, high), (back, ahead) in zip(self._ways, self._allowed, strict=True)
        ]
        j = shares.index(max(shares))
        (low, high), (back, ahead) = self._ways[j], self._allowed[j]
        way, allowed = (high, ahead) if high / ahead >= -low / back else (-low, back)
        time_s = max((estimate.seen_ns - begin.seen_ns) / NS_PER_S - estimate.standing_s, 0.0)
        self.last = MeasuredStop(self._names[j], self._units[j], way, allowed, time_s, self._allowed_s)
        self._begin = None
