"""Detects positions that no motion explains: glitches, slipping encoders, samples with a wrong stamp.

If a joint moved farther than its velocity limit allows, by the sender's clock and by the receiver's, the sample is
rejected. A joint with a large jump has to return. If it stays at the new position, the branch of the robot is unknown.
"""

from __future__ import annotations

from math import inf, remainder

from irsbot_kinematics.mechanism import Coordinate
from irsbot_msgs_py.records import Floats
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.core.estimation.estimate import Estimate
from irsbot_supervisor.core.settings import OVERSPEED, UNLIMITED, Settings
from irsbot_supervisor.core.validation import Accepted

ASTRAY = 2.0
"""1: a jump this many times longer than the limit is not noise at full speed. Until the joint returns, its position is
not known, even after a time in which the joint could have moved there."""


class Jumps:
    """Remembers where a joint jumped until it comes back."""

    def __init__(self, settings: Settings, joints: tuple[Coordinate, ...]) -> None:
        self._joints = joints
        self._units = tuple(joint.unit for joint in joints)
        self._astray: Accepted | None = None
        self.configure(settings)

    def configure(self, settings: Settings) -> None:
        """Take in new limits; a joint that jumped is still away."""
        self._names = settings.joint_names
        ranges = zip(self._joints, settings.position_lower, settings.position_upper, strict=True)
        # Where a joint has a range, its turns are counted: a reading that jumps by one is wrong.
        self._turns = tuple(
            [inf if lower > -UNLIMITED or upper < UNLIMITED else joint.turn for joint, lower, upper in ranges]
        )
        self._fastest = tuple(OVERSPEED * speed for speed in settings.velocity_limit)
        self._errors = tuple(
            [settings.encoder_resolution + 2.0 * settings.stamp_jitter_s * v for v in settings.velocity_limit]
        )

    @property
    def away(self) -> bool:
        """True if a joint jumped and has not returned."""
        return self._astray is not None

    def restart(self) -> None:
        """Accept the present positions of joints that jumped."""
        self._astray = None

    def moved(self, now: Floats, before: Floats) -> Floats:
        """rad or m from one position to another; angles modulo a turn, unless the joint has a range."""
        return tuple([remainder(q - then, turn) for q, then, turn in zip(now, before, self._turns, strict=True)])

    def too_far(self, moved: Floats, span_s: float) -> str:
        """The reason why a joint cannot move so far in this time; empty if all joints can."""
        for j, (step, fastest, error) in enumerate(zip(moved, self._fastest, self._errors, strict=True)):
            if not abs(step) <= fastest * span_s + error:
                return f"joint '{self._names[j]}' jumped by {step:.4g} {self._units[j]} in {span_s * 1e3:.3g} ms"
        return ""

    def fault(self, sample: Accepted, last: Estimate, moved: Floats, too_far: str, span_s: float) -> str:
        """Reason why a sample cannot follow the last good one; empty if it can. moved: rad or m since the last one.
        too_far: result of `too_far`. span_s: longer of the two times between them, by the sender's clock and by the
        receiver's."""
        if too_far:
            if self.too_far(moved, ASTRAY * span_s):
                self._astray = sample
            return too_far
        away = self._astray
        if away is not None:
            rates = tuple([rate if rate == rate else 0.0 for rate in last.velocity])
            if self._off(sample, away, rates) < self._off(sample, last, rates):
                self._astray = sample
                return "the positions stay where they jumped"
            self._astray = None
        return ""

    def _off(self, sample: Accepted, before: Estimate | Accepted, rates: Floats) -> float:
        """s that the fastest motion needs from the sample to the position predicted with these rates."""
        dt = (sample.stamp_ns - before.stamp_ns) / NS_PER_S
        moved = self.moved(sample.position, before.position)
        return max(abs(step - rate * dt) / most for step, rate, most in zip(moved, rates, self._fastest, strict=True))
