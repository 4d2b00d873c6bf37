"""What a recording becomes when it is judged again."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import NamedTuple

from irsbot_kinematics import Robot
from irsbot_msgs_py.records import CONSUMER_TIMEOUT_S, Cause, Level, cause_names
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.core.latch import Judgement
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.stop_monitor import MeasuredStop
from irsbot_supervisor.replay.levels import Levels

SILENCE_NS = round(CONSUMER_TIMEOUT_S * NS_PER_S)
"""ns without a verdict after which a consumer stops."""


class Interval(NamedTuple):
    """Level and causes from one moment until the next interval."""

    since_ns: int  # on the clock of the joint states' receipt, ROS time
    level: Level
    causes: int
    latched: bool
    event: int
    text: str

    def same_as(self, other: Interval) -> bool:
        """Equal except for the wording."""
        return self[:5] == other[:5]

    def __str__(self) -> str:
        return f"{self.level.name} ({cause_names(self.causes) or 'no cause'})"


@dataclass
class Judged:
    """A recording judged again."""

    parts: list[list[Interval]]  # one per supervision, or one for samples alone
    levels: Levels  # by number of the supervision and of the sample: level and causes
    unseen: int  # joint states in the bag that never reached a supervisor
    missing: int  # samples a supervisor saw that are not in the bag
    between: int = 0  # samples without a state, judged at times between those of their neighbours
    robot: str = ""  # for which it was judged, and how it is known
    errors: list[str] = field(default_factory=list)  # inside the supervisors, as a node would have caught them
    margins: dict[str, tuple[float, int]] = field(default_factory=dict)  # smallest by name, and its stamp, ns ROS time
    rejections: Counter[Cause] = field(default_factory=Counter)  # rejected joint states, by reason
    stops: list[tuple[int, MeasuredStop]] = field(default_factory=list)  # that came to rest, with the time of that, ns
    settings: list[tuple[int, Settings]] = field(default_factory=list)  # in force from a time on, ns
    machine: Robot | None = field(default=None, compare=False)  # the last one

    @property
    def intervals(self) -> list[Interval]:
        return [interval for part in self.parts for interval in part]

    def note(self, turn: Judgement, part: int, ahead_ns: int) -> None:
        """Add the interval that begins with a judgement."""
        text = "; ".join(finding.text for finding in turn.findings)
        since_ns = turn.since_ns + ahead_ns
        self.parts[part].append(Interval(since_ns, turn.level, turn.causes, turn.latched, turn.event, text))
