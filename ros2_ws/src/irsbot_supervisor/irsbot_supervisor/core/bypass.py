"""A bypass: one cause of a stop does not stop for a while, because an operator says so, by name and with a reason."""

from __future__ import annotations

from typing import NamedTuple

from irsbot_msgs_py.records import Bypass, Cause, Finding, Level
from irsbot_supervisor.core.intake import S

LONGEST_S = 60.0
"""s. Who needs longer looks again, and gives a reason again."""

STOPPING = (Cause.TYPE1, Cause.TYPE2, Cause.CONSTRAINT, Cause.LIMB, Cause.REACTION)
"""What can be bypassed: all that leads to STOP. What leads to UNKNOWN cannot."""

SHOWN = 200
"""Characters of a name and of a reason that every verdict repeats; the journal has all of them."""


class InForce(NamedTuple):
    """A bypass that was accepted."""

    cause: int
    until_ns: int  # steady clock
    words: str  # who, until when and why

    def covers(self, finding: Finding) -> bool:
        """Whether it is of this cause alone, reached now or on the way to standstill."""
        return finding.cause & ~Cause.BRAKING == self.cause

    def is_ended_by(self, finding: Finding) -> bool:
        """Any other stop ends it, and everything that is not known."""
        return finding.level == Level.UNKNOWN or (finding.level == Level.STOP and not self.covers(finding))

    def passed(self, finding: Finding) -> Finding:
        """A finding as it acts meanwhile: a stop warns."""
        if finding.level != Level.STOP:
            return finding
        return finding._replace(level=Level.WARN, text=f"{self.words}: {finding.text}")


def in_force(wish: Bypass, active: list[Finding]) -> tuple[InForce | None, str]:
    """The bypass that an operator asks for, or why not. active: what is found now."""
    operator, reason = _printed(wish.operator), _printed(wish.reason)
    stops = [finding for finding in active if finding.level == Level.STOP]
    if wish.cause not in STOPPING:
        names = ", ".join(f"{cause.name} ({int(cause)})" for cause in STOPPING)
        return None, f"cause {wish.cause} cannot be bypassed, one of these can: {names}"
    if not 0.0 < wish.duration_s <= LONGEST_S:
        return None, f"the duration is {wish.duration_s} s, must be above 0 and at most {LONGEST_S:g} s"
    if not operator or not reason:
        return None, "a bypass needs the name of the operator and a reason"
    name, duration_ns = Cause(wish.cause).name, round(wish.duration_s * S)
    words = f"bypassed by {operator} until {_time_of_day(wish.received_ns + duration_ns)}, {reason}"
    bypass = InForce(wish.cause, wish.seen_ns + duration_ns, words)
    if not any(map(bypass.covers, stops)):
        return None, f"{name} does not stop now" + (f": {stops[0].text}" if stops else ": reset the stop")
    if others := [finding for finding in stops if not bypass.covers(finding)]:
        return None, f"another cause than {name} stops, too: {others[0].text}"
    return bypass, ""


def _printed(text: str) -> str:
    """One line of what can be printed, and sent."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())[:SHOWN]


def _time_of_day(ros_ns: int) -> str:
    """As people say it, UTC."""
    minutes, second = divmod(ros_ns // S, 60)
    hour, minute = divmod(minutes % (24 * 60), 60)
    return f"{hour:02}:{minute:02}:{second:02} UTC"
