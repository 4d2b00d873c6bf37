"""Detects two publishers of joint states: two samples of one moment that no single robot can have sent."""

from __future__ import annotations

from math import remainder

from irsbot_kinematics.mechanism import Coordinate
from irsbot_msgs_py.records import Floats
from irsbot_supervisor.core.settings import OVERSPEED, Settings

LATE_PERIODS = 2
"""1: periods of the sender by which the arrival of a sample may be off. Clocks with coarse stamps repeat them while the
robot moves; the samples of two sources for one moment differ by more."""


class Publishers:
    """Compares a sample that is not newer than the last one with the last one."""

    def __init__(self, settings: Settings, joints: tuple[Coordinate, ...]) -> None:
        self._turns = tuple(joint.turn for joint in joints)
        self._units = tuple(joint.unit for joint in joints)
        self.configure(settings)

    def configure(self, settings: Settings) -> None:
        """Take in new limits."""
        self._names = settings.joint_names
        self._fastest = tuple(OVERSPEED * speed for speed in settings.velocity_limit)
        self._step = 2.0 * settings.encoder_resolution

    def contradiction(self, now: Floats, then: Floats, earlier_s: float, passed_s: float, period_s: float) -> str:
        """The reason why two samples cannot come from the same robot, or empty. earlier_s: by how much the later
        arrival is stamped earlier; passed_s: steady time between the arrivals; period_s: between the stamps of one
        sender."""
        span_s = passed_s + LATE_PERIODS * abs(period_s) + earlier_s
        joints = zip(self._names, self._units, self._turns, self._fastest, strict=True)
        for (name, unit, turn, fastest), a, b in zip(joints, now, then, strict=True):
            apart = abs(remainder(a - b, turn))
            if not apart <= fastest * span_s + self._step:
                when = f"{earlier_s:.3g} s" if earlier_s > 0.0 else "no time"
                return (
                    f"joint '{name}' is in two places, {apart:.4g} {unit} apart with {when} in between: two publishers?"
                )
        return ""
