"""A bypass: an operator allows motion in spite of one cause of a stop for a limited time, by name and with a reason."""

from __future__ import annotations

from typing import NamedTuple

from irsbot_msgs_py.records import Bypass, Cause, Finding, Level
from irsbot_msgs_py.stamps import NS_PER_S

LONGEST_S = 60.0
"""s: longest bypass. For a longer time the operator has to look and give a reason again."""

STOPPING = (Cause.TYPE1, Cause.TYPE2, Cause.CONSTRAINT, Cause.LIMB, Cause.REACTION)
"""Causes that can be bypassed: those that lead to STOP. Causes of UNKNOWN cannot be bypassed."""

SHOWN = 200
"""Number of characters of a name and of a reason that every verdict repeats; the journal has all of them."""


class InForce(NamedTuple):
    """An accepted bypass."""

    cause: int
    until_ns: int  # steady clock
    words: str  # who, until when and why

    def covers(self, finding: Finding) -> bool:
        """True for findings of this cause alone, active now or before standstill."""
        return finding.cause & ~Cause.BRAKING == self.cause

    def is_ended_by(self, finding: Finding) -> bool:
        """True if a finding ends the bypass: any other stop, and any UNKNOWN."""
        return finding.level == Level.UNKNOWN or (finding.level == Level.STOP and not self.covers(finding))

    def passed(self, finding: Finding) -> Finding:
        """The finding with its effect during the bypass: a stop becomes a warning."""
        if finding.level != Level.STOP:
            return finding
        return finding._replace(level=Level.WARN, text=f"{self.words}: {finding.text}")


def in_force(wish: Bypass, active: list[Finding]) -> tuple[InForce | None, str]:
    """The bypass that an operator requests, or the reason why it is refused. active: present findings."""
    operator, reason = _printed(wish.operator), _printed(wish.reason)
    stops = [finding for finding in active if finding.level == Level.STOP]
    if wish.cause not in STOPPING:
        names = ", ".join(f"{cause.name} ({int(cause)})" for cause in STOPPING)
        return None, f"cause {wish.cause} cannot be bypassed, one of these can: {names}"
    if not 0.0 < wish.duration_s <= LONGEST_S:
        return None, f"the duration is {wish.duration_s} s, must be above 0 and at most {LONGEST_S:g} s"
    if not operator or not reason:
        return None, "a bypass needs the name of the operator and a reason"
    name, duration_ns = Cause(wish.cause).name, round(wish.duration_s * NS_PER_S)
    words = f"bypassed by {operator} until {_time_of_day(wish.received_ns + duration_ns)}, {reason}"
    bypass = InForce(wish.cause, wish.seen_ns + duration_ns, words)
    if not any(map(bypass.covers, stops)):
        return None, f"{name} does not stop now" + (f": {stops[0].text}" if stops else ": reset the stop")
    if others := [finding for finding in stops if not bypass.covers(finding)]:
        return None, f"another cause than {name} stops, too: {others[0].text}"
    return bypass, ""


def _printed(text: str) -> str:
    """A text with its printable characters on one line, so that it can be sent."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())[:SHOWN]


def _time_of_day(ros_ns: int) -> str:
    """The time of day, UTC."""
    minutes, second = divmod(ros_ns // NS_PER_S, 60)
    hour, minute = divmod(minutes % (24 * 60), 60)
    return f"{hour:02}:{minute:02}:{second:02} UTC"
