"""Rules for a consumer of verdicts: a drive, a controller or a gateway. Standard library only, no ROS.

A verdict is valid as long as it is fresh. At the beginning, after a silence, and after a verdict out of sequence,
verdicts have to come in sequence for 0.1 s, or the time-out if it is longer, before motion is allowed: the first may be
the latched last verdict of a supervisor that is frozen or has ended, and the verdicts of two supervisors on one topic
are not in sequence for so long. A STOP or UNKNOWN that ends motion forbids it for that verdict and the next one.

A command of velocities has no stamp. One that comes while motion is forbidden may have been sent before motion ended,
and waited while this process was paused: it is void, as is every command from before the end (`LastCommand`).
"""

from __future__ import annotations

from math import inf
from typing import Generic, TypeVar

Command = TypeVar("Command")

OK, WARN, STOP, UNKNOWN = range(4)
"""Levels, as in irsbot_msgs/SingularityState."""

TIMEOUT_S = 0.1
"""s without a verdict after which a consumer brakes; the shipped supervisor publishes every 10 ms."""

IN_SEQUENCE = 2
"""Number of verdicts that follow another before motion is allowed."""


class Consumer:
    """Obeys one supervisor. All times are of one steady clock, ns. Call `hear` for every verdict and `allowed` before
    every step."""

    def __init__(self, timeout_s: float = TIMEOUT_S, *, gated: bool = False) -> None:
        """timeout_s: silence, s, after which to brake; above 0.1 s an assumption of the stopping theorem is broken.

        gated: all commands pass the command gate, which limits their speed and lets a stopped robot move out: a STOP
        with a speed scale above 0 then allows motion. Raises ValueError for an invalid timeout."""
        if isinstance(timeout_s, bool) or not 0.0 < timeout_s < inf:
            raise ValueError(f"the timeout must be positive and finite, got {timeout_s!r} s")
        self._timeout_s, self._gated = timeout_s, gated
        self._sequence_s = max(timeout_s, TIMEOUT_S)  # several verdicts of the slowest supervisor
        self._heard_ns = self._begun_ns = 0  # of the last verdict, and of the first of those in sequence
        self._sequence = self._following = -1  # of the last verdict; how many in a row followed their predecessors
        self._scale = 0.0
        self._braking = True
        self.brakes = 0
        """Number of times that motion has ended. Commands from before the last end are void."""

    def hear(self, level: int, sequence: int, speed_scale: float, now_ns: int, age_s: float = 0.0) -> None:
        """Take in a verdict. age_s: present time minus its stamp, by the clock that stamps; NaN if it is not
        known, which forbids motion."""
        follows = sequence > self._sequence >= 0 and self._is_fresh(now_ns)
        self._following = self._following + 1 if follows else 0
        self._begun_ns = self._begun_ns if follows else now_ns
        self._heard_ns, self._sequence = now_ns, sequence
        allows = level in (OK, WARN) or (self._gated and level == STOP)
        timely = -self._timeout_s <= age_s <= self._timeout_s
        in_sequence = self._following >= IN_SEQUENCE and now_ns - self._begun_ns >= self._sequence_s * 1e9
        known = allows and timely and 0.0 < speed_scale <= 1.0 and in_sequence
        self._scale = (1.0 if self._gated else speed_scale) if known else 0.0
        self._note(self._scale)

    def allowed(self, now_ns: int) -> float:
        """Share of the speed limits that may be used now, 0..1; 0 means brake."""
        scale = self._scale if self._is_fresh(now_ns) else 0.0
        self._note(scale)
        return scale

    def _is_fresh(self, now_ns: int) -> bool:
        return abs(now_ns - self._heard_ns) <= self._timeout_s * 1e9

    def _note(self, scale: float) -> None:
        """Permission that has expired stays expired until it is given again."""
        if scale > 0.0:
            self._braking = False
        elif not self._braking:
            self._braking, self._following, self._scale = True, 0, 0.0
            self.brakes += 1


class LastCommand(Generic[Command]):
    """The last command to a consumer, as long as it counts. Call `take` for every command, `now` in every cycle."""

    def __init__(self, consumer: Consumer) -> None:
        self._consumer = consumer
        self._given: tuple[Command, int] | None = None  # with the number of ends of motion before it

    def take(self, command: Command, now_ns: int) -> None:
        """Take in a command; it is void if motion is forbidden now."""
        self._given = (command, self._consumer.brakes) if self._consumer.allowed(now_ns) > 0.0 else None

    def now(self, now_ns: int) -> Command | None:
        """The command to follow; None: brake."""
        self._consumer.allowed(now_ns)  # a silence until now has ended motion
        if self._given is None or self._given[1] != self._consumer.brakes:
            return None
        return self._given[0]
