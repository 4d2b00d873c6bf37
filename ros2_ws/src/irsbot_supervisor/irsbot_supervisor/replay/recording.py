"""One supervised robot of a bag: its joint states, and what its supervisors said, session by session."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from irsbot_msgs_py.records import JointSample, SingularityState, Verdict
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.bag.bag import Bag
from irsbot_supervisor.bag.column_reader import Columns
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.bag.joint_columns import JointSamples
from irsbot_supervisor.bag.journal import Configuration, Entry, JournalError, read_entry
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.replay.robots_in_bag import namespace_of, robots_in, sources_of

Said = tuple[int, SingularityState | Verdict | Entry]
"""A message of a supervisor with its log time, ns."""


@dataclass
class SupervisorSession:
    """What one supervisor process published and received, while its sequence numbers increased."""

    journal: list[Entry] = field(default_factory=list)
    states: list[SingularityState] = field(default_factory=list)
    verdicts: list[tuple[int, Verdict]] = field(default_factory=list)  # log time, ns

    @property
    def begun_late(self) -> bool:
        """True if the supervisor had judged samples before the recording began."""
        return bool(self.states) and self.states[0].sequence > 1

    @property
    def ahead_ns(self) -> int:
        """ns that its ROS time is ahead of its steady clock."""
        known = [*self.states[:1], *self.journal[:1]]
        return known[0].received_ns - known[0].seen_ns if known else 0

    @property
    def end_ns(self) -> int:
        """End of its last record: ns, ROS time."""
        seen = [state.seen_ns for state in self.states[-1:]]
        return max([*seen, *(verdict.since_ns for _log, verdict in self.verdicts[-1:])], default=0) + self.ahead_ns


@dataclass
class Recording:
    """All records of one robot of a bag that a replay needs."""

    path: Path
    samples: Sequence[JointSample] = field(default_factory=list)  # seen_ns and received_ns as recorded
    sessions: list[SupervisorSession] = field(default_factory=list)  # one after another; none in a bag of samples alone
    loss: str = ""

    @property
    def begin_ns(self) -> int:
        """The first joint state, from which all times count: ns, ROS time. Its stamp; the time of its recording without
        states, and if the stamp is as old or as new as a supervisor rejects by its defaults: clocks may not agree."""
        first = self.samples[0]
        age_s = (first.seen_ns - first.stamp_ns) / NS_PER_S
        stamped = -Settings.future_limit_s <= age_s <= Settings.age_limit_s
        return first.stamp_ns if stamped and any(one.states for one in self.sessions) else first.seen_ns

    @property
    def states(self) -> list[SingularityState]:
        """The states of all sessions, in the order of recording."""
        return [state for session in self.sessions for state in session.states]

    @property
    def verdicts(self) -> list[tuple[int, Verdict]]:
        """The verdicts with their log times, ns."""
        return [heard for session in self.sessions for heard in session.verdicts]

    @property
    def journal(self) -> list[Entry]:
        """The journal entries of all sessions: settings, restarts, resets and bypasses."""
        return [entry for session in self.sessions for entry in session.journal]


def read_recording(bag: Path, namespace: str | None = None, topic: str | None = None) -> Recording:
    """Read all data that a replay of one robot needs.

    bag: folder or file. namespace: of the robot, in a bag of several robots. topic: of its joint states, if there are
    several; the topic alone also selects the robot. Raises BagError for a path that is not a bag, for a bag without
    joint states, for a journal that cannot be read, and if the robot is ambiguous.
    """
    samples: dict[str, JointSamples] = defaultdict(JointSamples)
    stated: dict[str, list[tuple[int, SingularityState | Verdict | str]]] = defaultdict(list)  # by supervisor
    with Bag(bag) as opened:
        for entry in opened.columns():
            if isinstance(entry, Columns):
                samples[entry.topic].append(entry.joints)
            elif isinstance(entry.record, JointSample):
                samples[entry.topic].extend([entry.record])
            elif not isinstance(entry.record, str) or entry.topic.endswith("/journal"):
                stated[namespace_of(entry.topic)].append((entry.log_ns, entry.record))
        loss = str(opened.loss) if opened.loss else ""
        for other in [name for name, words in stated.items() if not _is_supervisor([word for _, word in words])]:
            del stated[other]
        robots = robots_in(
            [topic for topic in opened.topics() if topic.name in samples or namespace_of(topic.name) in stated]
        )
    joints, supervisor = sources_of(bag, robots, namespace, topic)
    words = [
        (log, _journal_entry(bag, word) if isinstance(word, str) else word) for log, word in stated.get(supervisor, ())
    ]
    samples[joints].compact()
    return Recording(bag, samples[joints], _sessions(words), loss)


def _is_supervisor(words: Sequence[object]) -> bool:
    """True if a namespace has a state, a verdict, or a journal's entry: other programs have journals, too."""
    for word in words:
        if not isinstance(word, str):
            return True
        with suppress(JournalError):
            read_entry(word)
            return True
    return False


def _journal_entry(bag: Path, line: str) -> Entry:
    try:
        return read_entry(line)
    except JournalError as error:
        raise BagError(f"{bag}: {error}") from None


def _sessions(stated: list[Said]) -> list[SupervisorSession]:
    """Recorded entries by supervisor session, in the order of recording: a new one begins where the numbers of states
    or of verdicts fall back. Within a session the numbers continue through pauses."""
    begins: list[int] = []  # indices into `stated`
    numbers: dict[type, int] = {}
    for index, (_log_ns, record) in enumerate(stated):
        if isinstance(record, (SingularityState, Verdict)):
            if not begins or record.sequence <= numbers.get(type(record), 0):
                begins.append(index)
                numbers = {}
            numbers[type(record)] = record.sequence
    starts = [_settings_of(stated, begins, number) for number in range(len(begins))]
    starts[:1] = [0]
    found = []
    for begin, start, end, next_start in zip(
        [0, *begins[1:]], starts or [0], [*begins[1:], len(stated)], [*starts[1:], len(stated)], strict=True
    ):
        entries = [r for _log, r in stated[start:next_start] if not isinstance(r, (SingularityState, Verdict))]
        session = SupervisorSession(entries)
        for log_ns, record in stated[begin:end]:
            if isinstance(record, SingularityState):
                session.states.append(record)
            elif isinstance(record, Verdict):
                session.verdicts.append((log_ns, record))
        found.append(session)
    return found if stated else []


def _settings_of(stated: list[Said], begins: list[int], number: int) -> int:
    """Begin of a session's journal: its settings are the last ones before its first message. They come on another topic
    and may have been recorded a moment later."""
    begin = begins[number]
    word = stated[begin][1]
    moment_ns = word.since_ns if isinstance(word, Verdict) else word.seen_ns
    before = begins[number - 1] if number else 0
    after = begins[number + 1] if number + 1 < len(begins) else len(stated)
    known = [
        (entry.seen_ns, index)
        for index, (_log_ns, entry) in enumerate(stated[before:after], before)
        if isinstance(entry, Configuration) and entry.seen_ns <= moment_ns
    ]
    return max(known)[1] if known else begin
