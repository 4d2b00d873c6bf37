"""Validation of arriving samples: joints by name, finiteness, stamps against both clocks. Accepted or rejected."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from operator import itemgetter
from typing import NamedTuple

from irsbot_kinematics.mechanism import Coordinate
from irsbot_msgs_py.records import Cause, Floats, JointSample
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.core.estimation.publishers import Publishers
from irsbot_supervisor.core.settings import Settings

FARTHEST = 1e6
"""rad or m: a larger joint position is a unit error or invalid, and its sine loses digits."""


class Accepted(NamedTuple):
    """A sample that is valid as far as a single sample shows."""

    stamp_ns: int
    received_ns: int
    seen_ns: int
    position: Floats  # configured order, rad or m
    velocity: Floats  # configured order; empty when the message has none that can be used
    effort: Floats  # configured order; empty when the message has none that can be used


class Rejected(NamedTuple):
    """A sample that gives no information about the robot, and the reason."""

    cause: Cause
    text: str
    harmless: bool = False
    """A repetition or a late sample: it neither adds knowledge nor casts doubt on it."""


class IntakeMemory(NamedTuple):
    """What `Intake` remembers of the last accepted sample."""

    names: tuple[str, ...] | None  # of the messages
    stamp_ns: int
    seen_ns: int
    period_ns: int  # between the last two stamps
    position: Floats


class Intake:
    """Sorts samples into accepted and rejected; remembers the order of names and the newest stamp."""

    def __init__(self, settings: Settings, joints: tuple[Coordinate, ...]) -> None:
        self._publishers = Publishers(settings, joints)
        self.configure(settings)
        self._names: tuple[str, ...] | None = None
        self._pick: Callable[[Floats], Floats] = tuple
        self._stamp_ns = self._seen_ns = self._period_ns = 0
        self._position: Floats = ()

    def configure(self, settings: Settings) -> None:
        """Take in new limits; names and stamps are kept."""
        self._joints = settings.joint_names
        self._publishers.configure(settings)
        self._age_ns = round(settings.age_limit_s * NS_PER_S)
        self._future_ns = round(settings.future_limit_s * NS_PER_S)
        self._stale_ns = round(settings.stale_s * NS_PER_S)

    @property
    def memory(self) -> IntakeMemory:
        """What is remembered, for `remember`."""
        return IntakeMemory(self._names, self._stamp_ns, self._seen_ns, self._period_ns, self._position)

    def remember(self, memory: IntakeMemory) -> None:
        """Go on from a memory with the same names."""
        _names, self._stamp_ns, self._seen_ns, self._period_ns, self._position = memory

    def check(self, sample: JointSample) -> Accepted | Rejected:
        """The sample in the configured joint order, or the first reason to reject it."""
        stamp, received, seen, names, position, velocity, effort = sample
        count = len(names)
        if names != self._names and (fault := self._learn(names)):
            return Rejected(Cause.NAMES, fault)
        if not len(velocity or position) == len(effort or position) == len(position) == count:
            lengths = f"{count} names, {len(position)} positions, {len(velocity)} velocities, {len(effort)} efforts"
            return Rejected(Cause.NAMES, f"the arrays do not fit the names: {lengths}")
        pick = self._pick
        q = pick(position)
        if not sum([abs(value) for value in q]) <= FARTHEST:
            for name, value in zip(self._joints, q, strict=True):
                if not -FARTHEST <= value <= FARTHEST:
                    return Rejected(*_bad_position(name, value))
        in_time = stamp > self._stamp_ns and -self._future_ns <= received - stamp <= self._age_ns
        if not in_time and (late := self._stamp_fault(stamp, received, seen, q)):
            return late
        self._stamp_ns, self._seen_ns, self._position, self._period_ns = stamp, seen, q, stamp - self._stamp_ns
        return Accepted(
            stamp,
            received,
            seen,
            q,
            pick(velocity) if velocity else (),
            pick(effort) if effort else (),
        )

    def _learn(self, names: tuple[str, ...]) -> str:
        missing = [joint for joint in self._joints if joint not in names]
        if missing:
            return f"joint '{missing[0]}' is missing; the message has {', '.join(names) or 'no names'}"
        if doubled := [joint for joint in self._joints if names.count(joint) > 1]:
            return f"joint '{doubled[0]}' is named twice"
        first, *others = [names.index(joint) for joint in self._joints]
        self._names = names
        self._pick = itemgetter(first, *others) if others else lambda values: (values[first],)
        return ""

    def _stamp_fault(self, stamp: int, received: int, seen: int, position: Floats) -> Rejected | None:
        age = received - stamp
        if not (stamp > 0 and -self._future_ns <= age <= self._age_ns):
            what = (
                "zero"
                if stamp <= 0
                else f"{-age / NS_PER_S:.3f} s in the future"
                if age < 0
                else f"{age / NS_PER_S:.3f} s old"
            )
            return Rejected(Cause.STAMP, f"the stamp is {what}")
        if stamp > self._stamp_ns:
            return None
        # The sender's clock may have been set back, or a simulation restarted: believe it once nothing newer comes.
        # A stamp that is merely repeated never becomes news.
        if stamp < self._stamp_ns and seen - self._seen_ns > self._stale_ns:
            return None
        times = (self._stamp_ns - stamp) / NS_PER_S, (seen - self._seen_ns) / NS_PER_S, self._period_ns / NS_PER_S
        if fault := self._publishers.contradiction(position, self._position, *times):
            return Rejected(Cause.IMPLAUSIBLE, fault)
        return Rejected(Cause.STAMP, "the stamp is repeated or out of order", harmless=True)


def _bad_position(name: str, value: float) -> tuple[Cause, str]:
    if isfinite(value):
        return Cause.IMPLAUSIBLE, f"joint '{name}' is at {value:g}, farther than any joint gets"
    return Cause.NONFINITE, f"joint '{name}' is at {value}"
