"""Compares reported velocities with the bounds from positions.

The present speed is within the observer's bounds. With the velocity v reported at an earlier sample, the joint has
since moved by at most w <= (max(v, 0) + a D/2) D in the time D, plus errors of positions and stamps; the same holds
with the signs exchanged.
"""

from __future__ import annotations

from collections import deque
from math import isfinite, nan, remainder
from typing import NamedTuple

from irsbot_kinematics.mechanism import Coordinate
from irsbot_msgs_py.records import Floats
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.core.estimation.estimate import Speeds
from irsbot_supervisor.core.estimation.observer import stamped_errors
from irsbot_supervisor.core.settings import UNTRUSTED, Settings
from irsbot_supervisor.core.validation import Accepted


class Velocities(NamedTuple):
    """Rates of the joints, rad/s or m/s."""

    rates: Floats  # as reported, else from positions; NaN if neither is known
    fault: str  # empty, or which report is missing, no number, or contradicts the positions


class Reported:
    """Keeps the reported velocities and the positions of the last few milliseconds."""

    def __init__(self, settings: Settings, joints: tuple[Coordinate, ...]) -> None:
        self._turns = tuple(joint.turn for joint in joints)
        self._units = tuple(joint.unit for joint in joints)
        self._kept: deque[Accepted] = deque()
        self.configure(settings)

    def configure(self, settings: Settings) -> None:
        """Take in new limits."""
        self._names, self._gains = settings.joint_names, settings.acceleration_limit
        self._trust = min(settings.velocity_tolerance) < UNTRUSTED
        stated = settings.velocity_tolerance
        # A joint without a stated tolerance is compared with its positions, too.
        self._tolerances = tuple([error if error < UNTRUSTED else settings.standstill_speed for error in stated])
        # A velocity is true when it is read: at the stamp, up to tau away, it may be a tau more.
        at_stamp = zip(stated, self._gains, strict=True)
        self._trusted = tuple([tolerance + gain * settings.stamp_jitter_s for tolerance, gain in at_stamp])
        errors = stamped_errors(settings)
        self._errors = tuple([2.0 * error for error in errors])
        self._window_ns = max(
            [round((4.0 * error / gain) ** 0.5 * NS_PER_S) for error, gain in zip(errors, self._gains, strict=True)]
        )

    @property
    def memory(self) -> tuple[Accepted, ...]:
        """The samples that are remembered, oldest first, for `remember`."""
        return tuple(self._kept)

    def remember(self, kept: tuple[Accepted, ...]) -> None:
        """Go on from a memory."""
        self._kept = deque(kept)

    def clock_set(self, step_ns: int) -> None:
        """Shift earlier stamps after the clock of the stamps was set."""
        self._kept = deque(kept._replace(stamp_ns=kept.stamp_ns + step_ns) for kept in self._kept)

    def restart(self) -> None:
        """Forget all earlier samples."""
        self._kept.clear()

    def without_last(self) -> None:
        """Remove the last sample, which was wrong."""
        if self._kept:
            self._kept.pop()

    def look(self, sample: Accepted, speeds: Speeds) -> Velocities:
        """Accepted rates of a sample whose speeds are bounded, and the fault of the reported ones."""
        kept, stated = self._kept, sample.velocity
        kept.append(sample)
        while len(kept) > 2 and sample.stamp_ns - kept[1].stamp_ns >= self._window_ns:
            kept.popleft()
        then = kept[0]
        span = (sample.stamp_ns - then.stamp_ns) / NS_PER_S
        rates, fault = [], "" if stated else "the message has no velocities"
        for j, (forward, backward, gain, error, tolerance) in enumerate(
            zip(speeds.forward, speeds.backward, self._gains, self._errors, self._tolerances, strict=True)
        ):
            mean = nan
            if span > 0.0:
                mean = remainder(sample.position[j] - then.position[j], self._turns[j]) / span
                mean = min(max(mean, -backward), forward)  # `then` may have been stamped late
            if not stated:
                rates.append(mean)
                continue
            rate = stated[j]
            if not isfinite(rate):
                rates.append(mean)
                fault = fault or f"the velocity of joint '{self._names[j]}' is {rate}"
                continue
            right = -backward - tolerance <= rate <= forward + tolerance
            if right and span > 0.0 and then.velocity:
                begin, least = then.velocity[j], error / span + 0.5 * gain * span + tolerance
                right = mean - least <= max(begin, 0.0) and -mean - least <= max(-begin, 0.0)
            rates.append(rate if right else mean)
            if not right and not fault:
                unit = self._units[j]
                fault = (
                    f"joint '{self._names[j]}' reports {rate:.4g} {unit}/s, its position moves at {mean:.4g} {unit}/s"
                )
        return Velocities(tuple(rates), fault)

    def trusted(self, sample: Accepted, found: Velocities, speeds: Speeds) -> Speeds:
        """Bounds narrowed by the reported velocities, as far as the setting `velocity_tolerance` and the error of
        a stamp allow."""
        if not self._trust or found.fault or not sample.velocity:
            return speeds
        joints = list(zip(sample.velocity, self._trusted, strict=True))
        return Speeds(
            tuple([min(most, max(rate + e, 0.0)) for most, (rate, e) in zip(speeds.forward, joints, strict=True)]),
            tuple([min(most, max(e - rate, 0.0)) for most, (rate, e) in zip(speeds.backward, joints, strict=True)]),
        )
