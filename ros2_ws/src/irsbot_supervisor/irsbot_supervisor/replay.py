"""A recorded run judged again, from the bag alone: in process, event by event, as fast as it goes.

The supervisor's inputs are in the bag: the joint states, and the journal with its settings and resets. When each input
was seen stands in the states that were published for it. A bag without a supervisor (joint states only) is judged
with the shipped settings of a robot, in the order and at the times of its recording.
"""

from __future__ import annotations

from collections import defaultdict, deque
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from irsbot_kinematics import KinematicsError
from irsbot_kinematics.robot_record import robot_from_record
from irsbot_msgs_py.records import Cause, Configure, JointSample, Level, Reset, SingularityState, Tick, Verdict
from irsbot_supervisor.core.pipeline import Event, Supervisor
from irsbot_supervisor.core.settings import InvalidSettings, settings_from
from irsbot_supervisor.journal import JournalError, configured, read_entry
from irsbot_supervisor.mcap_writer import BagError
from irsbot_supervisor.settings_file import read_settings
from irsbot_supervisor.tape import JOINT_STATE, Tape


class Chapter(NamedTuple):
    """Level and causes from one moment on, until the next chapter."""

    since_ns: int  # steady clock
    level: Level
    causes: int
    latched: bool
    event: int
    text: str

    def same_as(self, other: Chapter) -> bool:
        """Equal but for the wording."""
        return self[:5] == other[:5]

    def __str__(self) -> str:
        return f"{self.level.name} ({cause_names(self.causes) or 'no cause'})"


@dataclass
class Recording:
    """What a bag holds of one supervised robot."""

    path: Path
    samples: list[JointSample] = field(default_factory=list)  # seen_ns and received_ns as recorded
    states: list[SingularityState] = field(default_factory=list)
    verdicts: list[tuple[int, Verdict]] = field(default_factory=list)  # log time, ns
    journal: list[Configure | Reset] = field(default_factory=list)
    loss: str = ""

    @property
    def begun_late(self) -> bool:
        """Whether the supervisor had judged samples before the recording began."""
        return bool(self.states) and self.states[0].sequence > 1


@dataclass
class Judged:
    """A recording judged again."""

    chapters: list[Chapter]
    levels: dict[int, tuple[Level, int]]  # per judged sample number: level and causes
    unseen: int  # joint states in the bag that never reached the supervisor
    missing: int  # samples the supervisor saw that are not in the bag


def read_recording(bag: Path) -> Recording:
    """Everything a replay needs. Raises BagError for something that is no bag, or holds no joint states."""
    recording = Recording(bag)
    with Tape(bag) as tape:
        for entry in tape.records():
            record = entry.record
            if isinstance(record, JointSample):
                recording.samples.append(record)
            elif isinstance(record, SingularityState):
                recording.states.append(record)
            elif isinstance(record, Verdict):
                recording.verdicts.append((entry.log_ns, record))
            elif entry.topic.endswith("/journal"):
                recording.journal.append(_journal_entry(bag, record))
        recording.loss = str(tape.loss) if tape.loss else ""
    if not recording.samples:
        raise BagError(f"{bag}: no joint states (type {JOINT_STATE}) in it")
    return recording


def judge_again(recording: Recording, robot: str = "irsbot2") -> Judged:
    """What the supervisor makes of the recorded inputs. robot: for a bag that does not say which it is.

    Raises BagError for settings in the bag that this version cannot use.
    """
    first = next((entry for entry in recording.journal if isinstance(entry, Configure)), None)
    try:
        if first is None:
            settings, machine = read_settings(robot)
            start = recording.samples[0]
            first = configured(settings, machine, start.received_ns, start.seen_ns)
        machine = robot_from_record(first.machine)
        supervisor = Supervisor(settings_from(first.values, machine), machine)
    except (InvalidSettings, KinematicsError) as error:
        raise BagError(f"{recording.path}: {error}") from None
    events, unseen, missing = _events(recording, first)
    chapters: list[Chapter] = []
    levels: dict[int, tuple[Level, int]] = {}
    offset = recording.states[0].sequence - 1 if recording.states else 0
    for event in events:
        step = supervisor.step(event)
        if step.state is not None:
            levels[step.state.sequence + offset] = step.state.level, step.state.causes
        for turn in step.turns:
            text = "; ".join(finding.text for finding in turn.findings)
            chapters.append(Chapter(turn.since_ns, turn.level, turn.causes, turn.latched, turn.event, text))
    return Judged(chapters, levels, unseen, missing)


def cause_names(causes: int) -> str:
    """The causes of a bit mask, in words."""
    return ", ".join(cause.name or "" for cause in Cause if cause and causes & cause)


def _journal_entry(bag: Path, line: str) -> Configure | Reset:
    try:
        return read_entry(line)
    except JournalError as error:
        raise BagError(f"{bag}: {error}") from None


def _events(recording: Recording, first: Configure) -> tuple[list[Event], int, int]:
    """The supervisor's inputs in the order in which it saw them, how many samples it never saw, and how many it saw
    that the bag does not have."""
    others: list[Event] = [entry for entry in recording.journal if entry is not first]
    if not recording.states:
        samples: list[Event] = list(recording.samples)
        return _with_ticks([*samples, *others], samples[-1].seen_ns), 0, 0
    waiting: dict[int, deque[JointSample]] = defaultdict(deque)
    for sample in recording.samples:
        waiting[sample.stamp_ns].append(sample)
    judged: list[Event] = []
    missing = 0
    for state in recording.states:
        queue = waiting[state.stamp_ns]
        if queue:
            judged.append(queue.popleft()._replace(received_ns=state.received_ns, seen_ns=state.seen_ns))
        else:
            missing += 1
    last = recording.states[-1].sequence - recording.states[0].sequence + 1
    missing += last - len(recording.states)
    unseen = sum(len(queue) for queue in waiting.values())
    end_ns = max([verdict.since_ns for _log, verdict in recording.verdicts], default=0)
    return _with_ticks([_begin(recording, first), *judged, *others], end_ns), unseen, missing


def _begin(recording: Recording, first: Configure) -> Tick:
    """When silence begins to count: as the settings came into force, or where the recording begins if that is later."""
    if recording.begun_late:
        return Tick(recording.states[0].received_ns, recording.states[0].seen_ns)
    return Tick(first.received_ns, first.seen_ns)


def _with_ticks(events: list[Event], end_ns: int) -> list[Event]:
    """In order of time, with a tick at the end so that a silence there is noticed."""
    ordered = sorted(events, key=lambda event: event.seen_ns)
    if end_ns > ordered[-1].seen_ns:
        ordered.append(Tick(end_ns, end_ns))
    return ordered
