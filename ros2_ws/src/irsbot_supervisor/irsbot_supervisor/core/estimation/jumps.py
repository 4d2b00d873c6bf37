"""Positions that no motion explains: glitches, encoders that slip, samples with a wrong stamp.

A joint that has gone farther than its velocity limit allows, by the sender's clock and by ours, was not there: the
sample is rejected. A joint that jumped far has to come back. If it stays where it jumped, nobody knows on which branch
the robot is.
"""

from __future__ import annotations

from math import remainder
from operator import sub

from irsbot_kinematics.mechanism import Coordinate
from irsbot_msgs_py.records import Floats
from irsbot_supervisor.core.estimation.estimate import Estimate
from irsbot_supervisor.core.intake import Accepted, S
from irsbot_supervisor.core.settings import OVERSPEED, Settings

ASTRAY = 2.0
"""1: a jump this many times longer than that is no noise at full speed; until the joint comes back its position is not
known, however much time passes in which it could have gone there."""


class Jumps:
    """Remembers where a joint jumped until it comes back."""

    def __init__(self, settings: Settings, joints: tuple[Coordinate, ...]) -> None:
        self._turns = tuple(joint.turn for joint in joints)
        self._units = tuple(joint.unit for joint in joints)
        self._astray: Accepted | None = None
        self.configure(settings)

    def configure(self, settings: Settings) -> None:
        """New limits; a joint that jumped is still away."""
        self._names = settings.joint_names
        self._fastest = tuple(OVERSPEED * speed for speed in settings.velocity_limit)
        self._errors = tuple(
            [settings.encoder_resolution + 2.0 * settings.stamp_jitter_s * v for v in settings.velocity_limit]
        )

    @property
    def away(self) -> bool:
        """Whether a joint jumped and has not come back."""
        return self._astray is not None

    def restart(self) -> None:
        """What jumped is where it is."""
        self._astray = None

    def moved(self, now: Floats, before: Floats) -> Floats:
        """rad or m from one position to another, angles modulo a turn."""
        return tuple(map(remainder, map(sub, now, before), self._turns))

    def too_far(self, moved: Floats, span_s: float) -> str:
        """Why no joint moves so far in this time; empty if all can."""
        joints = zip(self._names, self._units, moved, self._fastest, self._errors, strict=True)
        for name, unit, step, fastest, error in joints:
            if not abs(step) <= fastest * span_s + error:
                return f"joint '{name}' jumped by {step:.4g} {unit} in {span_s * 1e3:.3g} ms"
        return ""

    def fault(self, sample: Accepted, last: Estimate, span_s: float) -> str:
        """Why a sample cannot follow the last good one; empty if it can. span_s: the time there was for the way, by the
        more generous of both clocks."""
        moved = self.moved(sample.position, last.position)
        if why := self.too_far(moved, span_s):
            if self.too_far(moved, ASTRAY * span_s):
                self._astray = sample
            return why
        away = self._astray
        if away is not None:
            rates = tuple([rate if rate == rate else 0.0 for rate in last.velocity])
            if self._off(sample, away, rates) < self._off(sample, last, rates):
                self._astray = sample
                return "the positions stay where they jumped"
            self._astray = None
        return ""

    def _off(self, sample: Accepted, before: Estimate | Accepted, rates: Floats) -> float:
        """s of fastest motion between where a sample is and where it would be, had the motion gone on at these
        rates."""
        dt = (sample.stamp_ns - before.stamp_ns) / S
        moved = self.moved(sample.position, before.position)
        return max(abs(step - rate * dt) / most for step, rate, most in zip(moved, rates, self._fastest, strict=True))
