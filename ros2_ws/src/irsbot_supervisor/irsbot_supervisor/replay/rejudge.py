"""Judges a recorded run again, from the bag alone: in process, event by event, as fast as possible.

The bag contains the supervisor's inputs: the joint states, and the journal with its settings and resets. The published
states contain the time at which each input was received. A bag without a journal (joint states only) is judged for a
given robot, in the order and at the times of its recording.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

from irsbot_kinematics import KinematicsError, Robot
from irsbot_msgs_py.records import (
    CONSUMER_TIMEOUT_S,
    JointSample,
    Level,
    SingularityState,
    Tick,
    Verdict,
)
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.bag.bag import JOINT_STATE, STATE, STRING, VERDICT, Bag, Topic, choose_joint_topic
from irsbot_supervisor.bag.column_reader import Columns
from irsbot_supervisor.bag.joint_columns import JointColumns, JointSamples
from irsbot_supervisor.bag.journal import Configuration, Entry, JournalError, configured, read_entry
from irsbot_supervisor.bag.mcap_writer import BagError
from irsbot_supervisor.configuration.loading import read_settings, robot_of
from irsbot_supervisor.core.settings import InvalidSettings, Settings
from irsbot_supervisor.replay.judged import Interval, Judged
from irsbot_supervisor.replay.levels import Levels
from irsbot_supervisor.replay.stepping import Input, Stepper, Watch, WatchRows, in_order

SILENCE_NS = round(CONSUMER_TIMEOUT_S * NS_PER_S)
"""ns without a verdict after which a consumer stops."""

Said = tuple[int, SingularityState | Verdict | Entry]
"""A message of a supervisor with its log time, ns."""


class Assumption(NamedTuple):
    """Data that a bag without a journal does not contain. robot: preset, YAML file or Robot; None: not given. settings:
    by name, in place of shipped ones. complete: all of them, instead."""

    robot: str | Path | Robot | None
    settings: Mapping[str, Any] = {}
    complete: Settings | None = None


@dataclass
class SupervisorSession:
    """One supervisor of a bag, from the begin of its numbers to their end."""

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
    """One supervised robot of a bag."""

    path: Path
    samples: Sequence[JointSample] = field(default_factory=list)  # seen_ns and received_ns as recorded
    sessions: list[SupervisorSession] = field(default_factory=list)  # one after another; none in a bag of samples alone
    loss: str = ""

    @property
    def begin_ns(self) -> int:
        """The first joint state, from which all times count: ns, ROS time."""
        first = self.samples[0]
        return first.stamp_ns if any(one.states for one in self.sessions) else first.seen_ns

    @property
    def states(self) -> list[SingularityState]:
        return [state for session in self.sessions for state in session.states]

    @property
    def verdicts(self) -> list[tuple[int, Verdict]]:
        """The verdicts with their log times, ns."""
        return [heard for session in self.sessions for heard in session.verdicts]

    @property
    def journal(self) -> list[Entry]:
        return [entry for session in self.sessions for entry in session.journal]


class Sources(NamedTuple):
    """Topics of one robot in a bag: joint states, and names of supervisors."""

    joints: list[str]
    supervisors: list[str]


def robots_in(topics: Iterable[Topic]) -> dict[str, Sources]:
    """The robots in a bag, by the namespace of their supervisor, or of their joint states if they have none. One
    supervisor and one topic of joint states belong together, whatever their names are after remaps."""
    joints = sorted({topic.name for topic in topics if topic.type == JOINT_STATE})
    nodes = sorted({supervisor_of(topic.name) for topic in topics if _is_said(topic)})
    if len(joints) == len(nodes) == 1:
        return {_outside(nodes[0]): Sources(joints, nodes)}
    return {
        namespace: Sources(
            [name for name in joints if _outside(name) == namespace],
            [name for name in nodes if _outside(name) == namespace],
        )
        for namespace in sorted({_outside(name) for name in (*joints, *nodes)})
    }


def supervisor_of(topic: str) -> str:
    """Full name of the supervisor that publishes a topic."""
    return _outside(topic)


def read_recording(bag: Path, namespace: str | None = None, topic: str | None = None) -> Recording:
    """All data that a replay of one robot needs. namespace: of the robot, in a bag of several robots. topic: of its
    joint states, if there are several; the topic alone also selects the robot.

    Raises BagError for a path that is not a bag, for a bag without joint states, and if the robot is ambiguous.
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
                stated[supervisor_of(entry.topic)].append((entry.log_ns, entry.record))
        loss = str(opened.loss) if opened.loss else ""
        robots = robots_in(
            [topic for topic in opened.topics() if topic.name in samples or supervisor_of(topic.name) in stated]
        )
    joints, supervisor = _sources(bag, robots, namespace, topic)
    words = [
        (log, _journal_entry(bag, word) if isinstance(word, str) else word) for log, word in stated.get(supervisor, ())
    ]
    samples[joints].compact()
    return Recording(bag, samples[joints], _sessions(words), loss)


def _sources(bag: Path, robots: dict[str, Sources], namespace: str | None, topic: str | None) -> tuple[str, str]:
    """The topic of joint states and the supervisor of one robot; empty if it has no supervisor."""
    everywhere = [name for found in robots.values() for name in found.joints]
    chosen = None if topic is None else choose_joint_topic(bag, everywhere, topic)
    if namespace is None and chosen is not None:
        namespace = next(name for name, found in robots.items() if chosen in found.joints)
    if namespace is None and len(robots) > 1:
        choice = f"choose one with --namespace, or its joint states with --topic: {', '.join(everywhere) or 'none'}"
        raise BagError(f"{bag}: it holds robots in the namespaces {', '.join(robots)}; {choice}")
    name = next(iter(robots), "/") if namespace is None else f"/{namespace.strip('/')}"
    if name not in robots and robots:
        raise BagError(f"{bag}: no robot in the namespace {name}; there are robots in {', '.join(robots)}")
    joints, supervisors = robots.get(name, Sources([], []))
    if not (joints or chosen) and len(robots) > 1:
        raise BagError(f"{bag}: no joint states (type {JOINT_STATE}) in the namespace {name}")
    if len(supervisors) > 1:
        raise BagError(f"{bag}: several supervisors for one robot: {', '.join(supervisors)}")
    return chosen or choose_joint_topic(bag, joints), next(iter(supervisors), "")


def _is_said(topic: Topic) -> bool:
    """True if the topic belongs to a supervisor."""
    return topic.type in (STATE, VERDICT) or (topic.type == STRING and topic.name.endswith("/journal"))


def _outside(name: str) -> str:
    """The namespace of a name."""
    return f"/{name.strip('/').rpartition('/')[0]}"


def judge_again(
    recording: Recording,
    assumption: Assumption | None = None,
    mechanisms: Sequence[Path] | None = None,
    watch: Watch | None = None,
    watch_rows: WatchRows | None = None,
) -> Judged:
    """Verdicts of the supervisors for the recorded inputs. told: robot and settings, only for a bag without a journal.
    mechanisms: files that may contain the recorded mechanism; left out: those beside the bag. Only the file with the
    recorded hash is loaded. watch: called for every judged sample. watch_rows: the same for samples that are judged as
    columns; with `watch` alone none are.

    Raises BagError for settings that this version cannot use, and if the robot is missing or given twice.
    """
    judged, watches = Judged([], Levels(), 0, 0), (watch, watch_rows)
    files = beside(recording.path) if mechanisms is None else mechanisms
    first = next((entry for entry in recording.journal if isinstance(entry, Configuration)), None)
    try:
        if first is None:
            first = _assumed(recording, assumption)
            other = assumption is not None and (assumption.settings or assumption.complete is not None)
            settings = "other settings than the shipped ones" if other else "its shipped settings"
            judged.robot = f"{first.values['robot']} with {settings}, as given: the bag does not contain it"
        elif assumption is not None:
            fault = "the bag contains its robot and settings; a given robot and settings"
            raise BagError(f"{recording.path}: {fault} are for bags of joint states alone")
        else:
            judged.robot = f"{first.values['robot']}, as recorded"
        if not recording.states:
            others = [entry for entry in recording.journal if entry is not first]
            events = _with_ticks(recording.samples, others, recording.samples[-1].seen_ns)
            _step_through(judged, first, events, count(1), files, watches)
            return judged
        waiting: dict[int, deque[JointSample]] = defaultdict(deque)
        for sample in recording.samples:
            waiting[sample.stamp_ns].append(sample)
        for session in recording.sessions:
            first = next((entry for entry in session.journal if isinstance(entry, Configuration)), first)
            seen = _seen(session, waiting)
            last = session.states[-1].sequence - session.states[0].sequence + 1 if session.states else 0
            judged.missing += last - len(seen)
            events = _events(session, first, list(seen.values()))
            _step_through(judged, first, events, seen, files, watches, session.ahead_ns)
        for session, part, later in zip(recording.sessions, judged.parts, judged.parts[1:], strict=False):
            part += _silence(session.end_ns, later[0].since_ns)
        judged.unseen = sum(len(queue) for queue in waiting.values())
    except (InvalidSettings, KinematicsError) as error:
        raise BagError(f"{recording.path}: {error}") from None
    return judged


def beside(bag: Path) -> list[Path]:
    """Python files in the folder of a bag and beside it."""
    return [
        file
        for folder in ((bag, bag.parent) if bag.is_dir() else (bag.parent,))
        for file in sorted(folder.glob("*.py"))
    ]


def _journal_entry(bag: Path, line: str) -> Entry:
    try:
        return read_entry(line)
    except JournalError as error:
        raise BagError(f"{bag}: {error}") from None


def _silence(end_ns: int, again_ns: int) -> list[Interval]:
    """The intervals between two supervisors, as a consumer sees them."""
    text = f"no verdict for more than {SILENCE_NS / 1e6:.0f} ms: there was no supervisor"
    since_ns = end_ns + SILENCE_NS
    return [Interval(since_ns, Level.UNKNOWN, 0, False, 0, text)] if since_ns < again_ns else []


def _assumed(recording: Recording, assumption: Assumption | None) -> Configuration:
    if assumption is None or assumption.robot is None:
        how = "say it with --robot NAME, and settings other than the shipped ones with --params FILE"
        raise BagError(f"{recording.path}: the bag does not say which robot it is of; {how}")
    start, machine = recording.samples[0], assumption.robot
    if assumption.complete is None:
        found, machine = read_settings(machine, assumption.settings)
    else:
        found, machine = assumption.complete, machine if isinstance(machine, Robot) else robot_of(machine)
    _need_joints(recording, found.joint_names)
    return configured(found, machine, start.received_ns, start.seen_ns)


def _need_joints(recording: Recording, joints: Sequence[str]) -> None:
    """Raises BagError if no message names all joints: then no sample could be judged."""
    samples = recording.samples
    sets = samples.names if isinstance(samples, JointSamples) else {sample.names for sample in samples}
    if not any(set(joints) <= set(names) for names in sets):
        known = "; ".join(sorted(", ".join(names) or "no names" for names in sets))
        fault = f"no message names all joints of the robot, {', '.join(joints)}; there are {known}"
        raise BagError(f"{recording.path}: {fault}. Other names are said by joint_names in --params FILE")


def _sessions(stated: list[Said]) -> list[SupervisorSession]:
    """Recorded entries by supervisor session, in the order of recording: a new one begins where the numbers of states
    or of verdicts fall back. Within a session the numbers continue through pauses."""
    begins: list[int] = []  # indices into `said`
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


def _seen(session: SupervisorSession, waiting: dict[int, deque[JointSample]]) -> dict[int, JointSample]:
    """The samples that a supervisor received, with its numbers and times; they are taken from the waiting ones."""
    return {
        state.sequence: waiting[state.stamp_ns].popleft()._replace(received_ns=state.received_ns, seen_ns=state.seen_ns)
        for state in session.states
        if waiting[state.stamp_ns]
    }


def _events(
    session: SupervisorSession, first: Configuration, samples: list[JointSample]
) -> Iterator[Input | JointColumns]:
    """The inputs of a supervisor in the order of their reception."""
    others: list[Input] = [entry for entry in session.journal if entry is not first]
    end_ns = max([verdict.since_ns for _log, verdict in session.verdicts], default=0)
    yield _begin(session, first)
    yield from _with_ticks(samples, others, end_ns)


def _begin(session: SupervisorSession, first: Configuration) -> Tick:
    """Begin of the first silence: when the settings came into force, or at the begin of the recording if that is
    later."""
    if session.begun_late:
        return Tick(session.states[0].received_ns, session.states[0].seen_ns)
    return Tick(first.received_ns, first.seen_ns)


def _with_ticks(samples: Sequence[JointSample], others: Sequence[Input], end_ns: int) -> Iterator[Input | JointColumns]:
    """In order of time, with a tick just after the end: a silence that counts from the end on is noticed by it."""
    kept = samples if isinstance(samples, JointSamples) else JointSamples(samples)
    others = sorted(others, key=lambda event: event.seen_ns)
    yield from in_order(kept, others)
    last_ns = max([*(event.seen_ns for event in others[-1:]), *(part.last_ns for part in [kept] if len(kept))])
    if end_ns > last_ns:
        yield Tick(end_ns + 1, end_ns + 1)


def _step_through(
    judged: Judged,
    first: Configuration,
    events: Iterator[Input | JointColumns],
    numbers: Iterable[int],
    files: Sequence[Path],
    watches: tuple[Watch | None, WatchRows | None],
    ahead_ns: int = 0,
) -> None:
    """Judge the inputs of one supervisor. numbers: of its samples, as recorded."""
    stepper = Stepper(judged, first, numbers, files, watches, ahead_ns)
    stepper.take(events)
    stepper.finish()
