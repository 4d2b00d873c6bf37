"""A recorded run judged again, from the bag alone: in process, event by event, as fast as it goes.

The supervisor's inputs are in the bag: the joint states, and the journal with its settings and resets. When each input
was seen stands in the states that were published for it. A bag without a journal (joint states only) is judged for
the robot that it is said to be of, in the order and at the times of its recording.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

from irsbot_kinematics import KinematicsError, Robot
from irsbot_kinematics.robot_record import robot_from_record
from irsbot_msgs_py.records import Cause, JointSample, Level, SingularityState, Tick, Verdict
from irsbot_supervisor.core.intake import S
from irsbot_supervisor.core.limits import settings_from
from irsbot_supervisor.core.pipeline import Configure, Event, Supervisor
from irsbot_supervisor.core.settings import InvalidSettings
from irsbot_supervisor.journal import Configuration, Entry, JournalError, configured, read_entry
from irsbot_supervisor.mcap_writer import BagError
from irsbot_supervisor.settings_file import read_settings
from irsbot_supervisor.sim.simulation import Simulation
from irsbot_supervisor.tape import JOINT_STATE, STATE, STRING, VERDICT, Tape, Topic

SILENCE_NS = round(Simulation().verdict_timeout_s * S)
"""ns without a verdict after which a consumer stops."""

Said = tuple[int, SingularityState | Verdict | Entry]
"""What a supervisor said, with its log time, ns."""

Input = JointSample | Tick | Entry
"""What a supervisor was given, as a bag has it."""


class Assumption(NamedTuple):
    """What a bag without a journal does not say. robot: preset or YAML file, None: not told either. settings: by name,
    in place of shipped ones."""

    robot: str | None
    settings: Mapping[str, Any] = {}


class Chapter(NamedTuple):
    """Level and causes from one moment on, until the next chapter."""

    since_ns: int  # on the clock of the joint states' receipt, ROS time
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
class Supervision:
    """What a bag holds of one supervisor, from the beginning of its numbers to their end."""

    journal: list[Entry] = field(default_factory=list)
    states: list[SingularityState] = field(default_factory=list)
    verdicts: list[tuple[int, Verdict]] = field(default_factory=list)  # log time, ns

    @property
    def begun_late(self) -> bool:
        """Whether the supervisor had judged samples before the recording began."""
        return bool(self.states) and self.states[0].sequence > 1

    @property
    def ahead_ns(self) -> int:
        """ns that its ROS time is ahead of its steady clock."""
        known = [*self.states[:1], *self.journal[:1]]
        return known[0].received_ns - known[0].seen_ns if known else 0

    @property
    def end_ns(self) -> int:
        """The last thing that is known of it: ns, ROS time."""
        seen = [state.seen_ns for state in self.states[-1:]]
        return max([*seen, *(verdict.since_ns for _log, verdict in self.verdicts[-1:])], default=0) + self.ahead_ns


@dataclass
class Recording:
    """What a bag holds of one supervised robot."""

    path: Path
    samples: list[JointSample] = field(default_factory=list)  # seen_ns and received_ns as recorded
    supervisions: list[Supervision] = field(default_factory=list)  # one after another; none in a bag of samples alone
    loss: str = ""

    @property
    def begin_ns(self) -> int:
        """The first joint state, from which all times count: ns, ROS time."""
        first = self.samples[0]
        return first.stamp_ns if any(one.states for one in self.supervisions) else first.seen_ns

    @property
    def states(self) -> list[SingularityState]:
        return [state for supervision in self.supervisions for state in supervision.states]

    @property
    def verdicts(self) -> list[tuple[int, Verdict]]:
        """With their log times, ns."""
        return [heard for supervision in self.supervisions for heard in supervision.verdicts]

    @property
    def journal(self) -> list[Entry]:
        return [entry for supervision in self.supervisions for entry in supervision.journal]


@dataclass
class Judged:
    """A recording judged again."""

    parts: list[list[Chapter]]  # one per supervision, or one for samples alone
    levels: dict[tuple[int, int], tuple[Level, int]]  # by number of the supervision and of the sample: level and causes
    unseen: int  # joint states in the bag that never reached a supervisor
    missing: int  # samples a supervisor saw that are not in the bag
    robot: str = ""  # for which it was judged, and how it is known
    errors: list[str] = field(default_factory=list)  # inside the supervisors, as a node would have caught them

    @property
    def chapters(self) -> list[Chapter]:
        return [chapter for part in self.parts for chapter in part]


class Sources(NamedTuple):
    """Where a bag has what belongs to one robot: topics of joint states, and names of supervisors."""

    joints: list[str]
    supervisors: list[str]


def robots_in(topics: Iterable[Topic]) -> dict[str, Sources]:
    """The robots of a bag by the namespace of their supervisor, or of their joint states where nobody supervises them.
    If there is one supervisor and one topic of joint states they belong together, whatever remaps made of the names.
    """
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
    """The full name of the supervisor whose topic it is."""
    return _outside(topic)


def read_recording(bag: Path, namespace: str | None = None) -> Recording:
    """Everything a replay needs of one robot. namespace: whose, in a bag of several robots.

    Raises BagError for something that is no bag, holds no joint states, or does not tell whose they are.
    """
    samples: dict[str, list[JointSample]] = defaultdict(list)
    said: dict[str, list[tuple[int, SingularityState | Verdict | str]]] = defaultdict(list)  # by supervisor
    with Tape(bag) as tape:
        for entry in tape.records():
            if isinstance(entry.record, JointSample):
                samples[entry.topic].append(entry.record)
            elif not isinstance(entry.record, str) or entry.topic.endswith("/journal"):
                said[supervisor_of(entry.topic)].append((entry.log_ns, entry.record))
        loss = str(tape.loss) if tape.loss else ""
        robots = robots_in(
            [topic for topic in tape.topics() if topic.name in samples or supervisor_of(topic.name) in said]
        )
    joints, supervisor = _sources(bag, robots, namespace)
    words = [
        (log, _journal_entry(bag, word) if isinstance(word, str) else word) for log, word in said.get(supervisor, ())
    ]
    return Recording(bag, samples[joints], _supervisions(words), loss)


def _sources(bag: Path, robots: dict[str, Sources], namespace: str | None) -> tuple[str, str]:
    """The topic of joint states and the supervisor of one robot; empty if nobody supervises it."""
    if namespace is None and len(robots) > 1:
        raise BagError(f"{bag}: it holds robots in the namespaces {', '.join(robots)}; choose one with --namespace")
    name = next(iter(robots), "/") if namespace is None else f"/{namespace.strip('/')}"
    if name not in robots and robots:
        raise BagError(f"{bag}: no robot in the namespace {name}; there are robots in {', '.join(robots)}")
    joints, supervisors = robots.get(name, Sources([], []))
    if not joints:
        where = f"the namespace {name}" if len(robots) > 1 else "it"
        raise BagError(f"{bag}: no joint states (type {JOINT_STATE}) in {where}")
    usual = [topic for topic in joints if topic.endswith("joint_states")] if len(joints) > 1 else joints
    for found, what in ((usual or joints, "topics of joint states"), (supervisors, "supervisors")):
        if len(found) > 1:
            raise BagError(f"{bag}: several {what} for one robot: {', '.join(found)}")
    return (usual or joints)[0], next(iter(supervisors), "")


def _is_said(topic: Topic) -> bool:
    """Whether it is a supervisor that says it."""
    return topic.type in (STATE, VERDICT) or (topic.type == STRING and topic.name.endswith("/journal"))


def _outside(name: str) -> str:
    """The namespace of a name."""
    return f"/{name.strip('/').rpartition('/')[0]}"


def judge_again(
    recording: Recording, told: Assumption | None = None, mechanisms: Sequence[Path] | None = None
) -> Judged:
    """What the supervisors make of the recorded inputs. told: for a bag without a journal, and only there.
    mechanisms: files of which one may be that of a mechanism of one's own; those beside the bag if left out. Only the
    file whose hash was recorded is loaded.

    Raises BagError for settings that this version cannot use, and where the robot is not known, or said twice.
    """
    judged = Judged([], {}, 0, 0)
    files = beside(recording.path) if mechanisms is None else mechanisms
    first = next((entry for entry in recording.journal if isinstance(entry, Configuration)), None)
    try:
        if first is None:
            first = _assumed(recording, told)
            settings = "other settings than the shipped ones" if told and told.settings else "its shipped settings"
            judged.robot = f"{first.values['robot']} with {settings}, as told: the bag does not say it"
        elif told is not None:
            fault = "the bag says itself which robot and settings it was recorded with; a robot and settings of yours"
            raise BagError(f"{recording.path}: {fault} are for bags of joint states alone")
        else:
            judged.robot = f"{first.values['robot']}, as recorded"
        if not recording.states:
            others = [entry for entry in recording.journal if entry is not first]
            events = _with_ticks([*recording.samples, *others], recording.samples[-1].seen_ns)
            _step_through(judged, first, events, count(1), files)
            return judged
        waiting: dict[int, deque[JointSample]] = defaultdict(deque)
        for sample in recording.samples:
            waiting[sample.stamp_ns].append(sample)
        for supervision in recording.supervisions:
            first = next((entry for entry in supervision.journal if isinstance(entry, Configuration)), first)
            seen = _seen(supervision, waiting)
            last = supervision.states[-1].sequence - supervision.states[0].sequence + 1 if supervision.states else 0
            judged.missing += last - len(seen)
            events = _events(supervision, first, list(seen.values()))
            _step_through(judged, first, events, iter(seen), files, supervision.ahead_ns)
        for supervision, part, later in zip(recording.supervisions, judged.parts, judged.parts[1:], strict=False):
            part += _silence(supervision.end_ns, later[0].since_ns)
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


def cause_names(causes: int) -> str:
    """The causes of a bit mask, in words."""
    return ", ".join(cause.name or "" for cause in Cause if cause and causes & cause)


def _journal_entry(bag: Path, line: str) -> Entry:
    try:
        return read_entry(line)
    except JournalError as error:
        raise BagError(f"{bag}: {error}") from None


def _silence(end_ns: int, again_ns: int) -> list[Chapter]:
    """What a consumer makes of the time between two supervisors."""
    text = f"no verdict for more than {SILENCE_NS / 1e6:.0f} ms: there was no supervisor"
    since_ns = end_ns + SILENCE_NS
    return [Chapter(since_ns, Level.UNKNOWN, 0, False, 0, text)] if since_ns < again_ns else []


def _assumed(recording: Recording, told: Assumption | None) -> Configuration:
    if told is None or told.robot is None:
        raise BagError(f"{recording.path}: the bag does not say which robot it is of; say it with --robot NAME")
    start = recording.samples[0]
    return configured(*read_settings(told.robot, told.settings), start.received_ns, start.seen_ns)


def _supervisions(said: list[Said]) -> list[Supervision]:
    """What was recorded, in the order of recording, by supervisor: another begins where the numbers of states or of
    verdicts fall back. They go on through pauses of one and the same."""
    begins: list[int] = []  # indices into `said`
    numbers: dict[type, int] = {}
    for index, (_log_ns, record) in enumerate(said):
        if isinstance(record, (SingularityState, Verdict)):
            if not begins or record.sequence <= numbers.get(type(record), 0):
                begins.append(index)
                numbers = {}
            numbers[type(record)] = record.sequence
    starts = [_settings_of(said, begins, number) for number in range(len(begins))]
    starts[:1] = [0]
    found = []
    for begin, start, end, next_start in zip(
        [0, *begins[1:]], starts or [0], [*begins[1:], len(said)], [*starts[1:], len(said)], strict=True
    ):
        entries = [r for _log, r in said[start:next_start] if not isinstance(r, (SingularityState, Verdict))]
        supervision = Supervision(entries)
        for log_ns, record in said[begin:end]:
            if isinstance(record, SingularityState):
                supervision.states.append(record)
            elif isinstance(record, Verdict):
                supervision.verdicts.append((log_ns, record))
        found.append(supervision)
    return found if said else []


def _settings_of(said: list[Said], begins: list[int], number: int) -> int:
    """Where the journal of a supervision begins: its settings are the last ones from before its first word. They are
    told on another topic, so they may have been recorded a moment after that."""
    begin = begins[number]
    word = said[begin][1]
    moment_ns = word.since_ns if isinstance(word, Verdict) else word.seen_ns
    before = begins[number - 1] if number else 0
    after = begins[number + 1] if number + 1 < len(begins) else len(said)
    known = [
        (entry.seen_ns, index)
        for index, (_log_ns, entry) in enumerate(said[before:after], before)
        if isinstance(entry, Configuration) and entry.seen_ns <= moment_ns
    ]
    return max(known)[1] if known else begin


def _seen(supervision: Supervision, waiting: dict[int, deque[JointSample]]) -> dict[int, JointSample]:
    """The samples that a supervisor saw, by its numbers and at its times; they are taken from those that wait."""
    return {
        state.sequence: waiting[state.stamp_ns].popleft()._replace(received_ns=state.received_ns, seen_ns=state.seen_ns)
        for state in supervision.states
        if waiting[state.stamp_ns]
    }


def _events(supervision: Supervision, first: Configuration, samples: list[JointSample]) -> list[Input]:
    """The inputs of a supervisor in the order in which it saw them."""
    others: list[Input] = [entry for entry in supervision.journal if entry is not first]
    end_ns = max([verdict.since_ns for _log, verdict in supervision.verdicts], default=0)
    return _with_ticks([_begin(supervision, first), *samples, *others], end_ns)


def _begin(supervision: Supervision, first: Configuration) -> Tick:
    """When silence begins to count: as the settings came into force, or where the recording begins if that is later."""
    if supervision.begun_late:
        return Tick(supervision.states[0].received_ns, supervision.states[0].seen_ns)
    return Tick(first.received_ns, first.seen_ns)


def _with_ticks(events: list[Input], end_ns: int) -> list[Input]:
    """In order of time, with a tick at the end so that a silence there is noticed."""
    ordered = sorted(events, key=lambda event: event.seen_ns)
    if end_ns > ordered[-1].seen_ns:
        ordered.append(Tick(end_ns, end_ns))
    return ordered


def _step_through(
    judged: Judged,
    first: Configuration,
    events: list[Input],
    numbers: Iterator[int],
    files: Sequence[Path],
    ahead_ns: int = 0,
) -> None:
    """Judge the inputs of one supervisor. numbers: of its samples, as they were recorded. An error inside makes the
    state UNKNOWN, as in the node, and the replay goes on."""
    machine = robot_from_record(first.machine, files)
    supervisor = Supervisor(settings_from(first.values, machine), machine)
    chapters: list[Chapter] = []
    for event in events:
        try:
            step = supervisor.step(_event(event, machine))
        except InvalidSettings:  # of the bag, not of an error inside
            raise
        except Exception as error:  # as the node guards it
            step = supervisor.fail(event.seen_ns, error)
            judged.errors.append(f"input seen at {event.seen_ns / S:.6f}: {type(error).__name__}: {error}")
        if isinstance(event, JointSample):
            found = (
                (Level.UNKNOWN, int(Cause.INTERNAL)) if step.state is None else (step.state.level, step.state.causes)
            )
            judged.levels[len(judged.parts), next(numbers)] = found
        for turn in step.turns:
            text = "; ".join(finding.text for finding in turn.findings)
            chapters.append(Chapter(turn.since_ns + ahead_ns, turn.level, turn.causes, turn.latched, turn.event, text))
    judged.parts.append(chapters)


def _event(given: Input, machine: Robot) -> Event:
    """The event of the core: settings are checked here, once."""
    if isinstance(given, Configuration):
        return Configure(given.received_ns, given.seen_ns, settings_from(given.values, machine))
    return given
